//! One belief of where the robot is: a Gaussian over (x, y, heading) with its own opinion of every anchor.

use crate::anchors::ANCHOR_LIMIT;
use geometry::{Pose2, angle};
use nalgebra::{Matrix3, RowVector3, Vector3};

/// Standard deviations of odometry after one metre, or one radian; they grow with the root.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MotionNoise {
    pub(crate) distance_sigma_m: f64,
    pub(crate) drift_sigma_rad: f64,
    pub(crate) turn_sigma_rad: f64,
}

/// A scalar measurement, compared with what a hypothesis expects.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Comparison {
    /// Measured minus expected.
    pub(crate) innovation: f64,
    /// Derivative of the expected by (x, y, heading).
    pub(crate) jacobian: RowVector3<f64>,
    /// Variance of a good measurement around the truth.
    pub(crate) variance: f64,
    /// Probability, before this measurement is seen, that it is good.
    pub(crate) prior: f64,
    /// Density of the measurement in case it is not: one over the span of possible values.
    pub(crate) wrong_density: f64,
}

/// One Gaussian of the mixture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hypothesis {
    pub(crate) pose: Pose2,
    pub(crate) covariance: Matrix3<f64>,
    /// Natural logarithm of its weight, up to a constant that all share.
    pub(crate) log_weight: f64,
    /// Probability that each anchor was heard wrongly the last time.
    pub(crate) wrong: [f32; ANCHOR_LIMIT],
}

impl Hypothesis {
    /// A place within `sigma_m`, a heading within `sigma_rad`.
    pub(crate) fn new(pose: Pose2, sigma_m: f64, sigma_rad: f64, log_weight: f64, wrong: f64) -> Self {
        let place = sigma_m * sigma_m;
        let covariance = Matrix3::from_diagonal(&Vector3::new(place, place, sigma_rad * sigma_rad));
        Self { pose, covariance, log_weight, wrong: [wrong as f32; ANCHOR_LIMIT] }
    }

    /// Moves by what odometry saw, in the robot's frame (Thrun et al. 2005, table 7.2, with noise that grows
    /// with the root of the path, so that it does not depend on how often odometry reports).
    pub(crate) fn advance(&mut self, motion: Pose2, noise: MotionNoise) {
        let (sine, cosine) = self.pose.heading_rad.sin_cos();
        let (x_m, y_m) = (cosine * motion.x_m - sine * motion.y_m, sine * motion.x_m + cosine * motion.y_m);
        let path_m = motion.x_m.hypot(motion.y_m);
        let place = noise.distance_sigma_m * noise.distance_sigma_m * path_m;
        let heading = noise.drift_sigma_rad * noise.drift_sigma_rad * path_m
            + noise.turn_sigma_rad * noise.turn_sigma_rad * motion.heading_rad.abs();
        let step = Matrix3::new(1.0, 0.0, -y_m, 0.0, 1.0, x_m, 0.0, 0.0, 1.0);
        self.covariance = step * self.covariance * step.transpose()
            + Matrix3::from_diagonal(&Vector3::new(place, place, heading));
        self.pose =
            Pose2::new(self.pose.x_m + x_m, self.pose.y_m + y_m, self.pose.heading_rad + motion.heading_rad);
    }

    /// Adds uncertainty.
    pub(crate) fn blur(&mut self, sigma_m: f64, sigma_rad: f64) {
        self.covariance[(0, 0)] += sigma_m * sigma_m;
        self.covariance[(1, 1)] += sigma_m * sigma_m;
        self.covariance[(2, 2)] += sigma_rad * sigma_rad;
    }

    /// Probabilistic data association with one measurement that is either good or from anywhere (Bar-Shalom,
    /// Willett and Tian 2011, section 3.4): the correction counts as much as the measurement is probably
    /// good. Returns that probability. The weight changes by the measurement's likelihood to the power of
    /// `news`.
    pub(crate) fn correct(&mut self, seen: &Comparison, news: f64) -> f64 {
        let spread = self.covariance * seen.jacobian.transpose();
        let variance = (seen.jacobian * spread)[0] + seen.variance;
        let good = seen.prior * (-0.5 * seen.innovation * seen.innovation / variance).exp()
            / (std::f64::consts::TAU * variance).sqrt();
        let total = good + (1.0 - seen.prior) * seen.wrong_density;
        if !(total > 0.0 && variance > 0.0) {
            return 0.0;
        }
        let share = good / total;
        self.log_weight += news * total.ln();
        let gain = spread / variance;
        let shift = gain * (share * seen.innovation);
        self.pose =
            Pose2::new(self.pose.x_m + shift.x, self.pose.y_m + shift.y, self.pose.heading_rad + shift.z);
        let shrink = share * variance - share * (1.0 - share) * seen.innovation * seen.innovation;
        self.covariance -= gain * gain.transpose() * shrink;
        // Rounding must not make it lopsided.
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        share
    }

    /// What a range from an anchor says: second-order extended Kalman filter (Bar-Shalom, Li and Kirubarajan
    /// 2001, section 10.3.2), because near an anchor, or with a wide belief, circles are not straight.
    pub(crate) fn compare_range(&self, reading: &RangeReading) -> Comparison {
        let (sine, cosine) = self.pose.heading_rad.sin_cos();
        let [forward_m, left_m] = reading.antenna_m;
        let offset = (cosine * forward_m - sine * left_m, sine * forward_m + cosine * left_m);
        let away =
            (self.pose.x_m + offset.0 - reading.anchor_m[0], self.pose.y_m + offset.1 - reading.anchor_m[1]);
        let flat_m = away.0.hypot(away.1).max(1e-3);
        let expected_m = flat_m.hypot(reading.rise_m).max(0.2);
        let jacobian = RowVector3::new(
            away.0 / expected_m,
            away.1 / expected_m,
            (away.1 * offset.0 - away.0 * offset.1) / expected_m,
        );
        let (along, across) = ((away.0 / flat_m, away.1 / flat_m), (-away.1 / flat_m, away.0 / flat_m));
        let spread = |(x, y): (f64, f64)| {
            x * x * self.covariance[(0, 0)]
                + y * y * self.covariance[(1, 1)]
                + 2.0 * x * y * self.covariance[(0, 1)]
        };
        let rise = reading.rise_m / expected_m;
        let bends = [spread(across) / expected_m, spread(along) * rise * rise / expected_m];
        Comparison {
            innovation: reading.range_m - expected_m - 0.5 * (bends[0] + bends[1]),
            jacobian,
            variance: reading.variance + 0.5 * (bends[0] * bends[0] + bends[1] * bends[1]),
            prior: reading.prior,
            wrong_density: reading.wrong_density,
        }
    }
}

/// A usable range to an anchor.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RangeReading {
    /// The anchor's slot in the list of anchors.
    pub(crate) slot: usize,
    /// The anchor in the map.
    pub(crate) anchor_m: [f64; 2],
    /// From the antenna's height to the anchor's.
    pub(crate) rise_m: f64,
    /// The antenna in the robot's frame.
    pub(crate) antenna_m: [f64; 2],
    /// Measured.
    pub(crate) range_m: f64,
    /// Of a good reading.
    pub(crate) variance: f64,
    /// Probability that it is good; set for each hypothesis.
    pub(crate) prior: f64,
    /// Density of a wrong reading.
    pub(crate) wrong_density: f64,
}

impl RangeReading {
    /// Distance on the floor plan.
    pub(crate) fn flat_m(&self) -> f64 {
        (self.range_m * self.range_m - self.rise_m * self.rise_m).max(0.0).sqrt()
    }
}

/// The difference of two poses as a vector.
pub(crate) fn offset(to: Pose2, from: Pose2) -> Vector3<f64> {
    Vector3::new(to.x_m - from.x_m, to.y_m - from.y_m, angle::difference(to.heading_rad, from.heading_rad))
}
