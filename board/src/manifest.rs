//! The board's table of contents: which topics there are, what their messages look like, who publishes and who reads them.
//!
//! The launcher writes it before any service lives. With it, any tool can read every topic, also those of services it never heard of.

use crate::place::Place;
use crate::private::{self, Version, version};
use messages::{Description, elements_offset};
use serde::{Deserialize, Serialize};
use std::io;

const FILE: &str = "board.json";
/// Elements that a message has room for where nobody says how many it takes.
pub const ELEMENTS: usize = 64;

/// One topic of a board.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// The service that publishes it; `None` when messages come from outside.
    pub publisher: Option<String>,
    /// The services that read it.
    pub readers: Vec<String>,
    /// How many messages may wait for a reader.
    pub depth: usize,
    /// For messages with elements: for how many there is room from the start. Longer ones get room when they
    /// come, if there is memory.
    #[serde(default = "default_elements")]
    pub elements: usize,
    /// The type of its messages.
    pub message: Description,
}

fn default_elements() -> usize {
    ELEMENTS
}

impl Topic {
    /// Bytes of a message for which there is room from the start.
    pub fn room_bytes(&self) -> usize {
        match &self.message.element {
            Some(element) => elements_offset(self.message.size)
                .saturating_add(self.elements.max(1).saturating_mul(element.size())),
            None => self.message.size,
        }
    }
}

/// The table of contents.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct Manifest {
    /// The graph that the board was made for.
    pub graph: String,
    /// The graph's seed.
    pub seed: u64,
    /// The topics; a topic's place in this list is its number on the switchboard.
    pub topics: Vec<Topic>,
    /// The services.
    pub services: Vec<String>,
    /// The launcher's process.
    pub launcher_pid: u32,
}

impl Manifest {
    /// The number and the entry of a topic.
    pub fn topic(&self, name: &str) -> Option<(u32, &Topic)> {
        let index = self.topics.iter().position(|topic| topic.name == name)?;
        Some((index as u32, &self.topics[index]))
    }

    /// Writes it into the board's folder, whole or not at all.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn write(&self, place: &Place) -> io::Result<()> {
        private::replace(&place.file(FILE), &serde_json::to_vec(self)?)
    }

    /// Tells whether it has changed since.
    pub(crate) fn version(place: &Place) -> Option<Version> {
        version(&place.file(FILE))
    }

    /// Reads that of a board.
    ///
    /// # Errors
    /// When there is no such board, or the file is broken.
    pub fn read(place: &Place) -> io::Result<Self> {
        let path = place.file(FILE);
        let bytes = std::fs::read(&path).map_err(private::at(&path))?;
        serde_json::from_slice(&bytes).map_err(io::Error::from).map_err(private::at(&path))
    }
}
