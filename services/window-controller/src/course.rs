//! Along a path: where to aim, how far it still is.

use crate::Params;
use geometry::Pose2;
use messages::Waypoint;
use nalgebra::Point2;

/// How far beyond the last progress it is looked for, so that a path that comes back to itself is not cut
/// short.
const SEARCH_M: f64 = 1.0;

/// Progress along the present path.
#[derive(Debug, Clone, Default)]
pub(crate) struct Course {
    path: Option<(u64, u64)>,
    along_m: f64,
    reached: bool,
}

/// What a step needs to know of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aim {
    pub(crate) point: Point2<f64>,
    /// Along the path to its end.
    pub(crate) way_m: f64,
    pub(crate) reached: bool,
}

impl Course {
    /// Where to drive from `pose` on the path `(request, revision)`; `None` without waypoints or with
    /// nonsense among them.
    pub(crate) fn aim(
        &mut self,
        path: (u64, u64),
        waypoints: &[Waypoint],
        pose: Pose2,
        params: &Params,
    ) -> Option<Aim> {
        if self.path != Some(path) {
            *self = Self { path: Some(path), ..Self::default() };
        }
        let sound = waypoints.iter().all(|waypoint| waypoint.x_m.is_finite() && waypoint.y_m.is_finite());
        let last = waypoints.last().filter(|_| sound)?;
        let (here, goal) = (pose.position(), Point2::new(last.x_m, last.y_m));
        let mut nearest = (f64::INFINITY, self.along_m);
        let mut begin_m = 0.0;
        for (from, to) in segments(waypoints) {
            let (length_m, end_m) = ((to - from).norm(), begin_m + (to - from).norm());
            let (low, high) = (self.along_m - begin_m, self.along_m + SEARCH_M - begin_m);
            if length_m > 0.0 && low <= length_m && high >= 0.0 {
                let along = (here - from).dot(&(to - from)) / length_m;
                let along = along.clamp(low.max(0.0), high.min(length_m));
                let distance_m = (from + (to - from) * (along / length_m) - here).norm();
                if distance_m < nearest.0 {
                    nearest = (distance_m, begin_m + along);
                }
            }
            begin_m = end_m;
        }
        self.along_m = nearest.1;
        let point = place_at(waypoints, self.along_m + params.lookahead_m).unwrap_or(goal);
        self.reached |= (goal - here).norm() <= params.reach_tolerance_m;
        let way_m = (begin_m - self.along_m).max((goal - here).norm());
        Some(Aim { point, way_m, reached: self.reached })
    }

    /// Forgets the path.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}

fn segments(waypoints: &[Waypoint]) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> {
    let place = |waypoint: &Waypoint| Point2::new(waypoint.x_m, waypoint.y_m);
    waypoints.windows(2).map(move |ends| (place(&ends[0]), place(&ends[1])))
}

/// The place this far along the path; `None` beyond its end.
fn place_at(waypoints: &[Waypoint], along_m: f64) -> Option<Point2<f64>> {
    let mut begin_m = 0.0;
    for (from, to) in segments(waypoints) {
        let length_m = (to - from).norm();
        if length_m > 0.0 && along_m <= begin_m + length_m {
            return Some(from + (to - from) * ((along_m - begin_m) / length_m));
        }
        begin_m += length_m;
    }
    None
}
