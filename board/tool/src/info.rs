//! `board info`: what a topic's messages are.

use crate::connect::{self, publisher_life};
use crate::{Common, Outcome, list, recorded, show};
use board::tap::{Tap, now};
use board::{Envelope, clock};
use messages::{Description, Kind, Time};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The topic, or the recording.
    #[arg(value_name = "TOPIC|FILE.mcap")]
    topic: String,
}

/// How long a publisher may take to serve us its last message.
const PATIENCE: Duration = Duration::from_millis(300);

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    if options.topic.ends_with(".mcap") {
        return recorded::run(common, Path::new(&options.topic));
    }
    let place = connect::choose(common)?;
    let look = connect::look(&place)?;
    let (index, topic) = connect::topic(&look.manifest, &options.topic)?;
    let last = last_message(&connect::join(&place)?, &topic.name)?;
    let message = &topic.message;
    let life = publisher_life(&look.switchboard, index);
    let now = now(&look.switchboard);
    if common.json {
        show::json(&json!({
            "topic": topic.name, "publisher": topic.publisher, "publisher_life": life, "readers": topic.readers,
            "tools": list::tools_reading(&look, index), "depth": topic.depth,
            "fingerprint": format!("{:016x}", message.fingerprint()), "message": message,
            "last": last.map(|(envelope, bytes)| json!({
                "stamp_ns": envelope.stamp_ns, "origin_ns": envelope.origin_ns, "sequence": envelope.sequence,
                "generation": envelope.generation, "round": envelope.round, "bytes": bytes,
                "age_ns": now.since(Time::from_nanos(envelope.stamp_ns)).as_nanos() as u64,
            })),
        }))?;
        return Ok(ExitCode::SUCCESS);
    }
    let colours = show::colours();
    show::line(&format!("{} ({})", show::harmless(&topic.name), show::harmless(&message.name)))?;
    for line in message.doc.trim().lines() {
        show::line(&format!("  {}", show::harmless(line.trim())))?;
    }
    show::line("")?;
    let size = match &message.element {
        Some(element) => format!("{} B and elements of {} B", message.size, element.size()),
        None => format!("{} B", message.size),
    };
    let facts = [
        ("publisher", list::publisher(colours, topic.publisher.as_deref(), life)),
        (
            "readers",
            if topic.readers.is_empty() { "none".into() } else { show::harmless(&topic.readers.join(", ")) },
        ),
        ("depth", topic.depth.to_string()),
        ("size", size),
        ("fingerprint", format!("{:016x}", message.fingerprint())),
        (
            "last message",
            last.map_or("none yet".into(), |(envelope, bytes)| {
                format!(
                    "number {}, {} ago, {} since its origin, {}, generation {}",
                    envelope.sequence,
                    show::duration(now.since(Time::from_nanos(envelope.stamp_ns)).as_nanos() as f64),
                    show::duration(now.since(Time::from_nanos(envelope.origin_ns)).as_nanos() as f64),
                    show::count(bytes, "byte"),
                    envelope.generation
                )
            }),
        ),
    ];
    for (name, fact) in facts {
        show::line(&format!("  {name:<13} {fact}"))?;
    }
    show::line("")?;
    let mut table = show::table(&["offset", "field", "type", "unit", "meaning"]);
    add_fields(&mut table, message, "", 0);
    if let Some(element) = &message.element {
        let doc = if let Kind::Record(record) = element { words(&record.doc) } else { String::new() };
        table.add_row([String::new(), "elements[]".into(), kind(element), String::new(), doc]);
        if let Kind::Record(record) = element {
            add_fields(&mut table, record, "elements[].", 0);
        }
    }
    show::line(&table.trim_fmt())?;
    Ok(ExitCode::SUCCESS)
}

fn add_fields(table: &mut comfy_table::Table, record: &Description, prefix: &str, base: usize) {
    for field in &record.fields {
        let name = format!("{prefix}{}", field.name);
        let offset = base + field.offset;
        table.add_row([
            offset.to_string(),
            show::harmless(&name),
            show::harmless(&kind(&field.kind)),
            show::harmless(&field.unit),
            words(&field.doc),
        ]);
        match &field.kind {
            Kind::Record(inner) => add_fields(table, inner, &format!("{name}."), offset),
            Kind::Array { of, .. } => {
                if let Kind::Record(inner) = &**of {
                    add_fields(table, inner, &format!("{name}[]."), offset);
                }
            }
            _ => {}
        }
    }
}

/// A text of one or several lines as one.
fn words(text: &str) -> String {
    show::harmless(&text.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn kind(kind: &Kind) -> String {
    match kind {
        Kind::State { names } => {
            names.iter().map(|(value, name)| format!("{value}={name}")).collect::<Vec<_>>().join(" ")
        }
        other => other.to_string(),
    }
}

/// The envelope and the length of the newest message, if there is one.
fn last_message(tap: &Tap, topic: &str) -> Result<Option<(Envelope, usize)>, board::JoinError> {
    let mut reader = tap.reader(topic)?;
    let deadline = clock::monotonic().after(PATIENCE);
    let mut last = None;
    loop {
        let heard = tap.bell();
        while let Some((envelope, bytes)) = reader.next() {
            last = Some((envelope, bytes.len()));
        }
        if last.is_some() || clock::monotonic() >= deadline {
            return Ok(last);
        }
        tap.wait(heard, Duration::from_millis(10));
    }
}
