//! What a run in logical time is, and what it came to.

use crate::graph::Fault;
use crate::prompter::Part;
use crate::signals::Signals;
use messages::{RunState, RunSummary, Time};
use recording::Digest;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// How a run in logical time is to be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pace {
    /// Logical seconds a second; `None` for as fast as possible.
    pub(crate) speed: Option<f64>,
    /// Begin at this moment.
    pub(crate) begin: Time,
    /// End after the instant at this moment, or the first one after it, whatever the referee says.
    pub(crate) until: Option<Time>,
    /// Play no instant after this moment.
    pub(crate) last: Option<Time>,
    /// Faults beside those of the graph.
    pub(crate) faults: Vec<Fault>,
    /// The processor for the whole graph.
    pub(crate) cpu: Option<usize>,
    /// Record every message here.
    pub(crate) record: Option<PathBuf>,
    /// What else the recording is to say of itself.
    pub(crate) notes: BTreeMap<String, String>,
    /// Say these words of a recording.
    pub(crate) script: Option<Script>,
    /// Take orders from the standard input.
    pub(crate) steered: bool,
}

/// What is said from a recording.
#[derive(Debug, Clone)]
pub(crate) struct Script {
    /// The recording.
    pub(crate) file: PathBuf,
    /// The topics.
    pub(crate) topics: Vec<String>,
    /// What is said on them.
    pub(crate) part: Part,
}

/// What a run in logical time has come to.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) verdict: Option<RunState>,
    pub(crate) summary: Option<RunSummary>,
    pub(crate) digest: Digest,
    /// The last instant.
    pub(crate) end: Time,
    pub(crate) wall_s: f64,
    pub(crate) turns: u64,
    pub(crate) restarts: u32,
    /// Faults that were ordered while it ran.
    pub(crate) ordered: Vec<Fault>,
    pub(crate) interrupted: bool,
    /// What services could not leave in order at the end.
    pub(crate) unclean: Vec<String>,
}

impl Outcome {
    /// Whether nothing went wrong: a run that was broken off has not failed.
    pub(crate) fn is_success(&self) -> bool {
        self.verdict != Some(RunState::Failed) && self.unclean.is_empty()
    }

    /// Who or what ended it.
    pub(crate) fn ended(&self, signals: &Signals) -> String {
        match self.verdict {
            Some(RunState::Passed) => "the judge has ended the run: passed".to_owned(),
            Some(_) => "the judge has ended the run: failed".to_owned(),
            None if self.interrupted => signals.why().to_owned(),
            None => "the run is over: its time, or all that was to happen".to_owned(),
        }
    }
}
