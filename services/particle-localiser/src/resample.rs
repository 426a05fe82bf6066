//! Systematic resampling (Kitagawa 1996): one random number, one comb, one walk.

use crate::Particles;
use crate::random::{Purpose, Stream};

/// Calls `pick` with the index of every particle drawn, `count` of them, in ascending order.
pub(crate) fn comb(weights: &[f64], count: usize, seed: u64, epoch: u64, mut pick: impl FnMut(usize)) {
    if weights.is_empty() || count == 0 {
        return;
    }
    let total: f64 = weights.iter().sum();
    let step = total / count as f64;
    let offset = f64::from(Stream::new(seed, epoch, Purpose::Comb).uniform(0, 0)) * step;
    let (mut index, mut reached) = (0, weights[0]);
    for tooth in 0..count {
        let at = offset + tooth as f64 * step;
        while reached <= at && index + 1 < weights.len() {
            index += 1;
            reached += weights[index];
        }
        pick(index);
    }
}

/// Draws `count` particles into `into`, all of equal weight.
pub(crate) fn resample(from: &Particles, into: &mut Particles, count: usize, seed: u64, epoch: u64) {
    into.clear();
    comb(&from.weight, count, seed, epoch, |index| into.push(from.pose(index)));
    into.level();
}
