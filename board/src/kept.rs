//! State that outlives a process, kept beside the board and gone with it.

use crate::shared::Shared;
use serde::{Serialize, de::DeserializeOwned};
use std::marker::PhantomData;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::Ordering;

/// A state of a service that its successor takes over: after a crash, or in a swap.
#[derive(Debug)]
pub struct Kept<S> {
    /// The file, and the topic whose generation says who plays the role.
    home: Option<(PathBuf, Rc<Shared>, u32)>,
    last: Vec<u8>,
    marker: PhantomData<S>,
}

impl<S: Serialize + DeserializeOwned> Kept<S> {
    pub(crate) fn new(home: Option<(PathBuf, Rc<Shared>, u32)>) -> Self {
        Self { home, last: Vec::new(), marker: PhantomData }
    }

    /// What the predecessor saved; `None` on the first start, and when it was of another version.
    pub fn restore(&self) -> Option<S> {
        let bytes = std::fs::read(&self.home.as_ref()?.0).ok()?;
        serde_json::from_slice(&bytes)
            .inspect_err(|error| tracing::warn!(%error, "the predecessor's state is of another version and is left out"))
            .ok()
    }

    /// Saves the state, whole or not at all. Nothing is written while it stays the same.
    pub fn save(&mut self, state: &S) {
        let Some((file, shared, health)) = &self.home else { return };
        let playing = shared.switchboard.topic(*health).map(|entry| entry.generation.load(Ordering::Acquire));
        if playing != Some(shared.generation) {
            return;
        }
        let Ok(bytes) = serde_json::to_vec(state) else { return };
        if bytes == self.last {
            return;
        }
        let temporary = file.with_extension("new");
        let written = std::fs::write(&temporary, &bytes).and_then(|()| std::fs::rename(&temporary, file));
        match written {
            Ok(()) => self.last = bytes,
            Err(error) => tracing::warn!(%error, "the state cannot be kept"),
        }
    }
}
