//! The board's table of contents: which topics there are, what their messages look like, who publishes and who reads them.
//!
//! The launcher writes it before any service lives. With it, any tool can read every topic, also those of services it never heard of.

use crate::place::Place;
use crate::private::{self, Version, version};
pub use messages::Topic;
use serde::{Deserialize, Serialize};
use std::io;

const FILE: &str = "board.json";
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
