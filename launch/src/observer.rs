//! Every message of a run in logical time, seen once: for the digest, the recording, and the referee's word.

use board::JoinError;
use board::manifest::Manifest;
use board::tap::{Tap, TapReader};
use messages::{RunState, RunSummary, Time, View};
use recording::{Digest, Digester, Envelope, Recorder};
use std::path::Path;

/// Reads every topic after every round.
pub(crate) struct Observer {
    readers: Vec<Watched>,
    digester: Digester,
    recorder: Option<Recorder>,
    finish: Option<String>,
    summary: Option<RunSummary>,
    /// Kept until the end: dropping it gives the place on the board back.
    _tap: Tap,
}

struct Watched {
    topic: String,
    reader: TapReader,
}

/// Why a run cannot be observed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ObserverError {
    /// The board.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] recording::RecordingError),
}

impl Observer {
    /// Joins the board and reads every topic but the health of the services, which speaks of the machine; records them if there is a file.
    ///
    /// # Errors
    /// When the board takes no more readers, or the file cannot be written.
    pub(crate) fn new(tap: Tap, finish: Option<&str>, file: Option<&Path>) -> Result<Self, ObserverError> {
        let contents = of_a_run(tap.manifest());
        let mut readers = Vec::with_capacity(contents.topics.len());
        for topic in &contents.topics {
            readers.push(Watched { topic: topic.name.clone(), reader: tap.reader(&topic.name)? });
        }
        let digester = Digester::new(contents.topics.iter().map(|topic| topic.name.as_str()));
        let recorder = file.map(|file| Recorder::new(file, &contents)).transpose()?;
        Ok(Self { readers, digester, recorder, finish: finish.map(str::to_owned), summary: None, _tap: tap })
    }

    /// Takes in what this round has brought.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub(crate) fn look(&mut self) -> Result<(), recording::RecordingError> {
        for (index, watched) in self.readers.iter_mut().enumerate() {
            while let Some((envelope, bytes)) = watched.reader.next() {
                let envelope = Envelope {
                    stamp_ns: envelope.stamp_ns,
                    origin_ns: envelope.origin_ns,
                    sequence: envelope.sequence,
                    generation: envelope.generation,
                    round: envelope.round,
                };
                self.digester.add(index, &envelope, bytes);
                if let Some(recorder) = &mut self.recorder {
                    recorder.record(index, &envelope, bytes)?;
                }
                if self.finish.as_ref() == Some(&watched.topic) {
                    self.summary =
                        View::<RunSummary>::parse(bytes).ok().map(|view| *view.message).or(self.summary);
                }
            }
        }
        Ok(())
    }

    /// Lets the recording close what is old enough, so that little is lost if this process is killed.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub(crate) fn tick(&mut self, host_time: Time) -> Result<(), recording::RecordingError> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.tick(host_time))
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn finish(&mut self) -> Result<(), recording::RecordingError> {
        self.recorder.take().map_or(Ok(()), |recorder| recorder.finish().map(|_| ()))
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
        self.digester.digest()
    }
}

/// The topics of a run as a recording lists them.
fn of_a_run(manifest: &Manifest) -> recording::Manifest {
    let topics = manifest.topics.iter().filter(|topic| !topic.name.starts_with("health/"));
    recording::Manifest {
        graph: manifest.graph.clone(),
        seed: manifest.seed,
        topics: topics
            .map(|topic| recording::Topic {
                name: topic.name.clone(),
                publisher: topic.publisher.clone(),
                depth: topic.depth,
                message: topic.message.clone(),
            })
            .collect(),
        notes: std::collections::BTreeMap::new(),
    }
}
