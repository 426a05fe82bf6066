//! The exact Euclidean distance transform.

use super::Grid;

/// More cells than any column has: nothing in this column.
const NONE: u32 = 1 << 29;

impl<T> Grid<T> {
    /// Distance in metres from each cell's middle to that of the nearest cell for which `is_target` holds: 0
    /// in such a cell, infinite where there is none at all. Exact, in time linear in the cells: distances
    /// within the columns, then in each row the lower envelope of their parabolas (Felzenszwalb and
    /// Huttenlocher 2012).
    pub fn distances_to_m(&self, is_target: impl Fn(&T) -> bool) -> Grid<f32> {
        let width = self.frame().width() as usize;
        let resolution_m = self.frame().resolution_m();
        // Cells to the nearest target of the same column, swept up and down row by row: the inner loops run
        // side by side.
        let mut columns: Vec<u32> =
            self.as_slice().iter().map(|cell| if is_target(cell) { 0 } else { NONE }).collect();
        let sweep = |before: &[u32], row: &mut [u32]| {
            for (cell, before) in row.iter_mut().zip(before) {
                *cell = (*cell).min(*before + 1);
            }
        };
        let height = self.frame().height() as usize;
        for row in 1..height {
            let (below, above) = columns.split_at_mut(row * width);
            sweep(&below[(row - 1) * width..], &mut above[..width]);
        }
        for row in (1..height).rev() {
            let (below, above) = columns.split_at_mut(row * width);
            sweep(&above[..width], &mut below[(row - 1) * width..]);
        }
        let mut distances = Vec::with_capacity(columns.len());
        let mut envelope = Vec::with_capacity(width);
        for row in columns.chunks_exact(width) {
            envelope_row(row, &mut envelope, |square| distances.push((square.sqrt() * resolution_m) as f32));
        }
        Grid { frame: *self.frame(), cells: distances }
    }
}

/// A parabola `height + (x - column)^2` that is the lowest from `from` on.
#[derive(Debug, Clone, Copy)]
struct Parabola {
    column: f64,
    height: f64,
    from: f64,
}

/// Yields for every column of a row the smallest squared distance, in cells.
fn envelope_row(row: &[u32], envelope: &mut Vec<Parabola>, mut yields: impl FnMut(f64)) {
    envelope.clear();
    for (column, &up) in row.iter().enumerate().filter(|&(_, &up)| up < NONE) {
        let (column, up) = (column as f64, f64::from(up));
        let height = up * up;
        let mut from = f64::NEG_INFINITY;
        while let Some(top) = envelope.last() {
            // Where both are equally high: whole numbers below 2^53 in numerator and denominator.
            let difference = (height + column * column) - (top.height + top.column * top.column);
            from = difference / (2.0 * (column - top.column));
            if from > top.from {
                break;
            }
            envelope.pop();
            from = f64::NEG_INFINITY;
        }
        envelope.push(Parabola { column, height, from });
    }
    let Some(&(mut lowest)) = envelope.first() else {
        row.iter().for_each(|_| yields(f64::INFINITY));
        return;
    };
    let mut next = 1;
    for column in 0..row.len() {
        let x = column as f64;
        while let Some(&candidate) = envelope.get(next).filter(|candidate| candidate.from <= x) {
            lowest = candidate;
            next += 1;
        }
        yields(lowest.height + (x - lowest.column) * (x - lowest.column));
    }
}
