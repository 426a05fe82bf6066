//! The three faces in a laser scan.

use crate::{FaceRanges, Params};
use messages::{RangeScan, Stamped};

/// A scan must look within this angle of straight ahead, or it guards nothing.
const AHEAD_RAD: f64 = 0.2;

/// Nearest clearances from the hull: front from end points ahead of the body within its width and a margin, sides likewise. `None`
/// for a scan that cannot be trusted: numbers that are none, no beam ahead, or most beams without meaning.
pub(crate) fn faces(scan: &Stamped<'_, RangeScan>, params: &Params) -> Option<FaceRanges> {
    scan.check().ok()?;
    if scan.range_max_m.is_nan() || scan.range_max_m <= 0.0 {
        return None;
    }
    let mut faces = FaceRanges::FAR;
    let (mut meaningless, mut ahead) = (0_usize, false);
    for (index, &range_m) in scan.elements.iter().enumerate() {
        // NaN, zero and negative ranges say nothing; infinite ones say "far".
        if range_m.is_nan() || range_m <= 0.0 {
            meaningless += 1;
            continue;
        }
        let direction_rad = scan.sensor_heading_rad + scan.angle_min_rad + index as f64 * scan.angle_step_rad;
        ahead |= geometry::angle::wrap(direction_rad).abs() <= AHEAD_RAD;
        if let Some((direction_rad, range_m)) = scan.beam(scan.elements, index) {
            let (sine, cosine) = direction_rad.sin_cos();
            faces.add(scan.sensor_x_m + range_m * cosine, scan.sensor_y_m + range_m * sine, params);
        }
    }
    (ahead && 2 * meaningless <= scan.elements.len()).then_some(faces)
}

impl FaceRanges {
    /// Takes in an end point in the robot's frame.
    fn add(&mut self, x_m: f64, y_m: f64, params: &Params) {
        let margin_m = params.laser_margin_m;
        let front_m = x_m - params.body_front_m;
        let side_m = y_m.abs() - params.body_half_width_m;
        let nearest_side_m = if y_m < 0.0 { &mut self.right_m } else { &mut self.left_m };
        if front_m > 0.0 {
            if side_m <= margin_m {
                self.front_m = self.front_m.min(front_m);
            }
            if side_m > 0.0 && front_m <= margin_m {
                *nearest_side_m = nearest_side_m.min(side_m);
            }
        } else if side_m > 0.0 {
            if x_m >= -params.body_rear_m - margin_m {
                *nearest_side_m = nearest_side_m.min(side_m);
            }
        } else if x_m >= -params.body_rear_m {
            // Within the hull: it touches the nearer of the two edges.
            let touched_m = if front_m > side_m { &mut self.front_m } else { nearest_side_m };
            *touched_m = 0.0;
        }
    }
}
