//! Every message of a run in logical time, seen once: for the digest, and for the referee's word.

use blake3::Hasher;
use board::JoinError;
use board::tap::{Tap, TapReader};
use messages::{RunState, RunSummary, View};
use serde::Serialize;
use std::collections::BTreeMap;

/// Reads every topic after every round.
pub(crate) struct Observer {
    readers: Vec<Watched>,
    finish: Option<String>,
    summary: Option<RunSummary>,
    /// Kept until the end: dropping it gives the place on the board back.
    _tap: Tap,
}

struct Watched {
    topic: String,
    reader: TapReader,
    hasher: Hasher,
    count: u64,
}

/// A hash over all messages of a run in their order: equal for equal runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Digest {
    /// Over all topics.
    pub(crate) digest: String,
    /// Messages in all.
    pub(crate) messages: u64,
    /// Topic by topic: count and hash.
    pub(crate) topics: BTreeMap<String, (u64, String)>,
}

impl Observer {
    /// Joins the board and reads every topic but the health of the services, which speaks of the machine.
    ///
    /// # Errors
    /// When the board takes no more readers.
    pub(crate) fn new(tap: Tap, finish: Option<&str>) -> Result<Self, JoinError> {
        let names: Vec<String> = tap.manifest().topics.iter().map(|topic| topic.name.clone()).collect();
        let mut readers = Vec::with_capacity(names.len());
        for topic in names.into_iter().filter(|name| !name.starts_with("health/")) {
            let reader = tap.reader(&topic)?;
            readers.push(Watched { topic, reader, hasher: Hasher::new(), count: 0 });
        }
        Ok(Self { readers, finish: finish.map(str::to_owned), summary: None, _tap: tap })
    }

    /// Takes in what this round has brought.
    pub(crate) fn look(&mut self) {
        for watched in &mut self.readers {
            while let Some((envelope, bytes)) = watched.reader.next() {
                watched.count += 1;
                let mut head = [0; 28];
                head[..8].copy_from_slice(&envelope.stamp_ns.to_le_bytes());
                head[8..16].copy_from_slice(&envelope.origin_ns.to_le_bytes());
                head[16..24].copy_from_slice(&envelope.sequence.to_le_bytes());
                head[24..].copy_from_slice(&envelope.round.to_le_bytes());
                watched.hasher.update(&head).update(bytes);
                if self.finish.as_ref() == Some(&watched.topic) {
                    self.summary = View::<RunSummary>::parse(bytes).ok().map(|view| *view.message).or(self.summary);
                }
            }
        }
    }

    /// The referee's last word.
    pub(crate) fn summary(&self) -> Option<&RunSummary> {
        self.summary.as_ref()
    }

    /// Whether the referee has ended the run, and how.
    pub(crate) fn verdict(&self) -> Option<RunState> {
        let state = self.summary.as_ref()?.state.get().ok()?;
        (state != RunState::Running).then_some(state)
    }

    /// The digest of what was seen so far.
    pub(crate) fn digest(&self) -> Digest {
        let mut whole = Hasher::new();
        let mut topics = BTreeMap::new();
        for watched in &self.readers {
            let hash = watched.hasher.finalize();
            whole.update(watched.topic.as_bytes()).update(hash.as_bytes());
            topics.insert(watched.topic.clone(), (watched.count, short(&hash)));
        }
        let messages = self.readers.iter().map(|watched| watched.count).sum();
        Digest { digest: short(&whole.finalize()), messages, topics }
    }
}

/// 128 bits are enough to tell runs apart, and fit on a line.
fn short(hash: &blake3::Hash) -> String {
    hash.to_hex().chars().take(32).collect()
}

