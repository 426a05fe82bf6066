//! What lies around a message, wherever it goes: into shared memory, into a recording, to another program.

use crate::{Description, elements_offset};
use serde::{Deserialize, Serialize};

/// Elements that a message has room for where nobody says how many it takes.
pub const ELEMENTS: usize = 64;

/// The topics on which services show that they live.
const HEALTH: &str = "health/";

/// What is said of a message beside what it says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Envelope {
    /// When it was published, in nanoseconds of the board's clock.
    pub stamp_ns: u64,
    /// When the oldest sensor reading behind it was taken.
    pub origin_ns: u64,
    /// The publisher's count of messages on this topic, beginning with 1.
    pub sequence: u64,
    /// Which start of which publisher; a message of an older generation does not count.
    pub generation: u32,
    /// The round within the logical instant, in lockstep.
    pub round: u32,
}

/// One topic, of a board or of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// The service that publishes it; `None` when messages come from outside.
    pub publisher: Option<String>,
    /// The services that read it.
    #[serde(default)]
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

    /// The role whose process publishes on it; `None` when messages come from outside.
    pub fn role(&self) -> Option<&str> {
        self.publisher.as_deref().or_else(|| health_of(&self.name))
    }

    /// Whether a service shows on it that it lives. What is said there depends on the machine, and is no part
    /// of what a run came to.
    pub fn is_health(&self) -> bool {
        is_health(&self.name)
    }
}

/// Whether a topic of this name is one on which a service shows that it lives.
pub fn is_health(topic: &str) -> bool {
    health_of(topic).is_some()
}

/// The service that shows on this topic that it lives.
pub fn health_of(topic: &str) -> Option<&str> {
    topic.strip_prefix(HEALTH)
}

/// The topic on which a service shows that it lives.
pub fn health_topic(service: &str) -> String {
    format!("{HEALTH}{service}")
}
