//! Where the nearest wall is.

use crate::{Params, Ring};

/// Differences between mirrored readings count for no more than this.
const MOST_DIFFERENCE_M: f64 = 0.05;

/// Direction and distance of the nearest wall: the least mean of neighbouring readings, which one late echo
/// cannot make nor break (note 1.6 step 2), and then the direction about which the readings are most alike on
/// both sides. Within the cone all readings of a wall are alike, and only farther out does it show which way
/// it runs.
pub fn nearest(ring: &Ring, params: &Params) -> Option<(f64, f64)> {
    let count = params.neighbours as usize;
    let mean = |index: usize| {
        let readings = ring.around(index, count / 2).map(|beside| ring.range_m(beside));
        Some(readings.sum::<Option<f64>>()? / (count / 2 * 2 + 1) as f64)
    };
    let means = (0..ring.len()).filter_map(|index| Some((index, mean(index)?)));
    let (lowest, range_m) = means.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let search = ring.span(params.search_deg.to_radians()) as isize;
    let wall = (-search..=search).filter_map(|offset| {
        let index = ring.moved(lowest, offset);
        (mean(index)? <= range_m + params.alike_m).then(|| (index, asymmetry(ring, index, params)))
    });
    let (index, _) = wall.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((ring.direction_rad(index), range_m))
}

/// Mean squared difference between the readings on both sides of a direction.
fn asymmetry(ring: &Ring, index: usize, params: &Params) -> f64 {
    let reach = ring.span(params.mirror_deg.to_radians()).max(1) as isize;
    let differences =
        (1..=reach).map(|offset| match (ring.beside_m(index, offset), ring.beside_m(index, -offset)) {
            (Some(left_m), Some(right_m)) => (left_m - right_m).abs().min(MOST_DIFFERENCE_M),
            (None, None) => 0.0,
            _ => MOST_DIFFERENCE_M,
        });
    differences.map(|difference| difference * difference).sum::<f64>() / reach as f64
}
