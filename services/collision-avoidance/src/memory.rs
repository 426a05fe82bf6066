//! Obstacles that vanish under a beam, such as a mail cart whose shelf drops out of view at close range (Fig.
//! 4, X-24).

use crate::Params;
use geometry::{Point2, Pose2};
use messages::{Time, TofRanges};
use serde::{Deserialize, Serialize};

/// The front sensors.
const FRONT: std::ops::Range<usize> = 2..6;
const FRONT_COUNT: usize = 4;

/// Half of the sensors' cone (COF-021: at most 27° in all): what leaves it by the robot's own turning has not
/// vanished.
const HALF_CONE_RAD: f64 = 13.5 * std::f64::consts::PI / 180.0;

/// What the guard may know of the robot's motion at one moment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    /// Pose in the odometry frame.
    pub(crate) pose: Pose2,
    /// Speed forward.
    pub(crate) forward_mps: f64,
}

/// Something that a front sensor saw nearby.
#[derive(Debug, Clone, Copy)]
struct Sight {
    /// In the robot's frame when it was seen.
    in_body: Point2<f64>,
    /// Its place in the odometry frame, if the robot's motion was known.
    in_odometry: Option<Point2<f64>>,
}

impl Sight {
    /// Where it is now in the robot's frame, if the motion since is known.
    fn now(&self, motion: Option<Motion>) -> Option<Point2<f64>> {
        Some(motion?.pose.inverse_transform(self.in_odometry?))
    }
}

/// What was near, and what of it vanished, when a predecessor last said so: per front sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Snapshot {
    seen: [Option<KeptSight>; FRONT_COUNT],
    vanished: [Option<KeptSight>; FRONT_COUNT],
}

/// A sight in the robot's frame, and in that of odometry.
type KeptSight = ([f64; 2], Option<[f64; 2]>);

/// The memory for obstacles in front.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    /// Per front sensor, what its last reading showed, if that was nearby.
    seen: [Option<Sight>; FRONT_COUNT],
    /// Per front sensor, what vanished.
    vanished: [Option<Sight>; FRONT_COUNT],
    /// Since when the readings have been clear and the robot has not moved forward.
    quiet_since: Option<Time>,
}

impl Memory {
    /// What a successor needs: an obstacle that was remembered must not be driven over because the guard was
    /// started anew.
    pub(crate) fn snapshot(&self) -> Snapshot {
        let pair = |place: Point2<f64>| [place.x, place.y];
        let kept = |sight: Sight| (pair(sight.in_body), sight.in_odometry.map(pair));
        Snapshot {
            seen: self.seen.map(|sight| sight.map(kept)),
            vanished: self.vanished.map(|sight| sight.map(kept)),
        }
    }

    /// Takes over what a predecessor remembered.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot) {
        let place = |[x, y]: [f64; 2]| (x.is_finite() && y.is_finite()).then(|| Point2::new(x, y));
        let sight = |(in_body, in_odometry): KeptSight| {
            Some(Sight { in_body: place(in_body)?, in_odometry: in_odometry.and_then(place) })
        };
        self.seen = snapshot.seen.map(|kept| kept.and_then(sight));
        self.vanished = snapshot.vanished.map(|kept| kept.and_then(sight));
    }

    /// Takes in one frame: the new readings of the sensors (`None` where a sensor gave none; infinite for "no
    /// target").
    pub(crate) fn take(
        &mut self,
        now: Time,
        readings_m: &[Option<f64>; messages::TOF_COUNT],
        motion: Option<Motion>,
        params: &Params,
    ) {
        if params.memory_range_m() <= 0.0 {
            return;
        }
        for sensor in FRONT {
            if let Some(reading_m) = readings_m[sensor] {
                self.take_reading(sensor, reading_m, motion, params);
            }
        }
        let clear = FRONT.filter_map(|sensor| readings_m[sensor]).all(|m| m >= params.front_radius_m);
        let forward = motion.is_some_and(|motion| motion.forward_mps > params.standstill_mps);
        if !clear || forward || self.vanished.iter().all(Option::is_none) {
            self.quiet_since = None;
            return;
        }
        let since = *self.quiet_since.get_or_insert(now);
        if now.seconds_since(since) >= params.memory_release_s {
            self.vanished = Default::default();
            self.quiet_since = None;
        }
    }

    fn take_reading(&mut self, sensor: usize, reading_m: f64, motion: Option<Motion>, params: &Params) {
        let slot = sensor - FRONT.start;
        let mount = TofRanges::MOUNTS[sensor];
        if let Some(before) = self.seen[slot].take() {
            // Unknown motion is no backing off.
            let expected = before.now(motion).unwrap_or(before.in_body);
            let relative = mount.inverse_transform(expected);
            let turned_away = relative.y.abs() > relative.x.max(0.0) * HALF_CONE_RAD.tan() + 0.02;
            if turned_away || reading_m > relative.x + params.memory_jump_m {
                self.vanished[slot] = Some(before);
            }
        }
        if reading_m < params.memory_range_m() {
            let in_body = mount.transform(Point2::new(reading_m, 0.0));
            let in_odometry = motion.map(|motion| motion.pose.transform(in_body));
            self.seen[slot] = Some(Sight { in_body, in_odometry });
            // What is seen need not be remembered.
            self.vanished[slot] = None;
        } else if self.vanished[slot].is_some_and(|sight| was_backed_off(&sight, mount, motion, params)) {
            self.vanished[slot] = None;
        } else if let Some(here) = self.vanished[slot].and_then(|sight| sight.now(motion))
            && here.coords.norm() > params.hull_front_m + params.memory_range_m() + 1.0
        {
            self.vanished[slot] = None;
        }
    }

    /// Distance from the robot's front edge to the nearest remembered obstacle ahead; 0 where the motion
    /// since is not known.
    pub(crate) fn nearest_m(&self, motion: Option<Motion>, params: &Params) -> Option<f64> {
        let ahead = |sight: &Sight| match sight.now(motion) {
            None => Some(0.0),
            Some(here) => {
                // 20 mm for the errors of reading and odometry.
                let in_the_way = here.y.abs() <= params.hull_side_m + 0.02 && here.x > -params.hull_rear_m;
                in_the_way.then_some((here.x - params.hull_front_m).max(0.0))
            }
        };
        self.vanished.iter().flatten().filter_map(ahead).min_by(f64::total_cmp)
    }
}

/// Whether the robot stands so far back that the sensor, which shows nothing near, would see the obstacle if
/// it were there.
fn was_backed_off(sight: &Sight, mount: Pose2, motion: Option<Motion>, params: &Params) -> bool {
    sight.now(motion).is_some_and(|here| {
        let relative = mount.inverse_transform(here);
        relative.x > params.memory_range_m() && relative.y.abs() <= relative.x * HALF_CONE_RAD.tan()
    })
}
