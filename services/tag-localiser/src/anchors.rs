//! The anchors ever heard, and which of them can be trusted.

use messages::AnchorRange;

/// How many anchors are remembered: the bits of `PoseEstimate::alive_anchors`.
pub(crate) const ANCHOR_LIMIT: usize = 32;
/// How many anchors a DWM1001 uses at once (note 2.3): with so many heard, another's silence means nothing.
const USED_AT_ONCE: usize = 4;
/// Share of wrong readings, averaged over about ten, from which an anchor counts as always wrong, and below
/// which as right again.
const WRONG: f64 = 0.75;
const RIGHT: f64 = 0.4;

#[derive(Debug, Clone, Copy, Default)]
struct Anchor {
    floor: i32,
    id: u32,
    at_m: [f64; 3],
    /// Count of tag messages when it was last heard.
    heard: u64,
    readings: u32,
    /// Moving average of its readings: 1 for a wrong one.
    wrong: f64,
    always_wrong: bool,
    /// The farthest distance from which a good range came.
    farthest_m: f64,
}

/// The list of anchors, in the order of their first hearing.
#[derive(Debug, Clone)]
pub(crate) struct Anchors {
    known: [Anchor; ANCHOR_LIMIT],
    count: usize,
    /// Tag messages received.
    messages: u64,
    /// Anchors in the last of them.
    last_heard: usize,
}

/// Anchors by their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct AnchorBits {
    pub(crate) alive: u32,
    pub(crate) dead: u32,
}

impl Anchors {
    pub(crate) fn new() -> Self {
        Self { known: [Anchor::default(); ANCHOR_LIMIT], count: 0, messages: 0, last_heard: 0 }
    }

    /// A tag message begins.
    pub(crate) fn begin(&mut self, heard: usize) {
        self.messages += 1;
        self.last_heard = heard;
    }

    /// The slot of an anchor that is heard now; `None` when it was heard in this message already, or when the
    /// list is full.
    pub(crate) fn hear(&mut self, floor: i32, anchor: &AnchorRange) -> Option<usize> {
        let place = [anchor.x_m, anchor.y_m, anchor.z_m];
        let slot =
            match self.known[..self.count].iter().position(|one| one.floor == floor && one.id == anchor.id) {
                Some(slot) => slot,
                None if self.count < ANCHOR_LIMIT => {
                    self.known[self.count] = Anchor { floor, id: anchor.id, ..Anchor::default() };
                    self.count += 1;
                    self.count - 1
                }
                None => return None,
            };
        let known = &mut self.known[slot];
        if known.heard == self.messages {
            return None;
        }
        known.heard = self.messages;
        known.at_m = place;
        Some(slot)
    }

    /// A reading of an anchor was judged.
    pub(crate) fn judge(&mut self, slot: usize, good: bool, range_m: f64) {
        let anchor = &mut self.known[slot];
        anchor.readings = anchor.readings.saturating_add(1);
        // The first ten count alike, later ones a tenth.
        let share = (1.0 / f64::from(anchor.readings)).max(0.1);
        anchor.wrong += share * (f64::from(u8::from(!good)) - anchor.wrong);
        if good {
            anchor.farthest_m = anchor.farthest_m.max(range_m);
        }
        if anchor.readings >= 8 && anchor.wrong > WRONG {
            anchor.always_wrong = true;
        } else if anchor.wrong < RIGHT {
            anchor.always_wrong = false;
        }
    }

    /// The anchors of a floor, as seen from a place. An anchor that is silent is dead only where it has been
    /// heard before, and only if the tag had room for it: a building has more anchors than a tag hears at
    /// once.
    pub(crate) fn bits(&self, floor: i32, from: Option<[f64; 2]>, silent_messages: u32) -> AnchorBits {
        let mut bits = AnchorBits::default();
        for (slot, anchor) in self.known[..self.count].iter().enumerate() {
            if anchor.floor != floor {
                continue;
            }
            let silent = self.messages - anchor.heard >= u64::from(silent_messages);
            let near = from.is_none_or(|[x_m, y_m]| {
                (anchor.at_m[0] - x_m).hypot(anchor.at_m[1] - y_m) <= anchor.farthest_m
            });
            if anchor.always_wrong || (silent && near && self.last_heard < USED_AT_ONCE) {
                bits.dead |= 1 << slot;
            }
            if !silent && !anchor.always_wrong {
                bits.alive |= 1 << slot;
            }
        }
        bits
    }
}
