//! How likely each of several places is, after a search of the whole map: the evidence of each cluster by
//! importance sampling, in two rounds of which the second draws from what the first has found (population
//! Monte Carlo, Cappé et al. 2004).
//!
//! The weight that a cluster has gathered in the search depends on how near to its peak one of the scattered
//! particles lay, which is chance. Places that are alike to the last reading must come out alike.

use crate::clusters::Cluster;
use crate::random::{Purpose, Stream};
use crate::trigonometry::{sin_cos, wrap};
use crate::{Beams, Particles, Weigher};
use nalgebra::{Matrix3, Vector3};

/// Rounds for each cluster.
const ROUNDS: u64 = 2;
/// How much wider than the cluster is the particles are drawn, so that nothing of it is missed.
const WIDER: f64 = 1.5;

/// What one cluster is drawn from.
#[derive(Debug, Clone, Copy)]
struct Proposal {
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
}

/// A cluster drawn anew: particles, and the logarithm of each one's likelihood by its density; their mean is
/// the evidence.
#[derive(Debug, Default)]
pub(crate) struct Sampled {
    pub(crate) particles: Particles,
    pub(crate) log_weights: Vec<f64>,
}

/// Draws `count` particles for a cluster. `least` are standard deviations of place and heading below which
/// nothing is told apart. `None` for a cluster without an extent that makes sense.
pub(crate) fn sample(
    weigher: &Weigher,
    beams: &Beams,
    cluster: &Cluster,
    count: usize,
    least: [f64; 2],
    numbers: (u64, u64),
) -> Option<Sampled> {
    let pose = cluster.pose;
    let mut proposal = Proposal {
        mean: Vector3::new(pose.x_m, pose.y_m, pose.heading_rad),
        covariance: Matrix3::from_row_slice(&cluster.covariance),
    };
    let [place, heading] = least.map(|sigma| sigma * sigma);
    let floor = Matrix3::from_diagonal(&Vector3::new(place, place, heading));
    let mut sampled = Sampled::default();
    let mut points = Vec::new();
    for round in 0..ROUNDS {
        let wide = proposal.covariance * (WIDER * WIDER) + floor;
        let root = wide.cholesky()?.l();
        let stream = Stream::new(numbers.0, numbers.1.wrapping_add(round << 40), Purpose::Evidence);
        let log_root: f64 = root.diagonal().iter().map(|number| number.ln()).sum();
        sampled.particles.clear();
        sampled.log_weights.clear();
        for index in 0..count {
            let normal = Vector3::from_fn(|row, _| f64::from(stream.normal(index, row as u64)));
            let [x, y, heading]: [f64; 3] = (proposal.mean + root * normal).into();
            sampled.particles.push([x as f32, y as f32, wrap(heading as f32)]);
            // Minus the logarithm of the density, but for a constant.
            sampled.log_weights.push(0.5 * normal.norm_squared() + log_root);
        }
        weigher.weigh(&sampled.particles, beams, &mut points);
        for (log, points) in sampled.log_weights.iter_mut().zip(&points) {
            *log += weigher.log_likelihood(*points, beams.len());
        }
        proposal = sampled.moments();
    }
    Some(sampled)
}

impl Sampled {
    /// The largest logarithm of a weight.
    pub(crate) fn highest(&self) -> f64 {
        self.log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Mean and covariance of the weighted particles.
    fn moments(&self) -> Proposal {
        let highest = self.highest();
        let weights: Vec<f64> = self.log_weights.iter().map(|log| (log - highest).exp()).collect();
        let total: f64 = weights.iter().sum();
        let particles = &self.particles;
        let (mut place, mut turn) = (Vector3::zeros(), [0.0; 2]);
        for (index, weight) in weights.iter().enumerate() {
            let (sine, cosine) = sin_cos(particles.heading[index]);
            place += Vector3::new(particles.x[index].into(), particles.y[index].into(), 0.0) * *weight;
            turn[0] += weight * f64::from(sine);
            turn[1] += weight * f64::from(cosine);
        }
        let mean = Vector3::new(place.x / total, place.y / total, turn[0].atan2(turn[1]));
        let mut covariance = Matrix3::zeros();
        for (index, weight) in weights.iter().enumerate() {
            let away = Vector3::new(
                f64::from(particles.x[index]) - mean.x,
                f64::from(particles.y[index]) - mean.y,
                geometry::angle::difference(particles.heading[index].into(), mean.z),
            );
            covariance += away * away.transpose() * (weight / total);
        }
        Proposal { mean, covariance }
    }
}
