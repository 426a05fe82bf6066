//! `board echo`: messages as they come.

use crate::connect::{self, Watch};
use crate::{Common, EXIT_TIMEOUT, Outcome, show};
use board::tap::now;
use board::{Envelope, arguments};
use messages::{Description, Kind, Time, elements_offset};
use serde_json::{Value, json};
use std::process::ExitCode;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The topic.
    topic: String,
    /// End after this many messages.
    #[arg(short = 'n', long, value_name = "N")]
    count: Option<u64>,
    /// Print this field only: `pose.x_m`, `elements.3`.
    #[arg(long, value_name = "PATH")]
    field: Option<String>,
    /// End after this many seconds without a message, with exit code 3 when none came at all, or fewer than
    /// -n asks for.
    #[arg(long, value_name = "SECONDS", value_parser = arguments::seconds)]
    timeout: Option<Duration>,
}

/// Elements and array items that the form for people shows.
const SHOWN: usize = 8;
/// Longest sleep: how soon an interrupt is noticed that comes just before it.
const LOOK: Duration = Duration::from_millis(200);

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let place = connect::choose(common)?;
    let mut watch = Watch::begin(place.clone())?;
    let tap = connect::join(&place)?;
    let (index, topic) = connect::topic(tap.manifest(), &options.topic)?;
    let description = topic.message.clone();
    if let Some(path) = &options.field {
        check_path(&description, path)?;
    }
    let mut reader = tap.reader(&options.topic)?;
    let mut printed = 0;
    let all = |printed| options.count.is_none_or(|count| printed >= count);
    let mut code = ExitCode::SUCCESS;
    while options.count.is_none() || !all(printed) {
        if watch.end_said()?.is_some() {
            code = if all(printed) { ExitCode::SUCCESS } else { ExitCode::FAILURE };
            break;
        }
        let heard = tap.bell();
        if let Some((envelope, bytes)) = reader.next() {
            let age = now(tap.switchboard()).since(Time::from_nanos(envelope.stamp_ns));
            print(common, options, &description, &envelope, age, bytes)?;
            printed += 1;
            watch.heard();
            continue;
        }
        let waited = watch.wait(|| connect::awaited(&tap, index));
        if options.timeout.is_some_and(|timeout| waited >= timeout) {
            let enough = printed > 0 && all(printed);
            code = if enough { ExitCode::SUCCESS } else { ExitCode::from(EXIT_TIMEOUT) };
            break;
        }
        tap.wait(heard, options.timeout.map_or(LOOK, |timeout| timeout.saturating_sub(waited).min(LOOK)));
    }
    if reader.lost() > 0 {
        show::note(&format!(
            "{} came faster than could be printed",
            show::count(reader.lost() as usize, "message")
        ));
    }
    if reader.invalid() > 0 {
        show::note(&format!(
            "{} were not what they said, and are left out",
            show::count(reader.invalid() as usize, "message")
        ));
    }
    Ok(code)
}

fn print(
    common: &Common,
    options: &Options,
    description: &Description,
    envelope: &Envelope,
    age: Duration,
    bytes: &[u8],
) -> std::io::Result<()> {
    // People see the first few elements, so only those are translated.
    let shown = match &description.element {
        Some(element) if !common.json && options.field.is_none() => {
            elements_offset(description.size) + SHOWN * element.size()
        }
        _ => bytes.len(),
    };
    let message = description.to_json(&bytes[..shown.min(bytes.len())]);
    if let Some(path) = &options.field {
        let value = pick(&message, path).unwrap_or(&Value::Null);
        return if common.json { show::json(value) } else { show::line(&show::value(value)) };
    }
    if common.json {
        return show::json(&json!({
            "topic": options.topic, "stamp_ns": envelope.stamp_ns, "origin_ns": envelope.origin_ns,
            "age_ns": age.as_nanos() as u64, "sequence": envelope.sequence, "generation": envelope.generation,
            "round": envelope.round, "message": message,
        }));
    }
    let since_origin = Time::from_nanos(envelope.stamp_ns).since(Time::from_nanos(envelope.origin_ns));
    show::line(&show::faint(
        show::colours(),
        &format!(
            "{} #{}  stamp {:.6} s  age {}  origin {} before",
            show::harmless(&options.topic),
            envelope.sequence,
            envelope.stamp_ns as f64 * 1e-9,
            show::duration(age.as_nanos() as f64),
            show::duration(since_origin.as_nanos() as f64),
        ),
    ))?;
    let mut rows = Vec::new();
    rows_of(description, &message, "", &mut rows);
    if let Some(element) = &description.element {
        let count = bytes.len().saturating_sub(elements_offset(description.size)) / element.size().max(1);
        let items = message["elements"].as_array().map_or(&[][..], Vec::as_slice);
        rows.push(("elements".into(), list(items, count), ""));
    }
    let width = rows.iter().map(|(name, ..)| name.len()).max().unwrap_or(0);
    for (name, value, unit) in rows {
        let (name, unit) = (show::harmless(&name), show::harmless(unit));
        show::line(format!("  {name:<width$}  {value} {unit}").trim_end())?;
    }
    Ok(())
}

/// Name, value and unit of every field, those of nested records one by one.
fn rows_of<'a>(
    description: &'a Description,
    message: &Value,
    prefix: &str,
    rows: &mut Vec<(String, String, &'a str)>,
) {
    for field in &description.fields {
        let (name, value) = (format!("{prefix}{}", field.name), &message[&field.name]);
        match (&field.kind, value) {
            (Kind::Record(inner), _) => rows_of(inner, value, &format!("{name}."), rows),
            (Kind::Array { of, .. }, Value::Array(items)) => match &**of {
                Kind::Record(inner) => {
                    for (index, item) in items.iter().enumerate() {
                        rows_of(inner, item, &format!("{name}[{index}]."), rows);
                    }
                }
                _ => rows.push((name, list(items, items.len()), &field.unit)),
            },
            _ => rows.push((name, show::value(value), &field.unit)),
        }
    }
}

/// The first few of the items.
fn list(items: &[Value], count: usize) -> String {
    let first: Vec<String> = items.iter().take(SHOWN).map(show::value).collect();
    let more = count.saturating_sub(first.len());
    let more = if more > 0 { format!(", .. {more} more") } else { String::new() };
    format!("[{}{more}]", first.join(", "))
}

fn pick<'a>(message: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.').try_fold(message, |value, name| match value {
        Value::Array(items) => items.get(name.parse::<usize>().ok()?),
        other => other.get(name),
    })
}

/// A path that no message can have is an error at once, not a stream of nulls.
fn check_path(description: &Description, path: &str) -> Result<(), String> {
    let mut kind = Kind::Record(Box::new(description.clone()));
    for name in path.split('.') {
        kind = match kind {
            Kind::Record(record) => {
                let field = record.fields.iter().find(|field| field.name == name);
                match (field, &record.element) {
                    (Some(field), _) => field.kind.clone(),
                    (None, Some(element)) if name == "elements" => {
                        Kind::Array { of: Box::new(element.clone()), count: usize::MAX }
                    }
                    _ => {
                        let known: Vec<&str> =
                            record.fields.iter().map(|field| field.name.as_str()).collect();
                        return Err(format!(
                            "`{}` has no field `{name}`; it has {}",
                            record.name,
                            known.join(", ")
                        ));
                    }
                }
            }
            Kind::Array { of, count } => match name.parse::<usize>() {
                Ok(index) if index < count => *of,
                _ => return Err(format!("`{name}` in `{path}` is no number below {count}")),
            },
            plain => return Err(format!("`{name}` in `{path}`: a {plain} has no fields")),
        };
    }
    Ok(())
}
