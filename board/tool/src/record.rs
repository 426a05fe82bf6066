//! `board record`: every message into a file.

use crate::connect::{self, End, Watch};
use crate::{Common, Outcome, output, show};
use board::tap::{Tap, TapReader, now};
use board::{arguments, clock};
use messages::Time;
use recording::{Manifest, Recorder, Topic};
use serde_json::json;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, IsTerminal as _};
use std::path::PathBuf;
use std::process::ExitCode;
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
    /// Overwrite the file if it exists; anything but a plain file is left alone.
    #[arg(long)]
    force: bool,
    /// End after this many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = arguments::seconds)]
    duration: Option<Duration>,
}

/// Longest sleep: how soon an interrupt is noticed, and a chunk closed when no message comes.
const LOOK: Duration = Duration::from_millis(100);
/// How often it is looked for new topics, and said what was lost.
const SECOND: Duration = Duration::from_secs(1);

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let place = connect::choose(common)?;
    let watch = Watch::begin(place.clone())?;
    let tap = connect::join(&place)?;
    for pattern in &options.topics {
        if !tap.manifest().topics.iter().any(|topic| matches(pattern, &topic.name)) {
            connect::topic(tap.manifest(), pattern)?;
        }
    }
    let board = tap.manifest();
    let chosen: Vec<&Topic> = board.topics.iter().filter(|topic| options.wants(topic)).collect();
    let manifest = Manifest {
        graph: board.graph.clone(),
        seed: board.seed,
        topics: chosen.into_iter().cloned().collect(),
        notes: [
            ("board".to_owned(), place.name().to_owned()),
            // Messages that are older lay on the board when the recording began.
            (recording::BEGIN_NOTE.to_owned(), now(tap.switchboard()).as_nanos().to_string()),
        ]
        .into(),
    };
    output::make_way(&options.output, options.force)?;
    let recorder = Recorder::new(&options.output, &manifest)?;
    let begin = clock::monotonic();
    let mut session =
        Session { recorder, sources: Vec::new(), begin, looked: begin, said: 0, watch, tap, options };
    for topic in manifest.topics {
        session.open(topic.name)?;
    }
    session.run(common)
}

impl Options {
    fn wants(&self, topic: &Topic) -> bool {
        if self.topics.is_empty() {
            return self.all || !topic.is_health();
        }
        self.topics.iter().any(|pattern| matches(pattern, &topic.name))
    }
}

fn matches(pattern: &str, name: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(subject) => name.starts_with(subject),
        None => pattern == name,
    }
}

/// A topic that is recorded.
struct Source {
    topic: String,
    reader: TapReader,
    sequence: Option<u64>,
    lost: u64,
}

struct Session<'a> {
    recorder: Recorder,
    /// In the order of the recording's topics.
    sources: Vec<Source>,
    begin: Time,
    looked: Time,
    /// Messages that were said to be lost.
    said: u64,
    watch: Watch,
    tap: Tap,
    options: &'a Options,
}

impl Session<'_> {
    fn open(&mut self, topic: String) -> Result<(), board::JoinError> {
        let reader = self.tap.reader(&topic)?;
        self.sources.push(Source { topic, reader, sequence: None, lost: 0 });
        Ok(())
    }

    fn run(mut self, common: &Common) -> Outcome {
        let end = self.options.duration.map(|duration| self.begin.after(duration));
        let mut shown = self.begin;
        let shows = io::stderr().is_terminal() && !common.json;
        let why = loop {
            let heard = self.tap.bell();
            let found = self.drain()?;
            let now = clock::monotonic();
            self.recorder.tick(now)?;
            if shows && now.since(shown) >= Duration::from_millis(200) {
                shown = now;
                show::progress(&self.progress(now));
            }
            if now.since(self.looked) >= SECOND {
                self.looked = now;
                self.follow()?;
                self.say_lost(shows);
            }
            if let Some(why) = self.watch.end()? {
                break why;
            }
            if end.is_some_and(|end| now >= end) {
                break End::Asked;
            }
            if !found {
                self.tap.wait(heard, LOOK);
            }
        };
        // What came between the last look and the end.
        self.drain()?;
        if shows {
            show::progress("");
        }
        self.finish(common, why == End::BoardWent)
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
                self.recorder.record(index, &envelope, bytes)?;
            }
        }
        Ok(found)
    }

    /// Records topics that were added to the board since, as a swap or a shadow does.
    fn follow(&mut self) -> Result<(), Box<dyn Error>> {
        for index in self.tap.refresh()? {
            let topic = &self.tap.manifest().topics[index];
            if self.options.wants(topic) {
                let topic = topic.clone();
                self.recorder.add_topic(&topic)?;
                self.open(topic.name)?;
            }
        }
        Ok(())
    }

    fn lost(&self) -> u64 {
        self.sources.iter().map(|source| source.lost).sum()
    }

    /// Says at once that the recording has holes, and where.
    fn say_lost(&mut self, shows: bool) {
        let lost = self.lost();
        if lost == self.said {
            return;
        }
        self.said = lost;
        if shows {
            show::progress("");
        }
        show::note(&self.lost_in_words());
    }

    fn lost_in_words(&self) -> String {
        let lost = self.sources.iter().filter(|source| source.lost > 0);
        let topics: Vec<String> = lost.map(|source| format!("`{}` {}", source.topic, source.lost)).collect();
        let number = show::count(self.lost() as usize, "message");
        format!("{number} overwritten before they could be recorded: {}", topics.join(", "))
    }

    fn progress(&self, now: Time) -> String {
        let messages = show::count(self.recorder.counts().messages as usize, "message");
        let lost = match self.lost() {
            0 => String::new(),
            lost => format!(", {lost} lost"),
        };
        let size = show::bytes(self.recorder.file_bytes());
        format!("{:.1} s: {messages}, {size}{lost}", now.seconds_since(self.begin))
    }

    fn finish(mut self, common: &Common, board_went: bool) -> Outcome {
        let lost: BTreeMap<&str, u64> = self
            .sources
            .iter()
            .filter(|source| source.lost > 0)
            .map(|source| (source.topic.as_str(), source.lost))
            .collect();
        let lost = json!(lost);
        self.recorder.note(recording::LOST_NOTE, &lost.to_string());
        let now = clock::monotonic();
        let (progress, total, words) = (self.progress(now), self.lost(), self.lost_in_words());
        let counts = self.recorder.finish()?;
        let output = &self.options.output;
        let bytes = std::fs::metadata(output)?.len();
        if common.json {
            show::json(&json!({
                "file": output, "messages": counts.messages, "misfits": counts.misfits, "bytes": bytes,
                "seconds": now.seconds_since(self.begin), "lost": lost, "board_went_down": board_went,
            }))?;
        } else {
            let why = if board_went { "the board went down; " } else { "" };
            let file = show::harmless(&output.display().to_string());
            show::line(&format!("{why}{file} ({}): {progress}", show::bytes(bytes)))?;
        }
        if counts.misfits > 0 {
            let misfits = show::count(counts.misfits as usize, "message");
            show::note(&format!("{misfits} did not fit their type; other tools will not show them"));
        }
        if total > 0 {
            show::note(&words);
        }
        Ok(ExitCode::SUCCESS)
    }
}
