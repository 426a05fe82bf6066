//! Along a path: which waypoint is next, where to aim, how far it still is.

use crate::params::Params;
use geometry::Pose2;
use messages::Waypoint;
use nalgebra::{Point2, Vector2};

/// A corner this near can be passed by lying behind the robot, not only by nearness.
const PASSED_WITHIN_M: f64 = 1.0;
/// How far beyond a straight corner, and beyond a right angle, the motion controller may look: so it slows
/// down for turns.
const SLACK_STRAIGHT_M: f64 = 2.5;
const SLACK_RIGHT_ANGLE_M: f64 = 0.35;

/// Progress along the present path.
#[derive(Debug, Clone, Default)]
pub(crate) struct Course {
    path: Option<(u64, u64)>,
    next: usize,
    reached: bool,
}

/// What the controllers need to know of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aim {
    /// Where to drive now.
    pub(crate) point: Point2<f64>,
    /// Distance to that place, or to the corner just passed if that is nearer: how close a point to turn at
    /// is.
    pub(crate) close_m: f64,
    /// Along the path to the goal, shortened where a sharp corner comes first.
    pub(crate) way_m: f64,
    /// Straight to the goal.
    pub(crate) goal_m: f64,
    /// The goal was reached; stays so until another path comes.
    pub(crate) reached: bool,
}

impl Course {
    /// Where to drive from `pose` on the path `(request, revision)`. `None` without waypoints or with
    /// nonsense among them.
    pub(crate) fn aim(
        &mut self,
        path: (u64, u64),
        waypoints: &[Waypoint],
        pose: Pose2,
        params: &Params,
    ) -> Option<Aim> {
        if self.path != Some(path) {
            *self = Self { path: Some(path), next: 0, reached: false };
        }
        let last = waypoints.len().checked_sub(1)?;
        if !waypoints.iter().all(|waypoint| waypoint.x_m.is_finite() && waypoint.y_m.is_finite()) {
            return None;
        }
        let place = |index: usize| Point2::new(waypoints[index].x_m, waypoints[index].y_m);
        let here = pose.position();
        self.next = self.next.min(last);
        while self.next < last {
            let corner = place(self.next);
            let after = direction(corner, place(self.next + 1));
            let before = if self.next > 0 { direction(place(self.next - 1), corner) } else { after };
            let distance_m = (here - corner).norm();
            let near = distance_m <= params.pass_distance_m;
            let through = before + after;
            // In a hairpin there is no direction through the corner.
            let may_lie_behind = self.next == 0 || (distance_m <= PASSED_WITHIN_M && through.norm() > 0.5);
            if near || (may_lie_behind && (here - corner).dot(&through) > 0.0) {
                self.next += 1;
            } else {
                break;
            }
        }
        let corner = place(self.next);
        let point = if self.next > 0 && params.lookahead_m > 0.0 {
            ahead(place(self.next - 1), corner, here, params.lookahead_m)
        } else {
            corner
        };
        let distance_m = (point - here).norm();
        let to_corner_m = distance_m + (corner - point).norm();
        let rest_m: f64 = (self.next..last).map(|index| (place(index + 1) - place(index)).norm()).sum();
        let slack_m = if self.next < last {
            let came = if self.next > 0 { place(self.next - 1) } else { here };
            slack(direction(came, corner), direction(corner, place(self.next + 1)))
        } else {
            f64::INFINITY
        };
        let goal_m = (place(last) - here).norm();
        self.reached |= self.next == last && goal_m <= params.reach_tolerance_m;
        let way_m = (to_corner_m + rest_m).min(to_corner_m + slack_m);
        let passed_m = if self.next > 1 { (place(self.next - 1) - here).norm() } else { f64::INFINITY };
        let close_m = distance_m.min(passed_m);
        Some(Aim { point, close_m, way_m, goal_m, reached: self.reached })
    }

    /// Forgets the path.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// The unit vector from one place to another; zero if they are one.
fn direction(from: Point2<f64>, to: Point2<f64>) -> Vector2<f64> {
    (to - from).try_normalize(1e-9).unwrap_or_else(Vector2::zeros)
}

/// The place on the segment `from..to` that lies `lookahead_m` beyond the one nearest to `here`.
fn ahead(from: Point2<f64>, to: Point2<f64>, here: Point2<f64>, lookahead_m: f64) -> Point2<f64> {
    let along = direction(from, to);
    let length_m = (to - from).norm();
    let nearest_m = (here - from).dot(&along).clamp(0.0, length_m);
    from + along * (nearest_m + lookahead_m).min(length_m)
}

fn slack(before: Vector2<f64>, after: Vector2<f64>) -> f64 {
    let turn_rad = before.dot(&after).clamp(-1.0, 1.0).acos();
    (SLACK_STRAIGHT_M * (1.0 - turn_rad / std::f64::consts::FRAC_PI_2)).max(SLACK_RIGHT_ANGLE_M)
}
