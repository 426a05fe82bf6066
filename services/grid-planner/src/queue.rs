//! A monotone priority queue of integer keys: one bucket a key, so that the order is exact and nothing is
//! ever compared.

/// Keys may lie this far above the smallest key in the queue.
pub(crate) const SPAN: u32 = 1 << 15;
const NONE: u32 = u32::MAX;
const WORDS: usize = SPAN as usize / 64;

/// A circle of buckets (Dial 1969) with two levels of bits that say which are not empty; entries are linked
/// in one arena.
#[derive(Debug, Clone)]
pub(crate) struct BucketQueue {
    /// First entry of each bucket.
    heads: Vec<u32>,
    /// Bit of each bucket that has entries.
    filled: [u64; WORDS],
    /// Bit of each word of `filled` that is not zero.
    summary: [u64; WORDS / 64],
    /// (cell, next entry).
    entries: Vec<(u32, u32)>,
    /// First entry that can be used again.
    spare: u32,
    /// The bucket from which the last key was taken.
    current: u32,
}

impl Default for BucketQueue {
    fn default() -> Self {
        Self {
            heads: vec![NONE; SPAN as usize],
            filled: [0; WORDS],
            summary: [0; WORDS / 64],
            entries: Vec::new(),
            spare: NONE,
            current: 0,
        }
    }
}

impl BucketQueue {
    /// Empties the queue; the next keys are `first_key` and above. Costs as much as buckets are filled.
    pub(crate) fn restart(&mut self, first_key: u32) {
        for group in 0..self.summary.len() {
            while self.summary[group] != 0 {
                let word = group * 64 + self.summary[group].trailing_zeros() as usize;
                self.summary[group] &= self.summary[group] - 1;
                while self.filled[word] != 0 {
                    let bucket = word * 64 + self.filled[word].trailing_zeros() as usize;
                    self.filled[word] &= self.filled[word] - 1;
                    self.heads[bucket] = NONE;
                }
            }
        }
        self.entries.clear();
        self.spare = NONE;
        self.current = first_key % SPAN;
    }

    /// Adds a cell. The key must not lie below the last one taken, nor `SPAN` or more above it.
    #[inline]
    pub(crate) fn push(&mut self, key: u32, cell: u32) {
        let bucket = (key % SPAN) as usize;
        let head = self.heads[bucket];
        let entry = self.spare;
        if entry == NONE {
            self.heads[bucket] = self.entries.len() as u32;
            self.entries.push((cell, head));
        } else {
            let slot = &mut self.entries[entry as usize];
            self.spare = slot.1;
            *slot = (cell, head);
            self.heads[bucket] = entry;
        }
        if head == NONE {
            self.filled[bucket / 64] |= 1 << (bucket % 64);
            self.summary[bucket / 4096] |= 1 << (bucket / 64 % 64);
        }
    }

    /// Takes a cell with the smallest key; of several, the one added last.
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<u32> {
        let bucket = self.next_filled()?;
        self.current = bucket as u32;
        let entry = self.heads[bucket];
        let (cell, next) = self.entries[entry as usize];
        self.heads[bucket] = next;
        self.entries[entry as usize].1 = self.spare;
        self.spare = entry;
        if next == NONE {
            self.filled[bucket / 64] &= !(1 << (bucket % 64));
            if self.filled[bucket / 64] == 0 {
                self.summary[bucket / 4096] &= !(1 << (bucket / 64 % 64));
            }
        }
        Some(cell)
    }

    /// The first bucket that is not empty, from the current one around the circle.
    #[inline]
    fn next_filled(&self) -> Option<usize> {
        let (word, bit) = (self.current as usize / 64, self.current % 64);
        let here = self.filled[word] & (u64::MAX << bit);
        if here != 0 {
            return Some(word * 64 + here.trailing_zeros() as usize);
        }
        let (group, bit) = (word / 64, word % 64);
        let later = if bit == 63 { 0 } else { self.summary[group] & (u64::MAX << (bit + 1)) };
        let (group, bits) = if later != 0 {
            (group, later)
        } else {
            let groups = self.summary.len();
            // The last turn comes back to the words before the current one, and to the current one's lower
            // bits.
            (1..=groups).map(|ahead| (group + ahead) % groups).find_map(|group| {
                let bits = self.summary[group];
                (bits != 0).then_some((group, bits))
            })?
        };
        let word = group * 64 + bits.trailing_zeros() as usize;
        Some(word * 64 + self.filled[word].trailing_zeros() as usize)
    }
}
