//! Where the moving parts of a world are at a given time.

use super::items::{Door, Trigger, Walker, WalkerCourse};
use crate::{Pose2, Segment};
use nalgebra::Point2;

impl Trigger {
    /// Whether it goes off: `now_s` seconds since the beginning, with the nearest robot `robot_distance_m`
    /// away (infinite if there is none). It is for the caller to remember that it did.
    pub fn goes_off(&self, now_s: f64, robot_distance_m: f64) -> bool {
        self.at_s.is_none_or(|at_s| now_s >= at_s)
            && self.near_m.is_none_or(|near_m| robot_distance_m < near_m)
    }
}

impl Door {
    /// How far the leaf is open, from 0 (closed) to 1, `since_trigger_s` seconds after [`Door::moves`] went
    /// off; `None` before that.
    pub fn opening_fraction(&self, since_trigger_s: Option<f64>) -> f64 {
        let Some(since_s) = since_trigger_s else { return f64::from(u8::from(self.open)) };
        let turned = |seconds: f64| (seconds / self.swing_s).clamp(0.0, 1.0);
        let moved = match self.returns_after_s {
            Some(after_s) if since_s > after_s => {
                (turned(after_s) - (since_s - after_s) / self.swing_s).max(0.0)
            }
            _ => turned(since_s),
        };
        if self.open { 1.0 - moved } else { moved }
    }
}

impl Walker {
    /// Where the person is and faces, `since_start_s` seconds after setting out (0 before). Corners are
    /// turned at once.
    pub fn pose(&self, since_start_s: f64) -> Pose2 {
        let point = |i: usize| Point2::new(self.path[i][0], self.path[i][1]);
        if self.path.len() < 2 {
            return self.path.first().map_or(Pose2::IDENTITY, |&[x, y]| Pose2::new(x, y, 0.0));
        }
        let mut legs: Vec<_> = (1..self.path.len()).map(|i| Segment::new(point(i - 1), point(i))).collect();
        match self.course {
            WalkerCourse::Once => {}
            WalkerCourse::Loop => legs.push(Segment::new(point(self.path.len() - 1), point(0))),
            WalkerCourse::BackAndForth => {
                legs.extend(legs.clone().iter().rev().map(|leg| Segment::new(leg.b, leg.a)));
            }
        }
        let total_m: f64 = legs.iter().map(Segment::length_m).sum();
        let walked_m = (self.speed_m_s * since_start_s).max(0.0);
        let mut left_m = match self.course {
            WalkerCourse::Once => walked_m,
            WalkerCourse::Loop | WalkerCourse::BackAndForth => walked_m % total_m,
        };
        let mut last = Pose2::new(self.path[0][0], self.path[0][1], 0.0);
        for leg in legs {
            let (length_m, step) = (leg.length_m(), leg.vector());
            if length_m <= 0.0 {
                continue;
            }
            let place = leg.at((left_m / length_m).min(1.0));
            last = Pose2::new(place.x, place.y, step.y.atan2(step.x));
            if left_m < length_m {
                break;
            }
            left_m -= length_m;
        }
        last
    }
}
