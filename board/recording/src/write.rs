//! Writing a recording.

use crate::format::{CONTEXT, Context, METADATA, METADATA_END, MISFIT, VERSION, write_misfit};
use crate::{Codec, Envelope, Manifest, RecordingError, Topic, codec, codecs};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::PrivateRecordOptions;
use messages::Time;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A chunk is closed when it has this many bytes.
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
/// Whatever kills the process, the file opens up to its last closed chunk; [`Recorder::tick`] closes one at
/// least each second.
pub struct Recorder {
    path: PathBuf,
    /// Gone when the recording could not go on.
    writer: Option<mcap::Writer<BufWriter<File>>>,
    file: File,
    manifest: Manifest,
    codecs: Vec<Codec>,
    /// What the present chunk has said of each channel.
    said: Vec<Option<Context>>,
    cdr: Vec<u8>,
    chunk_bytes: usize,
    chunk_since: Option<Time>,
    counts: Counts,
    /// What is in the file for certain: messages, and bytes of the file.
    kept: (u64, u64),
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
        // What a robot has seen is its owner's alone.
        let mut options = File::options();
        let file = options.read(true).write(true).create_new(true).mode(0o600).open(path).map_err(io())?;
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
        writer.write_metadata(&contents(manifest)).map_err(mcap())?;
        for (index, topic) in manifest.topics.iter().enumerate() {
            add_channel(&mut writer, index, topic).map_err(mcap())?;
        }
        writer.flush().map_err(mcap())?;
        let bytes = file.metadata().map_err(io())?.len();
        Ok(Self {
            path: path.to_owned(),
            writer: Some(writer),
            file,
            manifest: manifest.clone(),
            kept: (0, bytes),
            said: vec![None; codecs.len()],
            codecs,
            cdr: Vec::new(),
            chunk_bytes: 0,
            chunk_since: None,
            counts: Counts::default(),
            notes: BTreeMap::new(),
        })
    }

    /// Records a topic that was not there at the beginning, from now on; its place in the manifest, for
    /// [`Recorder::record`].
    ///
    /// # Errors
    /// When the file cannot be written, holds no more topics, or the message type contradicts itself.
    pub fn add_topic(&mut self, topic: &Topic) -> Result<usize, RecordingError> {
        let index = self.manifest.topics.len();
        if index + 1 >= usize::from(u16::MAX) {
            return Err(RecordingError::TooManyTopics { path: self.path.clone(), topics: index + 1 });
        }
        self.codecs.push(codec(&self.path, topic)?);
        self.said.push(None);
        self.manifest.topics.push(topic.clone());
        // A reader takes the last table of contents that it finds. What was recorded so far is whole before
        // it.
        self.flush()?;
        let contents = contents(&self.manifest);
        self.write(|writer| {
            writer.write_metadata(&contents)?;
            add_channel(writer, index, topic)
        })?;
        Ok(index)
    }

    /// Records a message: the topic's place in the manifest, the envelope, and the bytes as they lie in
    /// memory.
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
        let channel_id = channel(topic);
        if codec.encode(bytes, &mut self.cdr).is_ok() {
            let context = Context::of(envelope);
            if self.said[topic] != Some(context) {
                self.said[topic] = Some(context);
                let record = context.write(channel_id);
                self.write(|writer| {
                    writer.write_private_record(
                        CONTEXT,
                        &record,
                        PrivateRecordOptions::IncludeInChunks.into(),
                    )
                })?;
            }
            let header = MessageHeader {
                channel_id,
                sequence: envelope.sequence as u32,
                log_time: envelope.stamp_ns,
                publish_time: envelope.origin_ns,
            };
            let cdr = std::mem::take(&mut self.cdr);
            let written = self.write(|writer| writer.write_to_known_channel(&header, &cdr));
            self.cdr = cdr;
            written?;
        } else {
            let record = write_misfit(channel_id, envelope, bytes);
            self.write(|writer| {
                writer.write_private_record(MISFIT, &record, PrivateRecordOptions::IncludeInChunks.into())
            })?;
            self.counts.misfits += 1;
        }
        self.counts.messages += 1;
        self.counts.bytes += bytes.len() as u64;
        self.chunk_bytes += bytes.len() + 31;
        if self.chunk_bytes >= CHUNK_BYTES { self.flush() } else { Ok(()) }
    }

    /// Closes the present chunk when it is old: to be called a few times a second, also while no message
    /// comes. `now` is any clock that runs on in real time.
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
        self.write(mcap::Writer::flush)?;
        self.kept = (self.counts.messages, self.file_bytes());
        Ok(())
    }

    /// Writes something, or ends the recording where it was whole.
    fn write<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<BufWriter<File>>) -> mcap::McapResult<T>,
    ) -> Result<T, RecordingError> {
        let written = match &mut self.writer {
            Some(writer) => act(writer),
            None => Err(std::io::Error::other("the recording was cut before").into()),
        };
        written.map_err(|cause| self.cut(cause))
    }

    /// Takes back what is only half written, so that the file is one that was cut, and not a damaged one.
    fn cut(&mut self, cause: mcap::McapError) -> RecordingError {
        // Its end would be written behind what is half written.
        drop(self.writer.take());
        let (messages, bytes) = self.kept;
        let _ = self.file.set_len(bytes);
        let cause: Box<dyn std::error::Error + Send + Sync> = match cause {
            mcap::McapError::Io(cause) => Box::new(cause),
            cause => Box::new(cause),
        };
        RecordingError::Cut { path: self.path.clone(), messages, bytes, cause }
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
        self.flush()?;
        let notes = std::mem::take(&mut self.notes);
        let end = Metadata { name: METADATA_END.to_owned(), metadata: notes };
        self.write(|writer| {
            if !end.metadata.is_empty() {
                writer.write_metadata(&end)?;
            }
            writer.finish()
        })?;
        if let Some(writer) = self.writer.take()
            && let Err(error) = writer.into_inner().into_inner()
        {
            return Err(self.cut(error.into_error().into()));
        }
        match self.file.sync_all() {
            Ok(()) => Ok(self.counts),
            Err(error) => Err(self.cut(error.into())),
        }
    }
}

/// The table of contents as it stands in the file.
fn contents(manifest: &Manifest) -> Metadata {
    // Names, numbers and texts, which are always JSON.
    let manifest = serde_json::to_string(manifest).unwrap_or_default();
    let metadata = [("manifest".to_owned(), manifest), ("version".to_owned(), VERSION.to_owned())];
    Metadata { name: METADATA.to_owned(), metadata: metadata.into() }
}

fn add_channel(
    writer: &mut mcap::Writer<BufWriter<File>>,
    index: usize,
    topic: &Topic,
) -> mcap::McapResult<()> {
    let text = topic.message.ros2msg();
    let schema = writer.add_schema(&topic.message.ros2msg_name(), "ros2msg", text.as_bytes())?;
    let about = BTreeMap::from([
        ("publisher".to_owned(), topic.publisher.clone().unwrap_or_default()),
        ("fingerprint".to_owned(), format!("{:016x}", topic.message.fingerprint())),
    ]);
    let topic = format!("/{}", topic.name);
    writer.add_channel_with_id(channel(index), schema, &topic, "cdr", &about).map(|_| ())
}

/// The channel of a topic. Zero is left out, as some readers take it for no channel.
fn channel(topic: usize) -> u16 {
    (topic + 1) as u16
}
