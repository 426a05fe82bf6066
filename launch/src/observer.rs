//! Every message of a run in logical time, seen once: for the digest, the recording, and the referee's word.

use crate::graph::Checked;
use crate::notes;
use crate::run::{Outcome, Pace};
use board::JoinError;
use board::manifest::{Manifest, Topic};
use board::tap::{OUTSIDE_ROUND, Tap, TapReader};
use messages::{RunState, RunSummary, Time, View};
use recording::{Digest, Digester, Recorder};
use std::collections::BTreeMap;
use std::time::Duration;

/// Reads every topic after every round.
pub(crate) struct Observer {
    readers: Vec<Watched>,
    digester: Digester,
    recorder: Option<Recorder>,
    finish: Option<String>,
    /// Topics on which something came from outside.
    outside: Vec<bool>,
    summary: Option<RunSummary>,
    /// Kept until the end: dropping it gives the place on the board back.
    tap: Tap,
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
    /// The recording, a while ago.
    #[error("{} was broken off", file.display())]
    BrokenOff {
        /// The file.
        file: std::path::PathBuf,
    },
}

impl Observer {
    /// Joins the board and reads every topic but the health of the services, which speaks of the machine; records them if there is a file.
    ///
    /// # Errors
    /// When the board takes no more readers, or the file cannot be written.
    pub(crate) fn new(tap: Tap, graph: &Checked, pace: &Pace) -> Result<Self, ObserverError> {
        let notes = if pace.record.is_some() { notes::of_graph(graph) } else { BTreeMap::new() };
        let contents = of_a_run(tap.manifest(), notes.into_iter().chain(pace.notes.clone()).collect());
        let mut readers = Vec::with_capacity(contents.topics.len());
        for topic in &contents.topics {
            readers.push(Watched { topic: topic.name.clone(), reader: tap.reader(&topic.name)? });
        }
        let digester = Digester::new(contents.topics.iter().map(|topic| topic.name.as_str()));
        let recorder = pace.record.as_deref().map(|file| Recorder::new(file, &contents)).transpose()?;
        let (outside, finish) = (vec![false; readers.len()], graph.finish.clone());
        Ok(Self { readers, digester, recorder, finish, outside, summary: None, tap })
    }

    /// Takes in what this round has brought.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub(crate) fn look(&mut self) -> Result<(), recording::RecordingError> {
        for (index, watched) in self.readers.iter_mut().enumerate() {
            while let Some((envelope, bytes)) = watched.reader.next() {
                self.digester.add(index, &envelope, bytes);
                self.outside[index] |= envelope.round == OUTSIDE_ROUND;
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

    /// In host time: reads topics that were added to the board since, as a swap or a shadow does. They are recorded, and are no part of the digest.
    ///
    /// # Errors
    /// When the board cannot be read, or the recording cannot be written.
    pub(crate) fn follow(&mut self) -> Result<(), ObserverError> {
        let added = self.tap.refresh()?;
        let added: Vec<Topic> =
            self.tap.manifest().topics[added].iter().filter(|topic| !topic.is_health()).cloned().collect();
        for topic in added {
            if let Some(recorder) = &mut self.recorder {
                recorder.add_topic(&topic)?;
            }
            let reader = self.tap.reader(&topic.name)?;
            self.readers.push(Watched { topic: topic.name, reader });
            self.outside.push(false);
        }
        Ok(())
    }

    /// In host time: takes in what has come, and sleeps until more comes, at most for `rest`.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub(crate) fn look_and_rest(&mut self, rest: Duration) -> Result<(), recording::RecordingError> {
        let heard = self.tap.bell();
        self.look()?;
        self.tap.wait(heard, rest);
        Ok(())
    }

    /// Lets the recording close what is old enough, so that little is lost if this process is killed.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub(crate) fn tick(&mut self, host_time: Time) -> Result<(), recording::RecordingError> {
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.tick(host_time))
    }

    /// Brings the recording up to date.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn flush(&mut self) -> Result<(), recording::RecordingError> {
        self.recorder.as_mut().map_or(Ok(()), Recorder::flush)
    }

    /// Ends the recording; there is an outcome if the run ended in order.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn finish(&mut self, outcome: Option<&Outcome>) -> Result<(), recording::RecordingError> {
        let Some(mut recorder) = self.recorder.take() else { return Ok(()) };
        let topics = self.readers.iter().zip(&self.outside).filter(|(_, outside)| **outside);
        notes::at_end(&mut recorder, outcome, topics.map(|(watched, _)| watched.topic.as_str()));
        recorder.finish().map(|_| ())
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
fn of_a_run(manifest: &Manifest, notes: BTreeMap<String, String>) -> recording::Manifest {
    let topics = manifest.topics.iter().filter(|topic| !topic.is_health());
    recording::Manifest {
        graph: manifest.graph.clone(),
        seed: manifest.seed,
        topics: topics.cloned().collect(),
        notes,
    }
}
