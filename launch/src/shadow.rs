//! What a shadow would say, against what the service says: field by field, while both run on the same inputs.

use crate::cli::SwapArgs;
use crate::console::{say, say_line};
use crate::control::{self, Request};
use crate::numbers::{number, with_unit};
use crate::signals::Signals;
use board::clock;
use board::host::{shadow_role, shadow_topic};
use board::place::Place;
use board::tap::{Tap, TapReader};
use comfy_table::{CellAlignment, Table, presets};
use messages::{Description, Health, health_topic};
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::io::IsTerminal as _;
use std::time::Duration;

/// Messages of the service that are kept to find the one beside a shadow's.
const KEPT: usize = 64;
/// How far the two may lie apart.
const APART_NS: u64 = 200_000_000;

/// How a field of the two differs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Difference {
    /// Pairs of values.
    pub(crate) pairs: u64,
    /// Pairs that are not equal.
    pub(crate) unequal: u64,
    /// Pairs of numbers.
    pub(crate) numbers: u64,
    /// Sum of the absolute differences of numbers.
    sum: f64,
    /// The largest of them.
    pub(crate) max: f64,
}

impl Difference {
    fn add(&mut self, service: &Value, shadow: &Value) {
        self.pairs += 1;
        self.unequal += u64::from(service != shadow);
        if let (Some(a), Some(b)) = (service.as_f64(), shadow.as_f64()) {
            let apart = (a - b).abs();
            self.numbers += 1;
            self.sum += apart;
            self.max = self.max.max(apart);
        }
    }

    /// Mean of the absolute differences of numbers.
    pub(crate) fn mean(&self) -> f64 {
        if self.numbers == 0 { 0.0 } else { self.sum / self.numbers as f64 }
    }
}

/// The differences of two streams of messages of one type.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    recent: VecDeque<(u64, Value)>,
    /// Messages of the service.
    pub(crate) said: u64,
    /// Messages of the shadow.
    pub(crate) would_say: u64,
    /// By the path of the field.
    pub(crate) fields: BTreeMap<String, Difference>,
}

impl Comparison {
    /// Takes in a message of the service.
    pub(crate) fn service(&mut self, stamp_ns: u64, message: Value) {
        self.said += 1;
        if self.recent.len() == KEPT {
            self.recent.pop_front();
        }
        self.recent.push_back((stamp_ns, message));
    }

    /// Takes in a message of the shadow, and compares it with the service's that lies next to it in time.
    pub(crate) fn shadow(&mut self, stamp_ns: u64, message: &Value) {
        self.would_say += 1;
        let nearest = self.recent.iter().min_by_key(|(stamp, _)| stamp.abs_diff(stamp_ns));
        if let Some((stamp, service)) = nearest
            && stamp.abs_diff(stamp_ns) <= APART_NS
        {
            compare(&mut self.fields, String::new(), service, message);
        }
    }
}

fn compare(fields: &mut BTreeMap<String, Difference>, path: String, service: &Value, shadow: &Value) {
    match (service, shadow) {
        (Value::Object(service), Value::Object(shadow)) => {
            for (key, value) in service {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                compare(fields, path, value, shadow.get(key).unwrap_or(&Value::Null));
            }
        }
        // Lists of another length are other lists; element by element they would say little.
        (Value::Array(service), Value::Array(shadow)) if service.len() == shadow.len() => {
            for (service, shadow) in service.iter().zip(shadow) {
                compare(fields, format!("{path}[]"), service, shadow);
            }
        }
        _ => fields.entry(path).or_default().add(service, shadow),
    }
}

struct Topic {
    name: String,
    message: Description,
    service: TapReader,
    shadow: TapReader,
    comparison: Comparison,
}

/// Shows the differences until Ctrl-C or the end of the time, and sends the shadow away.
pub(crate) fn watch(args: &SwapArgs, place: &Place, role: &str) -> Result<(), String> {
    let outcome = compare_until_the_end(args, place, role);
    let away = control::ask(place, &Request::SwapBack { role: role.to_owned() });
    outcome?;
    away.map(|_| ())
}

fn compare_until_the_end(args: &SwapArgs, place: &Place, role: &str) -> Result<(), String> {
    let in_words = |error: board::JoinError| error.to_string();
    let signals = Signals::catch().map_err(|error| error.to_string())?;
    let tap = Tap::join(place.clone(), "shadow").map_err(in_words)?;
    let beside = shadow_role(role);
    let names: Vec<String> = tap
        .manifest()
        .topics
        .iter()
        .filter(|topic| topic.publisher.as_deref() == Some(role) && topic.name != health_topic(role))
        .map(|topic| topic.name.clone())
        .filter(|name| tap.manifest().topic(&shadow_topic(name)).is_some())
        .collect();
    let mut topics = Vec::new();
    for name in names {
        let Some((_, entry)) = tap.manifest().topic(&name) else { continue };
        topics.push(Topic {
            message: entry.message.clone(),
            service: tap.reader(&name).map_err(in_words)?,
            shadow: tap.reader(&shadow_topic(&name)).map_err(in_words)?,
            comparison: Comparison::default(),
            name,
        });
    }
    let mut health = [
        tap.reader(&health_topic(role)).map_err(in_words)?,
        tap.reader(&health_topic(&beside)).map_err(in_words)?,
    ];
    let mut steps = [Health::default(); 2];
    let began = clock::monotonic();
    let mut next_show = began.after(Duration::from_secs(1));
    let on_terminal = std::io::stdout().is_terminal() && !args.json;
    loop {
        let heard = tap.bell();
        for topic in &mut topics {
            while let Some((envelope, bytes)) = topic.service.next() {
                topic.comparison.service(envelope.stamp_ns, topic.message.to_json(bytes));
            }
            while let Some((envelope, bytes)) = topic.shadow.next() {
                topic.comparison.shadow(envelope.stamp_ns, &topic.message.to_json(bytes));
            }
        }
        for (reader, health) in health.iter_mut().zip(&mut steps) {
            *health = reader.newest().unwrap_or(*health);
        }
        let now = clock::monotonic();
        let over = args.length.is_some_and(|length| now.since(began) >= length);
        let down = !control::is_up(place)?;
        if over || down || signals.count() > 0 {
            break;
        }
        if on_terminal && now >= next_show {
            next_show = now.after(Duration::from_secs(1));
            say(&format!("\x1b[H\x1b[J{}", as_text(role, &topics, &steps)));
            say_line("Ctrl-C ends the comparison and sends the shadow away");
        }
        tap.wait(heard, Duration::from_millis(100));
    }
    if args.json {
        say_line(&format!("{:#}", as_json(&topics, &steps)));
    } else {
        say(&as_text(role, &topics, &steps));
    }
    Ok(())
}

fn as_text(role: &str, topics: &[Topic], steps: &[Health; 2]) -> String {
    let mut text = String::new();
    let us = |nanoseconds: u64| nanoseconds as f64 / 1e3;
    text += &format!(
        "`{role}`: a step takes {:.0} us (99 %: {:.0}); the shadow's {:.0} us (99 %: {:.0})\n",
        us(steps[0].step_p50_ns),
        us(steps[0].step_p99_ns),
        us(steps[1].step_p50_ns),
        us(steps[1].step_p99_ns)
    );
    text + &topics.iter().map(|topic| topic.comparison.text(&topic.name, &topic.message)).collect::<String>()
}

impl Comparison {
    /// How often the two have spoken, and the fields in which they differ.
    fn text(&self, topic: &str, message: &Description) -> String {
        let Self { said, would_say, fields, .. } = self;
        let mut text = format!("\n{topic}: {said} messages, the shadow's {would_say}\n");
        let mut table = Table::new();
        table.load_style(presets::NOTHING).set_header(["FIELD", "UNEQUAL", "MEAN", "LARGEST"]);
        for (path, difference) in fields.iter().filter(|(_, difference)| difference.unequal > 0) {
            let share = difference.unequal as f64 / difference.pairs.max(1) as f64 * 100.0;
            let shown = |value: f64| with_unit(&number(value), message.unit_at(path));
            // Of words there is no difference in numbers.
            let sizes = match difference.numbers {
                0 => ["-", "-"].map(str::to_owned),
                _ => [shown(difference.mean()), shown(difference.max)],
            };
            table.add_row([path.clone(), format!("{share:.0} %")].into_iter().chain(sizes));
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        if fields.is_empty() {
            text += "  nothing to compare yet\n";
        } else if table.row_count() == 0 {
            text += "  no difference\n";
        } else {
            text += &format!("{table}\n");
        }
        text
    }
}

fn as_json(topics: &[Topic], steps: &[Health; 2]) -> Value {
    let topic = |topic: &Topic| {
        let fields: BTreeMap<&String, Value> = topic
            .comparison
            .fields
            .iter()
            .map(|(path, difference)| {
                let Difference { pairs, unequal, max, .. } = *difference;
                let (mean, unit) = (difference.mean(), topic.message.unit_at(path));
                let found =
                    json!({"pairs": pairs, "unequal": unequal, "mean": mean, "max": max, "unit": unit});
                (path, found)
            })
            .collect();
        let Comparison { said, would_say, .. } = topic.comparison;
        (topic.name.clone(), json!({"messages": said, "shadow_messages": would_say, "fields": fields}))
    };
    let topics: serde_json::Map<String, Value> = topics.iter().map(topic).collect();
    json!({
        "topics": topics,
        "step_p50_ns": steps[0].step_p50_ns,
        "shadow_step_p50_ns": steps[1].step_p50_ns,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{Message as _, WheelSpeeds};

    #[test]
    fn neighbours_in_time_are_compared() {
        let mut comparison = Comparison::default();
        comparison.service(1_000, json!({"speed": 0.5, "state": "Driving"}));
        comparison.service(51_000, json!({"speed": 0.25, "state": "Driving"}));
        comparison.shadow(50_000, &json!({"speed": 0.5, "state": "Stopped"}));
        comparison.shadow(2_000, &json!({"speed": 0.5, "state": "Driving"}));
        let speed = comparison.fields["speed"];
        assert_eq!((speed.pairs, speed.unequal, speed.max), (2, 1, 0.25));
        assert!((speed.mean() - 0.125).abs() < 1e-12);
        assert_eq!(comparison.fields["state"].unequal, 1);
    }

    #[test]
    fn what_has_no_neighbour_is_counted_and_not_compared() {
        let mut comparison = Comparison::default();
        comparison.shadow(0, &json!({"speed": 1.0}));
        comparison.service(0, json!({"speed": 1.0}));
        comparison.shadow(10 * APART_NS, &json!({"speed": 2.0}));
        assert_eq!((comparison.would_say, comparison.fields.len()), (2, 0));
    }

    #[test]
    fn differences_have_the_units_of_their_fields() {
        let mut comparison = Comparison::default();
        comparison.service(0, json!({"left_mps": 0.25, "right_mps": 0.25, "curvature": 1}));
        comparison.shadow(0, &json!({"left_mps": 0.139_5, "right_mps": 0.25, "curvature": 2, "word": "x"}));
        comparison
            .fields
            .insert("word".to_owned(), Difference { pairs: 1, unequal: 1, ..Difference::default() });
        let text = comparison.text("wheels/desired", &WheelSpeeds::description());
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert!(lines.contains(&vec!["left_mps", "100", "%", "0.1105", "m/s", "0.1105", "m/s"]), "{text}");
        assert!(lines.contains(&vec!["curvature", "100", "%", "1", "1"]), "{text}");
        assert!(lines.contains(&vec!["word", "100", "%", "-", "-"]), "{text}");
        assert!(!text.contains("right_mps"), "{text}");
    }

    #[test]
    fn lists_are_compared_element_by_element_unless_their_lengths_differ() {
        let mut fields = BTreeMap::new();
        compare(
            &mut fields,
            String::new(),
            &json!({"path": [{"x": 1.0}, {"x": 2.0}]}),
            &json!({"path": [{"x": 1.0}, {"x": 2.5}]}),
        );
        assert_eq!((fields["path[].x"].pairs, fields["path[].x"].max), (2, 0.5));
        compare(&mut fields, String::new(), &json!({"path": [1]}), &json!({"path": []}));
        assert_eq!(fields["path"].unequal, 1);
    }
}
