//! Builds an occupancy grid from poses and scans by the binary Bayes filter (ASN-120 to ASN-122; Thrun et al.
//! 2005, tables 4.2 and 9.2). Each cell is touched once a scan, and scans are filled in as polygons, row by
//! row, instead of beam by beam.

mod map;
mod params;
mod placed;
mod sectors;
mod spans;
#[cfg(test)]
mod tests;

pub use map::{Beyond, Map};
pub use params::{Params, ParamsError, SAVED_AS};

use geometry::OccupancyGrid;
use messages::{OccupancyMap, Parameters, PoseEstimate, RangeScan, Stamped, Time};
use placed::Track;
use std::time::Duration;

/// What the mapper reads: the next of each, in order.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// Where the robot is.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
    /// What its laser sees.
    pub scan: Option<Stamped<'a, RangeScan>>,
}

/// What is due now.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Outputs {
    /// The map has changed and shall be published: [`Mapper::header`], [`Map::write_percents`].
    pub publish: bool,
    /// The map has changed and shall be saved.
    pub save: bool,
}

/// A scan that waits for the pose at which it was taken.
#[derive(Debug, Clone)]
struct Waiting {
    taken: Time,
    came: Time,
    header: RangeScan,
    ranges: Vec<f32>,
}

/// The mapper.
#[derive(Debug)]
pub struct Mapper {
    params: Params,
    map: Map,
    track: Track,
    floor: Option<i32>,
    waiting: Option<Waiting>,
    /// Memory for the next scan that waits.
    spare: Vec<f32>,
    scans: u64,
    unused_scans: u64,
    published: (Option<Time>, u64),
    saved: (Option<Time>, u64),
}

impl Mapper {
    /// Begins with the map that the parameters name, or with nothing known.
    ///
    /// # Errors
    /// When a parameter or the file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let map = if params.load.is_empty() {
            Map::new(&params, params.frame()?)
        } else {
            Map::of_grid(&params, &OccupancyGrid::load(&params.load)?)
        };
        Ok(Self {
            floor: params.floor,
            params,
            map,
            track: Track::default(),
            waiting: None,
            spare: Vec::new(),
            scans: 0,
            unused_scans: 0,
            published: (None, 0),
            saved: (None, 0),
        })
    }

    /// Takes in the next pose and the next scan, and says what is due.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if let Some(pose) = inputs.pose {
            self.follow(pose);
        }
        if let Some(scan) = inputs.scan {
            // Only one scan waits: its time is over.
            self.place_waiting();
            self.spare.clear();
            self.spare.extend_from_slice(scan.elements);
            let ranges = std::mem::take(&mut self.spare);
            self.waiting = Some(Waiting { taken: scan.origin, came: now, header: *scan.message, ranges });
        }
        let is_over = |waiting: &Waiting| {
            self.track.reaches(waiting.taken) || now.since(waiting.came) >= self.params.pose_max_age()
        };
        if self.waiting.as_ref().is_some_and(is_over) {
            self.place_waiting();
        }
        let save_period = Duration::try_from_secs_f64(self.params.save_period_s).unwrap_or(Duration::MAX);
        let saves = !self.params.save.is_empty() && !save_period.is_zero();
        Outputs {
            publish: is_due(&mut self.published, self.scans, now, self.params.publish_period()),
            save: saves && is_due(&mut self.saved, self.scans, now, save_period),
        }
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// What stands above the cells when the map is published.
    pub fn header(&self) -> OccupancyMap {
        let frame = self.map.frame();
        OccupancyMap {
            scans: self.scans,
            unused_scans: self.unused_scans,
            origin_x_m: frame.origin().x_m,
            origin_y_m: frame.origin().y_m,
            origin_heading_rad: frame.origin().heading_rad,
            resolution_m: frame.resolution_m(),
            columns: frame.width(),
            rows: frame.height(),
            floor: self.floor.unwrap_or_default(),
            reserved: 0,
        }
    }

    fn follow(&mut self, pose: Stamped<'_, PoseEstimate>) {
        if self.params.floor.is_some_and(|floor| floor != pose.floor) {
            self.track.clear();
            return;
        }
        let Ok(place) = pose.pose() else { return };
        if self.floor != Some(pose.floor) {
            // Another floor is another place, even where its plan is the same.
            self.track.clear();
            self.floor = Some(pose.floor);
        }
        self.track.push(pose.stamp, place);
    }

    /// Puts the scan that waits where its time says, if a pose tells.
    fn place_waiting(&mut self) {
        let Some(scan) = self.waiting.take() else { return };
        let pose = self.track.at(scan.taken, self.params.pose_max_age());
        let added = pose.is_some_and(|pose| self.map.add(pose, &scan.header, &scan.ranges));
        self.scans += u64::from(added);
        self.unused_scans += u64::from(!added);
        self.spare = scan.ranges;
    }
}

/// Whether the map has changed since it was last given out, and that is a period ago.
fn is_due(given: &mut (Option<Time>, u64), scans: u64, now: Time, period: Duration) -> bool {
    let is_due = scans != given.1 && given.0.is_none_or(|last| now.since(last) >= period);
    if is_due {
        *given = (Some(now), scans);
    }
    is_due
}
