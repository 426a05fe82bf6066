//! Random numbers by counting: the number of a particle depends on the seed, the update and the particle's
//! index only, so it does not matter which thread asks, or in which order.

/// The numbers of one purpose in one update.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream {
    key: u64,
}

/// What numbers are drawn for; each purpose has numbers of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    Start = 1,
    Motion = 2,
    Comb = 3,
    Jitter = 4,
    Scatter = 5,
    Evidence = 6,
}

const LANES: u64 = 8;
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of splitmix64 (Steele, Lea and Flood 2014).
#[inline(always)]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Stream {
    pub(crate) fn new(seed: u64, epoch: u64, purpose: Purpose) -> Self {
        let key = mix(seed ^ mix(epoch.wrapping_mul(GOLDEN).wrapping_add(purpose as u64)));
        Self { key }
    }

    #[inline(always)]
    fn bits(self, index: usize, lane: u64) -> u64 {
        let count = (index as u64).wrapping_mul(LANES).wrapping_add(lane);
        mix(self.key.wrapping_add(count.wrapping_mul(GOLDEN)))
    }

    /// From 0 to 1 without the end. Lanes 0 to 7 of an index are independent.
    #[inline(always)]
    pub(crate) fn uniform(self, index: usize, lane: u64) -> f32 {
        (self.bits(index, lane) >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// Mean 0, standard deviation 1: the sum of eight uniform numbers, which ends at 4.9 standard deviations.
    /// Uses the lanes `2 lane` and `2 lane + 1`: there are four of them.
    #[inline(always)]
    pub(crate) fn normal(self, index: usize, lane: u64) -> f32 {
        let sum =
            |bits: u64| (bits & 0xffff) + ((bits >> 16) & 0xffff) + ((bits >> 32) & 0xffff) + (bits >> 48);
        let total = sum(self.bits(index, 2 * lane)) + sum(self.bits(index, 2 * lane + 1));
        // Eight numbers of mean 32767.5 and variance 65536² / 12.
        (total as i32 - 262_140) as f32 * (1.0 / 53_509.92)
    }
}
