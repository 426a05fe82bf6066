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

/// Clusters that are drawn from separately.
const KEPT_APART: usize = 12;
/// A cluster with less of the weight may die out.
const WORTH_KEEPING: f64 = 0.005;
/// Each cluster worth keeping gets at least this part of the particles.
const FLOOR: f64 = 0.03;

/// Draws about `count` particles, from each cluster separately, so that none dies by chance: places that are alike must stay alike until
/// the robot has moved (after Vermaak et al. 2003, "Maintaining multi-modality through mixture tracking"). A small cluster gets more
/// particles than its share, which weigh less. `ranks` says for each particle in which cluster it lies, 0 for the heaviest.
pub(crate) fn resample_clusters(
    from: &Particles,
    into: &mut Particles,
    ranks: &[u32],
    count: usize,
    seed: u64,
    epoch: u64,
) {
    // The last group is everything that is not kept apart.
    let mut mass = [0.0; KEPT_APART + 1];
    let group = |rank: u32| (rank as usize).min(KEPT_APART);
    for (rank, weight) in ranks.iter().zip(&from.weight) {
        mass[group(*rank)] += weight;
    }
    let total: f64 = mass.iter().sum();
    let apart = mass[..KEPT_APART].iter().filter(|mass| **mass > WORTH_KEEPING * total).count();
    if apart < 2 {
        resample(from, into, count, seed, epoch);
        return;
    }
    let rest: f64 = mass[apart..].iter().sum();
    into.clear();
    let mut weights = Vec::with_capacity(from.len());
    let parts = mass[..apart].iter().map(|mass| (*mass, FLOOR)).chain([(rest, 0.0)]);
    for (part, (mass, least)) in parts.enumerate() {
        let share = mass / total;
        let teeth = (share.max(least) * count as f64).round() as usize;
        if teeth == 0 {
            continue;
        }
        weights.clear();
        let of_part = |rank: &u32| (*rank as usize).min(apart) == part;
        weights.extend(
            ranks.iter().zip(&from.weight).map(|(rank, weight)| if of_part(rank) { *weight } else { 0.0 }),
        );
        comb(&weights, teeth, seed, epoch.wrapping_add((part as u64) << 48), |index| {
            into.push(from.pose(index));
            if let Some(weight) = into.weight.last_mut() {
                *weight = share / teeth as f64;
            }
        });
    }
    let drawn: f64 = into.weight.iter().sum();
    into.weight.iter_mut().for_each(|weight| *weight /= drawn);
}
