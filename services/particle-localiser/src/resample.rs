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
    let mut picks = Vec::with_capacity(count);
    comb(&from.weight, count, seed, epoch, |index| picks.push(index as u32));
    into.clear();
    into.append(from, &picks);
    into.level();
}

/// Groups that are drawn from separately, so that none dies by chance: places that are alike must stay alike
/// until the robot has moved (after Vermaak et al. 2003, "Maintaining multi-modality through mixture
/// tracking").
#[derive(Debug, Clone, Copy)]
pub(crate) struct Apart {
    /// No more than this, the heaviest.
    pub(crate) most: usize,
    /// A group with a smaller part of the weight may die out.
    pub(crate) least_share: f64,
}

/// The clusters of a belief.
pub(crate) const CLUSTERS: Apart = Apart { most: 12, least_share: 0.005 };
/// The bins of a search: of a place that will fit, too little may be known yet to call it a cluster.
pub(crate) const BINS: Apart = Apart { most: 64, least_share: 0.0 };

/// The share of the particles of which no group gets less than its even part, so that each is judged by
/// enough of them.
const EVEN: f64 = 0.5;

/// Draws `count` particles, and up to half as many more where light groups are kept apart: the heavy ones
/// need theirs. A light group gets more particles than its share, which weigh less. `ranks` says for each
/// particle in which group it lies, 0 for the heaviest.
pub(crate) fn resample_apart(
    from: &Particles,
    into: &mut Particles,
    ranks: &[u32],
    groups: Apart,
    count: usize,
    numbers: (u64, u64),
) {
    // The last group is everything that is not kept apart.
    let mut mass = vec![0.0; groups.most + 1];
    let group = |rank: u32| (rank as usize).min(groups.most);
    for (rank, weight) in ranks.iter().zip(&from.weight) {
        mass[group(*rank)] += weight;
    }
    let total: f64 = mass.iter().sum();
    let is_worth = |mass: &&f64| **mass > groups.least_share * total;
    let apart = mass[..groups.most].iter().take_while(is_worth).count();
    let (seed, epoch) = numbers;
    if apart < 2 {
        resample(from, into, count, seed, epoch);
        return;
    }
    let rest: f64 = mass[apart..].iter().sum();
    // The particles of each group one after the other, by counting.
    let part_of = |rank: &u32| (*rank as usize).min(apart);
    let mut begins = vec![0; apart + 2];
    ranks.iter().for_each(|rank| begins[part_of(rank) + 1] += 1);
    (1..begins.len()).for_each(|part| begins[part] += begins[part - 1]);
    let mut next = begins.clone();
    let mut sorted = vec![0_u32; ranks.len()];
    for (index, rank) in (0_u32..).zip(ranks) {
        let place = &mut next[part_of(rank)];
        sorted[*place] = index;
        *place += 1;
    }
    into.clear();
    let mut weights = Vec::with_capacity(from.len());
    let mut picks = Vec::with_capacity(count);
    let even = EVEN / apart as f64;
    let parts = mass[..apart].iter().map(|mass| (*mass, even)).chain([(rest, 0.0)]);
    for (part, (mass, least)) in parts.enumerate() {
        let share = mass / total;
        let teeth = (share.max(least) * count as f64).round() as usize;
        if teeth == 0 {
            continue;
        }
        let members = &sorted[begins[part]..begins[part + 1]];
        weights.clear();
        weights.extend(members.iter().map(|index| from.weight[*index as usize]));
        picks.clear();
        comb(&weights, teeth, seed, epoch.wrapping_add((part as u64) << 48), |member| {
            picks.push(members[member]);
        });
        into.append(from, &picks);
        let drawn = into.len() - picks.len();
        into.weight[drawn..].fill(share / teeth as f64);
    }
    let drawn: f64 = into.weight.iter().sum();
    into.weight.iter_mut().for_each(|weight| *weight /= drawn);
}
