//! `launch rerun`: a recorded run again, whole or service by service on the recorded inputs, and whether it
//! comes out the same.
//!
//! Of a whole run the judge's last word on both comes first ([`judge`]), then the topics ([`text`]).

mod judge;
mod text;

use crate::cli::RerunArgs;
use crate::console::Console;
use crate::console::{say, say_line, warn};
use crate::desk::Face;
use crate::graph::{self, Checked, Overrides, Publisher, Request};
use crate::lockstep;
use crate::notes;
use crate::prompter::Part;
use crate::run::{Outcome, Pace, Script};
use crate::signals::Signals;
use crate::up::Options;
use board::terminal::harmless;
use judge::{Judged, LastWord};
use messages::Time;
use recording::{Difference, Digest, Recording, TopicComparison, compare_topics};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

/// The exit code of what could not be run.
const NOT_RUN: u8 = 2;
/// With a change a robot may need longer than it did: so many times as long, and a minute.
const LONGER: u64 = 3;

/// What came of it.
#[derive(Debug, Serialize)]
struct Report {
    /// Whether every message that was compared is the same.
    same: bool,
    /// `closed` or `open`.
    #[serde(rename = "loop")]
    closed_or_open: &'static str,
    /// The services that ran.
    services: Vec<String>,
    logical_s: f64,
    wall_s: f64,
    /// What the judge said of both, when the whole graph ran and has a judge.
    judge: Option<Judged>,
    /// Of the whole run, when the whole graph ran.
    digests: Option<Digests>,
    /// Where the two first differ in logical time.
    difference: Option<Difference>,
    topics: Vec<TopicComparison>,
    /// What is not as it was when the recording was made.
    remarks: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Digests {
    recorded: Digest,
    rerun: Digest,
}

/// `launch rerun`.
pub(crate) fn command(args: &RerunArgs) -> ExitCode {
    match rerun(args) {
        Ok(report) => {
            if args.json {
                say_line(&serde_json::to_string_pretty(&report).unwrap_or_default());
            } else {
                // The judge's words came from a service.
                say(&text::of(&report).lines().map(|line| harmless(line) + "\n").collect::<String>());
            }
            if report.same { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            // The checker has said already what is wrong with a graph.
            let words = error.to_string();
            if !words.is_empty() {
                warn(&format!("error: {words}"));
            }
            ExitCode::from(NOT_RUN)
        }
    }
}

fn rerun(args: &RerunArgs) -> Result<Report, Failure> {
    let recording = Recording::open(&args.file)?;
    let manifest = recording.manifest();
    let origins = notes::origins(manifest);
    let alone = notes::driven(manifest);
    if !alone.is_empty() {
        return Err(format!(
            "{} is a rerun of {} alone; rerun the recording that it was made from",
            args.file.display(),
            alone.join(", ")
        )
        .into());
    }
    let driven = driven(args)?;
    if origins.is_none() && (driven.is_empty() || args.graph.is_none()) {
        return Err(format!(
            "{} does not say how its run was made, as those of `launch up --lockstep --record` do; with --graph GRAPH and --only ROLE single \
             services can be run on it",
            args.file.display()
        )
        .into());
    }
    let overrides = origins.as_ref().filter(|_| args.graph.is_none()).map(|origins| &origins.overrides);
    let overrides = with_changes(overrides.cloned().unwrap_or_default(), args, manifest.seed);
    let whole = match (&args.graph, &origins) {
        (Some(graph), _) => {
            graph::prepare(&Request { graph: graph.clone(), overrides, build: !args.no_build })
        }
        (None, Some(origins)) => {
            let name = format!("the graph in {}", args.file.display());
            graph::prepare_recorded(&name, &origins.text, &origins.file, &overrides, !args.no_build)
        }
        (None, None) => None,
    };
    let Some(whole) = whole else { return Err(String::new().into()) };
    let roles: Vec<String> = match driven.as_slice() {
        [] => whole.services.iter().map(|service| service.role.clone()).collect(),
        driven => driven.to_vec(),
    };
    let mut remarks = origins.as_ref().map(|origins| origins.changes(&whole, &roles)).unwrap_or_default();
    let until = match notes::end(manifest) {
        Some(end) => end,
        None => last_stamp(&recording)?,
    };
    let mut pace = Pace { until: Some(until), last: Some(until), ..Pace::default() };
    let recorded = LastWord::of(&recording, whole.finish.as_deref())?;
    let is_changed = !args.with.is_empty() || !args.set.is_empty() || args.graph.is_some();
    if args.closed && is_changed && recorded.as_ref().is_some_and(LastWord::is_decided) {
        // Then the judge ended the run, and ends this one, be it later.
        let longer = Duration::from_nanos(until.as_nanos().saturating_mul(LONGER)) + Duration::from_secs(60);
        (pace.until, pace.last) = (Some(Time::ZERO.after(longer)), None);
    }
    pace.faults = notes::ordered(manifest);
    pace.faults.retain(|fault| roles.contains(&fault.role));
    let graph = if driven.is_empty() {
        let topics = notes::outside(manifest);
        if !topics.is_empty() {
            pace.script = Some(Script { file: args.file.clone(), topics, part: Part::Outside });
        }
        whole
    } else {
        let (graph, topics) = alone_on_record(whole, &driven, &recording, &mut remarks)?;
        pace.script = Some(Script { file: args.file.clone(), topics, part: Part::All });
        pace.notes = BTreeMap::from([(notes::DRIVEN.to_owned(), serde_json::to_string(&driven)?)]);
        if origins.is_none() {
            // Host time: the board's clock did not begin with the run.
            pace.begin = first_stamp(&recording)?;
        }
        graph
    };
    run_and_compare(args, &recording, recorded, &graph, pace, !driven.is_empty(), remarks)
}

/// The services that run alone; none when the whole graph runs.
fn driven(args: &RerunArgs) -> Result<Vec<String>, String> {
    if args.closed {
        return Ok(Vec::new());
    }
    let mut driven = args.only.clone();
    let role = |text: &str, end: char| text.split(end).next().unwrap_or_default().trim().to_owned();
    driven.extend(args.with.iter().map(|with| role(with, '=')));
    driven.extend(args.set.iter().map(|set| role(set, '.')));
    let for_all = driven.iter().any(|role| role == "graph");
    driven.retain(|role| role != "graph");
    driven.sort();
    driven.dedup();
    if for_all && driven.is_empty() {
        return Err(
            "what is set below `graph` is for all services: say --closed to run the whole graph anew with it, or --only ROLE to run single services"
                .to_owned(),
        );
    }
    Ok(driven)
}

fn with_changes(mut overrides: Overrides, args: &RerunArgs, seed: u64) -> Overrides {
    // A binary that was swapped in is swapped out again.
    overrides.swap.extend(args.with.iter().cloned());
    overrides.set.extend(args.set.iter().cloned());
    Overrides { seed: Some(seed), board: None, ..overrides }
}

/// The graph with these services alone, and the topics that the recording says to them: all but their own.
fn alone_on_record(
    mut graph: Checked,
    driven: &[String],
    recording: &Recording,
    remarks: &mut Vec<String>,
) -> Result<(Checked, Vec<String>), String> {
    for role in driven {
        if !graph.services.iter().any(|service| service.role == *role) {
            let known: Vec<&str> = graph.services.iter().map(|service| service.role.as_str()).collect();
            return Err(format!("the graph has no service `{role}`; there are {}", known.join(", ")));
        }
    }
    graph.services.retain(|service| driven.contains(&service.role));
    graph.faults.retain(|fault| driven.contains(&fault.role));
    // Whoever ends the run is on record too.
    graph.finish = None;
    let mut topics = Vec::new();
    for topic in &graph.topics {
        let own = matches!(&topic.publisher, Publisher::Service(role) if driven.contains(role));
        let read = topic.readers.iter().any(|reader| driven.contains(&reader.role));
        if !own && recording.manifest().topic(&topic.name).is_some() {
            topics.push(topic.name.clone());
        } else if !own && read {
            remarks.push(format!("`{}` is not on record: who reads it gets nothing", topic.name));
        }
    }
    Ok((graph, topics))
}

fn first_stamp(recording: &Recording) -> Result<Time, Failure> {
    let first = recording.in_order(|topic| !topic.is_health()).next().transpose()?;
    Ok(first.map_or(Time::ZERO, |message| Time::from_nanos(message.envelope.stamp_ns)))
}

/// The end of a run that did not end in order.
fn last_stamp(recording: &Recording) -> Result<Time, Failure> {
    let mut last = Time::ZERO;
    for message in recording.as_recorded(|topic| !topic.is_health()) {
        last = last.max(Time::from_nanos(message?.envelope.stamp_ns));
    }
    Ok(last)
}

fn run_and_compare(
    args: &RerunArgs,
    recording: &Recording,
    recorded: Option<LastWord>,
    graph: &Checked,
    mut pace: Pace,
    is_open: bool,
    remarks: Vec<String>,
) -> Result<Report, Failure> {
    let name = format!("rerun-{}", std::process::id());
    let kept = Kept::new(args.record.as_deref(), &name);
    pace.record = Some(kept.file.clone());
    let board = args.board.clone().unwrap_or(name);
    for swept in board::host::sweep_named(Some(&board))? {
        warn(&crate::summary::swept(&swept));
    }
    let options = Options { board: Some(board), ..Options::default() };
    let signals = Signals::catch()?;
    let console = Console::start();
    let outcome = lockstep::run(graph, &options, &pace, &signals, &console, Face::Trouble);
    console.flush();
    let outcome = outcome?;
    if outcome.interrupted {
        return Err("interrupted".into());
    }
    let rerun = Recording::open(&kept.file)?;
    let services: Vec<String> = graph.services.iter().map(|service| service.role.clone()).collect();
    let compared = compared_topics(graph, recording, is_open.then_some(&services));
    let Outcome { digest, wall_s, end, .. } = outcome;
    let digests = match is_open {
        false => Some(Digests { recorded: recording.digest()?, rerun: digest }),
        true => None,
    };
    let is_whole = recording.is_complete();
    let same = digests.as_ref().filter(|_| is_whole).map(|both| both.recorded == both.rerun);
    let topics = match same {
        Some(true) => Vec::new(),
        _ => compare_topics(recording, &rerun, &compared)?,
    };
    // A recording that was cut says nothing of what came after.
    let is_same = |topic: &TopicComparison| {
        let added = if is_whole { topic.added } else { 0 };
        let same_layout = topic.first.as_ref().is_none_or(|first| !first.field.starts_with("layout"));
        topic.changed + topic.missing + added == 0 && same_layout
    };
    let same = same.unwrap_or_else(|| topics.iter().all(is_same));
    let first = topics.iter().filter(|topic| !is_same(topic)).filter_map(|topic| topic.first.as_ref());
    let difference = first.min_by_key(|found| (found.stamp_ns, found.round)).cloned();
    let judge = match is_open {
        false => Judged::new(recorded, LastWord::of(&rerun, graph.finish.as_deref())?),
        true => None,
    };
    let mut remarks = remarks;
    if !is_open && judge.is_none() {
        remarks
            .push("no topic of this graph is that of a judge: what came of the run is not known".to_owned());
    }
    if pace.last.is_none() && pace.until.is_some_and(|until| end >= until) {
        let end_s = end.as_secs_f64();
        remarks.push(format!(
            "the rerun was broken off after {end_s:.0} s, long after the recorded run had ended"
        ));
    }
    if !is_whole {
        remarks.push("the recording was cut: it is compared up to its last whole chunk".to_owned());
    }
    Ok(Report {
        same,
        closed_or_open: if is_open { "open" } else { "closed" },
        services,
        logical_s: end.as_secs_f64(),
        wall_s,
        judge,
        digests,
        difference,
        topics,
        remarks,
    })
}

/// Every topic, or those of the services that ran alone.
fn compared_topics(graph: &Checked, recording: &Recording, alone: Option<&Vec<String>>) -> Vec<String> {
    let is_wanted = |publisher: Option<&String>| match alone {
        None => true,
        Some(roles) => publisher.is_some_and(|role| roles.contains(role)),
    };
    let recorded = recording
        .topics()
        .iter()
        .filter(|topic| !topic.is_health() && is_wanted(topic.publisher.as_ref()))
        .map(|topic| topic.name.clone());
    let now = graph.topics.iter().filter_map(|topic| {
        let publisher = match &topic.publisher {
            Publisher::Service(role) => Some(role),
            Publisher::External | Publisher::Nobody => None,
        };
        is_wanted(publisher).then(|| topic.name.clone())
    });
    let mut topics: Vec<String> = recorded.chain(now).collect();
    topics.sort();
    topics.dedup();
    topics
}

/// The recording of the rerun: kept if somebody wants it, and removed at the end otherwise.
struct Kept {
    file: PathBuf,
    is_wanted: bool,
}

impl Kept {
    fn new(wanted: Option<&Path>, name: &str) -> Self {
        match wanted {
            Some(file) => Self { file: file.to_owned(), is_wanted: true },
            None => {
                Self { file: std::env::temp_dir().join(format!("corkboard-{name}.mcap")), is_wanted: false }
            }
        }
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if !self.is_wanted {
            let _ = std::fs::remove_file(&self.file);
        }
    }
}
