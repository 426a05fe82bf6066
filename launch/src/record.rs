//! `launch up --record` in host time: a thread of the launcher that reads every topic beside the services.

use crate::graph::Checked;
use crate::observer::{Observer, ObserverError};
use crate::run::Pace;
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
    file: PathBuf,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), ObserverError>>>,
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
        let (place, graph, path) = (place.clone(), graph.clone(), file.to_owned());
        let file = path.clone();
        let end = Arc::clone(&ending);
        let thread = std::thread::Builder::new()
            .name("record".to_owned())
            .spawn(move || record(place, &graph, file, &end))?;
        Ok(Self { file: path, ending, thread: Some(thread) })
    }

    /// Where it goes.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// What keeps it from going on; said once, at once.
    pub(crate) fn trouble(&mut self) -> Option<String> {
        self.thread.as_ref().filter(|thread| thread.is_finished())?;
        let ended = self.thread.take()?.join();
        Some(match ended {
            Ok(Ok(())) => "it has ended".to_owned(),
            Ok(Err(error)) => error.to_string(),
            Err(_) => "its thread has panicked".to_owned(),
        })
    }

    /// Ends it.
    ///
    /// # Errors
    /// When it could not be written.
    pub(crate) fn end(mut self) -> Result<(), ObserverError> {
        self.ending.store(true, Ordering::Release);
        match self.thread.take() {
            Some(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // It was said when it happened; the run has failed all the same.
            None => Err(ObserverError::BrokenOff { file: self.file }),
        }
    }
}

fn record(place: Place, graph: &Checked, file: PathBuf, ending: &AtomicBool) -> Result<(), ObserverError> {
    let pace = Pace { record: Some(file), ..Pace::default() };
    let mut observer = Observer::new(Tap::join(place, "record")?, graph, &pace)?;
    while !ending.load(Ordering::Acquire) {
        observer.look_and_rest(LOOK)?;
        observer.follow()?;
        observer.tick(clock::monotonic())?;
    }
    observer.look()?;
    Ok(observer.finish(None)?)
}
