//! `launch up --lockstep`: the same processes in logical time.

use crate::graph::Checked;
use crate::observer::Observer;
use crate::play::Stage;
use crate::prompter::{Part, Prompter};
use crate::summary;
use crate::supervise::Supervisor;
use crate::up::{Display, Options, Signals};
use board::clock;
use board::tap::Tap;
use messages::{RunState, RunSummary, Time};
use recording::{Digest, Recording};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

/// How a run in logical time is to be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pace {
    /// Logical seconds a second; `None` for as fast as possible.
    pub(crate) speed: Option<f64>,
    /// Begin at this moment.
    pub(crate) begin: Time,
    /// End after the instant at this moment, or the first one after it, whatever the referee says.
    pub(crate) until: Option<Time>,
    /// The processor for the whole graph.
    pub(crate) cpu: Option<usize>,
    /// Record every message here.
    pub(crate) record: Option<PathBuf>,
    /// What else the recording is to say of itself.
    pub(crate) notes: BTreeMap<String, String>,
    /// Say these words of a recording.
    pub(crate) script: Option<Script>,
    /// Take orders from the standard input.
    pub(crate) steered: bool,
}

/// What is said from a recording.
#[derive(Debug, Clone)]
pub(crate) struct Script {
    /// The recording.
    pub(crate) file: PathBuf,
    /// The topics.
    pub(crate) topics: Vec<String>,
    /// What is said on them.
    pub(crate) part: Part,
}

/// What a run in logical time has come to.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) verdict: Option<RunState>,
    pub(crate) summary: Option<RunSummary>,
    pub(crate) digest: Digest,
    /// The last instant.
    pub(crate) end: Time,
    pub(crate) wall_s: f64,
    pub(crate) turns: u64,
    pub(crate) restarts: u32,
    pub(crate) interrupted: bool,
}

/// Runs a graph in logical time until its referee, the limit or a person ends it.
///
/// # Errors
/// When the board or a service fails.
pub(crate) fn run(
    graph: &Checked,
    options: &Options,
    pace: &Pace,
    signals: &Signals,
    display: &mut dyn Display,
) -> Result<Outcome, Failure> {
    let board = options.board.as_deref().unwrap_or(&graph.name);
    let mut graph = graph.clone();
    // Turns are handed around thousands of times a second. On one processor that costs a switch; across two, an interrupt.
    let cpu = pace.cpu.unwrap_or_else(last_processor);
    for service in graph.services.iter_mut().filter(|service| service.launch.cpu.is_empty()) {
        service.launch.cpu = vec![cpu];
    }
    let mut set = rustix::thread::CpuSet::new();
    set.set(cpu);
    rustix::thread::sched_setaffinity(None, &set)?;
    let script = pace.script.as_ref().map(|script| Recording::open(&script.file)).transpose()?;
    let mut supervisor = Supervisor::new(&graph, board, options.logs.as_deref(), true)?;
    let observer = Tap::join(supervisor.host.place().clone(), "observer")
        .map_err(Into::into)
        .and_then(|tap| Observer::new(tap, &graph, pace));
    let mut observer = match observer {
        Ok(observer) => observer,
        Err(error) => {
            supervisor.stop(&|| true)?;
            return Err(error.into());
        }
    };
    supervisor.start_all();
    let outcome = wait_until_ready(&mut supervisor, signals)
        .and_then(|()| prompter(&supervisor, script.as_ref(), pace))
        .and_then(|prompter| Stage::new(&graph, &mut supervisor, &mut observer, prompter, pace))
        .and_then(|mut stage| stage.play(pace, signals, display));
    display.close();
    if let Err(error) = &outcome {
        let role = supervisor
            .services
            .iter()
            .find(|service| error.to_string().contains(&format!("`{}`", service.service.role)));
        if let Some(service) = role {
            let role = service.service.role.clone();
            eprintln!("the last lines of the log of `{role}`:");
            supervisor.last_log_lines(&role, 12).iter().for_each(|line| eprintln!("  {line}"));
        }
    }
    let recorded = observer.finish(outcome.as_ref().ok().map(|outcome| outcome.end));
    drop(observer);
    supervisor.stop(&|| signals.count() > 1)?;
    recorded?;
    outcome
}

fn prompter<'a>(
    supervisor: &Supervisor,
    recording: Option<&'a Recording>,
    pace: &Pace,
) -> Result<Prompter<'a>, Failure> {
    let (Some(recording), Some(script)) = (recording, &pace.script) else { return Ok(Prompter::default()) };
    let tap = Tap::join(supervisor.host.place().clone(), "prompter")?;
    Ok(Prompter::new(tap, recording, &script.topics, script.part)?)
}

fn wait_until_ready(supervisor: &mut Supervisor, signals: &Signals) -> Result<(), Failure> {
    while !supervisor.all_ready() {
        supervisor.tick();
        if let Some(failed) = supervisor.failed() {
            let role = failed.service.role.clone();
            let last = supervisor.last_log_lines(&role, 1).pop().unwrap_or_default();
            return Err(format!("`{role}` cannot start: {last}").into());
        }
        if signals.count() > 0 {
            return Err("interrupted".into());
        }
        clock::sleep(Duration::from_millis(1));
    }
    Ok(())
}

/// `launch up --lockstep`, with its last lines.
pub(crate) fn up(graph: &Checked, options: &Options, pace: &Pace, display: &mut dyn Display) -> ExitCode {
    let run = || -> Result<Outcome, Failure> {
        for swept in board::host::sweep_named(options.board.as_deref())? {
            eprintln!("{}", summary::swept(&swept));
        }
        let signals = Signals::catch()?;
        run(graph, options, pace, &signals, display)
    };
    let mut run = run;
    match run() {
        Ok(outcome) => {
            print!("{}", if options.json { as_json(&outcome) } else { as_text(&outcome) });
            let failed = outcome.verdict == Some(RunState::Failed);
            if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn as_text(outcome: &Outcome) -> String {
    let word = outcome.summary.as_ref().map(|word| summary::text(word, outcome.restarts)).unwrap_or_default();
    let interrupted = if outcome.interrupted { "interrupted after " } else { "" };
    format!(
        "{word}{interrupted}{:.3} s of logical time in {:.3} s: {:.0} x real time, {} turns\ndigest {} ({} messages)\n",
        outcome.end.as_secs_f64(),
        outcome.wall_s,
        outcome.end.as_secs_f64() / outcome.wall_s.max(1e-9),
        outcome.turns,
        outcome.digest.digest,
        outcome.digest.messages,
    )
}

fn as_json(outcome: &Outcome) -> String {
    let run = outcome
        .summary
        .as_ref()
        .map(|word| summary::json(word, outcome.restarts))
        .unwrap_or_else(|| "null".to_owned());
    let run: serde_json::Value = serde_json::from_str(&run).unwrap_or_default();
    let value = serde_json::json!({
        "run": run,
        "logical_s": outcome.end.as_secs_f64(),
        "wall_s": outcome.wall_s,
        "turns": outcome.turns,
        "digest": outcome.digest,
        "interrupted": outcome.interrupted,
    });
    format!("{value}\n")
}

fn last_processor() -> usize {
    let allowed = rustix::thread::sched_getaffinity(None).ok();
    let last = allowed.and_then(|set| (0..1024).rev().find(|&processor| set.is_set(processor)));
    last.unwrap_or(0)
}
