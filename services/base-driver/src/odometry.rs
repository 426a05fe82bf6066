//! Dead reckoning from the wheels' encoders.

use crate::WheelTravel;
use geometry::Pose2;
use messages::{Odometry, Time};
use std::time::Duration;

/// Faster than this no wheel of such a robot turns: a larger jump is an encoder that began anew.
const FASTEST_MPS: f64 = 5.0;

/// The pose since the start, by exact arcs.
#[derive(Debug, Clone)]
pub(crate) struct DeadReckoning {
    wheel_track_m: f64,
    period: Duration,
    next: Option<Time>,
    last: Option<(Time, WheelTravel)>,
    pose: Pose2,
    travelled: WheelTravel,
}

impl DeadReckoning {
    pub(crate) fn new(wheel_track_m: f64, period: Duration) -> Self {
        let travelled = WheelTravel::default();
        Self { wheel_track_m, period, next: None, last: None, pose: Pose2::IDENTITY, travelled }
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

        let (stamp, before) = self.last.replace((now, travel)).unwrap_or((now, travel));
        let seconds = now.seconds_since(stamp);
        let (mut left_m, mut right_m) = (travel.left_m - before.left_m, travel.right_m - before.right_m);
        if left_m.abs().max(right_m.abs()) > FASTEST_MPS * seconds {
            (left_m, right_m) = (0.0, 0.0);
        }
        let (forward_m, turn_rad) = (0.5 * (left_m + right_m), (right_m - left_m) / self.wheel_track_m);
        self.pose = self.pose.after_arc(forward_m, turn_rad);
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
