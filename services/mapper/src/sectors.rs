//! A scan as sectors: what each beam says is free, and where it says something stands, in units of the grid's
//! cells.

use geometry::{GridFrame, Pose2};
use messages::RangeScan;
use std::f64::consts::TAU;

/// No scan has more beams.
const BEAMS_MAX: usize = 16_384;
/// Beams nearer to each other than this are not told apart.
const STEP_MIN_RAD: f64 = 1e-5;
/// Nothing is farther away than this, in cells: a bound for what follows, not a limit of use.
const FAR: f64 = 1e7;

/// A point in cells from the grid's origin.
pub(crate) type Point = [f64; 2];

/// What limits readings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Readings are used up to here.
    pub(crate) range_max_m: f64,
    /// A beam that sees nothing clears up to here.
    pub(crate) clear_max_m: f64,
    /// Beams are no wider.
    pub(crate) beam_width_max_rad: f64,
}

/// The sectors of one scan; its memory is kept for the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sectors {
    /// Around what is free, counter-clockwise, beginning at the sensor: a star without overlaps.
    pub(crate) free: Vec<Point>,
    /// Where beams end at something; across a beam wider than a cell, several places.
    pub(crate) hits: Vec<Point>,
}

impl Sectors {
    /// Reads a scan taken at a pose of the robot; `None` when it cannot be used.
    ///
    /// The inverse model of Thrun et al. 2005, table 9.2: a cell belongs to the beam nearest in direction; up
    /// to the reading it is free, around the reading, as thick as a cell, it is occupied. Readings of zero,
    /// below, or NaN are invalid. Those beyond our limit clear up to it; those at the sensor's limit or
    /// beyond saw nothing.
    pub(crate) fn read(
        &mut self,
        frame: &GridFrame,
        limits: &Limits,
        robot: Pose2,
        scan: &RangeScan,
        ranges: &[f32],
    ) -> Option<()> {
        self.free.clear();
        self.hits.clear();
        scan.check().ok()?;
        let mount =
            Pose2 { x_m: scan.sensor_x_m, y_m: scan.sensor_y_m, heading_rad: scan.sensor_heading_rad };
        let sensor = robot.compose(mount);
        let limit_m = limits.range_max_m.min(scan.range_max_m);
        let step_rad = scan.angle_step_rad.abs();
        let usable = sensor.is_finite() && limit_m > 0.0 && !ranges.is_empty();
        if !usable || ranges.len() > BEAMS_MAX || (ranges.len() > 1 && step_rad < STEP_MIN_RAD) {
            return None;
        }
        let centre = frame.to_cells(sensor.position());
        if centre.iter().any(|value| value.is_nan() || value.abs() > FAR) {
            return None;
        }
        // Beams beyond one turn would speak for the same directions again.
        let most = (TAU / step_rad + 1e-6).min(BEAMS_MAX as f64) as usize;
        let ranges = &ranges[..ranges.len().min(most.max(1))];
        let width_rad = if step_rad > 0.0 { step_rad } else { TAU }.min(limits.beam_width_max_rad);
        // Counter-clockwise, whichever way the sensor turns.
        let backwards = scan.angle_step_rad < 0.0;
        let first = if backwards { (ranges.len() - 1) as f64 * scan.angle_step_rad } else { 0.0 };
        let angle_rad =
            sensor.heading_rad - frame.origin().heading_rad + scan.angle_min_rad + first - 0.5 * width_rad;
        let fan = Fan {
            centre: [centre.x, centre.y],
            per_m: 1.0 / frame.resolution_m(),
            sensor_m: scan.range_max_m,
            limit_m,
            clear_m: limit_m.min(limits.clear_max_m),
            edge: unit(angle_rad),
            across: unit(width_rad),
            // To the next beam, where that is not the edge of this one.
            gap: (step_rad - width_rad > 1e-12 && ranges.len() > 1).then(|| unit(step_rad - width_rad)),
            half: unit(0.5 * width_rad),
            width_rad,
        };
        if backwards {
            self.sweep(fan, ranges.iter().rev().copied());
        } else {
            self.sweep(fan, ranges.iter().copied());
        }
        Some(())
    }

    fn sweep(&mut self, fan: Fan, ranges: impl Iterator<Item = f32>) {
        let mut edge = fan.edge;
        self.free.push(fan.centre);
        for range_m in ranges {
            let next = turned(edge, fan.across);
            let range_m = f64::from(range_m);
            if range_m > 0.0 {
                let is_hit = range_m < fan.limit_m;
                let free = if is_hit {
                    // The obstacle is as thick as a cell, half of it before the reading.
                    (range_m * fan.per_m - 0.5).max(0.0)
                } else {
                    fan.per_m * if range_m < fan.sensor_m { fan.limit_m } else { fan.clear_m }
                };
                self.free.push(fan.at(edge, free));
                self.free.push(fan.at(next, free));
                if is_hit {
                    self.hit(&fan, edge, range_m * fan.per_m);
                }
            } else {
                self.free.push(fan.centre);
            }
            edge = match fan.gap {
                Some(gap) => {
                    self.free.push(fan.centre);
                    turned(next, gap)
                }
                None => next,
            };
        }
    }

    /// Places across the beam, no farther apart than a cell.
    fn hit(&mut self, fan: &Fan, edge: Point, range: f64) {
        let count = (range * fan.width_rad).ceil();
        if count <= 1.0 {
            self.hits.push(fan.at(turned(edge, fan.half), range));
            return;
        }
        let (from, to) = (fan.at(edge, range), fan.at(turned(edge, fan.across), range));
        for place in 0..count as u32 {
            let share = (f64::from(place) + 0.5) / count;
            self.hits.push([from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share]);
        }
    }
}

/// The beams' common measures. Directions are unit vectors, turned by multiplication: 16 384 turns lose
/// 1e-12.
#[derive(Debug, Clone, Copy)]
struct Fan {
    centre: Point,
    /// Cells to the metre.
    per_m: f64,
    /// As far as the sensor sees, as far as its readings are used, and as far as it clears when it sees
    /// nothing.
    sensor_m: f64,
    limit_m: f64,
    clear_m: f64,
    /// The right edge of the first beam.
    edge: Point,
    /// From a beam's right edge to its left one, to the next beam's right one, and to its middle.
    across: Point,
    gap: Option<Point>,
    half: Point,
    width_rad: f64,
}

impl Fan {
    fn at(&self, direction: Point, range: f64) -> Point {
        [self.centre[0] + direction[0] * range, self.centre[1] + direction[1] * range]
    }
}

fn unit(angle_rad: f64) -> Point {
    let (sine, cosine) = angle_rad.sin_cos();
    [cosine, sine]
}

fn turned(direction: Point, by: Point) -> Point {
    [direction[0] * by[0] - direction[1] * by[1], direction[0] * by[1] + direction[1] * by[0]]
}
