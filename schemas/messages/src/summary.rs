//! What a referee says of a run.

use crate::{FixedText, Message};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// How a run stands.
    RunStateField, RunState {
        /// It goes on.
        Running = 0,
        /// It ended as it should.
        Passed = 1,
        /// It ended otherwise.
        Failed = 2,
    }
}

/// One measured figure.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Metric {
    /// Its name, in words.
    pub name: FixedText<40>,
    /// Its unit; empty for a count.
    pub unit: FixedText<8>,
    /// Its value; NaN while it is not known.
    pub value: f64,
}

/// How many figures a summary can hold.
pub const METRIC_CAPACITY: usize = 24;

/// The run so far, measured against the truth. Published by a referee on `run/summary`; the launcher ends the
/// run when it is over.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct RunSummary {
    /// The figures; the first `metric_count` are valid.
    pub metrics: [Metric; METRIC_CAPACITY],
    /// The verdict, or what happens now, in words.
    pub remark: FixedText<120>,
    /// How many figures there are.
    pub metric_count: u32,
    /// Whether the run goes on.
    pub state: RunStateField,
}

impl RunSummary {
    /// Adds a figure; without effect when there is no room.
    pub fn push(&mut self, name: &str, value: f64, unit: &str) {
        if let Some(slot) = self.metrics.get_mut(self.metric_count as usize) {
            *slot = Metric { name: FixedText::truncated(name), unit: FixedText::truncated(unit), value };
            self.metric_count += 1;
        }
    }

    /// The figures there are, whatever the count claims.
    pub fn figures(&self) -> &[Metric] {
        &self.metrics[..(self.metric_count as usize).min(METRIC_CAPACITY)]
    }
}
