//! `launch up --lockstep`: the same processes in logical time.

use crate::console::Console;
use crate::desk::{Desk, Face};
use crate::graph::Checked;
use crate::observer::Observer;
use crate::play::Stage;
use crate::prompter::Prompter;
use crate::run::{Outcome, Pace};
use crate::runs::{self, Ended, Record};
use crate::signals::Signals;
use crate::summary;
use crate::supervise::Supervisor;
use crate::up::{self, Options};
use board::clock;
use board::tap::Tap;
use recording::Recording;
use std::process::ExitCode;
use std::time::Duration;

type Failure = Box<dyn std::error::Error>;

/// Runs a graph in logical time until its referee, the limit or a person ends it.
///
/// # Errors
/// When the board or a service fails.
pub(crate) fn run(
    graph: &Checked,
    options: &Options,
    pace: &Pace,
    signals: &Signals,
    console: &Console,
    face: Face,
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
    let script = pace.script.as_ref().map(|script| Recording::open(&script.file)).transpose()?;
    let mut supervisor = Supervisor::new(&graph, board, options.logs.as_deref(), true)?;
    let mut desk = Desk::new(&graph, console.clone(), signals, face);
    // What speaks to people has a processor of its own where there is one.
    let opened = desk.open(supervisor.host.place());
    let pinned = rustix::thread::sched_setaffinity(None, &set);
    let observer = opened
        .map_err(Failure::from)
        .and_then(|()| pinned.map_err(|error| format!("--cpu {cpu}: {error}").into()))
        .and_then(|()| Tap::join(supervisor.host.place().clone(), "observer").map_err(Into::into))
        .and_then(|tap| Observer::new(tap, &graph, pace).map_err(Into::into));
    let mut observer = match observer {
        Ok(observer) => observer,
        Err(error) => {
            supervisor.stop(&|| true)?;
            return Err(error);
        }
    };
    let mut record = Record::begin(board, &graph.file, graph.seed, true);
    up::keep(&mut supervisor, &record);
    supervisor.start_all();
    let outcome = wait_until_ready(&mut supervisor, signals)
        .and_then(|()| prompter(&supervisor, script.as_ref(), pace))
        .and_then(|prompter| Stage::new(&graph, &mut supervisor, &mut observer, prompter, pace, desk))
        .and_then(|mut stage| {
            let played = stage.play(pace);
            stage.close();
            played
        });
    let ended = match &outcome {
        Ok(outcome) => outcome.ended(signals),
        Err(error) => error.to_string(),
    };
    supervisor.note("", ended.clone(), outcome.is_err());
    let mut failures = Vec::new();
    if let Err(error) = &outcome {
        let role = supervisor
            .services
            .iter()
            .find(|service| error.to_string().contains(&format!("`{}`", service.service.role)));
        if let Some(service) = role {
            let role = service.service.role.clone();
            let lines = supervisor.telling_lines(&role, 12);
            if !lines.is_empty() {
                console.error(&format!("the last lines of the log of `{role}`:"));
                lines.iter().for_each(|line| console.error(&format!("  {line}")));
            }
        }
    }
    let recorded = observer.finish(outcome.as_ref().ok());
    drop(observer);
    let folder = supervisor.logs().clone();
    failures.extend(supervisor.stop(&|| signals.count() > 1)?);
    recorded?;
    let mut outcome = outcome;
    if let Ok(outcome) = &mut outcome {
        outcome.unclean = failures;
    }
    let passed = outcome.as_ref().is_ok_and(Outcome::is_success);
    record.end = Some(Ended {
        at_unix_s: runs::unix_s(),
        why: ended,
        code: u8::from(!passed),
        summary: outcome.as_ref().map(as_text).unwrap_or_default(),
        run: outcome.as_ref().map(as_value).unwrap_or_default(),
    });
    if let Err(error) = folder.write(&record) {
        console.error(&format!("the end of this run is not kept in {}: {error}", folder.path().display()));
    }
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
pub(crate) fn up(graph: &Checked, options: &Options, pace: &Pace, face: Face) -> ExitCode {
    let console = Console::start();
    let code = match run_to_the_end(graph, options, pace, face, &console) {
        Ok(outcome) => {
            console.release();
            console.print(&if options.json {
                format!("{}\n", as_value(&outcome))
            } else {
                as_text(&outcome)
            });
            outcome.unclean.iter().for_each(|failure| console.error(&format!("error: {failure}")));
            if outcome.is_success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            console.release();
            console.error(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    };
    console.flush();
    code
}

fn run_to_the_end(
    graph: &Checked,
    options: &Options,
    pace: &Pace,
    face: Face,
    console: &Console,
) -> Result<Outcome, Failure> {
    for swept in board::host::sweep_named(options.board.as_deref())? {
        console.error(&summary::swept(&swept));
    }
    let signals = Signals::catch()?;
    run(graph, options, pace, &signals, console, face)
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

fn as_value(outcome: &Outcome) -> serde_json::Value {
    let run = outcome.summary.as_ref().map(|word| summary::value(word, outcome.restarts));
    serde_json::json!({
        "run": run,
        "logical_s": outcome.end.as_secs_f64(),
        "wall_s": outcome.wall_s,
        "turns": outcome.turns,
        "digest": outcome.digest,
        "interrupted": outcome.interrupted,
        "unclean": outcome.unclean,
    })
}

fn last_processor() -> usize {
    let allowed = rustix::thread::sched_getaffinity(None).ok();
    let last = allowed.and_then(|set| (0..1024).rev().find(|&processor| set.is_set(processor)));
    last.unwrap_or(0)
}
