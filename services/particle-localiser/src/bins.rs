//! A spatial hash: which cell of (x, y, heading) a particle lies in, and what lies in each cell.

/// How space is divided.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Division {
    per_metre: f32,
    per_radian: f32,
    pub(crate) headings: i32,
}

/// A cell of the division.
pub(crate) type Bin = [i32; 3];

impl Division {
    pub(crate) fn new(bin_m: f64, bin_rad: f64) -> Self {
        let headings = (std::f64::consts::TAU / bin_rad).round().max(1.0);
        Self {
            per_metre: (1.0 / bin_m) as f32,
            per_radian: (headings / std::f64::consts::TAU) as f32,
            headings: headings as i32,
        }
    }

    pub(crate) fn bin(&self, [x, y, heading]: [f32; 3]) -> Bin {
        let turned = floor(heading * self.per_radian);
        [floor(x * self.per_metre), floor(y * self.per_metre), turned.rem_euclid(self.headings)]
    }
}

/// The whole number below. The standard library's is a call where the processor's oldest instructions are all
/// that may be used.
#[inline(always)]
fn floor(number: f32) -> i32 {
    let whole = number as i32;
    whole - i32::from(whole as f32 > number)
}

const EMPTY: u32 = u32::MAX;

/// Bins in the order of their first particle, found by open addressing.
#[derive(Debug, Clone, Default)]
pub(crate) struct BinTable {
    slots: Vec<u32>,
    pub(crate) bins: Vec<Bin>,
}

impl BinTable {
    /// Empties the table and makes room for as many bins.
    pub(crate) fn reset(&mut self, capacity: usize) {
        let slots = (2 * capacity.max(8)).next_power_of_two();
        self.slots.clear();
        self.slots.resize(slots, EMPTY);
        self.bins.clear();
    }

    fn slot(&self, bin: Bin) -> usize {
        let mask = self.slots.len() - 1;
        let key = (bin[0] as u32 as u64)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .wrapping_add((bin[1] as u32 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f))
            .wrapping_add((bin[2] as u32 as u64).wrapping_mul(0x1656_67b1_9e37_79f9));
        let mut at = (key ^ (key >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) as usize >> 20 & mask;
        while self.slots[at] != EMPTY && self.bins[self.slots[at] as usize] != bin {
            at = (at + 1) & mask;
        }
        at
    }

    /// The bin's number; it gets one if it has none yet. No more bins than the capacity may be added.
    pub(crate) fn add(&mut self, bin: Bin) -> usize {
        let at = self.slot(bin);
        if self.slots[at] == EMPTY {
            self.slots[at] = self.bins.len() as u32;
            self.bins.push(bin);
        }
        self.slots[at] as usize
    }

    /// The bin's number, if it has one.
    pub(crate) fn find(&self, bin: Bin) -> Option<usize> {
        let found = self.slots[self.slot(bin)];
        (found != EMPTY).then_some(found as usize)
    }
}
