//! An occupancy grid as a flat array with a border of one occupied cell, so that no neighbour needs a bounds
//! check.

use crate::line;
use geometry::{GridFrame, Pose2};

/// The eight directions of a step, counter-clockwise from +x: even ones are straight, odd ones diagonal.
pub const DIRECTIONS: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// What of a floor is occupied before anything was observed (ASN-131).
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Columns without the border.
    width: usize,
    /// Rows without the border.
    height: usize,
    /// Edge of a cell.
    resolution_m: f64,
    /// The map's place of the lower left corner of column 0, row 0.
    origin_m: [f64; 2],
    /// Row by row with the border: 1 occupied, 0 free.
    occupied: Vec<u8>,
}

impl Grid {
    /// A free grid.
    pub fn new(width: usize, height: usize, resolution_m: f64, origin_m: [f64; 2]) -> Self {
        let mut grid =
            Self { width, height, resolution_m, origin_m, occupied: vec![1; (width + 2) * (height + 2)] };
        for row in 0..height {
            let first = grid.index(0, row);
            grid.occupied[first..first + width].fill(0);
        }
        grid
    }

    /// A grid around pieces of wall `[x, y]` to `[x, y]`, with `margin_m` to spare on each side. Pieces that
    /// are not finite are left out.
    pub fn from_segments(segments: &[[[f64; 2]; 2]], resolution_m: f64, margin_m: f64) -> Self {
        let finite = || segments.iter().filter(|piece| piece.iter().flatten().all(|value| value.is_finite()));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in finite().flatten() {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        if low[0] > high[0] {
            return Self::new(0, 0, resolution_m, [0.0, 0.0]);
        }
        // Whole cells from zero, so that equal walls fall into equal cells whatever else the floor holds.
        let origin = low.map(|value| ((value - margin_m) / resolution_m).floor() * resolution_m);
        let cells = |axis: usize| ((high[axis] + margin_m - origin[axis]) / resolution_m).ceil() as usize;
        let mut grid = Self::new(cells(0), cells(1), resolution_m, origin);
        for piece in finite() {
            let (from, to) = (grid.to_cells(piece[0]), grid.to_cells(piece[1]));
            line::visit(from, to, |column, row| {
                grid.occupy(column, row);
                true
            });
        }
        grid
    }

    /// Marks a cell; outside the grid nothing happens.
    pub fn occupy(&mut self, column: i64, row: i64) {
        if let Some(index) = self.checked_index(column, row) {
            self.occupied[index] = 1;
        }
    }

    /// Marks the cells of a row whose values are occupied.
    pub(crate) fn occupy_where<T>(&mut self, row: usize, values: &[T], is_occupied: impl Fn(&T) -> bool) {
        let first = self.index(0, row);
        for (cell, value) in self.occupied[first..first + self.width].iter_mut().zip(values) {
            *cell |= u8::from(is_occupied(value));
        }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Edge of a cell.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// From one row to the next in flat arrays.
    pub fn stride(&self) -> usize {
        self.width + 2
    }

    /// Length of flat arrays, with the border.
    pub fn len(&self) -> usize {
        self.occupied.len()
    }

    /// Whether the grid has no cell.
    pub fn is_empty(&self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// Whether a cell of the flat array is occupied (the border is).
    pub fn is_occupied(&self, index: usize) -> bool {
        self.occupied[index] != 0
    }

    /// The occupied cells, 1 each, row by row with the border.
    pub fn occupied(&self) -> &[u8] {
        &self.occupied
    }

    /// The flat index of a cell that exists.
    pub fn index(&self, column: usize, row: usize) -> usize {
        (row + 1) * self.stride() + column + 1
    }

    /// The flat index, or `None` outside.
    pub fn checked_index(&self, column: i64, row: i64) -> Option<usize> {
        let inside = column >= 0 && row >= 0 && column < self.width as i64 && row < self.height as i64;
        inside.then(|| self.index(column as usize, row as usize))
    }

    /// The flat index of the cell at a place of the map, or `None` outside.
    pub fn index_at(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let [column, row] = self.to_cells([x_m, y_m]);
        (column.is_finite() && row.is_finite())
            .then(|| self.checked_index(column.floor() as i64, row.floor() as i64))
            .flatten()
    }

    /// Column and row of a flat index.
    pub fn column_row(&self, index: usize) -> (i64, i64) {
        ((index % self.stride()) as i64 - 1, (index / self.stride()) as i64 - 1)
    }

    /// The middle of a cell in units of cells.
    pub fn centre(&self, index: usize) -> [f64; 2] {
        let (column, row) = self.column_row(index);
        [column as f64 + 0.5, row as f64 + 0.5]
    }

    /// A place of the map in units of cells.
    pub fn to_cells(&self, place_m: [f64; 2]) -> [f64; 2] {
        [
            (place_m[0] - self.origin_m[0]) / self.resolution_m,
            (place_m[1] - self.origin_m[1]) / self.resolution_m,
        ]
    }

    /// Units of cells in the map.
    pub fn to_map(&self, cells: [f64; 2]) -> [f64; 2] {
        [self.origin_m[0] + cells[0] * self.resolution_m, self.origin_m[1] + cells[1] * self.resolution_m]
    }

    /// The step in the flat array for each direction.
    pub fn offsets(&self) -> [isize; 8] {
        DIRECTIONS.map(|(dx, dy)| dy as isize * self.stride() as isize + dx as isize)
    }

    /// Distance from each cell's middle to the middle of the nearest occupied cell, in cells, exact; the
    /// border does not count. Where nothing is occupied at all, farther than any grid reaches.
    pub fn distances(&self) -> Vec<f32> {
        const FAR: f32 = 1e6;
        let mut all = vec![FAR; self.len()];
        let (width, height) = (self.width as u32, self.height as u32);
        let Ok(frame) = GridFrame::new(width, height, 1.0, Pose2::IDENTITY) else { return all };
        let inner = self.occupied.chunks_exact(self.stride()).skip(1).take(self.height);
        let inner: Vec<u8> = inner.flat_map(|row| &row[1..=self.width]).copied().collect();
        let Ok(inner) = geometry::Grid::new(frame, inner) else { return all };
        let distances = inner.distances_to_m(|&occupied| occupied != 0);
        for (row, distances) in distances.as_slice().chunks_exact(self.width).enumerate() {
            let first = self.index(0, row);
            for (cell, distance) in all[first..first + self.width].iter_mut().zip(distances) {
                *cell = distance.min(FAR);
            }
        }
        all
    }
}
