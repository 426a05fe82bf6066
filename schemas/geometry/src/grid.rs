//! Grids over the plane: where their cells lie, what the cells hold.

mod distance;
mod occupancy;
mod traverse;

pub use occupancy::{Occupancy, OccupancyGrid, log_odds, probability};
pub use traverse::{CellsAlong, CellsBetween};

use crate::Pose2;
use nalgebra::Point2;

/// No grid has more cells than this (a square of 8192, at 5 cm one of 409 m): what is worked out for each
/// cell then still fits into the memory of a robot's computer.
pub const MOST_CELLS: u64 = 1 << 26;
/// No grid has more columns or rows than this, so that a column or row and its neighbour stay apart in single
/// precision.
pub const LONGEST_SIDE: u32 = (1 << 24) - 2;

/// Why a grid cannot be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GridError {
    /// No cells at all, or more than [`MOST_CELLS`], or a side longer than [`LONGEST_SIDE`].
    #[error(
        "a grid of {width} x {height} cells: it needs at least one, and has at most {MOST_CELLS}, {LONGEST_SIDE} along a side"
    )]
    BadSize {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A resolution that is not positive and finite.
    #[error("a resolution of {resolution_m} m is not positive and finite")]
    BadResolution {
        /// Metres a cell.
        resolution_m: f64,
    },
    /// An origin that is not finite.
    #[error("the origin ({}, {}, {}) is not finite", origin.x_m, origin.y_m, origin.heading_rad)]
    BadOrigin {
        /// The origin.
        origin: Pose2,
    },
    /// The cells given are not as many as the grid has.
    #[error("{cells} cells given for a grid of {width} x {height}")]
    WrongCount {
        /// Cells given.
        cells: usize,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// A cell by column (along the grid's x axis) and row (along its y axis): (0, 0) lies at the grid's origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Counted along x, from 0.
    pub column: u32,
    /// Counted along y, from 0.
    pub row: u32,
}

impl Cell {
    /// The cell in that column and row.
    pub const fn new(column: u32, row: u32) -> Self {
        Self { column, row }
    }
}

/// Where the cells of a grid lie, as in ROS: the origin is the outer corner of cell (0, 0), rows follow each
/// other along y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridFrame {
    width: u32,
    height: u32,
    resolution_m: f64,
    origin: Pose2,
    sine: f64,
    cosine: f64,
}

impl GridFrame {
    /// A grid of `width` columns and `height` rows of square cells with sides of `resolution_m`, whose outer
    /// corner and x axis lie at `origin`.
    pub fn new(width: u32, height: u32, resolution_m: f64, origin: Pose2) -> Result<Self, GridError> {
        let cells = u64::from(width) * u64::from(height);
        if cells == 0 || cells > MOST_CELLS || width.max(height) > LONGEST_SIDE {
            return Err(GridError::BadSize { width, height });
        }
        if !(resolution_m > 0.0 && resolution_m.is_finite() && (1.0 / resolution_m).is_finite()) {
            return Err(GridError::BadResolution { resolution_m });
        }
        if !origin.is_finite() {
            return Err(GridError::BadOrigin { origin });
        }
        let (sine, cosine) = origin.heading_rad.sin_cos();
        Ok(Self { width, height, resolution_m, origin, sine, cosine })
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Side of a cell in metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Outer corner of cell (0, 0), and the direction of the rows.
    pub fn origin(&self) -> Pose2 {
        self.origin
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Never: a grid has at least one cell.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Where a cell stands in the list of cells; `None` outside.
    pub fn index(&self, cell: Cell) -> Option<usize> {
        let inside = cell.column < self.width && cell.row < self.height;
        inside.then(|| cell.row as usize * self.width as usize + cell.column as usize)
    }

    /// The cell at that place in the list.
    pub fn cell(&self, index: usize) -> Option<Cell> {
        let width = self.width as usize;
        (index < self.len()).then(|| Cell::new((index % width) as u32, (index / width) as u32))
    }

    /// A point in cells from the grid's origin: (0.5, 0.5) is the middle of cell (0, 0).
    pub fn to_cells(&self, point: Point2<f64>) -> Point2<f64> {
        let (x, y) = (point.x - self.origin.x_m, point.y - self.origin.y_m);
        Point2::new(
            (self.cosine * x + self.sine * y) / self.resolution_m,
            (self.cosine * y - self.sine * x) / self.resolution_m,
        )
    }

    /// The reverse of [`GridFrame::to_cells`].
    pub fn from_cells(&self, point: Point2<f64>) -> Point2<f64> {
        let (x, y) = (point.x * self.resolution_m, point.y * self.resolution_m);
        Point2::new(
            self.origin.x_m + self.cosine * x - self.sine * y,
            self.origin.y_m + self.sine * x + self.cosine * y,
        )
    }

    /// The cell that holds a point; `None` outside. Lower and left borders belong to a cell.
    pub fn cell_at(&self, point: Point2<f64>) -> Option<Cell> {
        let place = self.to_cells(point);
        // NaN fails the comparisons.
        let inside = place.x >= 0.0
            && place.y >= 0.0
            && place.x < f64::from(self.width)
            && place.y < f64::from(self.height);
        inside.then(|| Cell::new(place.x as u32, place.y as u32))
    }

    /// The middle of a cell, which need not lie inside of the grid.
    pub fn centre(&self, cell: Cell) -> Point2<f64> {
        self.from_cells(Point2::new(f64::from(cell.column) + 0.5, f64::from(cell.row) + 0.5))
    }

    /// Every cell, row after row.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let Self { width, height, .. } = *self;
        (0..height).flat_map(move |row| (0..width).map(move |column| Cell::new(column, row)))
    }
}

/// A value for each cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    frame: GridFrame,
    cells: Vec<T>,
}

impl<T> Grid<T> {
    /// A grid of the given values, row after row.
    pub fn new(frame: GridFrame, cells: Vec<T>) -> Result<Self, GridError> {
        if cells.len() == frame.len() {
            return Ok(Self { frame, cells });
        }
        Err(GridError::WrongCount { cells: cells.len(), width: frame.width, height: frame.height })
    }

    /// A grid that holds one value everywhere.
    pub fn filled(frame: GridFrame, value: T) -> Self
    where
        T: Clone,
    {
        Self { cells: vec![value; frame.len()], frame }
    }

    /// Where the cells lie.
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// The values, row after row.
    pub fn as_slice(&self) -> &[T] {
        &self.cells
    }

    /// The values, row after row, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.cells
    }

    /// The values, row after row.
    pub fn into_cells(self) -> Vec<T> {
        self.cells
    }

    /// A cell's value; `None` outside.
    pub fn get(&self, cell: Cell) -> Option<&T> {
        self.frame.index(cell).map(|index| &self.cells[index])
    }

    /// A cell's value, to be changed; `None` outside.
    pub fn get_mut(&mut self, cell: Cell) -> Option<&mut T> {
        self.frame.index(cell).map(|index| &mut self.cells[index])
    }

    /// The value at a point; `None` outside.
    pub fn at(&self, point: Point2<f64>) -> Option<&T> {
        self.frame.cell_at(point).and_then(|cell| self.get(cell))
    }

    /// This grid with other values.
    pub fn map<U>(&self, change: impl FnMut(&T) -> U) -> Grid<U> {
        Grid { frame: self.frame, cells: self.cells.iter().map(change).collect() }
    }
}
