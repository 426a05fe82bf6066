//! A scan all around, as a ring of readings.

use messages::RangeScan;
use std::f64::consts::TAU;

/// Readings all around, evenly, each a distance or nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Ring {
    ranges_m: Vec<Option<f64>>,
    /// Direction of the first reading in the robot's frame.
    first_rad: f64,
    /// From one reading to the next; negative is clockwise.
    step_rad: f64,
}

/// A ring of fewer readings shows nothing.
const FEWEST: usize = 8;
/// More readings than this are no scan.
const MOST: usize = 100_000;

impl Ring {
    /// The scan, if it goes once around; `None` when its header makes no sense.
    pub fn of_scan(scan: &RangeScan, ranges: &[f32]) -> Option<Self> {
        scan.check().ok()?;
        let around = scan.angle_step_rad.abs() * ranges.len() as f64;
        if !(FEWEST..=MOST).contains(&ranges.len()) || (around - TAU).abs() > 1.5 * scan.angle_step_rad.abs()
        {
            return None;
        }
        let ranges_m = (0..ranges.len()).map(|index| scan.beam(ranges, index).map(|(_, range_m)| range_m));
        Some(Self {
            ranges_m: ranges_m.collect(),
            first_rad: scan.sensor_heading_rad + scan.angle_min_rad,
            step_rad: scan.angle_step_rad,
        })
    }

    /// How many readings.
    pub fn len(&self) -> usize {
        self.ranges_m.len()
    }

    /// Whether there are none; never, as such a scan makes no ring.
    pub fn is_empty(&self) -> bool {
        self.ranges_m.is_empty()
    }

    /// The reading at an index, which is counted around the ring.
    pub fn range_m(&self, index: usize) -> Option<f64> {
        self.ranges_m.get(index % self.len().max(1)).copied().flatten()
    }

    /// The reading that lies `offset` readings behind another one, or before it.
    pub fn beside_m(&self, index: usize, offset: isize) -> Option<f64> {
        self.range_m(self.moved(index, offset))
    }

    /// The index that lies some readings on.
    pub fn moved(&self, index: usize, offset: isize) -> usize {
        let len = self.len().max(1) as isize;
        (index as isize % len + offset).rem_euclid(len) as usize
    }

    /// The indices within `half` readings of one, on both sides, in order.
    pub fn around(&self, centre: usize, half: usize) -> impl Iterator<Item = usize> + '_ {
        (-(half as isize)..=half as isize).map(move |offset| self.moved(centre, offset))
    }

    /// Direction of a reading in the robot's frame, in (-π, π].
    pub fn direction_rad(&self, index: usize) -> f64 {
        geometry::angle::wrap(self.first_rad + index as f64 * self.step_rad)
    }

    /// The reading nearest to a direction.
    pub fn index_at(&self, direction_rad: f64) -> usize {
        let steps = geometry::angle::wrap(direction_rad - self.first_rad) / self.step_rad;
        if steps.is_finite() { self.moved(0, steps.round() as isize) } else { 0 }
    }

    /// How many readings an angle spans.
    pub fn span(&self, angle_rad: f64) -> usize {
        ((angle_rad / self.step_rad).abs() + 1e-6) as usize
    }
}
