//! `launch up --record` in host time: a thread of the launcher that reads every topic beside the services.

use crate::graph::Checked;
use crate::lockstep::Pace;
use crate::observer::{Observer, ObserverError};
use board::clock;
use board::place::Place;
use board::tap::Tap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Longest sleep: how soon the end is noticed, and a chunk closed when no message comes.
const LOOK: Duration = Duration::from_millis(50);

/// A recording that goes on until it is ended.
#[derive(Debug)]
pub(crate) struct Recording {
    ending: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), ObserverError>>,
}

impl Recording {
    /// Begins on a board that is there already, whose services need not be.
    ///
    /// # Errors
    /// When there is a file of this name, which might be somebody's only recording.
    pub(crate) fn begin(place: &Place, graph: &Checked, file: &Path) -> std::io::Result<Self> {
        if file.exists() {
            let words = format!("{} exists; give the recording another name", file.display());
            return Err(std::io::Error::new(std::io::ErrorKind::AlreadyExists, words));
        }
        let ending = Arc::new(AtomicBool::new(false));
        let (place, graph, file) = (place.clone(), graph.clone(), file.to_owned());
        let end = Arc::clone(&ending);
        let thread = std::thread::Builder::new()
            .name("record".to_owned())
            .spawn(move || record(place, &graph, file, &end))?;
        Ok(Self { ending, thread })
    }

    /// Ends it.
    ///
    /// # Errors
    /// When it could not be written.
    pub(crate) fn end(self) -> Result<(), ObserverError> {
        self.ending.store(true, Ordering::Release);
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

fn record(place: Place, graph: &Checked, file: PathBuf, ending: &AtomicBool) -> Result<(), ObserverError> {
    let pace = Pace { record: Some(file), ..Pace::default() };
    let mut observer = Observer::new(Tap::join(place, "record")?, graph, &pace)?;
    while !ending.load(Ordering::Acquire) {
        observer.look_and_rest(LOOK)?;
        observer.tick(clock::monotonic())?;
    }
    observer.look()?;
    Ok(observer.finish(None)?)
}
