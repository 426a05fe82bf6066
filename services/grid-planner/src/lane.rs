//! The lane to the right in a hallway (COF-006), found from the walls alone.

use crate::grid::Grid;
use std::f64::consts::SQRT_2;

/// Free cells in a row count up to here.
pub(crate) const FAR: u16 = 4000;
/// A passage is a hallway where it is this much longer than wide; an elevator with the hallway before its
/// door is not.
const SLENDER: f64 = 3.5;
/// How near to the lane's middle counts as in the lane, in metres.
const TOLERANCE_M: f64 = 0.01;

/// Gives each cell of a hallway, with how far beside the lane it lies in each direction of travel, in metres,
/// to `write`; across the hallway that is zero, as it is in cells that are not given. The lane's middle is
/// `lane_m` from the wall on the right of the traveller, or the hallway's middle where that is nearer. A
/// hallway's axis is the direction across which the walls are nearest to each other, and at most
/// `width_max_m` apart.
pub(crate) fn beside_lane(
    grid: &Grid,
    lane_m: f64,
    width_max_m: f64,
    mut write: impl FnMut(usize, [f32; 8]),
) {
    let step_m =
        |direction: usize| grid.resolution_m() * if direction.is_multiple_of(2) { 1.0 } else { SQRT_2 };
    // From the cell's middle to the wall's line, about the middle of its cell; infinite where no wall is.
    let steps_m: [f64; 8] = std::array::from_fn(step_m);
    Runs::new(grid).rows(grid, |cell, runs| {
        let to_wall_m: [f64; 8] = std::array::from_fn(|direction| match runs[direction] {
            FAR => f64::INFINITY,
            run => f64::from(run) * steps_m[direction],
        });
        let across_m = |axis: usize| to_wall_m[(axis + 2) % 8] + to_wall_m[(axis + 6) % 8];
        let along_m = |axis: usize| to_wall_m[axis] + to_wall_m[axis + 4];
        // Of equal widths the first wins: straight axes before diagonal ones.
        let (mut axis, mut width_m) = (0, f64::INFINITY);
        for candidate in [0, 2, 1, 3] {
            let candidate_m = across_m(candidate);
            if candidate_m < width_m - 1e-9 {
                (axis, width_m) = (candidate, candidate_m);
            }
        }
        if width_m > width_max_m || along_m(axis) < SLENDER * width_m {
            return;
        }
        let wanted_m = lane_m.min(0.5 * width_m);
        let mut lane = [0.0; 8];
        for heading in [axis, axis + 4] {
            let right_m = to_wall_m[(heading + 6) % 8];
            let beside_m = ((right_m - wanted_m).abs() - TOLERANCE_M).max(0.0) as f32;
            for turn in [7, 0, 1] {
                lane[(heading + turn) % 8] = beside_m;
            }
        }
        write(cell, lane);
    });
}

/// How many cells can be walked in each direction, the cell itself included, until one is occupied; `FAR`
/// when the grid ends before.
///
/// A run continues that of the cell ahead. Going up through the rows, those ahead to the side and below are
/// at hand; only those above have to be kept for the whole grid, found on the way down.
pub(crate) struct Runs {
    /// Of the directions that lead up: 1, 2 and 3.
    above: [Vec<u16>; 3],
}

impl Runs {
    pub(crate) fn new(grid: &Grid) -> Self {
        let mut above = [1_usize, 2, 3].map(|_| vec![FAR; grid.len()]);
        let offsets = grid.offsets();
        for row in (0..grid.height()).rev() {
            for (runs, direction) in above.iter_mut().zip(1..) {
                for column in 0..grid.width() {
                    let cell = grid.index(column, row);
                    runs[cell] = run(grid, cell, runs[cell.wrapping_add_signed(offsets[direction])]);
                }
            }
        }
        Self { above }
    }

    /// Gives the runs of every free cell to `f`, row by row.
    pub(crate) fn rows(&self, grid: &Grid, mut f: impl FnMut(usize, [u16; 8])) {
        let stride = grid.stride();
        // With the border, as everywhere: place 0 is column -1.
        let mut below = vec![[FAR; 8]; stride];
        let mut here = below.clone();
        for row in 0..grid.height() {
            for column in (0..grid.width()).rev() {
                here[column + 1][0] = run(grid, grid.index(column, row), here[column + 2][0]);
            }
            for column in 0..grid.width() {
                let (place, cell) = (column + 1, grid.index(column, row));
                let ahead = [below[place - 1][5], below[place][6], below[place + 1][7]];
                let mut runs = here[place];
                runs[1] = self.above[0][cell];
                runs[2] = self.above[1][cell];
                runs[3] = self.above[2][cell];
                runs[4] = run(grid, cell, here[place - 1][4]);
                [runs[5], runs[6], runs[7]] = ahead.map(|ahead| run(grid, cell, ahead));
                here[place] = runs;
                if !grid.is_occupied(cell) {
                    f(cell, runs);
                }
            }
            std::mem::swap(&mut below, &mut here);
        }
    }
}

/// The run from a cell on, with that of the cell ahead.
fn run(grid: &Grid, cell: usize, ahead: u16) -> u16 {
    if grid.is_occupied(cell) { 0 } else { ahead.saturating_add(1).min(FAR) }
}
