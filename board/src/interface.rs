//! What a service's binary says of itself, without joining a board.

use messages::Description;
use serde::{Deserialize, Serialize};

/// A service's name and version, taken from its crate by [`about!`](crate::about).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct About {
    /// The crate's name, which is the binary's.
    pub name: &'static str,
    /// The crate's version.
    pub version: &'static str,
    /// What it does, in a sentence.
    pub description: &'static str,
}

/// The [`About`] of the crate in which it is written.
#[macro_export]
macro_rules! about {
    () => {
        $crate::About {
            name: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            description: env!("CARGO_PKG_DESCRIPTION"),
        }
    };
}

/// What a service does with a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// It publishes there.
    Publish,
    /// It reads the newest message.
    Latest,
    /// It reads every message, in order.
    Queue,
}

/// One port of a service.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortDescription {
    /// The topic.
    pub topic: String,
    /// What the service does with it.
    pub direction: Direction,
    /// For readers: whether somebody must publish it.
    pub required: bool,
    /// For readers: how many messages may wait.
    pub depth: usize,
    /// For publishers of messages with elements: for how many there is room from the start.
    #[serde(default)]
    pub elements: usize,
    /// Whether a message there makes the service take a step.
    pub wakes: bool,
    /// The type of its messages.
    pub message: Description,
    /// The fingerprint of the type's layout, in hexadecimal.
    pub fingerprint: String,
}

/// Everything that can be known of a service before it runs: the answer to `--interface`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Interface {
    /// The binary's name.
    pub service: String,
    /// Its version.
    pub version: String,
    /// What it does, in a sentence.
    pub description: String,
    /// Its ports, with the parameters that were given.
    pub ports: Vec<PortDescription>,
    /// The period of its timer in nanoseconds, if it has one.
    pub period_ns: Option<u64>,
    /// JSON schema of its parameters, with docs, ranges and defaults.
    pub parameters: serde_json::Value,
    /// The default parameters.
    pub defaults: serde_json::Value,
}
