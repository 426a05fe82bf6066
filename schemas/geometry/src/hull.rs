//! A robot's hull from above: a rectangle about its turning centre, and where its motions bring it.

use crate::Pose2;
use nalgebra::Point2;

/// A rectangle about the turning centre, which lies midway between the driven wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hull {
    /// From the turning centre to the front edge, in metres.
    pub front_m: f64,
    /// From the turning centre to the rear edge, in metres.
    pub rear_m: f64,
    /// From the turning centre to either side, in metres: half of the width.
    pub side_m: f64,
}

impl Hull {
    /// From the turning centre to the farthest corner, in metres: in a turn on the spot the hull needs a
    /// circle of this radius.
    pub fn radius_m(&self) -> f64 {
        self.front_m.max(self.rear_m).hypot(self.side_m)
    }

    /// From the hull to a point of the hull's own frame, in metres; 0 inside.
    pub fn distance_to_m(&self, point: Point2<f64>) -> f64 {
        let ahead_m = (point.x - self.front_m).max(-self.rear_m - point.x).max(0.0);
        let aside_m = (point.y.abs() - self.side_m).max(0.0);
        // Most points lie beside one edge.
        if ahead_m == 0.0 { aside_m } else { ahead_m.hypot(aside_m) }
    }

    /// From the hull of a robot at `pose` to a point of the frame that `pose` is given in, in metres; 0
    /// inside.
    pub fn distance_m(&self, pose: Pose2, point: Point2<f64>) -> f64 {
        self.distance_to_m(pose.inverse_transform(point))
    }

    /// Whether a point of the hull's own frame lies inside, off the edge.
    pub fn holds(&self, point: Point2<f64>) -> bool {
        point.x > -self.rear_m && point.x < self.front_m && point.y.abs() < self.side_m
    }

    /// The speed of the hull's fastest corner, in m/s, at a speed ahead and a turning speed
    /// (counter-clockwise, rad/s).
    pub fn fastest_corner_mps(&self, forward_mps: f64, turn_rad_per_s: f64) -> f64 {
        let along_mps = forward_mps.abs() + turn_rad_per_s.abs() * self.side_m;
        along_mps.hypot(turn_rad_per_s * self.front_m.max(self.rear_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HULL: Hull = Hull { front_m: 0.3, rear_m: 0.2, side_m: 0.25 };

    #[track_caller]
    fn check(x_m: f64, y_m: f64, expected_m: f64) {
        let distance_m = HULL.distance_to_m(Point2::new(x_m, y_m));
        assert!((distance_m - expected_m).abs() < 1e-12, "{distance_m}");
    }

    #[test]
    fn distances_are_measured_from_the_edges() {
        check(0.0, 0.0, 0.0);
        check(0.3, 0.25, 0.0);
        check(0.5, 0.0, 0.2);
        check(-0.5, 0.1, 0.3);
        check(0.0, -0.35, 0.1);
        check(0.6, 0.65, 0.5);
        check(-0.6, -0.55, 0.5);
        assert!((HULL.radius_m() - 0.3_f64.hypot(0.25)).abs() < 1e-12);
        assert!(HULL.holds(Point2::new(0.29, 0.24)) && !HULL.holds(Point2::new(0.3, 0.0)));
    }

    proptest! {
        /// Twice the same: the hull as a polygon.
        #[test]
        fn a_hull_is_a_rectangle(x in -2.0..2.0_f64, y in -2.0..2.0_f64, at_x in -1.0..1.0_f64, at_y in -1.0..1.0_f64, heading in -3.2..3.2_f64) {
            let (pose, point) = (Pose2::new(at_x, at_y, heading), Point2::new(x, y));
            let corners = [(-0.2, -0.25), (0.3, -0.25), (0.3, 0.25), (-0.2, 0.25)].map(|(x, y)| Point2::new(x, y));
            let polygon = crate::Polygon::new(corners.to_vec()).unwrap().transformed(pose);
            let expected_m = if polygon.contains(point) { 0.0 } else { polygon.edges().map(|edge| edge.distance_m(point)).fold(f64::INFINITY, f64::min) };
            prop_assert!((HULL.distance_m(pose, point) - expected_m).abs() < 1e-9);
        }

        /// No corner moves farther in a short moment than its speed allows, and one moves as far.
        #[test]
        fn the_fastest_corner_is_one_of_the_four(forward in -1.0..1.0_f64, turn in -2.0..2.0_f64) {
            let moment_s = 1e-6;
            let after = Pose2::IDENTITY.after_arc(forward * moment_s, turn * moment_s);
            let hull = Hull { front_m: 0.3, rear_m: 0.3, side_m: 0.25 };
            let corners = [(-0.3, -0.25), (0.3, -0.25), (0.3, 0.25), (-0.3, 0.25)].map(|(x, y)| Point2::new(x, y));
            let fastest = corners.map(|corner| (after.transform(corner) - corner).norm() / moment_s).into_iter().fold(0.0, f64::max);
            prop_assert!((hull.fastest_corner_mps(forward, turn) - fastest).abs() < 1e-4);
        }
    }
}
