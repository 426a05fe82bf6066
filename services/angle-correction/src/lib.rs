//! Measures how many degrees the robot has veered off the hallway's straight line, from the two wall
//! distances of one side, in places where the floor plan shows flat wall. Source: the coffee robot's paper,
//! sections III.B, IV.B and V.B (COF-080 to COF-093), with the gaps settled in X-20 (both sides qualify: the
//! nearer one), X-21 (what is worth a correction), X-22 (accuracy: averages) and X-2A (sign and areas).
//!
//! On entering an area the first frame is published at once; from `averaged_frames` frames on every frame
//! gives an average. With odometry the average follows the robot's turning: what is averaged is the
//! difference between the angle and the odometry's heading. On leaving, or when an obstacle comes, one
//! message says that nothing is measured.

mod areas;
mod params;
#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError};

use areas::{Areas, Spot};
use geometry::{angle, world::World};
use messages::{
    Clearance, Face, GuardReasonName, HeadingCorrection, Odometry, Once, Parameters, PoseEstimate, Reading,
    Side, Stamped, Time, TofRanges,
};
use std::collections::VecDeque;

/// What is read.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// `tof/ranges`.
    pub ranges: Option<Stamped<'a, TofRanges>>,
    /// `location/pose`.
    pub location: Option<Stamped<'a, PoseEstimate>>,
    /// `safety/clearance`, for COF-091; the front sensors are looked at even without it.
    pub clearance: Option<Stamped<'a, Clearance>>,
    /// `wheels/odometry`, so that an average follows the robot's turning.
    pub odometry: Option<Stamped<'a, Odometry>>,
}

/// What to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `heading/correction`, when there is something new to say.
    pub correction: Option<HeadingCorrection>,
}

/// The angle between robot and wall in radians from the distances (in metres) of a side's front and back
/// sensors: nose to the left is positive (COF-081, X-2A).
pub fn wall_angle_rad(front_m: f64, back_m: f64, side: Side) -> f64 {
    let angle_rad = ((front_m - back_m) / TofRanges::SIDE_BASE_M).atan();
    if side == Side::Left { -angle_rad } else { angle_rad }
}

/// Standard deviation of that angle in radians when each distance has that of `range_sigma_m`: the formula's
/// derivatives.
pub fn wall_angle_sigma_rad(angle_rad: f64, range_sigma_m: f64) -> f64 {
    angle_rad.cos().powi(2) * std::f64::consts::SQRT_2 * range_sigma_m / TofRanges::SIDE_BASE_M
}

/// Outliers in a row after which the average is wrong, not they.
const OUTLIERS: u32 = 3;

/// A run of measurements in one area at one side.
#[derive(Debug, Clone)]
struct Run {
    spot: Spot,
    side: Side,
    /// Whether odometry's heading was subtracted.
    steadied: bool,
    /// Angles, less the odometry's heading.
    angles_rad: VecDeque<f64>,
    outliers: u32,
}

/// The measurement of the angle.
#[derive(Debug, Clone)]
pub struct AngleCorrection {
    params: Params,
    areas: Areas,
    run: Option<Run>,
    /// Stamp and sequence of the last frame.
    frame: Once,
}

impl AngleCorrection {
    /// Reads the world file, if one is named.
    ///
    /// # Errors
    /// When the parameters make no sense or the world file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::with_world(params, &world)
    }

    /// A measurement in a world that is read already.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn with_world(params: Params, world: &World) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self { areas: Areas::new(world, &params), params, run: None, frame: Once::default() })
    }

    /// Looks at the newest frame and pose. Call it for every message of either.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        let Some((ranges, spot, side, angle_rad)) = self.measure(now, &inputs) else {
            return Outputs { correction: self.run.take().map(|run| ended(&run)) };
        };
        let is_new = self.frame.is_new(&ranges);
        let turned = inputs.odometry.and_then(|odometry| odometry.fresh(now, self.params.ranges_max_age()));
        let turned_rad = turned.and_then(|odometry| Some(odometry.pose().ok()?.heading_rad));
        let steadied = turned_rad.is_some();
        let sample_rad = angle_rad - turned_rad.unwrap_or(0.0);

        let entering = !self
            .run
            .as_ref()
            .is_some_and(|run| run.spot == spot && run.side == side && run.steadied == steadied);
        if entering {
            self.run = Some(Run { spot, side, steadied, angles_rad: VecDeque::new(), outliers: 0 });
        } else if !is_new {
            return Outputs { correction: None };
        }
        self.frame.take(ranges);
        let sigma_rad = wall_angle_sigma_rad(angle_rad, self.params.range_sigma_m);
        let Some(run) = &mut self.run else { return Outputs { correction: None } };
        run.add(sample_rad, sigma_rad, self.params.window_frames as usize);

        let frames = run.angles_rad.len() as u32;
        let newly = run.outliers == 0 && (frames == 1 || frames >= self.params.averaged_frames);
        let correction = newly.then(|| run.correction(turned_rad.unwrap_or(0.0), sigma_rad, &self.params));
        Outputs { correction }
    }

    /// The newest frame and what it shows of the wall: nothing unless the pose is known, an area allows it,
    /// no obstacle is ahead and a side qualifies.
    fn measure<'a>(
        &self,
        now: Time,
        inputs: &Inputs<'a>,
    ) -> Option<(Stamped<'a, TofRanges>, Spot, Side, f64)> {
        let ranges = inputs.ranges?.fresh(now, self.params.ranges_max_age())?;
        let location = inputs.location?.fresh(now, self.params.location_max_age())?;
        let pose = location.pose().ok()?;
        if self.is_obstructed(now, &ranges, inputs.clearance) {
            return None;
        }
        let side_of = |side: Side, front: usize, back: usize| {
            let (front_m, back_m) = (self.wall_m(&ranges, front)?, self.wall_m(&ranges, back)?);
            Some((side, front_m, back_m, self.areas.spot(location.floor, pose, side)?))
        };
        let sides = [side_of(Side::Right, 1, 0), side_of(Side::Left, 6, 7)];
        // COF-085, X-20: the side closer to its wall.
        let nearer =
            |a: &(Side, f64, f64, Spot), b: &(Side, f64, f64, Spot)| (a.1 + a.2).total_cmp(&(b.1 + b.2));
        let (side, front_m, back_m, spot) = sides.into_iter().flatten().min_by(nearer)?;
        Some((ranges, spot, side, wall_angle_rad(front_m, back_m, side)))
    }

    /// A reading that can be a wall of this half of the hallway (COF-086: strictly below).
    fn wall_m(&self, ranges: &TofRanges, sensor: usize) -> Option<f64> {
        match ranges.reading(sensor) {
            Reading::Distance(range_m) if range_m < self.params.half_hallway_m as f32 => {
                Some(f64::from(range_m))
            }
            _ => None,
        }
    }

    /// COF-091: the guard sees or remembers something, or a front sensor reads something near.
    fn is_obstructed(
        &self,
        now: Time,
        ranges: &TofRanges,
        clearance: Option<Stamped<'_, Clearance>>,
    ) -> bool {
        let near = |sensor| match ranges.reading(sensor) {
            Reading::Distance(range_m) => range_m < self.params.obstacle_m as f32,
            Reading::Fault => true,
            Reading::NoTarget | Reading::Ignore => false,
        };
        let guarded = clearance.and_then(|clearance| clearance.fresh(now, self.params.ranges_max_age()));
        let warned = guarded.is_some_and(|clearance| {
            clearance.violated_faces & Face::Front as u32 != 0
                || clearance.reason == GuardReasonName::Remembered
        });
        warned || (2..6).any(near)
    }
}

impl Run {
    fn add(&mut self, sample_rad: f64, sigma_rad: f64, window: usize) {
        if let Some(mean_rad) = self.mean_rad() {
            let off_rad = angle::difference(sample_rad, mean_rad).abs();
            // Four deviations of a single frame and of a mean of few.
            if off_rad > 4.0 * sigma_rad * (1.0 + 1.0 / self.angles_rad.len() as f64).sqrt() {
                self.outliers += 1;
                if self.outliers < OUTLIERS {
                    return;
                }
                self.angles_rad.clear();
            }
        }
        self.outliers = 0;
        if self.angles_rad.len() >= window {
            self.angles_rad.pop_front();
        }
        self.angles_rad.push_back(sample_rad);
    }

    fn mean_rad(&self) -> Option<f64> {
        angle::mean(self.angles_rad.iter().map(|&angle_rad| (angle_rad, 1.0)))
    }

    fn correction(&self, turned_rad: f64, sigma_rad: f64, params: &Params) -> HeadingCorrection {
        let frames = self.angles_rad.len() as u32;
        let angle_rad = angle::wrap(self.mean_rad().unwrap_or(0.0) + turned_rad);
        HeadingCorrection {
            angle_rad,
            wall_heading_rad: self.spot.wall_heading_rad,
            sigma_rad: (sigma_rad / f64::from(frames).sqrt()).hypot(params.mounting_sigma_rad),
            area: self.spot.area,
            valid: 1,
            correct: u32::from(angle_rad.abs() >= params.correct_from_rad),
            side: self.side.into(),
            frames,
        }
    }
}

/// Nothing is measured any more.
fn ended(run: &Run) -> HeadingCorrection {
    HeadingCorrection { area: run.spot.area, side: Side::None.into(), ..HeadingCorrection::default() }
}
