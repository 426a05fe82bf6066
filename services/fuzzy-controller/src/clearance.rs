//! Obstacle distances in the three cones of the avoidance controller, from whatever sensors there are.
//!
//! Left 30 to 50 degrees, front -30 to 30, right -50 to -30 (ASN-143), as clearances from the hull.
//! What lies beside the cones, from 50 to 110 degrees, counts for left and right with a stretched clearance
//! (X-38, note 3.7).

use crate::params::Params;
use messages::{RangeScan, Reading, Time, TofRanges};

/// Clearances from the hull in metres; infinite where nothing is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearances {
    /// To the left.
    pub left_m: f64,
    /// In front.
    pub front_m: f64,
    /// To the right.
    pub right_m: f64,
}

impl Clearances {
    /// Nothing in sight.
    pub const FREE: Self = Self { left_m: f64::INFINITY, front_m: f64::INFINITY, right_m: f64::INFINITY };

    /// The nearer of two in every direction.
    pub fn nearer(self, other: Self) -> Self {
        Self {
            left_m: self.left_m.min(other.left_m),
            front_m: self.front_m.min(other.front_m),
            right_m: self.right_m.min(other.right_m),
        }
    }

    /// Whether all three are distances: not negative, no NaN.
    pub fn is_usable(self) -> bool {
        [self.left_m, self.front_m, self.right_m].iter().all(|clearance| *clearance >= 0.0)
    }

    /// From a laser's scan; `None` if its header cannot be used. Beams that end in no obstacle are free.
    pub fn of_scan(scan: &RangeScan, ranges_m: &[f32], params: &Params) -> Option<Self> {
        scan.check().ok()?;
        let mut clearances = Self::FREE;
        for index in 0..ranges_m.len() {
            let Some((direction_rad, range_m)) = scan.beam(ranges_m, index) else { continue };
            let (sine, cosine) = direction_rad.sin_cos();
            let (x, y) = (scan.sensor_x_m + range_m * cosine, scan.sensor_y_m + range_m * sine);
            let ahead = (x - params.hull_front_m).max(-params.hull_rear_m - x).max(0.0);
            let aside = (y.abs() - params.hull_side_m).max(0.0);
            let clearance = ahead.hypot(aside);
            let degrees = geometry::angle::wrap(direction_rad).to_degrees();
            let (side, counted) = match degrees.abs() {
                angle if angle <= 30.0 => (&mut clearances.front_m, clearance),
                angle if angle <= 50.0 => (clearances.side(degrees), clearance),
                angle if angle <= 110.0 => (clearances.side(degrees), params.lateral_factor * clearance),
                _ => continue,
            };
            *side = side.min(counted);
        }
        Some(clearances)
    }

    fn side(&mut self, degrees: f64) -> &mut f64 {
        if degrees > 0.0 { &mut self.left_m } else { &mut self.right_m }
    }
}

/// The last word of each time-of-flight sensor: a frame without news leaves it, for a while.
#[derive(Debug, Clone, Default)]
pub(crate) struct TofMemory {
    held: [Option<(f64, Time)>; 8],
}

impl TofMemory {
    /// From the eight sensors of the coffee robot, which sit on the edges of its hull. `None` if a sensor is
    /// faulty, or silent for longer than inputs may be old.
    pub(crate) fn clearances(
        &mut self,
        now: Time,
        ranges: &TofRanges,
        params: &Params,
    ) -> Option<Clearances> {
        for (sensor, held) in self.held.iter_mut().enumerate() {
            match ranges.reading(sensor) {
                Reading::Distance(distance_m) => *held = Some((f64::from(distance_m), now)),
                Reading::NoTarget => *held = Some((f64::INFINITY, now)),
                Reading::Ignore => {}
                Reading::Fault => *held = None,
            }
        }
        let oldest = params.input_max_age_ms as f64 * 1e-3;
        let nearest = |sensors: std::ops::RangeInclusive<usize>| {
            let held = self.held[sensors].iter();
            held.map(|held| {
                held.filter(|(_, seen)| now.seconds_since(*seen) <= oldest).map(|(distance, _)| distance)
            })
            .try_fold(f64::INFINITY, |nearest, distance| Some(nearest.min(distance?)))
        };
        Some(Clearances {
            right_m: params.lateral_factor * nearest(0..=1)?,
            front_m: nearest(2..=5)?,
            left_m: params.lateral_factor * nearest(6..=7)?,
        })
    }
}
