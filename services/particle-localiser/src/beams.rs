//! From a scan to the readings that are used: invalid ones are dropped first, then the rest is thinned
//! evenly.

use messages::RangeScan;

/// The readings of a scan that count, in the robot's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Beams {
    /// Direction of each.
    pub direction_rad: Vec<f32>,
    /// Range of each.
    pub range_m: Vec<f32>,
    /// Where each ends, ahead.
    pub end_x: Vec<f32>,
    /// Where each ends, to the left.
    pub end_y: Vec<f32>,
    /// Where the sensor sits in the robot's frame.
    pub sensor: [f32; 2],
    /// Readings that were no readings, or too far.
    pub dropped: usize,
}

impl Beams {
    /// The valid readings below `range_max_m`, evenly thinned to `most`. A header that makes no sense leaves
    /// none.
    pub fn select(scan: &RangeScan, ranges: &[f32], range_max_m: f64, most: usize) -> Self {
        let mut beams = Self { dropped: ranges.len(), ..Self::default() };
        // Sensors sit on the robot.
        let on_robot = scan.sensor_x_m.abs() < 10.0 && scan.sensor_y_m.abs() < 10.0;
        if scan.check().is_err() || !on_robot {
            return beams;
        }
        beams.sensor = [scan.sensor_x_m as f32, scan.sensor_y_m as f32];
        let is_valid = |index: usize| scan.beam(ranges, index).filter(|(_, range_m)| *range_m < range_max_m);
        let valid: Vec<(f64, f64)> = (0..ranges.len()).filter_map(is_valid).collect();
        beams.dropped = ranges.len() - valid.len();
        let count = valid.len().min(most);
        for index in 0..count {
            // The middle of each of `count` equal parts.
            let (direction_rad, range_m) = valid[(2 * index + 1) * valid.len() / (2 * count)];
            let (sine, cosine) = direction_rad.sin_cos();
            beams.direction_rad.push(geometry::angle::wrap(direction_rad) as f32);
            beams.range_m.push(range_m as f32);
            beams.end_x.push((scan.sensor_x_m + range_m * cosine) as f32);
            beams.end_y.push((scan.sensor_y_m + range_m * sine) as f32);
        }
        beams
    }

    /// Every `step`-th of them.
    pub(crate) fn thinned(&self, step: usize) -> Self {
        let thin = |all: &Vec<f32>| all.iter().skip(step / 2).step_by(step.max(1)).copied().collect();
        Self {
            direction_rad: thin(&self.direction_rad),
            range_m: thin(&self.range_m),
            end_x: thin(&self.end_x),
            end_y: thin(&self.end_y),
            sensor: self.sensor,
            dropped: self.dropped,
        }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.range_m.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.range_m.is_empty()
    }
}
