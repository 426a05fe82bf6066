//! Square cells over a floor: which may hold a place of the configuration space, and which of those hang
//! together. Samples are drawn from them, and a goal that hangs together with nothing is known before
//! anything is drawn.

use geometry::{Point2, Vector2};
use rand::{Rng, RngExt};

/// Cells to the offset, so that no part leaks through a wall into another.
const CELLS_PER_OFFSET: f64 = 4.0;
/// No more cells than this along either side.
const CELLS_MAX: f64 = 600.0;

/// The cells of a floor.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lattice {
    low: Point2<f64>,
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// For each cell the part to which it belongs, from 1; 0 where nothing of the space is.
    part: Vec<u32>,
    /// The cells, part by part, and where each part begins and the last one ends.
    cells: Vec<u32>,
    begins: Vec<usize>,
}

impl Lattice {
    /// Asks for each cell between two corners whether the circle around it may hold something.
    pub(crate) fn new(
        low: Point2<f64>,
        high: Point2<f64>,
        offset_m: f64,
        may_hold: impl Fn(Point2<f64>, f64) -> bool,
    ) -> Self {
        let extent = high - low;
        let finest_m = extent.x.max(extent.y).max(1e-6) / CELLS_MAX;
        let cell_m = (offset_m / CELLS_PER_OFFSET).max(finest_m);
        let count = |extent_m: f64| (extent_m / cell_m).ceil().max(1.0) as usize;
        let (columns, rows) = (count(extent.x), count(extent.y));
        let mut lattice = Self {
            low,
            cell_m,
            columns,
            rows,
            part: vec![0; columns * rows],
            cells: vec![],
            begins: vec![0],
        };
        let within_m = lattice.within_m();
        let holds: Vec<bool> =
            (0..columns * rows).map(|cell| may_hold(lattice.centre(cell), within_m)).collect();
        for cell in 0..holds.len() {
            if holds[cell] && lattice.part[cell] == 0 {
                lattice.fill(cell, &holds);
            }
        }
        lattice
    }

    /// The cell at a place.
    pub(crate) fn cell_at(&self, place: Point2<f64>) -> Option<usize> {
        let at = (place - self.low) / self.cell_m;
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x <= self.columns as f64 && at.y <= self.rows as f64;
        inside.then(|| {
            let (column, row) = ((at.x as usize).min(self.columns - 1), (at.y as usize).min(self.rows - 1));
            row * self.columns + column
        })
    }

    /// The part of the space at a place, from 1.
    pub(crate) fn part_at(&self, place: Point2<f64>) -> Option<usize> {
        self.cell_at(place).map(|cell| self.part[cell] as usize).filter(|&part| part > 0)
    }

    /// The cells of one part, or of all.
    pub(crate) fn cells_of(&self, part: Option<usize>) -> &[u32] {
        match part {
            Some(part) if part > 0 && part < self.begins.len() => {
                &self.cells[self.begins[part - 1]..self.begins[part]]
            }
            Some(_) => &[],
            None => &self.cells,
        }
    }

    /// A place in one of the cells, all places equally likely; `None` without cells.
    pub(crate) fn draw(&self, cells: &[u32], rng: &mut impl Rng) -> Option<Point2<f64>> {
        let cell = *cells.get(rng.random_range(0..cells.len().max(1)))?;
        let inside = Vector2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
        Some(self.centre(cell as usize) + inside * self.cell_m)
    }

    /// Whether two places hang together around discs of `radius_m`: again over cells that may hold a place
    /// that no disc covers.
    pub(crate) fn may_connect(
        &self,
        one: Point2<f64>,
        other: Point2<f64>,
        discs: &[Point2<f64>],
        radius_m: f64,
    ) -> bool {
        let (Some(one), Some(other)) = (self.cell_at(one), self.cell_at(other)) else { return false };
        let mut open: Vec<bool> = self.part.iter().map(|&part| part > 0).collect();
        let covered_m = radius_m - self.within_m();
        let reach = Vector2::repeat(covered_m.max(0.0));
        for disc in discs {
            let at = |place: Point2<f64>, count: usize, axis: usize| {
                (((place[axis] - self.low[axis]) / self.cell_m).floor().max(0.0) as usize).min(count)
            };
            let (low, high) = (disc - reach, disc + reach);
            for row in at(low, self.rows, 1)..(at(high, self.rows, 1) + 1).min(self.rows) {
                for column in at(low, self.columns, 0)..(at(high, self.columns, 0) + 1).min(self.columns) {
                    let cell = row * self.columns + column;
                    open[cell] &= (self.centre(cell) - disc).norm() >= covered_m;
                }
            }
        }
        let mut found = vec![one];
        open[one] = false;
        while let Some(cell) = found.pop() {
            if cell == other {
                return true;
            }
            for neighbour in self.around(cell) {
                if std::mem::take(&mut open[neighbour]) {
                    found.push(neighbour);
                }
            }
        }
        false
    }

    /// Half the diagonal of a cell, and a little for the rounding.
    fn within_m(&self) -> f64 {
        self.cell_m * 0.5_f64.sqrt() * (1.0 + 1e-9)
    }

    /// A cell and its neighbours over edges and corners.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let (columns, rows) = (self.columns, self.rows);
        let (column, row) = (cell % columns, cell / columns);
        (row.saturating_sub(1)..(row + 2).min(rows)).flat_map(move |row| {
            (column.saturating_sub(1)..(column + 2).min(columns)).map(move |column| row * columns + column)
        })
    }

    fn centre(&self, cell: usize) -> Point2<f64> {
        let at = Vector2::new((cell % self.columns) as f64 + 0.5, (cell / self.columns) as f64 + 0.5);
        self.low + at * self.cell_m
    }

    /// Makes a new part of all that hangs together with a cell, over edges and corners.
    fn fill(&mut self, cell: usize, holds: &[bool]) {
        let part = self.begins.len() as u32;
        let mut next = self.cells.len();
        self.part[cell] = part;
        self.cells.push(cell as u32);
        while let Some(&cell) = self.cells.get(next) {
            next += 1;
            for neighbour in self.around(cell as usize) {
                if holds[neighbour] && self.part[neighbour] == 0 {
                    self.part[neighbour] = part;
                    self.cells.push(neighbour as u32);
                }
            }
        }
        self.begins.push(self.cells.len());
    }
}
