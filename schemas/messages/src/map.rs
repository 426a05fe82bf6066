//! Maps that are made on the way.

use crate::Message;
use geometry::{GridFrame, Occupancy, OccupancyGrid, Pose2};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// A grid of what is occupied: the header, then the probability of each cell in per cent, row after row, 255
/// where nothing is known. Published by `mapper` on `map/occupancy`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = u8)]
#[repr(C)]
pub struct OccupancyMap {
    /// Scans that are in it.
    pub scans: u64,
    /// Scans that could not be used: nonsense in them, or no pose for their time.
    pub unused_scans: u64,
    /// The outer corner of the first cell, in the map's frame.
    pub origin_x_m: f64,
    /// The outer corner of the first cell, in the map's frame.
    pub origin_y_m: f64,
    /// The direction of the rows.
    pub origin_heading_rad: f64,
    /// Side of a cell.
    pub resolution_m: f64,
    /// Columns, counted along the rows.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// The floor that it shows.
    pub floor: i32,
    /// Always zero.
    pub reserved: u32,
}

impl OccupancyMap {
    /// A cell of which nothing is known.
    pub const UNKNOWN: u8 = 255;

    /// What is known of a cell. A cell that is not there, whatever the header claims, and a value that is no
    /// per cent are unknown.
    pub fn cell(&self, elements: &[u8], column: u32, row: u32) -> Occupancy {
        let index = u64::from(row) * u64::from(self.columns) + u64::from(column);
        let cell = usize::try_from(index).ok().and_then(|index| elements.get(index));
        let inside = column < self.columns && row < self.rows;
        cell.filter(|_| inside).and_then(|&percent| Occupancy::from_percent(percent)).unwrap_or_default()
    }

    /// The map as a grid; `None` when its header is invalid, or does not fit its elements.
    pub fn grid(&self, elements: &[u8]) -> Option<OccupancyGrid> {
        let origin =
            Pose2 { x_m: self.origin_x_m, y_m: self.origin_y_m, heading_rad: self.origin_heading_rad };
        let frame = GridFrame::new(self.columns, self.rows, self.resolution_m, origin).ok()?;
        let cell = |&percent: &u8| Occupancy::from_percent(percent).unwrap_or_default();
        OccupancyGrid::new(frame, elements.iter().map(cell).collect()).ok()
    }
}
