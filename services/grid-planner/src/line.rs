//! Walking a straight line through the cells of a grid.

/// Calls `visit(column, row)` for every cell that the line between two points (in units of cells) touches,
/// also both cells beside a corner that it passes exactly, until `visit` says no. Says whether the end was
/// reached (Amanatides and Woo 1987).
pub(crate) fn visit(from: [f64; 2], to: [f64; 2], mut visit: impl FnMut(i64, i64) -> bool) -> bool {
    pieces(from, to, |column, row, _| visit(column, row))
}

/// As [`visit`]; the third argument is how much of the line lies in the cell, as a fraction of the whole
/// (zero for cells only touched).
pub(crate) fn pieces(from: [f64; 2], to: [f64; 2], mut visit: impl FnMut(i64, i64, f64) -> bool) -> bool {
    // Two crossings closer than this, as a fraction of the line, are one corner.
    const CORNER: f64 = 1e-9;
    let mut cell = [from[0].floor() as i64, from[1].floor() as i64];
    let end = [to[0].floor() as i64, to[1].floor() as i64];
    let (mut left, mut step, mut next, mut pitch) = ([0_i64; 2], [0_i64; 2], [f64::INFINITY; 2], [0.0; 2]);
    for axis in 0..2 {
        let length = to[axis] - from[axis];
        left[axis] = (end[axis] - cell[axis]).abs();
        step[axis] = if end[axis] > cell[axis] { 1 } else { -1 };
        if left[axis] > 0 {
            pitch[axis] = 1.0 / length.abs();
            let border = if step[axis] > 0 { cell[axis] as f64 + 1.0 } else { cell[axis] as f64 };
            next[axis] = (border - from[axis]) / length;
        }
    }
    let mut done = 0.0;
    loop {
        let leave = if left == [0, 0] { 1.0 } else { next[0].min(next[1]) };
        if !visit(cell[0], cell[1], (leave - done).max(0.0)) {
            return false;
        }
        done = leave;
        let corner = left[0] > 0 && left[1] > 0 && (next[0] - next[1]).abs() < CORNER;
        if corner {
            if !visit(cell[0] + step[0], cell[1], 0.0) || !visit(cell[0], cell[1] + step[1], 0.0) {
                return false;
            }
        } else if left == [0, 0] {
            return true;
        }
        let first = if corner || (left[0] > 0 && next[0] <= next[1]) { 0 } else { 1 };
        let last = if corner { 1 } else { first };
        for axis in first..=last {
            cell[axis] += step[axis];
            left[axis] -= 1;
            next[axis] = if left[axis] > 0 { next[axis] + pitch[axis] } else { f64::INFINITY };
        }
    }
}
