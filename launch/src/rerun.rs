//! `launch rerun`: a recorded run again, whole or service by service on the recorded inputs, and whether it comes out the same.

use crate::cli::RerunArgs;
use crate::console::Console;
use crate::console::{say, say_line, warn};
use crate::desk::Face;
use crate::graph::{self, Checked, Overrides, Publisher, Request};
use crate::lockstep::{self, Outcome, Pace, Script};
use crate::notes;
use crate::prompter::Part;
use crate::signals::Signals;
use crate::up::Options;
use messages::Time;
use recording::{Difference, Digest, Recording, TopicComparison, compare_topics};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

type Failure = Box<dyn std::error::Error>;

/// The exit code of what could not be run.
const NOT_RUN: u8 = 2;

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
                say(&text(&report));
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
    run_and_compare(args, &recording, &graph, pace, !driven.is_empty(), remarks)
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
    let first = recording.in_order(|topic| !topic.name.starts_with("health/")).next().transpose()?;
    Ok(first.map_or(Time::ZERO, |message| Time::from_nanos(message.envelope.stamp_ns)))
}

/// The end of a run that did not end in order.
fn last_stamp(recording: &Recording) -> Result<Time, Failure> {
    let mut last = Time::ZERO;
    for message in recording.as_recorded(|topic| !topic.name.starts_with("health/")) {
        last = last.max(Time::from_nanos(message?.envelope.stamp_ns));
    }
    Ok(last)
}

fn run_and_compare(
    args: &RerunArgs,
    recording: &Recording,
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
    let mut remarks = remarks;
    if !is_whole {
        remarks.push("the recording was cut: it is compared up to its last whole chunk".to_owned());
    }
    Ok(Report {
        same,
        closed_or_open: if is_open { "open" } else { "closed" },
        services,
        logical_s: end.as_secs_f64(),
        wall_s,
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
        .filter(|topic| !topic.name.starts_with("health/") && is_wanted(topic.publisher.as_ref()))
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

fn text(report: &Report) -> String {
    let mut text = String::new();
    let mut line = |words: String| text += &(words + "\n");
    for remark in &report.remarks {
        line(format!("note: {remark}"));
    }
    let who = match report.closed_or_open {
        "open" => format!("{} on the recorded inputs", report.services.join(", ")),
        _ => format!("all {} services", report.services.len()),
    };
    line(format!("{who}: {:.3} s of logical time in {:.3} s", report.logical_s, report.wall_s));
    // Of a whole graph only the topics that differ are of interest.
    let is_of_interest = |topic: &&TopicComparison| {
        report.closed_or_open == "open" || topic.changed + topic.missing + topic.added > 0
    };
    let topics: Vec<&TopicComparison> = report.topics.iter().filter(is_of_interest).collect();
    if !topics.is_empty() {
        text += &table(&topics);
    }
    let mut line = |words: String| text += &(words + "\n");
    for topic in topics {
        for field in topic.fields.iter().filter(|_| report.closed_or_open == "open") {
            line(format!(
                "`{}`: `{}` differs in {} messages, by {} on average and {} at most",
                topic.topic,
                field.field,
                field.messages,
                rounded(field.mean),
                rounded(field.largest)
            ));
        }
        if let Some(first) = &topic.first {
            line(format!("first {}", words(first)));
        }
    }
    match (&report.digests, report.same) {
        (Some(both), true) if both.recorded == both.rerun => {
            line(format!("SAME: digest {} ({} messages)", both.rerun.digest, both.rerun.messages));
        }
        (_, true) => line("SAME: every message that was compared".to_owned()),
        (both, false) => {
            let first = report.difference.as_ref().map(|first| format!(": {}", words(first)));
            line(format!("DIFFERENT{}", first.unwrap_or_default()));
            if let Some(both) = both {
                line(format!("  digest {} recorded, {} now", both.recorded.digest, both.rerun.digest));
            }
        }
    }
    text
}

fn table(topics: &[&TopicComparison]) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    table.set_header([
        "topic",
        "recorded",
        "rerun",
        "same",
        "changed",
        "missing",
        "added",
        "first difference",
    ]);
    for topic in topics {
        let first = topic.first.as_ref().map(|first| format!("{:.6} s", first.stamp_ns as f64 * 1e-9));
        let counts = [topic.recorded, topic.rerun, topic.same, topic.changed, topic.missing, topic.added];
        let cells = counts.into_iter().map(|count| count.to_string());
        table.add_row(std::iter::once(topic.topic.clone()).chain(cells).chain([first.unwrap_or_default()]));
    }
    format!("{table}\n")
}

fn words(difference: &Difference) -> String {
    let Difference { topic, stamp_ns, field, a, b, .. } = difference;
    let short = |value: &serde_json::Value| {
        let text = value.to_string();
        match text.char_indices().nth(160) {
            Some((end, _)) => format!("{} ..", &text[..end]),
            None => text,
        }
    };
    let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
    let (a, b) = (short(a), short(b));
    match (a.as_str(), b.as_str()) {
        ("null", _) if field == "message" => {
            format!("`{topic}` at {seconds}.{nanos:09} s: only the rerun has a message")
        }
        (_, "null") if field == "message" => {
            format!("`{topic}` at {seconds}.{nanos:09} s: only the recording has a message")
        }
        _ => format!("`{topic}` at {seconds}.{nanos:09} s: `{field}` was {a} and is {b}"),
    }
}

fn rounded(value: f64) -> String {
    if value != 0.0 && (value.abs() < 1e-3 || value.abs() >= 1e6) {
        format!("{value:.3e}")
    } else {
        format!("{value:.4}")
    }
}
