//! The particles: candidates for the robot's pose, component by component, so that eight of them fill a
//! vector register.

use crate::random::{Purpose, Stream};
use crate::trigonometry::wrap;

/// Candidate poses with weights. Places are in metres in the map's own frame (see [`crate::Map`]), headings
/// in [-π, π].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Particles {
    /// Place along the map's rows.
    pub x: Vec<f32>,
    /// Place along the map's columns.
    pub y: Vec<f32>,
    /// Direction.
    pub heading: Vec<f32>,
    /// Weights, which sum to 1.
    pub weight: Vec<f64>,
}

impl Particles {
    /// How many.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Adds a particle without weight.
    pub fn push(&mut self, [x, y, heading]: [f32; 3]) {
        self.x.push(x);
        self.y.push(y);
        self.heading.push(heading);
        self.weight.push(0.0);
    }

    /// Adds copies of another set's particles, without weight.
    pub(crate) fn append(&mut self, from: &Self, picks: &[u32]) {
        let copy =
            |into: &mut Vec<f32>, from: &[f32]| into.extend(picks.iter().map(|pick| from[*pick as usize]));
        copy(&mut self.x, &from.x);
        copy(&mut self.y, &from.y);
        copy(&mut self.heading, &from.heading);
        self.weight.resize(self.x.len(), 0.0);
    }

    /// One particle's place and heading.
    pub fn pose(&self, index: usize) -> [f32; 3] {
        [self.x[index], self.y[index], self.heading[index]]
    }

    /// Takes all away.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.heading.clear();
        self.weight.clear();
    }

    /// Gives all the same weight.
    pub fn level(&mut self) {
        let share = 1.0 / self.len().max(1) as f64;
        self.weight.fill(share);
    }

    /// Effective sample size: 1 / Σ w², from 1 to the number of particles (Kong 1992).
    pub fn effective(&self) -> f64 {
        let squares: f64 = self.weight.iter().map(|weight| weight * weight).sum();
        if squares > 0.0 { 1.0 / squares } else { 0.0 }
    }

    /// Moves every particle by a little noise: standard deviations of place and heading.
    pub(crate) fn jitter(&mut self, seed: u64, epoch: u64, sigma_m: f32, sigma_rad: f32) {
        let stream = Stream::new(seed, epoch, Purpose::Jitter);
        for index in 0..self.len() {
            self.x[index] += sigma_m * stream.normal(index, 0);
            self.y[index] += sigma_m * stream.normal(index, 1);
            self.heading[index] = wrap(self.heading[index] + sigma_rad * stream.normal(index, 2));
        }
    }
}
