//! The motion model: particles follow the odometry, each with an error of its own (after Thrun et al. 2005,
//! table 5.6, with the errors along, across and in heading instead of two turns and a distance, which need no
//! direction of travel).

use crate::Particles;
use crate::params::MotionNoise;
use crate::random::{Purpose, Stream};
use crate::trigonometry::{sin_cos, wrap};
use geometry::Pose2;

/// Standard deviations of one motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionSigma {
    /// Of the place, along and across.
    pub place_m: f64,
    /// Of the heading.
    pub heading_rad: f64,
}

/// What has been travelled since the last update.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Travel {
    /// From the pose then to the pose now, in the body's frame then.
    pub motion: Pose2,
    /// Length of the path, at least the distance of `motion`.
    pub path_m: f64,
    /// Sum of all turns, at least the turn of `motion`.
    pub turn_rad: f64,
}

impl Travel {
    /// Appends a small motion.
    pub fn extend(&mut self, step: Pose2) {
        self.motion = self.motion.compose(step);
        self.path_m += step.x_m.hypot(step.y_m);
        self.turn_rad += step.heading_rad.abs();
    }

    /// How uncertain the odometry is after this travel.
    pub fn sigma(&self, noise: &MotionNoise) -> MotionSigma {
        let place_m = noise.place_m + noise.place_per_m * self.path_m + noise.place_m_per_rad * self.turn_rad;
        let heading_rad =
            noise.heading_rad + noise.heading_per_rad * self.turn_rad + noise.heading_rad_per_m * self.path_m;
        MotionSigma { place_m, heading_rad }
    }
}

/// Moves every particle by the travel and its noise. Deterministic for a seed and an epoch.
pub(crate) fn advance(particles: &mut Particles, travel: &Travel, sigma: MotionSigma, seed: u64, epoch: u64) {
    let stream = Stream::new(seed, epoch, Purpose::Motion);
    let (ahead, aside, turn) =
        (travel.motion.x_m as f32, travel.motion.y_m as f32, travel.motion.heading_rad as f32);
    let (sigma_m, sigma_rad) = (sigma.place_m as f32, sigma.heading_rad as f32);
    let Particles { x, y, heading, .. } = particles;
    for (index, ((x, y), heading)) in x.iter_mut().zip(y.iter_mut()).zip(heading.iter_mut()).enumerate() {
        // Half of the heading's error comes before the way, half after it.
        let early = 0.5 * sigma_rad * stream.normal(index, 0);
        let late = 0.866 * sigma_rad * stream.normal(index, 1);
        let along = ahead + sigma_m * stream.normal(index, 2);
        let across = aside + sigma_m * stream.normal(index, 3);
        let (sine, cosine) = sin_cos(*heading + early);
        *x += cosine * along - sine * across;
        *y += sine * along + cosine * across;
        *heading = wrap(*heading + turn + early + late);
    }
}
