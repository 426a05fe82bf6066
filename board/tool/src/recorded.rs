//! `board info FILE.mcap`: what a recording holds.

use crate::{Common, Outcome, show};
use recording::Recording;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

pub(crate) fn run(common: &Common, file: &Path) -> Outcome {
    let recording = Recording::open(file)?;
    let manifest = recording.manifest();
    let mut counts = vec![0_u64; manifest.topics.len()];
    let (mut first_ns, mut last_ns, mut damaged) = (u64::MAX, 0, 0_u64);
    for message in recording.as_recorded(|_| true) {
        let Ok(message) = message else {
            damaged += 1;
            continue;
        };
        counts[message.topic] += 1;
        first_ns = first_ns.min(message.envelope.stamp_ns);
        last_ns = last_ns.max(message.envelope.stamp_ns);
    }
    // What lay on the board when the recording began is older than it.
    let begin = manifest.notes.get(recording::BEGIN_NOTE).and_then(|text| text.parse().ok());
    let length_s = last_ns.saturating_sub(begin.unwrap_or(first_ns)) as f64 * 1e-9;
    let lost = manifest.notes.get(recording::LOST_NOTE).and_then(|text| serde_json::from_str(text).ok());
    let lost: BTreeMap<String, u64> = lost.unwrap_or_default();
    let messages: u64 = counts.iter().sum();
    let bytes = std::fs::metadata(file)?.len();
    if common.json {
        let topics: Vec<_> = manifest
            .topics
            .iter()
            .zip(&counts)
            .map(|(topic, count)| {
                json!({
                    "topic": topic.name, "type": topic.message.name, "publisher": topic.publisher, "messages": count,
                })
            })
            .collect();
        show::json(&json!({
            "file": file, "bytes": bytes, "complete": recording.is_complete(), "graph": manifest.graph,
            "seed": manifest.seed, "seconds": length_s, "messages": messages, "damaged_chunks": damaged, "lost": lost,
            "topics": topics,
        }))?;
        return Ok(ExitCode::SUCCESS);
    }
    let state = match (recording.is_complete(), damaged) {
        (true, 0) => "complete".to_owned(),
        (false, 0) => "cut: its recorder did not end in order, and what it had last is missing".to_owned(),
        (_, damaged) => format!("{} cannot be read", show::count(damaged as usize, "damaged chunk")),
    };
    show::line(&format!("{} ({})", show::harmless(&file.display().to_string()), show::bytes(bytes)))?;
    let lost: Vec<String> =
        lost.iter().map(|(topic, lost)| format!("`{}` {lost}", show::harmless(topic))).collect();
    let facts = [
        ("state", state),
        ("graph", show::harmless(&manifest.graph)),
        ("seed", manifest.seed.to_string()),
        ("length", format!("{} s", show::number(length_s))),
        ("messages", messages.to_string()),
        ("lost", if lost.is_empty() { "none".to_owned() } else { lost.join(", ") }),
    ];
    for (name, fact) in facts {
        show::line(&format!("  {name:<9} {fact}"))?;
    }
    show::line("")?;
    let mut table = show::table(&["topic", "type", "publisher", "messages", "mean rate"]);
    for (topic, &count) in manifest.topics.iter().zip(&counts) {
        let rate_hz = count as f64 / length_s;
        table.add_row([
            show::harmless(&topic.name),
            show::harmless(&topic.message.name),
            topic.publisher.as_deref().map_or_else(|| "(from outside)".to_owned(), show::harmless),
            count.to_string(),
            if rate_hz.is_finite() { format!("{} Hz", show::three(rate_hz)) } else { "-".to_owned() },
        ]);
    }
    show::line(&table.trim_fmt())?;
    Ok(ExitCode::SUCCESS)
}
