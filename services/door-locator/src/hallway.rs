//! Where the robot is along the hallway: odometry, turned into the hallway's direction by the localiser's
//! heading.

use crate::doors::{Door, hallway_rad};
use geometry::{Pose2, angle};
use messages::{Odometry, PoseEstimate, Stamped, Time};

/// Odometry that jumps farther than this between two frames was started anew.
const JUMP_M: f64 = 1.0;

/// How much of each new pose enters the difference between the map's heading and the odometry's.
const HEADING_SHARE: f64 = 0.2;

/// Readings beyond the newest odometry are placed by its speed, for at most this long.
const AHEAD_S: f64 = 0.3;

/// The robot's way along the hallway.
#[derive(Debug, Clone, Default)]
pub(crate) struct Hallway {
    direction: Option<Direction>,
    travel_m: Option<f64>,
    /// Counted along the hallway from wherever the counting began.
    along_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Direction {
    floor: i32,
    /// In the map.
    hallway_rad: f64,
    /// The map's heading less the odometry's.
    offset_rad: f64,
}

/// Where the robot is when a frame is taken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Station {
    pub(crate) floor: i32,
    /// Direction of the hallway in the map.
    pub(crate) hallway_rad: f64,
    /// The robot's heading less the hallway's.
    pub(crate) off_rad: f64,
    pub(crate) along_m: f64,
    pub(crate) forward_mps: f64,
}

impl Hallway {
    /// `None` while the direction is unknown. The flag says that the counting has begun anew: what was
    /// counted before is void.
    pub(crate) fn follow(
        &mut self,
        taken: Time,
        odometry: &Stamped<'_, Odometry>,
        location: Option<(Pose2, &PoseEstimate)>,
        doors: &[Door],
    ) -> (Option<Station>, bool) {
        let numbers = [odometry.left_travel_m, odometry.right_travel_m, odometry.forward_mps];
        let Some(pose) = odometry.pose().ok().filter(|_| numbers.iter().all(|number| number.is_finite()))
        else {
            return (None, false);
        };
        let mut anew = false;
        if let Some((place, estimate)) = location {
            anew |= self.turn(place, estimate.floor, pose.heading_rad, doors);
        }
        let ahead_s = signed_seconds(taken, odometry.origin).clamp(-AHEAD_S, AHEAD_S);
        let travel_m =
            0.5 * (odometry.left_travel_m + odometry.right_travel_m) + ahead_s * odometry.forward_mps;
        let step_m = travel_m - self.travel_m.replace(travel_m).unwrap_or(travel_m);
        let Some(direction) = self.direction else { return (None, anew) };
        let off_rad = angle::wrap(pose.heading_rad + direction.offset_rad - direction.hallway_rad);
        if step_m.abs() > JUMP_M {
            anew = true;
        } else {
            self.along_m += step_m * off_rad.cos();
        }
        let Direction { floor, hallway_rad, .. } = direction;
        let station =
            Station { floor, hallway_rad, off_rad, along_m: self.along_m, forward_mps: odometry.forward_mps };
        (Some(station), anew)
    }

    fn turn(&mut self, place: Pose2, floor: i32, odometry_rad: f64, doors: &[Door]) -> bool {
        let Some(hallway_rad) = hallway_rad(doors, floor, place) else {
            return self.direction.take().is_some();
        };
        let measured_rad = angle::difference(place.heading_rad, odometry_rad);
        let same = self.direction.filter(|direction| {
            direction.floor == floor && angle::difference(direction.hallway_rad, hallway_rad).abs() < 0.5
        });
        let offset_rad = same.map_or(measured_rad, |direction| {
            let off_rad = angle::difference(measured_rad, direction.offset_rad);
            // A localiser that has just found its heading is believed at once.
            if off_rad.abs() > 0.3 {
                measured_rad
            } else {
                angle::wrap(direction.offset_rad + HEADING_SHARE * off_rad)
            }
        });
        self.direction = Some(Direction { floor, hallway_rad, offset_rad });
        same.is_none()
    }
}

fn signed_seconds(to: Time, from: Time) -> f64 {
    to.seconds_since(from) - from.seconds_since(to)
}
