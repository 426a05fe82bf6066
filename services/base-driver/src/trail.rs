//! The ground that the hull has just covered: the only one over which it may go back, as no sensor looks
//! there.

use geometry::{Hull, Point2, Pose2, angle};
use std::collections::VecDeque;

/// Poses of the trail lie so far apart, or differ by so much: between two of them no corner of the hull
/// swings out by more than what it may lie beside the ground that it has covered.
const APART_M: f64 = 0.03;
const APART_RAD: f64 = 0.02;
/// The most poses that are remembered: more than a metre of them, or a good quarter of a turn.
const POSES_MAX: usize = 96;
/// How far the hull may lie beside the ground that it has covered: less than what the odometry errs by on the
/// way.
const BESIDE_M: f64 = 0.01;
/// How far the hull may lie beside its sides, where the side sensors have looked when it passed: what they
/// saw is known, and kept off from.
const ASIDE_M: f64 = 0.06;
/// Points along the hull's rear edge and rear sides that are looked at.
const ALONG_REAR: i32 = 8;
const ALONG_SIDE: i32 = 3;

/// Where the robot has been, the oldest first, in the frame of odometry.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trail {
    poses: VecDeque<Pose2>,
}

impl Trail {
    /// For a successor: in tenths of a millimetre and of a thousandth of a radian, which is as fine as it has
    /// to be.
    pub(crate) fn kept(&self) -> Vec<[i64; 3]> {
        let fine =
            |pose: &Pose2| [pose.x_m, pose.y_m, pose.heading_rad].map(|number| (number * 1e4).round() as i64);
        self.poses.iter().map(fine).collect()
    }

    /// From a predecessor.
    pub(crate) fn restored(kept: &[[i64; 3]]) -> Self {
        let pose = |kept: &[i64; 3]| {
            let [x_m, y_m, heading_rad] = kept.map(|number| number as f64 * 1e-4);
            Pose2::new(x_m, y_m, heading_rad)
        };
        Self { poses: kept.iter().take(POSES_MAX).map(pose).collect() }
    }

    /// The encoders have begun anew: nobody knows where the robot has been.
    pub(crate) fn forget(&mut self) {
        self.poses.clear();
    }

    /// The robot is here now. The trail grows while it drives ahead or turns, and shrinks while it drives
    /// back.
    pub(crate) fn follow(&mut self, here: Pose2, length_m: f64) {
        let Some(&last) = self.poses.back() else {
            self.poses.push_back(here);
            return;
        };
        let moved = last.to(here);
        if moved.x_m < 0.0 {
            while self.poses.len() > 1 && self.is_nearer_to_the_last_but_one(here) {
                self.poses.pop_back();
            }
        } else if moved.position().coords.norm() >= APART_M || moved.heading_rad.abs() >= APART_RAD {
            self.poses.push_back(here);
            while self.poses.len() > POSES_MAX || self.length_m() > length_m {
                self.poses.pop_front();
            }
        }
    }

    fn is_nearer_to_the_last_but_one(&self, here: Pose2) -> bool {
        let away = |pose: &Pose2| {
            pose.distance_m(here)
                + APART_M / APART_RAD * angle::difference(pose.heading_rad, here.heading_rad).abs()
        };
        let mut newest = self.poses.iter().rev().map(away);
        match (newest.next(), newest.next()) {
            (Some(last), Some(before)) => before <= last,
            _ => false,
        }
    }

    fn length_m(&self) -> f64 {
        let pairs = self.poses.iter().zip(self.poses.iter().skip(1));
        pairs.map(|(from, to)| from.distance_m(*to)).sum()
    }

    /// Whether the robot may come to these places: not back, or only over ground that the hull has covered.
    pub(crate) fn allows(&self, hull: &Hull, places: impl IntoIterator<Item = Pose2>) -> bool {
        let Some(last) = self.poses.back() else { return false };
        places.into_iter().all(|place| last.to(place).x_m >= -BESIDE_M || self.covers(hull, place))
    }

    fn covers(&self, hull: &Hull, place: Pose2) -> bool {
        let covered = Hull { side_m: hull.side_m + ASIDE_M, ..*hull };
        let share = |index: i32, of: i32| f64::from(index) / f64::from(of);
        let rear = (0..=ALONG_REAR)
            .map(|index| Point2::new(-hull.rear_m, hull.side_m * (2.0 * share(index, ALONG_REAR) - 1.0)));
        let sides = (0..ALONG_SIDE).flat_map(|index| {
            let x_m = -hull.rear_m * share(index, ALONG_SIDE);
            [Point2::new(x_m, -hull.side_m), Point2::new(x_m, hull.side_m)]
        });
        let place = place.frame();
        rear.chain(sides).all(|point| {
            let point = place.transform(point);
            self.poses.iter().rev().any(|pose| covered.distance_m(*pose, point) <= BESIDE_M)
        })
    }
}
