//! The map itself: a binary Bayes filter in each cell (ASN-122).

use crate::params::Params;
use crate::sectors::{Limits, Sectors};
use crate::spans::Spans;
use geometry::{GridFrame, Occupancy, OccupancyGrid, Point2, Pose2, log_odds, probability};
use messages::{OccupancyMap, RangeScan};

/// Log-odds are kept as whole thousandths: a map is half as large, and sums are exact.
const PER_UNIT: f64 = 1000.0;

/// Cells that are passed are changed in blocks of as many.
const LANES: usize = 16;

/// Readings that ended where the map does not reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// How many there were.
    pub readings: u64,
    /// The least x and y at which one ended, in the map's frame.
    pub least: Point2<f64>,
    /// The greatest.
    pub most: Point2<f64>,
}

/// A grid of log-odds.
#[derive(Debug, Clone)]
pub struct Map {
    frame: GridFrame,
    /// Thousandths; 0 where nothing is known, or as much speaks for as against. Behind the last row lies one
    /// block more.
    cells: Vec<i16>,
    hit: i16,
    clamp: i16,
    /// A block of misses, then a block of nothing: a part of both changes the first cells of a block.
    misses: [i16; 2 * LANES],
    limits: Limits,
    sectors: Sectors,
    spans: Spans,
    /// Cells in which a beam of the present scan ends, and what they held before it.
    ended: Vec<(usize, i16)>,
    beyond: Option<Beyond>,
    /// Per cent for every value from -`clamp` on.
    percents: Vec<u8>,
}

impl Map {
    /// A map of which nothing is known. The parameters have been checked.
    pub fn new(params: &Params, frame: GridFrame) -> Self {
        let thousandths = |log_odds: f64| (log_odds * PER_UNIT).round() as i16;
        let clamp = thousandths(params.clamp_log_odds);
        let percent = |value: i16| match value {
            0 => OccupancyMap::UNKNOWN,
            value => (100.0 * probability(f64::from(value) / PER_UNIT)).round() as u8,
        };
        let mut misses = [0; 2 * LANES];
        misses[..LANES].fill(thousandths(log_odds(params.miss_probability)));
        Self {
            frame,
            cells: vec![0; frame.len() + LANES],
            hit: thousandths(log_odds(params.hit_probability)),
            clamp,
            misses,
            limits: Limits {
                range_max_m: params.range_max_m,
                clear_max_m: params.clear_max_m,
                beam_width_max_rad: params.beam_width_max_rad,
            },
            sectors: Sectors::default(),
            spans: Spans::default(),
            ended: Vec::new(),
            beyond: None,
            percents: (-clamp..=clamp).map(percent).collect(),
        }
    }

    /// A map that begins with what another one knows.
    pub fn of_grid(params: &Params, grid: &OccupancyGrid) -> Self {
        let mut map = Self::new(params, *grid.frame());
        for (cell, known) in map.cells.iter_mut().zip(grid.as_slice()) {
            if let Some(occupied) = known.probability() {
                let most = f64::from(map.clamp);
                *cell = (log_odds(occupied) * PER_UNIT).round().clamp(-most, most) as i16;
            }
        }
        map
    }

    /// Takes in a scan that was taken at a pose of the robot: each cell is changed at most once, cells in
    /// which a beam ends towards occupied, others that a beam passes towards free. `false` when the scan
    /// cannot be used.
    pub fn add(&mut self, robot: Pose2, scan: &RangeScan, ranges: &[f32]) -> bool {
        if self.sectors.read(&self.frame, &self.limits, robot, scan, ranges).is_none() {
            return false;
        }
        let (width, height) = (self.frame.width(), self.frame.height());
        let columns = width as usize;
        let cells = &mut self.cells[..];
        self.ended.clear();
        for &[x, y] in &self.sectors.hits {
            if x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height) {
                let index = y as u32 as usize * columns + x as u32 as usize;
                self.ended.push((index, cells[index]));
            } else {
                let place = self.frame.from_cells(Point2::new(x, y));
                let known = self.beyond.unwrap_or(Beyond { readings: 0, least: place, most: place });
                self.beyond = Some(Beyond {
                    readings: known.readings + 1,
                    least: known.least.inf(&place),
                    most: known.most.sup(&place),
                });
            }
        }
        self.spans.visit(&self.sectors.free, [width, height], |row, first, end| {
            pass(&mut cells[row * columns..], [first, end], &self.misses, -self.clamp);
        });
        // As if they had not been passed; two beams in one cell count once.
        for &(index, before) in &self.ended {
            cells[index] = (before + self.hit).min(self.clamp);
        }
        true
    }

    /// What was seen where the map does not reach, and is lost.
    pub fn beyond(&self) -> Option<Beyond> {
        self.beyond
    }

    /// Where the cells lie.
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// The log-odds at a place; `None` outside.
    pub fn log_odds_at(&self, place: Point2<f64>) -> Option<f64> {
        let index = self.frame.index(self.frame.cell_at(place)?)?;
        Some(f64::from(self.thousandths()[index]) / PER_UNIT)
    }

    /// The log-odds of every cell, in thousandths, row after row.
    pub fn thousandths(&self) -> &[i16] {
        &self.cells[..self.frame.len()]
    }

    /// The cells as they are published, in per cent, row after row; the shorter of both decides how many.
    pub fn write_percents(&self, places: &mut [u8]) {
        for (place, value) in places.iter_mut().zip(self.thousandths()) {
            *place = self.percents[(value + self.clamp) as usize];
        }
    }

    /// The map as others know it.
    pub fn to_grid(&self) -> OccupancyGrid {
        self.known(|value| match value {
            0 => Occupancy::UNKNOWN,
            value => Occupancy::from_probability(probability(f64::from(value) / PER_UNIT)),
        })
    }

    /// The map as others know it, with every cell occupied, free or unknown, as trinary map files have it:
    /// occupied above 0.65, free below 0.196.
    pub fn to_trinary_grid(&self) -> OccupancyGrid {
        self.known(|value| match probability(f64::from(value) / PER_UNIT) {
            occupied if occupied > 0.65 => Occupancy::OCCUPIED,
            occupied if occupied < 0.196 => Occupancy::FREE,
            _ => Occupancy::UNKNOWN,
        })
    }

    fn known(&self, meaning: impl Fn(i16) -> Occupancy) -> OccupancyGrid {
        let mut grid = OccupancyGrid::filled(self.frame, Occupancy::UNKNOWN);
        for (cell, value) in grid.as_mut_slice().iter_mut().zip(self.thousandths()) {
            *cell = meaning(*value);
        }
        grid
    }
}

/// Changes the cells of a row that beams passed, block by block. The last block may reach beyond them, where
/// it changes nothing.
fn pass(row: &mut [i16], [first, end]: [usize; 2], misses: &[i16; 2 * LANES], least: i16) {
    let mut at = first;
    while at < end {
        let count = (end - at).min(LANES);
        let block = row[at..].first_chunk_mut::<LANES>();
        let (Some(block), Some(step)) = (block, misses[LANES - count..].first_chunk::<LANES>()) else {
            return;
        };
        for (cell, step) in block.iter_mut().zip(step) {
            *cell = (*cell + step).max(least);
        }
        at += LANES;
    }
}
