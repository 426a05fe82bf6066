//! What a map knows of a cell.

use super::{Cell, Grid};
use nalgebra::Point2;

/// Whether a cell is occupied: unknown, or a probability in per cent. Held as ROS does: -1 or 0 to 100.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Occupancy(i8);

/// A map of free and occupied cells.
pub type OccupancyGrid = Grid<Occupancy>;

impl Occupancy {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self(-1);
    /// Certainly free.
    pub const FREE: Self = Self(0);
    /// Certainly occupied.
    pub const OCCUPIED: Self = Self(100);

    /// A probability in per cent; `None` above 100.
    pub const fn from_percent(percent: u8) -> Option<Self> {
        if percent <= 100 { Some(Self(percent as i8)) } else { None }
    }

    /// A probability, rounded to per cent; what is not from 0 to 1 is unknown.
    pub fn from_probability(probability: f64) -> Self {
        let possible = (0.0..=1.0).contains(&probability);
        if possible { Self((probability * 100.0).round() as i8) } else { Self::UNKNOWN }
    }

    /// From the byte of a ROS message; every value but 0 to 100 is unknown.
    pub const fn from_ros(byte: i8) -> Self {
        if byte >= 0 && byte <= 100 { Self(byte) } else { Self::UNKNOWN }
    }

    /// The byte of a ROS message.
    pub const fn to_ros(self) -> i8 {
        self.0
    }

    /// The probability in per cent; `None` when unknown.
    pub const fn percent(self) -> Option<u8> {
        if self.0 >= 0 { Some(self.0 as u8) } else { None }
    }

    /// The probability; `None` when unknown.
    pub fn probability(self) -> Option<f64> {
        self.percent().map(|percent| f64::from(percent) / 100.0)
    }

    /// Whether nothing is known.
    pub const fn is_unknown(self) -> bool {
        self.0 < 0
    }

    /// Whether it is known to be occupied with at least that probability in per cent.
    pub const fn is_occupied(self, threshold_percent: u8) -> bool {
        self.0 >= 0 && self.0 as u8 >= threshold_percent
    }
}

impl Default for Occupancy {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl std::fmt::Debug for Occupancy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.percent() {
            Some(percent) => write!(f, "{percent}%"),
            None => write!(f, "unknown"),
        }
    }
}

/// The logarithm of the odds of a probability: 0 for 0.5, infinite for 0 and 1. Updates of independent
/// measurements add up (Thrun et al. 2005, section 4.2).
pub fn log_odds(probability: f64) -> f64 {
    (probability / (1.0 - probability)).ln()
}

/// The reverse of [`log_odds`].
pub fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

impl OccupancyGrid {
    /// Distance in metres from each cell's middle to that of the nearest cell that is occupied with at least
    /// `threshold_percent`: 0 in such a cell, infinite where there is none at all. Exact, in linear time.
    pub fn distances_m(&self, threshold_percent: u8) -> Grid<f32> {
        self.distances_to_m(|cell| cell.is_occupied(threshold_percent))
    }

    /// The map with everything occupied that lies within `radius_m` of a cell that is occupied with at least
    /// `threshold_percent`, from middle to middle. Other cells keep their values.
    pub fn inflated(&self, radius_m: f64, threshold_percent: u8) -> Self {
        let mut grown = self.clone();
        let distances = self.distances_m(threshold_percent);
        // Distances are rounded to single precision: a cell at exactly the radius belongs to it.
        let radius_m = (radius_m * (1.0 + 1e-6)) as f32;
        for (cell, distance_m) in grown.as_mut_slice().iter_mut().zip(distances.as_slice()) {
            if *distance_m <= radius_m {
                *cell = Occupancy::OCCUPIED;
            }
        }
        grown
    }

    /// Whether a straight line between the middles of two cells touches no cell that is occupied with at
    /// least `threshold_percent`, nor one outside of the grid; a line through a corner touches all cells
    /// around it.
    pub fn is_in_sight(&self, from: Cell, to: Cell, threshold_percent: u8) -> bool {
        let mut cells = self.frame().cells_between(from, to);
        cells.all(|cell| self.get(cell).is_some_and(|cell| !cell.is_occupied(threshold_percent)))
    }

    /// How far a ray runs until it enters a cell that is occupied with at least `threshold_percent`, in
    /// metres; `None` if it meets none within `max_range_m` or leaves the grid before.
    pub fn cast_m(
        &self,
        origin: Point2<f64>,
        heading_rad: f64,
        max_range_m: f64,
        threshold_percent: u8,
    ) -> Option<f64> {
        self.cast_until_m(origin, heading_rad, max_range_m, |cell| cell.is_occupied(threshold_percent))
    }
}
