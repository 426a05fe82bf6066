//! Writing a recording.

use crate::format::{CONTEXT, Context, METADATA, METADATA_END, MISFIT, VERSION, write_misfit};
use crate::{Codec, Envelope, Manifest, RecordingError, codecs};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::PrivateRecordOptions;
use messages::Time;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A chunk is closed when it has so many bytes.
const CHUNK_BYTES: usize = 1 << 20;
/// A chunk is closed when it is so old: more than this is never lost.
const CHUNK_AGE: Duration = Duration::from_millis(900);
/// zstd's fastest regular level: the next ones save a tenth of the file and cost twice the time.
const LEVEL: u32 = 1;

/// What was recorded so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Messages in all.
    pub messages: u64,
    /// Messages that did not fit their type; they are in the file for our own reader alone.
    pub misfits: u64,
    /// Bytes of messages, as they lay in memory.
    pub bytes: u64,
}

/// Writes a recording while the board runs.
///
/// Whatever kills the process, the file opens up to its last closed chunk; [`Recorder::tick`] closes one at least each second.
pub struct Recorder {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    file: File,
    codecs: Vec<Codec>,
    /// What the present chunk has said of each channel.
    said: Vec<Option<Context>>,
    cdr: Vec<u8>,
    chunk_bytes: usize,
    chunk_since: Option<Time>,
    counts: Counts,
    notes: BTreeMap<String, String>,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder")
            .field("path", &self.path)
            .field("counts", &self.counts)
            .finish_non_exhaustive()
    }
}

impl Recorder {
    /// Begins a recording of these topics. An existing file is never overwritten.
    ///
    /// # Errors
    /// When the file exists or cannot be written, and for a message type that contradicts itself.
    pub fn new(path: &Path, manifest: &Manifest) -> Result<Self, RecordingError> {
        if manifest.topics.len() >= usize::from(u16::MAX) {
            return Err(RecordingError::TooManyTopics {
                path: path.to_owned(),
                topics: manifest.topics.len(),
            });
        }
        let codecs = codecs(path, manifest)?;
        let io = || RecordingError::io(path);
        let mcap = || RecordingError::mcap(path);
        let file = File::create_new(path).map_err(io())?;
        let writer = BufWriter::new(file.try_clone().map_err(io())?);
        let mut writer = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("corkboard ", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(LEVEL)
            .compression_threads(0)
            // We close chunks ourselves, and a chunk goes to the file whole.
            .chunk_size(None)
            .disable_seeking(true)
            .create(writer)
            .map_err(mcap())?;
        let manifest_json = serde_json::to_string(manifest).map_err(|error| io()(error.into()))?;
        let metadata = [("manifest".to_owned(), manifest_json), ("version".to_owned(), VERSION.to_owned())];
        writer
            .write_metadata(&Metadata { name: METADATA.to_owned(), metadata: metadata.into() })
            .map_err(mcap())?;
        for (index, topic) in manifest.topics.iter().enumerate() {
            let name = topic.message.ros2msg_name();
            let text = topic.message.ros2msg();
            let schema = writer.add_schema(&name, "ros2msg", text.as_bytes()).map_err(mcap())?;
            let about = BTreeMap::from([
                ("publisher".to_owned(), topic.publisher.clone().unwrap_or_default()),
                ("fingerprint".to_owned(), format!("{:016x}", topic.message.fingerprint())),
            ]);
            writer
                .add_channel_with_id(channel(index), schema, &format!("/{}", topic.name), "cdr", &about)
                .map_err(mcap())?;
        }
        writer.flush().map_err(mcap())?;
        Ok(Self {
            path: path.to_owned(),
            writer,
            file,
            said: vec![None; codecs.len()],
            codecs,
            cdr: Vec::new(),
            chunk_bytes: 0,
            chunk_since: None,
            counts: Counts::default(),
            notes: BTreeMap::new(),
        })
    }

    /// Records a message: the topic's place in the manifest, the envelope, and the bytes as they lie in memory.
    ///
    /// # Errors
    /// When the file cannot be written, or there is no such topic.
    pub fn record(&mut self, topic: usize, envelope: &Envelope, bytes: &[u8]) -> Result<(), RecordingError> {
        let Some(codec) = self.codecs.get(topic) else {
            return Err(RecordingError::NoTopic {
                path: self.path.clone(),
                index: topic,
                topics: self.codecs.len(),
            });
        };
        let fail = |cause| RecordingError::mcap(&self.path)(cause);
        let channel_id = channel(topic);
        if codec.encode(bytes, &mut self.cdr).is_ok() {
            let context = Context::of(envelope);
            if self.said[topic] != Some(context) {
                self.said[topic] = Some(context);
                let record = context.write(channel_id);
                self.writer
                    .write_private_record(CONTEXT, &record, PrivateRecordOptions::IncludeInChunks.into())
                    .map_err(fail)?;
            }
            let header = MessageHeader {
                channel_id,
                sequence: envelope.sequence as u32,
                log_time: envelope.stamp_ns,
                publish_time: envelope.origin_ns,
            };
            self.writer.write_to_known_channel(&header, &self.cdr).map_err(fail)?;
        } else {
            let record = write_misfit(channel_id, envelope, bytes);
            self.writer
                .write_private_record(MISFIT, &record, PrivateRecordOptions::IncludeInChunks.into())
                .map_err(fail)?;
            self.counts.misfits += 1;
        }
        self.counts.messages += 1;
        self.counts.bytes += bytes.len() as u64;
        self.chunk_bytes += bytes.len() + 31;
        if self.chunk_bytes >= CHUNK_BYTES { self.flush() } else { Ok(()) }
    }

    /// Closes the present chunk when it is old: to be called a few times a second, also while no message comes. `now` is any clock that runs on
    /// in real time.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn tick(&mut self, now: Time) -> Result<(), RecordingError> {
        if self.chunk_bytes == 0 {
            return Ok(());
        }
        let since = *self.chunk_since.get_or_insert(now);
        if now.since(since) >= CHUNK_AGE { self.flush() } else { Ok(()) }
    }

    /// Closes the present chunk: what was recorded so far is in the file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.said.fill(None);
        self.chunk_bytes = 0;
        self.chunk_since = None;
        self.writer.flush().map_err(RecordingError::mcap(&self.path))
    }

    /// Keeps a word for the end of the file, such as how many messages were lost; see [`Manifest::notes`].
    pub fn note(&mut self, key: &str, text: &str) {
        self.notes.insert(key.to_owned(), text.to_owned());
    }

    /// What was recorded so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The file's size at present.
    pub fn file_bytes(&self) -> u64 {
        self.file.metadata().map_or(0, |metadata| metadata.len())
    }

    /// Ends the recording and sees it to the disk.
    ///
    /// # Errors
    /// When the file cannot be written; it opens up to its last closed chunk all the same.
    pub fn finish(mut self) -> Result<Counts, RecordingError> {
        let mcap = || RecordingError::mcap(&self.path);
        if !self.notes.is_empty() {
            let metadata =
                Metadata { name: METADATA_END.to_owned(), metadata: std::mem::take(&mut self.notes) };
            self.writer.write_metadata(&metadata).map_err(mcap())?;
        }
        self.writer.finish().map_err(mcap())?;
        let io = || RecordingError::io(&self.path);
        self.writer.into_inner().into_inner().map_err(|error| io()(error.into_error()))?;
        self.file.sync_all().map_err(io())?;
        Ok(self.counts)
    }
}

/// The channel of a topic. Zero is left out, which some readers take for none.
fn channel(topic: usize) -> u16 {
    (topic + 1) as u16
}
