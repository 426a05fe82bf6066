//! Whether two runs were the same: a digest for yes or no, and the first difference for where.

use crate::{Envelope, Message, Recording, RecordingError, Topic};
use blake3::Hasher;
use messages::{Description, Kind, Time, elements_offset, is_health};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A hash over all messages of a run, topic by topic in their order: equal for equal runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Digest {
    /// Over all topics.
    pub digest: String,
    /// Messages in all.
    pub messages: u64,
    /// Topic by topic: count and hash.
    pub topics: BTreeMap<String, (u64, String)>,
}

/// Computes a [`Digest`] from messages as they come.
///
/// It covers stamp, origin, sequence, round and bytes; not the generation, since a run may restart services,
/// and not the topics of the services' health.
#[derive(Debug)]
pub struct Digester {
    topics: Vec<(String, Hasher, u64)>,
}

impl Digester {
    /// A digest of these topics, in this order.
    pub fn new<'a>(topics: impl IntoIterator<Item = &'a str>) -> Self {
        Self { topics: topics.into_iter().map(|name| (name.to_owned(), Hasher::new(), 0)).collect() }
    }

    /// Takes in a message of the topic with this number.
    pub fn add(&mut self, topic: usize, envelope: &Envelope, bytes: &[u8]) {
        let Some((_, hasher, count)) = self.topics.get_mut(topic) else { return };
        let mut head = [0; 28];
        head[..8].copy_from_slice(&envelope.stamp_ns.to_le_bytes());
        head[8..16].copy_from_slice(&envelope.origin_ns.to_le_bytes());
        head[16..24].copy_from_slice(&envelope.sequence.to_le_bytes());
        head[24..].copy_from_slice(&envelope.round.to_le_bytes());
        hasher.update(&head).update(bytes);
        *count += 1;
    }

    /// The digest of what was taken in so far.
    pub fn digest(&self) -> Digest {
        let mut whole = Hasher::new();
        let mut topics = BTreeMap::new();
        for (name, hasher, count) in self.topics.iter().filter(|(name, ..)| !is_health(name)) {
            let hash = hasher.finalize();
            whole.update(name.as_bytes()).update(hash.as_bytes());
            topics.insert(name.clone(), (*count, short(&hash)));
        }
        let messages = topics.values().map(|(count, _)| count).sum();
        Digest { digest: short(&whole.finalize()), messages, topics }
    }
}

impl Recording {
    /// The digest of the recorded run; the same as that of the run itself when every topic was recorded and
    /// nothing was lost.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn digest(&self) -> Result<Digest, RecordingError> {
        let mut digester = Digester::new(self.topics().iter().map(|topic| topic.name.as_str()));
        for message in self.as_recorded(|topic| !topic.is_health()) {
            let message = message?;
            digester.add(message.topic, &message.envelope, message.bytes());
        }
        Ok(digester.digest())
    }
}

impl Recording {
    /// How far a recording goes that was cut: the latest stamp in it, zero when it has no message; `None` for
    /// one that is complete.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn cut_at(&self) -> Result<Option<Time>, RecordingError> {
        if self.is_complete() {
            return Ok(None);
        }
        let mut last_ns = 0;
        for message in self.as_recorded(|_| true) {
            last_ns = last_ns.max(message?.envelope.stamp_ns);
        }
        Ok(Some(Time::from_nanos(last_ns)))
    }
}

/// Where two runs first differ in logical time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The topic.
    pub topic: String,
    /// The logical time, in nanoseconds.
    pub stamp_ns: u64,
    /// The round within the instant.
    pub round: u32,
    /// The publisher's count of messages.
    pub sequence: u64,
    /// The field by its path (`anchors[3].range_m`), or what else differs: `stamp_ns`, `origin_ns`,
    /// `sequence`, `round`, `layout`, `elements` (their number), `message` (one of the runs has none).
    pub field: String,
    /// Its value in the first run; null when there is none.
    pub a: Value,
    /// Its value in the second.
    pub b: Value,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { topic, stamp_ns, round, sequence, field, a, b } = self;
        let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        write!(
            f,
            "`{topic}` at {seconds}.{nanos:09} s (round {round}, message {sequence}): `{field}` is {a} in the first and {b} in the second"
        )
    }
}

/// The first difference between two recordings in logical time, over the topics that both have; `None` when
/// there is none.
///
/// # Errors
/// When a file is damaged.
pub fn first_difference(a: &Recording, b: &Recording) -> Result<Option<Difference>, RecordingError> {
    // A topic has the same rank in both, whatever its place in the manifests.
    let rank = |name: &str| {
        let common = !is_health(name) && b.manifest().topic(name).is_some();
        a.manifest().topic(name).filter(|_| common).map(|(index, _)| index)
    };
    let ranks = |recording: &Recording| recording.topics().iter().map(|topic| rank(&topic.name)).collect();
    for topic in a.topics() {
        if let Some((_, other)) = b.manifest().topic(&topic.name).filter(|_| rank(&topic.name).is_some())
            && let Some(difference) = layout_difference(topic, other)
        {
            return Ok(Some(difference));
        }
    }
    let (mut ours, mut theirs) = (a.messages(ranks(a), true), b.messages(ranks(b), true));
    loop {
        let (left, right) = (ours.next().transpose()?, theirs.next().transpose()?);
        let key = |recording: &Recording, message: &Message| {
            let Envelope { stamp_ns, round, sequence, .. } = message.envelope;
            (stamp_ns, round, rank(&recording.topics()[message.topic].name), sequence)
        };
        let found = match (&left, &right) {
            (None, None) => return Ok(None),
            (Some(left), None) => Some(missing(a, left, true)),
            (None, Some(right)) => Some(missing(b, right, false)),
            (Some(left), Some(right)) => {
                let (before, after) = (key(a, left), key(b, right));
                if before.2 == after.2 {
                    difference(a, left, right)
                } else if before < after {
                    Some(missing(a, left, true))
                } else {
                    Some(missing(b, right, false))
                }
            }
        };
        if found.is_some() {
            return Ok(found);
        }
    }
}

/// In what the layouts of a topic differ, if they do.
pub(crate) fn layout_difference(a: &Topic, b: &Topic) -> Option<Difference> {
    let words = a.message.first_difference(&b.message)?;
    let layout = |description: &Description| json!(format!("{:016x}", description.fingerprint()));
    Some(Difference {
        topic: a.name.clone(),
        stamp_ns: 0,
        round: 0,
        sequence: 0,
        field: format!("layout: {words}"),
        a: layout(&a.message),
        b: layout(&b.message),
    })
}

fn at(recording: &Recording, message: &Message, field: &str, a: Value, b: Value) -> Difference {
    Difference {
        topic: recording.topics()[message.topic].name.clone(),
        stamp_ns: message.envelope.stamp_ns,
        round: message.envelope.round,
        sequence: message.envelope.sequence,
        field: field.to_owned(),
        a,
        b,
    }
}

pub(crate) fn missing(recording: &Recording, message: &Message, in_second: bool) -> Difference {
    let json = recording.topics()[message.topic].message.to_json(message.bytes());
    let (a, b) = if in_second { (json, Value::Null) } else { (Value::Null, json) };
    at(recording, message, "message", a, b)
}

/// The first thing in which two messages of one topic differ.
pub(crate) fn difference(recording: &Recording, left: &Message, right: &Message) -> Option<Difference> {
    let (a, b) = (&left.envelope, &right.envelope);
    let envelope = [
        ("stamp_ns", a.stamp_ns, b.stamp_ns),
        ("round", u64::from(a.round), u64::from(b.round)),
        ("sequence", a.sequence, b.sequence),
        ("origin_ns", a.origin_ns, b.origin_ns),
    ];
    if let Some((field, a, b)) = envelope.into_iter().find(|(_, a, b)| a != b) {
        // The earlier of the two is where the runs part.
        let first = if left.envelope.stamp_ns <= right.envelope.stamp_ns { left } else { right };
        return Some(at(recording, first, field, a.into(), b.into()));
    }
    if left.bytes() == right.bytes() {
        return None;
    }
    let description = &recording.topics()[left.topic].message;
    let (path, a, b) = field_difference(description, left.bytes(), right.bytes());
    Some(at(recording, left, &path, a, b))
}

/// The first field in which the bytes of two messages differ, and its values. The bytes must differ.
fn field_difference(description: &Description, a: &[u8], b: &[u8]) -> (String, Value, Value) {
    if let Some(found) = in_record(description, "", a, b) {
        return found;
    }
    let offset = elements_offset(description.size);
    if let Some(element) = description.element.as_ref().filter(|element| element.size() > 0)
        && let (Some(a), Some(b)) = (a.get(offset..), b.get(offset..))
    {
        let size = element.size();
        let pairs = a.chunks_exact(size).zip(b.chunks_exact(size)).enumerate();
        for (index, (a, b)) in pairs {
            if let Some(found) = in_kind(element, &format!("elements[{index}]"), a, b) {
                return found;
            }
        }
        if a.len() != b.len() {
            return ("elements".to_owned(), json!(a.len() / size), json!(b.len() / size));
        }
    }
    // Only padding, or bytes that are no such message at all.
    ("bytes".to_owned(), json!(a.len()), json!(b.len()))
}

type Found = (String, Value, Value);

fn in_record(description: &Description, path: &str, a: &[u8], b: &[u8]) -> Option<Found> {
    description.fields.iter().find_map(|field| {
        let range = field.offset..field.offset.saturating_add(field.kind.size());
        let (a, b) = (a.get(range.clone())?, b.get(range)?);
        let path = if path.is_empty() { field.name.clone() } else { format!("{path}.{}", field.name) };
        in_kind(&field.kind, &path, a, b)
    })
}

fn in_kind(kind: &Kind, path: &str, a: &[u8], b: &[u8]) -> Option<Found> {
    if a == b {
        return None;
    }
    let found = match kind {
        Kind::Record(description) => in_record(description, path, a, b),
        Kind::Array { of, .. } => {
            let size = of.size().max(1);
            let mut pairs = a.chunks_exact(size).zip(b.chunks_exact(size)).enumerate();
            pairs.find_map(|(index, (a, b))| in_kind(of, &format!("{path}[{index}]"), a, b))
        }
        _ => None,
    };
    Some(found.unwrap_or_else(|| (path.to_owned(), kind.to_json(a), kind.to_json(b))))
}

/// 128 bits are enough to tell runs apart, and fit on a line.
fn short(hash: &blake3::Hash) -> String {
    hash.to_hex().chars().take(32).collect()
}
