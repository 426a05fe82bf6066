//! The windows that are kept.

use crate::{Params, Ring};
use std::f64::consts::FRAC_PI_2;

/// A part of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Its middle reading.
    pub centre: usize,
    /// So many readings on either side belong to it.
    pub half: usize,
    /// Whether it looks straight at a wall.
    pub is_kept: bool,
}

/// Four windows at right angles, the first one around `first_rad` (NXT-041). One whose readings fall towards
/// a side looks at a wall askew and is dropped. The first one is kept in any case: the robot has
/// turned to the nearest wall.
pub fn windows(ring: &Ring, first_rad: f64, params: &Params) -> [Window; 4] {
    [0, 1, 2, 3].map(|quarter| {
        let centre = ring.index_at(first_rad + f64::from(quarter) * FRAC_PI_2);
        let half = ring.span(params.window_deg.to_radians());
        let is_kept =
            quarter == 0 || !params.perpendicular_only || is_perpendicular(ring, centre, half, params);
        Window { centre, half, is_kept }
    })
}

/// Whether the readings have a local minimum near the middle: its third must not lie above either of the
/// outer thirds by more than the tolerance. A window that is mostly without readings looks at nothing.
fn is_perpendicular(ring: &Ring, centre: usize, half: usize, params: &Params) -> bool {
    let (size, third) = (2 * half + 1, (2 * half + 1) / 3);
    let readings: Vec<Option<f64>> = ring.around(centre, half).map(|index| ring.range_m(index)).collect();
    if 2 * readings.iter().flatten().count() < size {
        return false;
    }
    let mean = |part: &[Option<f64>]| {
        let count = part.iter().flatten().count();
        (count > 0).then(|| part.iter().flatten().sum::<f64>() / count as f64)
    };
    let sides = [&readings[..third], &readings[size - third..]];
    let Some(middle_m) = mean(&readings[third..size - third]) else { return false };
    sides.into_iter().filter_map(mean).all(|side_m| middle_m <= side_m + params.slope_tolerance_m)
}
