//! `board record`: every message into a file.

use crate::connect;
use crate::{Common, Outcome, show};
use board::host::living_launcher;
use board::place::Place;
use board::tap::{Tap, TapReader, now};
use board::{Envelope, clock};
use recording::{Manifest, Recorder, Topic};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Topics, or `subject/*` for all of a subject [default: all but the services' health]
    #[arg(value_name = "TOPIC")]
    topics: Vec<String>,
    /// The file.
    #[arg(short = 'o', long, value_name = "FILE.mcap")]
    output: PathBuf,
    /// The services' health too.
    #[arg(long)]
    all: bool,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
    /// End after so many seconds.
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
}

/// Longest sleep: how soon an interrupt is noticed, and a chunk closed when no message comes.
const LOOK: Duration = Duration::from_millis(100);
/// How often it is looked whether the board is still up.
const ALIVE: Duration = Duration::from_millis(500);

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let interrupted = connect::interrupted()?;
    let place = connect::choose(common)?;
    let tap = connect::join(common)?;
    let topics = chosen(&tap, options)?;
    if options.force {
        match std::fs::remove_file(&options.output) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(format!("{}: {error}", options.output.display()).into());
            }
            _ => {}
        }
    }
    let board = tap.manifest();
    let manifest = Manifest {
        graph: board.graph.clone(),
        seed: board.seed,
        topics: topics.iter().map(|&index| entry(&board.topics[index])).collect(),
        notes: [
            ("board".to_owned(), place.name().to_owned()),
            // Messages that are older lay on the board when the recording began.
            (recording::BEGIN_NOTE.to_owned(), now(tap.switchboard()).as_nanos().to_string()),
        ]
        .into(),
    };
    let recorder = Recorder::new(&options.output, &manifest).map_err(|error| match error {
        recording::RecordingError::Io { cause, .. } if cause.kind() == io::ErrorKind::AlreadyExists => {
            format!("{} exists; say --force to overwrite it", options.output.display()).into()
        }
        other => Box::<dyn std::error::Error>::from(other),
    })?;
    let open = |topic: &Topic| {
        let reader = tap.reader(&topic.name)?;
        Ok::<_, board::JoinError>(Source { topic: topic.name.clone(), reader, sequence: None, lost: 0 })
    };
    let sources = manifest.topics.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let session = Session { tap: &tap, place: &place, recorder, sources };
    session.run(common, options, &interrupted)
}

fn entry(topic: &board::manifest::Topic) -> Topic {
    Topic {
        name: topic.name.clone(),
        publisher: topic.publisher.clone(),
        depth: topic.depth,
        message: topic.message.clone(),
    }
}

/// The places of the chosen topics, in the board's order.
fn chosen(tap: &Tap, options: &Options) -> Result<Vec<usize>, connect::ConnectError> {
    let manifest = tap.manifest();
    let mut wanted = vec![false; manifest.topics.len()];
    if options.topics.is_empty() {
        for (index, topic) in manifest.topics.iter().enumerate() {
            wanted[index] = options.all || !topic.name.starts_with("health/");
        }
    }
    for name in &options.topics {
        let Some(subject) = name.strip_suffix('*') else {
            wanted[connect::topic(manifest, name)?.0 as usize] = true;
            continue;
        };
        let mut matching =
            (0..wanted.len()).filter(|&index| manifest.topics[index].name.starts_with(subject)).peekable();
        if matching.peek().is_none() {
            connect::topic(manifest, name)?;
        }
        matching.for_each(|index| wanted[index] = true);
    }
    Ok((0..wanted.len()).filter(|&index| wanted[index]).collect())
}

/// A topic that is recorded.
struct Source {
    topic: String,
    reader: TapReader,
    sequence: Option<u64>,
    lost: u64,
}

struct Session<'a> {
    tap: &'a Tap,
    place: &'a Place,
    recorder: Recorder,
    sources: Vec<Source>,
}

impl Session<'_> {
    fn run(mut self, common: &Common, options: &Options, interrupted: &AtomicBool) -> Outcome {
        let begin = clock::monotonic();
        let end =
            options.duration.map(|seconds| begin.after(Duration::from_secs_f64(seconds.clamp(0.0, 1e9))));
        let (mut looked, mut shown) = (begin, begin);
        let mut board_went = false;
        let shows = io::stderr().is_terminal() && !common.json;
        loop {
            let heard = self.tap.bell();
            let found = self.drain()?;
            let now = clock::monotonic();
            self.recorder.tick(now)?;
            if shows && now.since(shown) >= Duration::from_millis(200) {
                shown = now;
                let _ = write!(io::stderr(), "\r\x1b[K{}", self.progress(now.since(begin)));
            }
            if interrupted.load(Ordering::Relaxed) || end.is_some_and(|end| now >= end) {
                break;
            }
            if now.since(looked) >= ALIVE {
                looked = now;
                if living_launcher(self.place)?.is_none() {
                    board_went = true;
                    break;
                }
            }
            if !found {
                self.tap.wait(heard, LOOK);
            }
        }
        // What came between the last look and the end.
        self.drain()?;
        if shows {
            let _ = write!(io::stderr(), "\r\x1b[K");
        }
        self.finish(common, options, clock::monotonic().since(begin), board_went)
    }

    /// Records what is there; whether there was anything.
    fn drain(&mut self) -> Result<bool, recording::RecordingError> {
        let mut found = false;
        for (index, source) in self.sources.iter_mut().enumerate() {
            while let Some((envelope, bytes)) = source.reader.next() {
                found = true;
                if let Some(last) = source.sequence {
                    source.lost += envelope.sequence.saturating_sub(last.saturating_add(1));
                }
                source.sequence = Some(envelope.sequence);
                self.recorder.record(index, &translated(&envelope), bytes)?;
            }
        }
        Ok(found)
    }

    fn lost(&self) -> u64 {
        self.sources.iter().map(|source| source.lost).sum()
    }

    fn progress(&self, passed: Duration) -> String {
        let counts = self.recorder.counts();
        let lost = match self.lost() {
            0 => String::new(),
            lost => format!(", {lost} lost"),
        };
        let size = show::bytes(self.recorder.file_bytes());
        format!("{:.1} s: {} messages, {size}{lost}", passed.as_secs_f64(), counts.messages)
    }

    fn finish(mut self, common: &Common, options: &Options, passed: Duration, board_went: bool) -> Outcome {
        let lost: BTreeMap<&str, u64> = self
            .sources
            .iter()
            .filter(|source| source.lost > 0)
            .map(|source| (source.topic.as_str(), source.lost))
            .collect();
        self.recorder.note(recording::LOST_NOTE, &json!(lost).to_string());
        let total = self.lost();
        let words: Vec<String> = lost.iter().map(|(topic, lost)| format!("`{topic}` {lost}")).collect();
        let progress = self.progress(passed);
        let lost = json!(lost);
        let counts = self.recorder.finish()?;
        let bytes = std::fs::metadata(&options.output)?.len();
        if common.json {
            show::json(&json!({
                "file": options.output, "messages": counts.messages, "misfits": counts.misfits, "bytes": bytes,
                "seconds": passed.as_secs_f64(), "lost": lost, "board_went_down": board_went,
            }))?;
        } else {
            let why = if board_went { "the board went down; " } else { "" };
            show::line(&format!("{why}{} ({}): {progress}", options.output.display(), show::bytes(bytes)))?;
        }
        if counts.misfits > 0 {
            eprintln!("{} messages did not fit their type; other tools will not show them", counts.misfits);
        }
        if total > 0 {
            eprintln!(
                "{total} messages were overwritten before they could be recorded: {}",
                words.join(", ")
            );
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn translated(envelope: &Envelope) -> recording::Envelope {
    recording::Envelope {
        stamp_ns: envelope.stamp_ns,
        origin_ns: envelope.origin_ns,
        sequence: envelope.sequence,
        generation: envelope.generation,
        round: envelope.round,
    }
}
