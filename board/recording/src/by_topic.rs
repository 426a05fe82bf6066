//! Two runs topic by topic: how many messages agree, and by how much the others differ.

use crate::compare::{difference, layout_difference, missing};
use crate::{Difference, Message, Recording, RecordingError};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap, VecDeque};

/// Fields that are reported of a topic.
const FIELDS_MAX: usize = 4;
/// Longer arrays are no quantities that a person compares.
const ARRAY_MAX: usize = 8;

/// A topic in two runs. Messages belong together that were published in the same round of the same instant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicComparison {
    /// The topic.
    pub topic: String,
    /// Messages in the first run.
    pub recorded: u64,
    /// Messages in the second run.
    pub rerun: u64,
    /// Messages that are the same in both, origin and all bytes.
    pub same: u64,
    /// Messages of the same instant and round that differ.
    pub changed: u64,
    /// Messages that only the first run has.
    pub missing: u64,
    /// Messages that only the second run has.
    pub added: u64,
    /// The first difference in logical time.
    pub first: Option<Difference>,
    /// The numbers in which the changed messages differ, those that differ most often first.
    pub fields: Vec<FieldDifference>,
}

/// A number in which messages differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldDifference {
    /// Its path in the message.
    pub field: String,
    /// Its unit, empty for a pure number.
    pub unit: String,
    /// In how many messages.
    pub messages: u64,
    /// Mean absolute difference over these.
    pub mean: f64,
    /// Largest absolute difference.
    pub largest: f64,
}

struct Tally {
    comparison: TopicComparison,
    fields: BTreeMap<String, (u64, f64, f64)>,
    /// Messages of the first run whose counterpart did not come yet.
    waiting: VecDeque<Message>,
}

/// Compares these topics of two runs.
///
/// # Errors
/// When one of the recordings is damaged.
pub fn compare_topics(
    a: &Recording,
    b: &Recording,
    topics: &[String],
) -> Result<Vec<TopicComparison>, RecordingError> {
    let mut tallies: Vec<Tally> = topics.iter().map(|topic| Tally::new(topic)).collect();
    let places: HashMap<&str, usize> =
        topics.iter().enumerate().map(|(place, topic)| (topic.as_str(), place)).collect();
    for tally in &mut tallies {
        let name = tally.comparison.topic.clone();
        let both = a.manifest().topic(&name).zip(b.manifest().topic(&name));
        tally.comparison.first = both.and_then(|((_, a), (_, b))| layout_difference(a, b));
    }
    for (run, recording) in [a, b].into_iter().enumerate() {
        // The first run waits whole, topic by topic; its messages share the memory of their chunks.
        for message in recording.in_order(|topic| places.contains_key(topic.name.as_str())) {
            let message = message?;
            let tally = &mut tallies[places[recording.topics()[message.topic].name.as_str()]];
            if run == 0 {
                tally.comparison.recorded += 1;
                tally.waiting.push_back(message);
            } else {
                tally.comparison.rerun += 1;
                tally.take(a, b, message);
            }
        }
    }
    Ok(tallies.into_iter().map(|tally| tally.finish(a)).collect())
}

type Key = (u64, u32);

fn key(message: &Message) -> Key {
    (message.envelope.stamp_ns, message.envelope.round)
}

impl Tally {
    fn new(topic: &str) -> Self {
        let comparison = TopicComparison {
            topic: topic.to_owned(),
            recorded: 0,
            rerun: 0,
            same: 0,
            changed: 0,
            missing: 0,
            added: 0,
            first: None,
            fields: Vec::new(),
        };
        Self { comparison, fields: BTreeMap::new(), waiting: VecDeque::new() }
    }

    /// A message of the second run.
    fn take(&mut self, a: &Recording, b: &Recording, message: Message) {
        while let Some(ours) = self.waiting.front() {
            if key(ours) >= key(&message) {
                break;
            }
            let found = missing(a, ours, true);
            self.waiting.pop_front();
            self.comparison.missing += 1;
            self.comparison.first.get_or_insert(found);
        }
        let has_counterpart = self.waiting.front().is_some_and(|ours| key(ours) == key(&message));
        match if has_counterpart { self.waiting.pop_front() } else { None } {
            None => {
                self.comparison.added += 1;
                self.comparison.first.get_or_insert_with(|| missing(b, &message, false));
            }
            Some(ours)
                if ours.bytes() == message.bytes()
                    && ours.envelope.origin_ns == message.envelope.origin_ns =>
            {
                self.comparison.same += 1;
            }
            Some(ours) => {
                self.comparison.changed += 1;
                if self.comparison.first.is_none() {
                    self.comparison.first = difference(a, &ours, &message);
                }
                self.count_fields(a, b, &ours, &message);
            }
        }
    }

    fn count_fields(&mut self, a: &Recording, b: &Recording, ours: &Message, theirs: &Message) {
        let json = |recording: &Recording, message: &Message| {
            recording.topics()[message.topic].message.to_json(message.bytes())
        };
        let (mut left, mut right) = (BTreeMap::new(), BTreeMap::new());
        numbers("", &json(a, ours), &mut left);
        numbers("", &json(b, theirs), &mut right);
        for (path, was) in left {
            let Some(is) = right.get(&path).copied().filter(|is| *is != was) else { continue };
            let (count, sum, largest) = self.fields.entry(path).or_default();
            let by = (is - was).abs();
            *count += 1;
            *sum += by;
            *largest = largest.max(by);
        }
    }

    fn finish(mut self, a: &Recording) -> TopicComparison {
        let rest = self.waiting.len() as u64;
        self.comparison.missing += rest;
        if let Some(ours) = self.waiting.front() {
            let found = missing(a, ours, true);
            self.comparison.first.get_or_insert(found);
        }
        let description = a.manifest().topic(&self.comparison.topic).map(|(_, topic)| &topic.message);
        let mut fields: Vec<FieldDifference> = self
            .fields
            .into_iter()
            .map(|(field, (messages, sum, largest))| FieldDifference {
                unit: description.map_or("", |message| message.unit_at(&field)).to_owned(),
                field,
                messages,
                mean: sum / messages as f64,
                largest,
            })
            .collect();
        fields.sort_by_key(|field| std::cmp::Reverse(field.messages));
        fields.truncate(FIELDS_MAX);
        self.comparison.fields = fields;
        self.comparison
    }
}

/// The numbers of a message by their paths.
fn numbers(path: &str, value: &Value, into: &mut BTreeMap<String, f64>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Number(number) => {
            if let Some(number) = number.as_f64().filter(|number| number.is_finite()) {
                into.insert(path.to_owned(), number);
            }
        }
        Value::Object(fields) => fields.iter().for_each(|(name, value)| numbers(&below(name), value, into)),
        Value::Array(items) if items.len() <= ARRAY_MAX => {
            items
                .iter()
                .enumerate()
                .for_each(|(index, item)| numbers(&format!("{path}[{index}]"), item, into));
        }
        _ => {}
    }
}
