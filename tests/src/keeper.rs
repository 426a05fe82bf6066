//! Keeps a recording of a graph in host time, in a thread of the test; in logical time the launcher does
//! that.

use crate::binaries::target_folder;
use board::place::Place;
use board::tap::Tap;
use messages::Time;
use recording::{Recorder, Recording, RecordingError};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long somebody who wants to see the recording waits for it to be up to date.
const PATIENCE: Duration = Duration::from_secs(2);

/// A thread that records until this is dropped.
pub(crate) struct Keeper {
    thread: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    is_over: AtomicBool,
    /// Looks asked for, and looks done.
    asked: AtomicU32,
    done: AtomicU32,
}

impl Keeper {
    /// Records every topic of the board into this file.
    pub(crate) fn start(place: &Place, file: &Path) -> Self {
        let shared = Arc::new(Shared::default());
        let thread = {
            let (place, file, shared) = (place.clone(), file.to_owned(), Arc::clone(&shared));
            std::thread::spawn(move || {
                // A graph that is not recorded is still tested.
                if let Err(error) = record(place, &file, &shared) {
                    eprintln!("the graph is not recorded: {error}");
                }
                shared.is_over.store(true, Ordering::Release);
            })
        };
        Self { thread: Some(thread), shared }
    }

    /// Brings the recording up to date.
    pub(crate) fn look(&self) {
        let asked = self.shared.asked.fetch_add(1, Ordering::AcqRel) + 1;
        let deadline = board::clock::monotonic().after(PATIENCE);
        while self.shared.done.load(Ordering::Acquire) < asked
            && !self.shared.is_over.load(Ordering::Acquire)
            && board::clock::monotonic() < deadline
        {
            board::clock::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn record(place: Place, file: &Path, shared: &Shared) -> Result<(), Box<dyn std::error::Error>> {
    let tap = Tap::join(place, "keeper")?;
    let topics = &tap.manifest().topics;
    let contents = recording::Manifest {
        graph: tap.manifest().graph.clone(),
        seed: tap.manifest().seed,
        topics: topics.clone(),
        notes: BTreeMap::new(),
    };
    let mut readers = topics.iter().map(|topic| tap.reader(&topic.name)).collect::<Result<Vec<_>, _>>()?;
    let mut recorder = Recorder::new(file, &contents)?;
    loop {
        let (heard, asked) = (tap.bell(), shared.asked.load(Ordering::Acquire));
        let is_over = shared.is_over.load(Ordering::Acquire);
        for (index, reader) in readers.iter_mut().enumerate() {
            while let Some((envelope, bytes)) = reader.next() {
                recorder.record(index, &envelope, bytes)?;
            }
        }
        if shared.done.load(Ordering::Acquire) != asked {
            recorder.flush()?;
            shared.done.store(asked, Ordering::Release);
        }
        recorder.tick(board::clock::monotonic())?;
        if is_over {
            recorder.finish()?;
            return Ok(());
        }
        tap.wait(heard, Duration::from_millis(5));
    }
}

/// Where the recording of a board lies while its graph runs.
pub(crate) fn file(board: &str) -> PathBuf {
    let folder = folder();
    let _ = std::fs::create_dir_all(&folder);
    let file = folder.join(format!("{board}.mcap"));
    // Left by a test of the same process number that was killed.
    let _ = std::fs::remove_file(&file);
    file
}

/// Where the recordings of failed tests are kept.
pub fn folder() -> PathBuf {
    target_folder().join("tmp/failed-graphs")
}

/// The messages of a topic as JSON.
pub(crate) fn messages(file: &Path, topic: &str) -> Result<Vec<(Time, Value)>, RecordingError> {
    let recording = Recording::open(file)?;
    let description = recording.manifest().topic(topic).map(|(_, topic)| topic.message.clone());
    let mut messages = Vec::new();
    for message in recording.as_recorded(|known| known.name == topic) {
        let message = message?;
        let json = description.as_ref().map_or(Value::Null, |known| known.to_json(message.bytes()));
        messages.push((Time::from_nanos(message.envelope.stamp_ns), json));
    }
    Ok(messages)
}
