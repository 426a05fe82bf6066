//! Reading a recording, whole or cut.

use crate::cdr::MESSAGE_MAX;
use crate::format::{CONTEXT, Context, METADATA, METADATA_END, MISFIT, VERSION, read_misfit, take};
use crate::{Codec, Envelope, Manifest, RecordingError, Topic, codecs, records};
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, VecDeque};
use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};
use zerocopy::IntoBytes as _;

/// The largest chunk that is believed, packed or not, and the most that its messages take in memory: ours
/// have 1 MiB, or one message that is larger.
const CHUNK_MAX: u64 = MESSAGE_MAX as u64;
/// Messages of one chunk: as many as of the shortest fit into one of ours, ten times over.
const CHUNK_MESSAGES_MAX: usize = 250_000;
/// A recording that would unpack to more than this, and to more than so many times its size, is refused: it
/// would keep a reader busy for ever. What a robot says shrinks to a tenth; where it says the same map again
/// and again, to a hundredth.
const UNPACKED_MAX: u64 = 1 << 30;
const UNPACKED_TIMES_MAX: u64 = 400;
/// The largest table of contents or note that is believed.
const METADATA_MAX: u64 = 16 << 20;
/// What is read ahead where chunks overlap in time, in bytes and messages: ours overlap by one.
const AHEAD_MAX: usize = 256 << 20;
const AHEAD_MESSAGES_MAX: usize = 1_000_000;
/// Opcode and length.
const HEAD: u64 = 9;
/// Of a chunk's head: two stamps, the unpacked size, its checksum.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4;

/// A recording that is open for reading. Opening reads the table of contents and the places of the chunks;
/// messages are read when asked for.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    file: File,
    manifest: Manifest,
    codecs: Vec<Codec>,
    chunks: Vec<ChunkPlace>,
    /// The topic of each channel.
    channels: HashMap<u16, usize>,
    complete: bool,
}

/// Where a chunk lies in the file, with its head.
#[derive(Debug, Clone, PartialEq, Eq)]
struct ChunkPlace {
    record: Range<u64>,
    first_stamp_ns: u64,
    last_stamp_ns: u64,
    /// Bytes that it says to unpack to.
    unpacked: u64,
}

/// A message of a recording.
#[derive(Debug, Clone)]
pub struct Message {
    /// The topic's place in the manifest.
    pub topic: usize,
    /// What lay in front of it on the board.
    pub envelope: Envelope,
    memory: Arc<Vec<u64>>,
    range: Range<usize>,
}

impl Message {
    /// The bytes as they lay in memory, aligned to 8, fit for `messages::View`.
    pub fn bytes(&self) -> &[u8] {
        &self.memory.as_bytes()[self.range.clone()]
    }
}

impl Recording {
    /// Opens a recording, also one that was cut or is still being written: it then ends with its last whole
    /// chunk.
    ///
    /// # Errors
    /// When the file cannot be read, is something else, or was cut before its table of contents.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let io = || RecordingError::io(path);
        let not = |why: &str| RecordingError::NotARecording { path: path.to_owned(), why: why.to_owned() };
        let file = files::open(path, u64::MAX)?;
        let length = file.metadata().map_err(io())?.len();
        let mut magic = [0; 8];
        if length < 8 {
            return Err(not("it is too short"));
        }
        file.read_exact_at(&mut magic, 0).map_err(io())?;
        if magic != mcap::MAGIC {
            return Err(not("it does not begin as MCAP does"));
        }
        let mut manifest: Option<Manifest> = None;
        let mut notes = BTreeMap::new();
        let mut chunks = Vec::new();
        let mut complete = false;
        let mut unpacked = 0_u64;
        let mut at = 8;
        let mut heads = Heads::new(&file, length);
        while let Some((opcode, record)) = heads.record_at(at).map_err(io())? {
            at = record.end;
            match opcode {
                // A note that is too large is left out.
                op::METADATA if record.end - record.start <= METADATA_MAX => {
                    let body = read_range(&file, record.start + HEAD..record.end).map_err(io())?;
                    let Some(Record::Metadata(metadata)) = records::parse(opcode, &body) else { continue };
                    if metadata.name == METADATA {
                        manifest = Some(parse_manifest(&metadata.metadata).map_err(|why| not(&why))?);
                    } else if metadata.name == METADATA_END {
                        notes = metadata.metadata;
                    }
                }
                op::CHUNK => {
                    let mut head = [0; CHUNK_HEAD];
                    if record.end - record.start < HEAD + CHUNK_HEAD as u64 {
                        break;
                    }
                    file.read_exact_at(&mut head, record.start + HEAD).map_err(io())?;
                    let number =
                        |at: usize| head[at..].first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
                    let chunk = ChunkPlace {
                        record,
                        first_stamp_ns: number(0),
                        last_stamp_ns: number(8),
                        unpacked: number(16),
                    };
                    unpacked = unpacked.saturating_add(chunk.unpacked.min(CHUNK_MAX));
                    chunks.push(chunk);
                }
                op::DATA_END => {
                    complete = true;
                    break;
                }
                _ => {}
            }
        }
        let unpacked_max = UNPACKED_MAX.max(length.saturating_mul(UNPACKED_TIMES_MAX));
        if unpacked > unpacked_max {
            let (what, count) = ("bytes that it would unpack to", unpacked);
            return Err(RecordingError::TooMuch { path: path.to_owned(), what, count, limit: unpacked_max });
        }
        let Some(mut manifest) = manifest else {
            return Err(not(
                "it has no table of contents of ours; it was made by another tool, or cut at its very beginning",
            ));
        };
        manifest.notes.append(&mut notes);
        let codecs = codecs(path, &manifest)?;
        let mut recording = Self {
            path: path.to_owned(),
            file,
            manifest,
            codecs,
            chunks,
            channels: HashMap::new(),
            complete,
        };
        // Ours have all channels in the first chunk. Should it be damaged, its channels are those that we
        // would have written.
        recording.channels =
            (0..recording.manifest.topics.len()).map(|topic| ((topic + 1) as u16, topic)).collect();
        if let Some(first) = recording.chunks.first() {
            let mut found = HashMap::new();
            let _ = recording.each_record(first, |opcode, body| {
                if let (op::CHANNEL, Some(Record::Channel(channel))) = (opcode, records::parse(opcode, body))
                    && let Some((topic, _)) = recording.manifest.topic(channel.topic.trim_start_matches('/'))
                {
                    found.insert(channel.id, topic);
                }
            });
            recording.channels.extend(found);
        }
        Ok(recording)
    }

    /// What it is a recording of.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Its topics; a message names its topic by the place in this list.
    pub fn topics(&self) -> &[Topic] {
        &self.manifest.topics
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the recorder has ended in order; otherwise the recording was cut.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// When its first and its last message were published, in nanoseconds of the board's clock, as the heads
    /// of its chunks have it; `None` without a chunk. Where it was cut, the second is when.
    pub fn span_ns(&self) -> Option<(u64, u64)> {
        // Chunks without a message, as the first is, say nought.
        let said = || self.chunks.iter().filter(|chunk| chunk.last_stamp_ns > 0);
        let first = said().map(|chunk| chunk.first_stamp_ns).min();
        let last = said().map(|chunk| chunk.last_stamp_ns).max();
        let nothing = (!self.chunks.is_empty()).then_some((0, 0));
        first.zip(last).map(|(first, last)| (first, last.max(first))).or(nothing)
    }

    /// The messages of the wanted topics as they were recorded: each topic's in order, the topics interleaved
    /// as they came.
    pub fn as_recorded(&self, wanted: impl Fn(&Topic) -> bool) -> Messages<'_> {
        self.messages(self.ranks(wanted), false)
    }

    /// The messages of the wanted topics ordered by (stamp, round, topic, sequence). Only chunks that overlap
    /// are in memory at once.
    pub fn in_order(&self, wanted: impl Fn(&Topic) -> bool) -> Messages<'_> {
        self.messages(self.ranks(wanted), true)
    }

    fn ranks(&self, wanted: impl Fn(&Topic) -> bool) -> Vec<Option<usize>> {
        self.topics().iter().enumerate().map(|(index, topic)| wanted(topic).then_some(index)).collect()
    }

    /// Ordered with the topics' own ranks; `None` leaves a topic out.
    pub(crate) fn messages(&self, ranks: Vec<Option<usize>>, ordered: bool) -> Messages<'_> {
        let mut chunks: Vec<&ChunkPlace> = self.chunks.iter().collect();
        if ordered {
            chunks.sort_by_key(|chunk| chunk.first_stamp_ns);
        }
        Messages {
            recording: self,
            ranks,
            ordered,
            chunks: chunks.into(),
            channels: self.channels.clone(),
            waiting: BinaryHeap::new(),
            queue: VecDeque::new(),
            ahead: Vec::new(),
            read: 0,
        }
    }

    fn too_much(&self, what: &'static str, count: u64, limit: u64) -> RecordingError {
        RecordingError::TooMuch { path: self.path.clone(), what, count, limit }
    }

    /// Gives every record of a chunk to `f`.
    fn each_record(&self, chunk: &ChunkPlace, mut f: impl FnMut(u8, &[u8])) -> Result<(), RecordingError> {
        let packed = chunk.record.end - chunk.record.start;
        if packed.max(chunk.unpacked) > CHUNK_MAX {
            let count = packed.max(chunk.unpacked);
            return Err(self.too_much("bytes of a chunk", count, CHUNK_MAX));
        }
        let bytes = read_range(&self.file, chunk.record.clone()).map_err(RecordingError::io(&self.path))?;
        if !records::chunk_has_true_lengths(&bytes, HEAD as usize + CHUNK_HEAD) {
            return Err(RecordingError::mcap(&self.path)(mcap::McapError::UnexpectedEof));
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            // Nothing of a damaged chunk is believed.
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(CHUNK_MAX as usize);
        let mut reader = LinearReader::new_with_options(options);
        let mut rest = bytes.as_slice();
        while let Some(event) = reader.next_event() {
            match event.map_err(RecordingError::mcap(&self.path))? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let (part, after) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(part.len()).copy_from_slice(part);
                    reader.notify_read(part.len());
                    rest = after;
                }
                LinearReadEvent::Record { data, opcode } => f(opcode, data),
            }
        }
        Ok(())
    }
}

/// The messages of a recording, one by one. A damaged chunk gives one error, and the next message is that of
/// the next chunk.
#[derive(Debug)]
pub struct Messages<'a> {
    recording: &'a Recording,
    ranks: Vec<Option<usize>>,
    ordered: bool,
    chunks: VecDeque<&'a ChunkPlace>,
    channels: HashMap<u16, usize>,
    /// Read ahead, when ordered.
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// Read ahead, as recorded.
    queue: VecDeque<Message>,
    /// The memory of chunks that were read, as long as messages of theirs are wanted.
    ahead: Vec<Weak<Vec<u64>>>,
    /// Messages read so far: among equals the one recorded first comes first.
    read: u64,
}

/// A message in the order of logical time.
#[derive(Debug)]
struct Waiting {
    key: Key,
    message: Message,
}

/// Stamp, round, the topic's rank, sequence, place in the file.
pub(crate) type Key = (u64, u32, usize, u64, u64);

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<Message, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let first_ns = self.waiting.peek().map(|Reverse(waiting)| waiting.key.0);
            let may_come_earlier = self
                .chunks
                .front()
                .is_some_and(|chunk| first_ns.is_none_or(|first| chunk.first_stamp_ns <= first));
            let must_read = if self.ordered { may_come_earlier } else { self.queue.is_empty() };
            match self.chunks.front().copied().filter(|_| must_read) {
                Some(chunk) => {
                    self.chunks.pop_front();
                    if let Err(error) = self.check_ahead().and_then(|()| self.load(chunk)) {
                        return Some(Err(error));
                    }
                }
                None if self.ordered => {
                    return self.waiting.pop().map(|Reverse(waiting)| Ok(waiting.message));
                }
                None => return self.queue.pop_front().map(Ok),
            }
        }
    }
}

impl Messages<'_> {
    /// Refuses to hold more and more chunks that all claim to be of one time.
    fn check_ahead(&mut self) -> Result<(), RecordingError> {
        self.ahead.retain(|memory| memory.strong_count() > 0);
        let bytes: usize = self.ahead.iter().filter_map(Weak::upgrade).map(|memory| 8 * memory.len()).sum();
        let messages = self.waiting.len();
        let found = if bytes > AHEAD_MAX {
            self.recording.too_much("bytes of chunks that overlap in time", bytes as u64, AHEAD_MAX as u64)
        } else if messages > AHEAD_MESSAGES_MAX {
            let limit = AHEAD_MESSAGES_MAX as u64;
            self.recording.too_much("messages of chunks that overlap in time", messages as u64, limit)
        } else {
            return Ok(());
        };
        // What was read so far is still given, and nothing after it.
        self.chunks.clear();
        Err(found)
    }

    fn load(&mut self, chunk: &ChunkPlace) -> Result<(), RecordingError> {
        let recording = self.recording;
        let mut loaded: Vec<(usize, Envelope, Range<usize>)> = Vec::new();
        let mut arena: Vec<u8> = Vec::new();
        let mut contexts: HashMap<u16, Context> = HashMap::new();
        let mut misfit = None;
        let mut too_much = None;
        let mut add =
            |channel: u16, channels: &HashMap<u16, usize>, envelope: Envelope, body: &[u8], is_cdr: bool| {
                // Messages may be larger in memory than on the wire, and chunks hold any number of them.
                if arena.len() as u64 > CHUNK_MAX || loaded.len() >= CHUNK_MESSAGES_MAX {
                    let (count, limit) = (loaded.len() as u64, CHUNK_MESSAGES_MAX as u64);
                    too_much.get_or_insert_with(|| match loaded.len() < CHUNK_MESSAGES_MAX {
                        true => {
                            recording.too_much("bytes of a chunk's messages", arena.len() as u64, CHUNK_MAX)
                        }
                        false => recording.too_much("messages of a chunk", count, limit),
                    });
                    return;
                }
                let Some(&topic) = channels.get(&channel) else { return };
                if self.ranks.get(topic).copied().flatten().is_none() {
                    return;
                }
                arena.resize(arena.len().next_multiple_of(8), 0);
                let begin = arena.len();
                if !is_cdr {
                    arena.extend_from_slice(body);
                } else if recording.codecs[topic].decode(body, &mut arena).is_err() {
                    arena.truncate(begin);
                    let topic = &recording.manifest.topics[topic];
                    misfit.get_or_insert(RecordingError::Misfit {
                        path: recording.path.clone(),
                        topic: topic.name.clone(),
                        message: topic.message.name.clone(),
                        sequence: envelope.sequence,
                        bytes: body.len(),
                    });
                    return;
                }
                loaded.push((topic, envelope, begin..arena.len()));
            };
        let channels = &mut self.channels;
        recording.each_record(chunk, |opcode, mut body| match opcode {
            op::MESSAGE => {
                let Some((channel, sequence, log_time, publish_time)) = message_head(&mut body) else {
                    return;
                };
                let context = contexts.get(&channel).copied().unwrap_or_default();
                add(channel, channels, context.envelope(log_time, publish_time, sequence), body, true);
            }
            CONTEXT => contexts.extend(Context::read(body)),
            MISFIT => {
                if let Some((channel, envelope, bytes)) = read_misfit(body) {
                    add(channel, channels, envelope, bytes, false);
                }
            }
            op::CHANNEL => {
                if let Some(Record::Channel(channel)) = records::parse(opcode, body)
                    && let Some((topic, _)) = recording.manifest.topic(channel.topic.trim_start_matches('/'))
                {
                    channels.insert(channel.id, topic);
                }
            }
            _ => {}
        })?;
        if let Some(too_much) = too_much {
            return Err(too_much);
        }
        let mut words = vec![0_u64; arena.len().div_ceil(8)];
        words.as_mut_bytes()[..arena.len()].copy_from_slice(&arena);
        drop(arena);
        let memory = Arc::new(words);
        if self.ordered {
            self.ahead.push(Arc::downgrade(&memory));
        }
        for (topic, envelope, range) in loaded {
            let message = Message { topic, envelope, memory: Arc::clone(&memory), range };
            self.read += 1;
            if self.ordered {
                let rank = self.ranks[topic].unwrap_or(topic);
                let key = (envelope.stamp_ns, envelope.round, rank, envelope.sequence, self.read);
                self.waiting.push(Reverse(Waiting { key, message }));
            } else {
                self.queue.push_back(message);
            }
        }
        misfit.map_or(Ok(()), Err)
    }
}

fn parse_manifest(metadata: &BTreeMap<String, String>) -> Result<Manifest, String> {
    match metadata.get("version") {
        Some(version) if version == VERSION => {}
        Some(version) => {
            return Err(format!(
                "its table of contents is of version {version}; this program reads {VERSION}"
            ));
        }
        None => return Err("its table of contents has no version".to_owned()),
    }
    let json = metadata.get("manifest").ok_or("its table of contents is empty")?;
    serde_json::from_str(json).map_err(|error| format!("its table of contents cannot be read: {error}"))
}

/// Channel, sequence, log time and publish time; the data are left.
fn message_head(body: &mut &[u8]) -> Option<(u16, u32, u64, u64)> {
    Some((
        u16::from_le_bytes(take(body)?),
        u32::from_le_bytes(take(body)?),
        u64::from_le_bytes(take(body)?),
        u64::from_le_bytes(take(body)?),
    ))
}

/// Reads the heads of records, many of them at once: most records are short.
struct Heads<'a> {
    file: &'a File,
    length: u64,
    block: Vec<u8>,
    /// Where in the file the block begins.
    begin: u64,
}

impl<'a> Heads<'a> {
    const BLOCK: u64 = 64 * 1024;

    fn new(file: &'a File, length: u64) -> Self {
        Self { file, length, block: Vec::new(), begin: 0 }
    }

    /// The record that begins at `at`, if it is whole.
    fn record_at(&mut self, at: u64) -> std::io::Result<Option<(u8, Range<u64>)>> {
        if self.length.saturating_sub(at) < HEAD {
            return Ok(None);
        }
        let is_here = at >= self.begin && at + HEAD <= self.begin + self.block.len() as u64;
        if !is_here {
            self.block.resize((self.length - at).min(Self::BLOCK) as usize, 0);
            self.file.read_exact_at(&mut self.block, at)?;
            self.begin = at;
        }
        let head = &self.block[(at - self.begin) as usize..];
        let mut rest = &head[1..];
        let body = take(&mut rest).map_or(0, u64::from_le_bytes);
        let end = at.saturating_add(HEAD).saturating_add(body);
        Ok((end <= self.length).then_some((head[0], at..end)))
    }
}

fn read_range(file: &File, range: Range<u64>) -> std::io::Result<Vec<u8>> {
    let mut bytes = vec![0; (range.end - range.start) as usize];
    file.read_exact_at(&mut bytes, range.start)?;
    Ok(bytes)
}
