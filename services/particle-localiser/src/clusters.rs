//! Clusters: groups of particles that hang together, which are the places where the robot may be.

use crate::Particles;
use crate::bins::{Bin, BinTable, Division};
use crate::trigonometry::sin_cos;
use geometry::Pose2;

/// One place where the robot may be, in the map's own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cluster {
    /// Mean of its particles.
    pub pose: Pose2,
    /// Covariance of (x, y, heading), row by row.
    pub covariance: [f64; 9],
    /// Its part of the weight of all particles, 0 to 1.
    pub share: f64,
}

impl Cluster {
    /// Standard deviation of the place: the root of the mean square of both directions.
    pub fn sigma_m(&self) -> f64 {
        (0.5 * (self.covariance[0] + self.covariance[4])).max(0.0).sqrt()
    }

    /// Standard deviation of the heading.
    pub fn sigma_rad(&self) -> f64 {
        self.covariance[8].max(0.0).sqrt()
    }
}

/// Finds clusters; keeps its memory from one search to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Finder {
    table: BinTable,
    /// For each particle the number of its bin.
    pub(crate) of_particle: Vec<u32>,
    /// For each particle the place of its cluster in the list that was returned last.
    pub(crate) ranks: Vec<u32>,
    mass: Vec<f64>,
    parent: Vec<u32>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: f64,
    first: [f64; 2],
    sine: f64,
    cosine: f64,
    second: [f64; 6],
}

/// Bins with less than this part of the mean bin's weight do not join others.
const THIN: f64 = 0.1;

impl Finder {
    /// The clusters, the heaviest first. Bins that touch each other belong together, unless nearly empty.
    pub(crate) fn find(&mut self, particles: &Particles, division: Division) -> Vec<Cluster> {
        self.table.reset(particles.len());
        self.of_particle.clear();
        self.mass.clear();
        for index in 0..particles.len() {
            let bin = self.table.add(division.bin(particles.pose(index)));
            if bin == self.mass.len() {
                self.mass.push(0.0);
            }
            self.mass[bin] += particles.weight[index];
            self.of_particle.push(bin as u32);
        }
        self.join(division);
        self.measure(particles)
    }

    /// For each particle the place of its bin among all bins by weight, after [`Finder::find`].
    pub(crate) fn bin_ranks(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.mass.len() as u32).collect();
        order.sort_by(|a, b| self.mass[*b as usize].total_cmp(&self.mass[*a as usize]));
        let mut rank_of = vec![0; order.len()];
        for (rank, bin) in (0_u32..).zip(&order) {
            rank_of[*bin as usize] = rank;
        }
        self.of_particle.iter().map(|bin| rank_of[*bin as usize]).collect()
    }

    fn join(&mut self, division: Division) {
        let bins = self.table.bins.len();
        self.parent.clear();
        self.parent.extend(0..bins as u32);
        let least = THIN / bins.max(1) as f64;
        for bin in 0..bins {
            if self.mass[bin] < least {
                continue;
            }
            let [x, y, turn] = self.table.bins[bin];
            // Half of the 26 neighbours: the other half looks back.
            for (dx, dy, dturn) in NEIGHBOURS {
                let other: Bin = [x + dx, y + dy, (turn + dturn).rem_euclid(division.headings)];
                if let Some(other) = self.table.find(other)
                    && self.mass[other] >= least
                {
                    let (a, b) = (self.root(bin), self.root(other));
                    self.parent[a.max(b)] = a.min(b) as u32;
                }
            }
        }
    }

    fn root(&mut self, bin: usize) -> usize {
        let mut at = bin;
        while self.parent[at] as usize != at {
            let above = self.parent[self.parent[at] as usize];
            self.parent[at] = above;
            at = above as usize;
        }
        at
    }

    fn measure(&mut self, particles: &Particles) -> Vec<Cluster> {
        let bins = self.table.bins.len();
        let mut moments = vec![Moments::default(); bins];
        let roots: Vec<u32> = (0..bins).map(|bin| self.root(bin) as u32).collect();
        for index in 0..particles.len() {
            let weight = particles.weight[index];
            let (sine, cosine) = sin_cos(particles.heading[index]);
            let sum = &mut moments[roots[self.of_particle[index] as usize] as usize];
            sum.weight += weight;
            sum.first[0] += weight * f64::from(particles.x[index]);
            sum.first[1] += weight * f64::from(particles.y[index]);
            sum.sine += weight * f64::from(sine);
            sum.cosine += weight * f64::from(cosine);
        }
        let means: Vec<Pose2> = moments
            .iter()
            .map(|sum| {
                let total = sum.weight.max(f64::MIN_POSITIVE);
                Pose2::new(sum.first[0] / total, sum.first[1] / total, sum.sine.atan2(sum.cosine))
            })
            .collect();
        for index in 0..particles.len() {
            let root = roots[self.of_particle[index] as usize] as usize;
            let (weight, mean) = (particles.weight[index], means[root]);
            let dx = f64::from(particles.x[index]) - mean.x_m;
            let dy = f64::from(particles.y[index]) - mean.y_m;
            let turn = geometry::angle::difference(f64::from(particles.heading[index]), mean.heading_rad);
            let products = [dx * dx, dx * dy, dx * turn, dy * dy, dy * turn, turn * turn];
            for (sum, product) in moments[root].second.iter_mut().zip(products) {
                *sum += weight * product;
            }
        }
        let total: f64 = moments.iter().map(|sum| sum.weight).sum();
        // By bin; the order of equal shares is that of the bins.
        let mut order: Vec<usize> = (0..bins).filter(|bin| moments[*bin].weight > 0.0).collect();
        order.sort_by(|a, b| moments[*b].weight.total_cmp(&moments[*a].weight));
        let mut rank_of = vec![u32::MAX; bins];
        for (rank, bin) in (0_u32..).zip(&order) {
            rank_of[*bin] = rank;
        }
        self.ranks.clear();
        self.ranks.extend(self.of_particle.iter().map(|bin| rank_of[roots[*bin as usize] as usize]));
        let whole = order.into_iter().map(|bin| (&moments[bin], means[bin]));
        let cluster = |(sum, pose): (&Moments, Pose2)| {
            let [xx, xy, xt, yy, yt, tt] = sum.second.map(|product| product / sum.weight);
            let covariance = [xx, xy, xt, xy, yy, yt, xt, yt, tt];
            Cluster { pose, covariance, share: sum.weight / total }
        };
        whole.map(cluster).collect()
    }
}

const NEIGHBOURS: [(i32, i32, i32); 13] = [
    (1, 0, 0),
    (0, 1, 0),
    (1, 1, 0),
    (1, -1, 0),
    (0, 0, 1),
    (1, 0, 1),
    (0, 1, 1),
    (1, 1, 1),
    (1, -1, 1),
    (-1, 0, 1),
    (0, -1, 1),
    (-1, -1, 1),
    (-1, 1, 1),
];
