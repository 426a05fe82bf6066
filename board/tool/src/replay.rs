//! `board replay`: a recording onto a running board.

use crate::connect::{self, Watch, who_obeys};
use crate::{Common, Outcome, show};
use board::tap::{Tap, TapPublisher};
use board::{arguments, clock};
use recording::Recording;
use serde_json::json;
use std::error::Error;
use std::io::{self, IsTerminal as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The recording.
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// These topics only; `subject/*` for all of a subject [default: all that the board has]
    #[arg(long, value_name = "TOPIC", value_delimiter = ',')]
    topics: Vec<String>,
    /// How many times as fast, or `max`.
    #[arg(long, value_name = "X", default_value = "1", value_parser = speed)]
    speed: f64,
    /// Begin again at the end, until Ctrl-C.
    #[arg(long = "loop")]
    repeat: bool,
    /// Publish where services publish, or where some listen that move the robot.
    #[arg(long)]
    force: bool,
}

/// Longest sleep: how soon an interrupt is noticed.
const LOOK: Duration = Duration::from_millis(200);

/// Why a recording is not replayed.
#[derive(Debug, thiserror::Error)]
enum ReplayError {
    #[error("{file} has no topic `{topic}`; it has {known}")]
    NotRecorded { file: String, topic: String, known: String },
    #[error("the board has none of the topics of {file}: {topics}")]
    NothingInCommon { file: String, topics: String },
    #[error("topic `{topic}` was recorded with another layout: {difference}")]
    Layout { topic: String, difference: String },
    #[error(
        "{}: whoever obeys the recording's messages might move. Stop them, choose other topics with --topics, or say --force to publish \
         all the same",
        reasons.join("; ")
    )]
    Obeyed { reasons: Vec<String> },
}

fn speed(text: &str) -> Result<f64, String> {
    if text == "max" {
        return Ok(f64::INFINITY);
    }
    arguments::positive(text).map_err(|error| format!("{error}, or `max`"))
}

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let recording = Recording::open(&options.file)?;
    let place = connect::choose(common)?;
    let mut watch = Watch::begin(place.clone())?;
    let mut tap = connect::join(&place)?;
    let publishers = publishers(&recording, &mut tap, options)?;
    if !recording.is_complete() {
        show::note(&format!("{} was cut; it is replayed up to its last whole chunk", options.file.display()));
    }
    // Readers that were there before us find us first.
    connect::linger(&tap, &mut watch)?;
    let mut published = 0;
    let mut damaged = 0;
    loop {
        let (messages, errors) = play(&recording, &tap, &publishers, common, options, &mut watch)?;
        published += messages;
        damaged += errors;
        if !options.repeat || messages == 0 || watch.end()?.is_some() {
            break;
        }
    }
    connect::linger(&tap, &mut watch)?;
    if common.json {
        show::json(&json!({ "file": options.file, "published": published, "damaged_chunks": damaged }))?;
    } else {
        let topics = show::count(publishers.iter().flatten().count(), "topic");
        show::line(&format!("published {} on {topics}", show::count(published as usize, "message")))?;
    }
    Ok(if damaged > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// A publisher for each topic of the recording that is replayed.
fn publishers(
    recording: &Recording,
    tap: &mut Tap,
    options: &Options,
) -> Result<Vec<Option<TapPublisher>>, Box<dyn Error>> {
    let file = options.file.display().to_string();
    let matches = |pattern: &str, name: &str| match pattern.strip_suffix('*') {
        Some(subject) => name.starts_with(subject),
        None => pattern == name,
    };
    let known =
        || recording.topics().iter().map(|topic| format!("`{}`", topic.name)).collect::<Vec<_>>().join(", ");
    for pattern in &options.topics {
        if !recording.topics().iter().any(|topic| matches(pattern, &topic.name)) {
            return Err(ReplayError::NotRecorded { file, topic: pattern.clone(), known: known() }.into());
        }
    }
    let mut names = Vec::new();
    let mut reasons = Vec::new();
    for topic in recording.topics() {
        let wanted = if options.topics.is_empty() {
            !topic.is_health()
        } else {
            options.topics.iter().any(|pattern| matches(pattern, &topic.name))
        };
        let found = tap.manifest().topic(&topic.name).filter(|_| wanted);
        if let Some((index, here)) = found {
            if let Some(difference) = topic.message.first_difference(&here.message) {
                return Err(ReplayError::Layout { topic: topic.name.clone(), difference }.into());
            }
            reasons.extend(who_obeys(tap.manifest(), tap.switchboard(), index));
        }
        names.push(found.map(|_| topic.name.clone()));
    }
    if names.iter().all(Option::is_none) {
        return Err(ReplayError::NothingInCommon { file, topics: known() }.into());
    }
    if !reasons.is_empty() && !options.force {
        return Err(ReplayError::Obeyed { reasons }.into());
    }
    let open = |name: Option<String>| name.map(|name| tap.publisher(&name)).transpose();
    Ok(names.into_iter().map(open).collect::<Result<_, _>>()?)
}

/// Once through the recording: messages published, and chunks that could not be read.
fn play(
    recording: &Recording,
    tap: &Tap,
    publishers: &[Option<TapPublisher>],
    common: &Common,
    options: &Options,
    watch: &mut Watch,
) -> Result<(u64, u64), Box<dyn Error>> {
    let shows = io::stderr().is_terminal() && !common.json;
    // What lay on the board when the recording began is published at once, however old it was.
    let mut first_ns =
        recording.manifest().notes.get(recording::BEGIN_NOTE).and_then(|text| text.parse().ok());
    let begin = clock::monotonic();
    let mut shown = begin;
    let (mut published, mut damaged) = (0, 0);
    let names: Vec<bool> = publishers.iter().map(Option::is_some).collect();
    let wanted = |name: &str| recording.manifest().topic(name).is_some_and(|(index, _)| names[index]);
    for message in recording.in_order(|topic| wanted(&topic.name)) {
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                show::note(&error.to_string());
                damaged += 1;
                continue;
            }
        };
        let stamp_ns = message.envelope.stamp_ns;
        let passed_ns = stamp_ns.saturating_sub(*first_ns.get_or_insert(stamp_ns));
        let due = begin.after(Duration::from_nanos((passed_ns as f64 / options.speed) as u64));
        let mut now = clock::monotonic();
        let mut ended = watch.end_said()?.is_some();
        while now < due && !ended {
            tap.wait(tap.bell(), due.since(now).min(LOOK));
            now = clock::monotonic();
            ended = watch.end_said()?.is_some();
        }
        if ended {
            break;
        }
        if let Some(publisher) = &publishers[message.topic] {
            publisher.publish(message.bytes())?;
            published += 1;
        }
        if shows && now.since(shown) >= LOOK {
            shown = now;
            show::progress(&format!("{:.1} s: {published} messages", passed_ns as f64 * 1e-9));
        }
    }
    if shows {
        show::progress("");
    }
    Ok((published, damaged))
}
