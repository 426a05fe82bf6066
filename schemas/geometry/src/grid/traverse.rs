//! The cells along a line.

use super::{Cell, Grid, GridFrame};
use nalgebra::{Point2, Vector2};

impl GridFrame {
    /// The cells that the segment from `from` to `to` passes, in their order, without those outside of the
    /// grid (Amanatides and Woo 1987). A line exactly through a corner steps along x first. Empty when a
    /// coordinate is not finite.
    pub fn cells_along(&self, from: Point2<f64>, to: Point2<f64>) -> CellsAlong {
        CellsAlong::new(self, self.to_cells(from), self.to_cells(to))
    }

    /// Every cell that the line between the middles of two cells touches, both ends included, in their order
    /// and exactly: a line through a corner yields the two cells beside it as well. Ends may lie outside of
    /// the grid; so may what is yielded then.
    pub fn cells_between(&self, from: Cell, to: Cell) -> CellsBetween {
        CellsBetween::new(from, to)
    }
}

/// The cells along a segment; see [`GridFrame::cells_along`].
#[derive(Debug, Clone)]
pub struct CellsAlong {
    column: i64,
    row: i64,
    width: i64,
    height: i64,
    step: [i64; 2],
    /// Fraction of the way at which the next column and row begin.
    next: [f64; 2],
    /// Fraction of the way between columns and rows.
    stride: [f64; 2],
    /// Fraction of the way at which the present cell was entered.
    entered: f64,
    /// Fraction of the way at which the walk ends.
    until: f64,
    done: bool,
}

impl CellsAlong {
    fn new(frame: &GridFrame, from: Point2<f64>, to: Point2<f64>) -> Self {
        let (width, height) = (i64::from(frame.width()), i64::from(frame.height()));
        let way = to - from;
        let mut walk = Self {
            column: 0,
            row: 0,
            width,
            height,
            step: [0, 0],
            next: [f64::INFINITY; 2],
            stride: [f64::INFINITY; 2],
            entered: 0.0,
            until: 1.0,
            done: !(from.coords + way).iter().chain(from.iter()).all(|value| value.is_finite()),
        };
        let size = [width as f64, height as f64];
        for axis in 0..2 {
            let (p, q) = (-from[axis] / way[axis], (size[axis] - from[axis]) / way[axis]);
            if way[axis].abs() > 0.0 && p.is_finite() && q.is_finite() {
                walk.entered = walk.entered.max(p.min(q));
                walk.until = walk.until.min(p.max(q));
            } else if !(0.0..size[axis]).contains(&from[axis]) {
                walk.done = true;
            }
        }
        if walk.done || walk.entered > walk.until {
            walk.done = true;
            return walk;
        }
        let entry = from + way * walk.entered;
        let mut first = [0; 2];
        for axis in 0..2 {
            let last = if axis == 0 { width } else { height } - 1;
            first[axis] = (entry[axis].floor() as i64).clamp(0, last);
            if way[axis].abs() > 0.0 && (1.0 / way[axis]).is_finite() {
                let forward = way[axis] > 0.0;
                walk.step[axis] = if forward { 1 } else { -1 };
                let border = first[axis] + i64::from(forward);
                walk.next[axis] = (border as f64 - from[axis]) / way[axis];
                walk.stride[axis] = (1.0 / way[axis]).abs();
            }
        }
        [walk.column, walk.row] = first;
        walk
    }
}

impl CellsAlong {
    /// The next cell, and the fraction of the way at which it is entered.
    fn advance(&mut self) -> Option<(Cell, f64)> {
        if self.done {
            return None;
        }
        let entered = (Cell::new(self.column as u32, self.row as u32), self.entered);
        let axis = usize::from(self.next[1] < self.next[0]);
        self.entered = self.next[axis];
        self.next[axis] += self.stride[axis];
        let (place, count) =
            if axis == 0 { (&mut self.column, self.width) } else { (&mut self.row, self.height) };
        *place += self.step[axis];
        // A cell entered at the very end is touched in one point only, and the end's own cell when going
        // forward.
        self.done = self.entered > self.until
            || !(0..count).contains(place)
            || (self.entered >= self.until && self.step[axis] < 0);
        Some(entered)
    }
}

impl Iterator for CellsAlong {
    type Item = Cell;

    fn next(&mut self) -> Option<Cell> {
        self.advance().map(|(cell, _)| cell)
    }
}

impl<T> Grid<T> {
    /// How far a ray runs until it enters a cell that `stops` it, in metres: 0 if it begins in one; `None` if
    /// it meets none within `max_range_m`, or when a number is not finite.
    pub fn cast_until_m(
        &self,
        origin: Point2<f64>,
        heading_rad: f64,
        max_range_m: f64,
        stops: impl Fn(&T) -> bool,
    ) -> Option<f64> {
        let frame = self.frame();
        // A ray without limit ends where it has left the grid for certain.
        let place = frame.to_cells(origin);
        let reach =
            (f64::from(frame.width()) + f64::from(frame.height()) + place.x.abs() + place.y.abs()) * 2.0;
        let range_m = max_range_m.min(reach * frame.resolution_m());
        let (sine, cosine) = heading_rad.sin_cos();
        let end = origin + Vector2::new(cosine, sine) * range_m;
        let mut walk = CellsAlong::new(frame, place, frame.to_cells(end));
        while let Some((cell, fraction)) = walk.advance() {
            let index = cell.row as usize * frame.width() as usize + cell.column as usize;
            if stops(&self.as_slice()[index]) {
                return Some(fraction * range_m);
            }
        }
        None
    }
}

/// The cells that the line between two cells' middles touches; see [`GridFrame::cells_between`].
#[derive(Debug, Clone)]
pub struct CellsBetween {
    /// Present cell.
    place: [i64; 2],
    step: [i64; 2],
    /// Cells to go in each direction, of how many.
    way: [i64; 2],
    left: [i64; 2],
    /// Cells beside a corner, to be yielded before the walk goes on.
    beside: Option<[[i64; 2]; 2]>,
    begun: bool,
}

impl CellsBetween {
    fn new(from: Cell, to: Cell) -> Self {
        let place = [i64::from(from.column), i64::from(from.row)];
        let end = [i64::from(to.column), i64::from(to.row)];
        let way = [end[0] - place[0], end[1] - place[1]];
        let step = way.map(i64::signum);
        let way = way.map(i64::abs);
        Self { place, step, way, left: way, beside: None, begun: false }
    }
}

impl Iterator for CellsBetween {
    type Item = Cell;

    fn next(&mut self) -> Option<Cell> {
        let cell = |place: [i64; 2]| Cell::new(place[0] as u32, place[1] as u32);
        if !self.begun {
            self.begun = true;
            return Some(cell(self.place));
        }
        if let Some([first, second]) = self.beside.take() {
            // The first has been yielded; then the second, then the cell beyond the corner.
            if first != second {
                self.beside = Some([second, second]);
                return Some(cell(second));
            }
            return Some(cell(self.place));
        }
        if self.left == [0, 0] {
            return None;
        }
        // The line leaves the present cell at (2 k + 1) / (2 n) of the way along an axis of n cells after k
        // of them.
        let [nx, ny] = self.way;
        let leave = |axis: usize| 2 * (self.way[axis] - self.left[axis]) + 1;
        let (x, y) = (leave(0) * ny, leave(1) * nx);
        let [sx, sy] = self.step;
        if self.left[1] == 0 || (self.left[0] > 0 && x < y) {
            self.place[0] += sx;
            self.left[0] -= 1;
        } else if self.left[0] == 0 || y < x {
            self.place[1] += sy;
            self.left[1] -= 1;
        } else {
            let [column, row] = self.place;
            let (first, second) = ([column + sx, row], [column, row + sy]);
            self.place = [column + sx, row + sy];
            self.left = [self.left[0] - 1, self.left[1] - 1];
            self.beside = Some([first, second]);
            return Some(cell(first));
        }
        Some(cell(self.place))
    }
}
