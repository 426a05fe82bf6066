//! The lane to the right in a hallway (COF-006), found from the walls alone.

use crate::grid::{DIRECTIONS, Grid};
use std::f64::consts::SQRT_2;

/// Free cells in a row count up to here.
const FAR: u16 = 4000;
/// A passage is a hallway where it is this much longer than wide; an elevator with the hallway before its door is none.
const SLENDER: f64 = 3.5;
/// So near to the lane's middle is in the lane, in metres.
const TOLERANCE_M: f64 = 0.01;

/// For each cell and each direction of travel: how far beside the lane it lies, in metres; zero outside hallways and for travel across
/// one. The lane's middle is `lane_m` from the wall on the right of the traveller, or the hallway's middle where that is nearer. A
/// hallway's axis is the direction across which the walls are nearest to each other, and at most `width_max_m` apart.
pub(crate) fn beside_lane(grid: &Grid, lane_m: f64, width_max_m: f64) -> Vec<[f32; 8]> {
    let runs: Vec<Vec<u16>> = (0..8).map(|direction| free_run(grid, direction)).collect();
    let step_m =
        |direction: usize| grid.resolution_m() * if direction.is_multiple_of(2) { 1.0 } else { SQRT_2 };
    // From the cell's middle to the wall's line, about the middle of its cell; infinite where no wall is.
    let to_wall_m = |cell: usize, direction: usize| match runs[direction][cell] {
        FAR => f64::INFINITY,
        run => f64::from(run) * step_m(direction),
    };
    let mut lanes = vec![[0.0; 8]; grid.len()];
    for (cell, lane) in lanes.iter_mut().enumerate() {
        if grid.is_occupied(cell) {
            continue;
        }
        let across_m = |axis: usize| to_wall_m(cell, (axis + 2) % 8) + to_wall_m(cell, (axis + 6) % 8);
        let along_m = |axis: usize| to_wall_m(cell, axis) + to_wall_m(cell, axis + 4);
        // Of equal widths the first wins: straight axes before diagonal ones.
        let [mut axis, mut width_m] = [0.0, f64::INFINITY];
        for candidate in [0_u8, 2, 1, 3] {
            let candidate_m = across_m(usize::from(candidate));
            if candidate_m < width_m - 1e-9 {
                [axis, width_m] = [f64::from(candidate), candidate_m];
            }
        }
        let axis = axis as usize;
        if width_m > width_max_m || along_m(axis) < SLENDER * width_m {
            continue;
        }
        let wanted_m = lane_m.min(0.5 * width_m);
        for heading in [axis, axis + 4] {
            let right_m = to_wall_m(cell, (heading + 6) % 8);
            let beside_m = ((right_m - wanted_m).abs() - TOLERANCE_M).max(0.0) as f32;
            for turn in [7, 0, 1] {
                lane[(heading + turn) % 8] = beside_m;
            }
        }
    }
    lanes
}

/// How many cells can be walked in a direction, this one included, until one is occupied; `FAR` when the grid ends before.
fn free_run(grid: &Grid, direction: usize) -> Vec<u16> {
    let (dx, dy) = DIRECTIONS[direction];
    let offset = grid.offsets()[direction];
    let mut runs = vec![FAR; grid.len()];
    let (columns, rows) = (grid.width(), grid.height());
    for step in 0..rows {
        // The cell ahead comes before the cell behind.
        let row = if dy > 0 { rows - 1 - step } else { step };
        for step in 0..columns {
            let column = if dx > 0 { columns - 1 - step } else { step };
            let cell = grid.index(column, row);
            runs[cell] = if grid.is_occupied(cell) {
                0
            } else {
                runs[cell.wrapping_add_signed(offset)].saturating_add(1).min(FAR)
            };
        }
    }
    runs
}
