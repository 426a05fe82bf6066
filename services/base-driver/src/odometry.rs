//! Dead reckoning from the wheels' encoders.

use crate::trail::Trail;
use crate::{WheelTravel, motors::FASTEST_MPS};
use geometry::Pose2;
use messages::{Odometry, Time};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// An encoder that is farther than this from where a predecessor left it began anew.
const RESUMED_WITHIN_M: f64 = 5.0;

/// Where the odometry of a predecessor stood, and what its encoders said then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    travelled: [f64; 2],
    encoders: [f64; 2],
    /// The ground that the hull has just covered.
    trail: Vec<[i64; 3]>,
}

/// The pose since the start, by exact arcs.
#[derive(Debug, Clone)]
pub(crate) struct DeadReckoning {
    wheel_track_m: f64,
    period: Duration,
    next: Option<Time>,
    last: Option<(Time, WheelTravel)>,
    pose: Pose2,
    travelled: WheelTravel,
    /// Where the encoders stood when the predecessor last said so.
    resumed: Option<WheelTravel>,
}

impl DeadReckoning {
    pub(crate) fn new(wheel_track_m: f64, period: Duration) -> Self {
        let travelled = WheelTravel::default();
        Self {
            wheel_track_m,
            period,
            next: None,
            last: None,
            pose: Pose2::IDENTITY,
            travelled,
            resumed: None,
        }
    }

    /// What a successor needs to go on in the same frame; `None` before the first reading.
    pub(crate) fn snapshot(&self, trail: Vec<[i64; 3]>) -> Option<Snapshot> {
        let (_, encoders) = self.last?;
        let Pose2 { x_m, y_m, heading_rad } = self.pose;
        let pair = |travel: WheelTravel| [travel.left_m, travel.right_m];
        Some(Snapshot {
            x_m,
            y_m,
            heading_rad,
            travelled: pair(self.travelled),
            encoders: pair(encoders),
            trail,
        })
    }

    /// Goes on where a predecessor was: the encoders tell how far the wheels went meanwhile. Returns the
    /// predecessor's trail.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot) -> Trail {
        let Snapshot { x_m, y_m, heading_rad, travelled, encoders, ref trail } = *snapshot;
        let numbers = [x_m, y_m, heading_rad].into_iter().chain(travelled).chain(encoders);
        if self.last.is_none() && numbers.into_iter().all(f64::is_finite) {
            self.pose = Pose2::new(x_m, y_m, heading_rad);
            let travel = |[left_m, right_m]: [f64; 2]| WheelTravel { left_m, right_m };
            self.travelled = travel(travelled);
            self.resumed = Some(travel(encoders));
            return Trail::restored(trail);
        }
        Trail::default()
    }

    /// Where the robot is, with what the encoders say now; `None` before the first reading and after a jump.
    pub(crate) fn here(&self, travel: WheelTravel) -> Option<Pose2> {
        let before = self.last.map(|(_, travel)| travel).or(self.resumed)?;
        let (left_m, right_m) = (travel.left_m - before.left_m, travel.right_m - before.right_m);
        let is_near = left_m.abs().max(right_m.abs()) <= RESUMED_WITHIN_M;
        is_near.then(|| self.after(left_m, right_m))
    }

    fn after(&self, left_m: f64, right_m: f64) -> Pose2 {
        self.pose.after_arc(0.5 * (left_m + right_m), (right_m - left_m) / self.wheel_track_m)
    }

    /// Once a period, while the encoders answer, the odometry until now.
    pub(crate) fn step(&mut self, now: Time, travel: Option<WheelTravel>) -> Option<Odometry> {
        let travel = travel?;
        // A timer may fire a little early; a tenth of a period is no reason to skip a message.
        let due = self.next.is_none_or(|next| now.after(self.period / 10) >= next);
        if !due {
            return None;
        }
        let planned = self.next.map_or(now, |next| next.after(self.period));
        self.next = Some(if planned > now { planned } else { now.after(self.period) });

        let resumed = self.resumed.take();
        let (stamp, before) = self.last.replace((now, travel)).unwrap_or((now, resumed.unwrap_or(travel)));
        let seconds = now.seconds_since(stamp);
        let (mut left_m, mut right_m) = (travel.left_m - before.left_m, travel.right_m - before.right_m);
        let most_m = if resumed.is_some() { RESUMED_WITHIN_M } else { FASTEST_MPS * seconds };
        if left_m.abs().max(right_m.abs()) > most_m {
            (left_m, right_m) = (0.0, 0.0);
        }
        let (forward_m, turn_rad) = (0.5 * (left_m + right_m), (right_m - left_m) / self.wheel_track_m);
        self.pose = self.after(left_m, right_m);
        self.travelled.left_m += left_m;
        self.travelled.right_m += right_m;
        let rate = if seconds > 0.0 { 1.0 / seconds } else { 0.0 };
        Some(Odometry {
            x_m: self.pose.x_m,
            y_m: self.pose.y_m,
            heading_rad: self.pose.heading_rad,
            forward_mps: forward_m * rate,
            turn_rad_per_s: turn_rad * rate,
            left_travel_m: self.travelled.left_m,
            right_travel_m: self.travelled.right_m,
        })
    }
}
