//! Recordings: every message of a board, written while it runs and read back to the byte.
//!
//! A recording is an MCAP file (<https://mcap.dev/spec>) of profile `ros2`: each topic a channel of encoding
//! `cdr` with a generated `ros2msg` schema, so that the tools of ROS 2 and Foxglove read it. What they do not
//! know lies beside it where they do not look: the table of contents with the descriptions of all messages as
//! metadata, and the rest of the envelope in private records (see [`mod@format`]). The crate knows neither
//! the board nor the clock: moments come in as arguments.
//!
//! ```
//! use messages::{Message as _, RunSummary, View};
//! use recording::{Envelope, Manifest, Recorder, Recording, Topic};
//! use zerocopy::IntoBytes as _;
//!
//! # let folder = tempfile::tempdir()?;
//! let path = folder.path().join("run.mcap");
//! let topic = Topic {
//!     name: "run/summary".to_owned(),
//!     publisher: Some("referee".to_owned()),
//!     readers: Vec::new(),
//!     depth: 1,
//!     elements: 0,
//!     message: RunSummary::description(),
//! };
//! let graph = "coffee".to_owned();
//! let manifest = Manifest { graph, seed: 7, topics: vec![topic], ..Manifest::default() };
//!
//! let mut recorder = Recorder::new(&path, &manifest)?;
//! let envelope = Envelope { stamp_ns: 5_000_000, sequence: 1, ..Envelope::default() };
//! recorder.record(0, &envelope, RunSummary::default().as_bytes())?;
//! recorder.finish()?;
//!
//! let recording = Recording::open(&path)?;
//! for message in recording.in_order(|topic| topic.name == "run/summary") {
//!     let message = message?;
//!     let view: View<'_, RunSummary> = View::parse(message.bytes())?;
//!     println!("{} ns: {:?}", message.envelope.stamp_ns, view.message);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod format;

mod by_topic;
mod cdr;
mod compare;
mod read;
mod records;
mod write;

#[cfg(test)]
mod tests;

pub use by_topic::{FieldDifference, TopicComparison, compare_topics};
pub use cdr::{Codec, InvalidDescription, Misfit};
pub use compare::{Difference, Digest, Digester, first_difference};
pub use read::{Message, Messages, Recording};
pub use write::{Counts, Recorder};

/// The note that says when the recording began, in nanoseconds of the board's clock: older messages lay on
/// the board already.
pub const BEGIN_NOTE: &str = "begin_ns";
/// The note that says how many messages were lost, as a JSON object by topic.
pub const LOST_NOTE: &str = "lost";

pub use messages::{Envelope, Topic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a recording is of: enough to build the board's topics again, and to show every message, without
/// knowing a single type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct Manifest {
    /// The graph that ran.
    pub graph: String,
    /// Its seed.
    pub seed: u64,
    /// The topics; a message names its topic by the place in this list.
    pub topics: Vec<Topic>,
    /// Whatever else is worth keeping: the graph file's text, when it was recorded, messages lost.
    #[serde(default)]
    pub notes: BTreeMap<String, String>,
}

impl Manifest {
    /// The place and the entry of a topic.
    pub fn topic(&self, name: &str) -> Option<(usize, &Topic)> {
        self.topics.iter().enumerate().find(|(_, topic)| topic.name == name)
    }
}

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file is not there, or no plain file.
    #[error(transparent)]
    File(#[from] files::FileError),
    /// The file system.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The recording.
        path: PathBuf,
        /// What the system says.
        #[source]
        cause: std::io::Error,
    },
    /// The file is MCAP, and broken, or cannot be written as MCAP.
    #[error("{}: {cause}", path.display())]
    Mcap {
        /// The recording.
        path: PathBuf,
        /// What is wrong.
        #[source]
        cause: Box<mcap::McapError>,
    },
    /// More than is read of a recording at once.
    #[error("{}: {count} {what} are more than the {limit} that are read", path.display())]
    TooMuch {
        /// The recording.
        path: PathBuf,
        /// What there is too much of.
        what: &'static str,
        /// How much.
        count: u64,
        /// The limit.
        limit: u64,
    },
    /// The file is something else, or was cut before its table of contents.
    #[error("{} is no recording: {why}", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// How that is known.
        why: String,
    },
    /// A message type that cannot be laid out.
    #[error("{}: topic `{topic}`: {cause}", path.display())]
    Description {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// What is wrong with it.
        #[source]
        cause: InvalidDescription,
    },
    /// A message that is not what its topic says.
    #[error("{}: topic `{topic}`: the message {sequence} has {bytes} bytes, which are no `{message}`", path.display())]
    Misfit {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The type it should be.
        message: String,
        /// Which message.
        sequence: u64,
        /// Its bytes.
        bytes: usize,
    },
    /// The recording could not go on.
    #[error(
        "{}: {cause}; the recording ends here, and its first {messages} messages ({bytes} bytes of file) are kept",
        path.display()
    )]
    Cut {
        /// The recording.
        path: PathBuf,
        /// Messages that are in the file.
        messages: u64,
        /// Bytes of the file.
        bytes: u64,
        /// Why.
        #[source]
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A topic number that is not in the manifest.
    #[error("{}: there is no topic {index}; the recording has {topics}", path.display())]
    NoTopic {
        /// The recording.
        path: PathBuf,
        /// The number given.
        index: usize,
        /// How many there are.
        topics: usize,
    },
    /// More topics than the format can number.
    #[error("{}: {topics} topics; a recording holds {}", path.display(), u16::MAX)]
    TooManyTopics {
        /// The recording.
        path: PathBuf,
        /// How many.
        topics: usize,
    },
}

impl RecordingError {
    fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |cause| Self::Io { path, cause }
    }

    fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> Self {
        let path = path.to_owned();
        move |cause| match cause {
            mcap::McapError::Io(cause) => Self::Io { path, cause },
            cause => Self::Mcap { path, cause: Box::new(cause) },
        }
    }
}

/// A board holds 256 topics; a robot's history with all its swaps and shadows a few more.
const TOPICS_MAX: usize = 1024;

fn codecs(path: &Path, manifest: &Manifest) -> Result<Vec<Codec>, RecordingError> {
    if manifest.topics.len() > TOPICS_MAX {
        let (path, count, limit) = (path.to_owned(), manifest.topics.len() as u64, TOPICS_MAX as u64);
        return Err(RecordingError::TooMuch { path, what: "topics", count, limit });
    }
    manifest.topics.iter().map(|topic| codec(path, topic)).collect()
}

fn codec(path: &Path, topic: &Topic) -> Result<Codec, RecordingError> {
    Codec::new(&topic.message).map_err(|cause| RecordingError::Description {
        path: path.to_owned(),
        topic: topic.name.clone(),
        cause,
    })
}
