//! A graph that is in order: what is started from it, kept of it, and drawn.

use super::faults::Fault;
use super::file::Overrides;
use super::settings::{LaunchSettings, ViewSettings};
use board::{Direction, Interface};
use messages::Description;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::PathBuf;

/// A graph that can run.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Checked {
    /// The board's name.
    pub(crate) name: String,
    /// The file.
    pub(crate) file: PathBuf,
    /// The working directory of every service.
    pub(crate) folder: PathBuf,
    /// From which all randomness comes.
    pub(crate) seed: u64,
    /// The topic whose `RunSummary` ends the run.
    pub(crate) finish: Option<String>,
    /// What the live view shows.
    pub(crate) view: ViewSettings,
    /// The services, in the order of the file.
    pub(crate) services: Vec<CheckedService>,
    /// The topics, in the order of their names.
    pub(crate) topics: Vec<CheckedTopic>,
    /// What is done to services at logical moments.
    pub(crate) faults: Vec<Fault>,
    /// The graph as text, before the command line changed anything.
    #[serde(skip)]
    pub(crate) text: String,
    /// What the command line changed.
    #[serde(skip)]
    pub(crate) overrides: Overrides,
}

/// A service that can run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct CheckedService {
    /// Its name in this graph.
    pub(crate) role: String,
    /// The binary as the graph names it.
    pub(crate) run: String,
    /// The binary.
    pub(crate) binary: PathBuf,
    /// All its parameters: its defaults, and over them what the graph gives.
    pub(crate) parameters: Value,
    /// What the launcher does with it.
    pub(crate) launch: LaunchSettings,
    /// What it says of itself with these parameters.
    pub(crate) interface: Interface,
}

/// A topic of the graph.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct CheckedTopic {
    /// Its name.
    pub(crate) name: String,
    /// Who publishes it.
    pub(crate) publisher: Publisher,
    /// Who reads it.
    pub(crate) readers: Vec<Reader>,
    /// The type of its messages.
    pub(crate) message: Description,
    /// The fingerprint of the type's layout, in hexadecimal.
    pub(crate) fingerprint: String,
    /// How many messages the deepest of its ports holds.
    pub(crate) depth: usize,
    /// For messages with elements: for how many there is room from the start.
    #[serde(default)]
    pub(crate) elements: usize,
}

/// Who publishes a topic.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Publisher {
    /// This role.
    Service(String),
    /// A tool, from outside.
    External,
    /// Nobody; all readers can do without it.
    Nobody,
}

impl Publisher {
    /// The service that publishes it, if one does.
    pub(crate) fn role(&self) -> Option<&str> {
        match self {
            Self::Service(role) => Some(role),
            Self::External | Self::Nobody => None,
        }
    }
}

/// A reader of a topic.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Reader {
    /// The role that reads.
    pub(crate) role: String,
    /// The newest message, or every one.
    pub(crate) direction: Direction,
    /// Whether it can do without.
    pub(crate) required: bool,
    /// How many messages may wait for it.
    pub(crate) depth: usize,
    /// Whether a message makes it take a step.
    pub(crate) wakes: bool,
}
