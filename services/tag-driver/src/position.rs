//! The module's own position: least squares over the distances, at the known height.

use messages::AnchorRange;
use nalgebra::{Matrix2, Point2, Vector2};

/// Fewer anchors give no position.
const FEWEST: usize = 3;
/// Gauss and Newton's steps; a handful suffices from anywhere in a building.
const STEPS: usize = 8;

/// The place in the plane, at height `z_m`, that fits the distances best, beginning the search at `from`.
/// `None` with fewer than three distances, with invalid numbers, or when the anchors stand in one line of
/// sight.
pub fn position_from(heard: &[AnchorRange], z_m: f64, from: Point2<f64>) -> Option<Point2<f64>> {
    if heard.len() < FEWEST {
        return None;
    }
    let mut place = from;
    for _ in 0..STEPS {
        let (mut normal, mut residual) = (Matrix2::zeros(), Vector2::zeros());
        for anchor in heard {
            let offset = place - Point2::new(anchor.x_m, anchor.y_m);
            let expected_m = offset.norm().hypot(z_m - anchor.z_m).max(1e-6);
            let slope = offset / expected_m;
            normal += slope * slope.transpose();
            residual += slope * (anchor.range_m - expected_m);
        }
        // A little damping keeps the search in place where the anchors say nothing of a direction.
        place += (normal + Matrix2::identity() * 1e-3).try_inverse()? * residual;
    }
    (place.x.is_finite() && place.y.is_finite()).then_some(place)
}
