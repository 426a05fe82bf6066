//! Corrections by what is no range: the module's own position, the hallway's direction, and the walls beside
//! the robot.

use crate::hypothesis::{Comparison, Hypothesis};
use crate::walls::{self, HallwayWalls};
use crate::{TagLocaliser, WRONG_RANGE_DENSITY};
use geometry::{Point2, angle};
use messages::{HeadingCorrection, Time, TofRanges};
use nalgebra::RowVector3;

/// A heading correction is never believed better than this: a wall is drawn, and measured from half a metre
/// away.
const HEADING_SIGMA_RAD: f64 = 0.02;
/// A wrong heading is any of half a turn.
const WRONG_HEADING_DENSITY: f64 = std::f64::consts::FRAC_1_PI;
impl TagLocaliser {
    /// Corrects by a position of the antenna: its two coordinates are good or wrong together.
    pub(super) fn place_at(&mut self, at_m: [f64; 2], antenna_m: [f64; 2]) -> bool {
        let sigma_m = self.params.position_sigma_m;
        let outlier = self.params.outlier_chance;
        let gate = |one: &Hypothesis| {
            let antenna = one.pose.transform(Point2::new(antenna_m[0], antenna_m[1]));
            let (dx_m, dy_m) = (at_m[0] - antenna.x, at_m[1] - antenna.y);
            let variance = sigma_m * sigma_m + 0.5 * (one.covariance[(0, 0)] + one.covariance[(1, 1)]);
            // Chi-square with two degrees of freedom: 1 % lie beyond.
            dx_m * dx_m + dy_m * dy_m < 9.21 * variance
        };
        let mut good = self.bank.best().is_some_and(gate);
        for (axis, measured_m) in at_m.into_iter().enumerate() {
            let verdict = self.bank.observe(WRONG_RANGE_DENSITY, |one| {
                let lever = one.pose.transform(Point2::new(antenna_m[0], antenna_m[1])) - one.pose.position();
                let (expected_m, swing) = if axis == 0 {
                    (one.pose.x_m + lever.x, -lever.y)
                } else {
                    (one.pose.y_m + lever.y, lever.x)
                };
                let jacobian = if axis == 0 {
                    RowVector3::new(1.0, 0.0, swing)
                } else {
                    RowVector3::new(0.0, 1.0, swing)
                };
                gate(one).then_some(Comparison {
                    innovation: measured_m - expected_m,
                    jacobian,
                    variance: sigma_m * sigma_m,
                    prior: 1.0 - outlier,
                    wrong_density: WRONG_RANGE_DENSITY,
                })
            });
            good &= verdict.is_some_and(|share| share > 0.5);
        }
        good
    }

    /// The hallway's direction plus the angle to it, or the opposite direction.
    pub(super) fn turn_to_wall(&mut self, heading: &HeadingCorrection) {
        let measured_rad = heading.wall_heading_rad + heading.angle_rad;
        if heading.valid != 1 || !measured_rad.is_finite() || !heading.sigma_rad.is_finite() {
            return;
        }
        let sigma_rad = heading.sigma_rad.clamp(HEADING_SIGMA_RAD, 1.0);
        self.bank.observe(WRONG_HEADING_DENSITY, |one| {
            let ahead_rad = angle::difference(measured_rad, one.pose.heading_rad);
            // A wall looks the same from both ends.
            let innovation = if ahead_rad.abs() > std::f64::consts::FRAC_PI_2 {
                angle::wrap(ahead_rad + std::f64::consts::PI)
            } else {
                ahead_rad
            };
            Some(Comparison {
                innovation,
                jacobian: RowVector3::new(0.0, 0.0, 1.0),
                variance: sigma_rad * sigma_rad,
                prior: 0.9,
                wrong_density: WRONG_HEADING_DENSITY,
            })
        });
        self.bank.tidy();
    }

    pub(super) fn sides_are_due(&mut self, stamp: Time) -> bool {
        let due = self.seen.ranges.is_none_or(|last| {
            // A stamp before the last one is another clock's; then the message is new.
            stamp < last || (stamp > last && stamp.seconds_since(last) >= self.params.side_period_s)
        });
        if due {
            self.seen.ranges = Some(stamp);
        }
        due && !self.walls.is_empty()
    }

    /// Side sensors against walls. Only with few hypotheses left: walls are alike, and a wide belief would
    /// pick the wrong one.
    pub(super) fn feel_walls(&mut self, ranges: &TofRanges) {
        let Some(floor) = self.floor else { return };
        let certain = self.bank.estimate().is_some_and(|one| one.sigma_m() < 0.5 && one.sigma_rad() < 0.3);
        if !certain {
            return;
        }
        let (walls, sigma_m) = (&self.walls, self.params.side_sigma_m);
        let Some(agreeing) = self.bank.best().map(|best| walls.agreeing(best, floor, ranges, sigma_m)) else {
            return;
        };
        let (mut seen, mut fitting) = (0.0, 0.0);
        for sensor in walls::SIDE_SENSORS.into_iter().filter(|sensor| agreeing.contains(*sensor)) {
            let verdict = self.bank.observe(HallwayWalls::WRONG_DENSITY, |one| {
                let mut comparison = walls.compare(one, floor, sensor, ranges, sigma_m)?;
                comparison.variance *= agreeing.caution;
                Some(comparison)
            });
            if let Some(share) = verdict {
                (seen, fitting) = (seen + 1.0, fitting + share);
            }
        }
        if seen > 0.0 {
            self.disagreeing_sides += 0.1 * (1.0 - fitting / seen - self.disagreeing_sides);
        }
        self.bank.tidy();
    }
}
