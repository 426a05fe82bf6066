//! `launch up --lockstep`: the same processes in logical time.

use crate::conductor::{Conductor, Discord};
use crate::graph::Checked;
use crate::monitor::Monitor;
use crate::observer::Observer;
use crate::summary;
use crate::supervise::{Phase, Supervisor};
use crate::up::{Display, Options, Signals};
use board::clock;
use board::tap::Tap;
use messages::{RunState, RunSummary, Time};
use recording::Digest;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Between two looks at signals, deaths and the screen.
const GLANCE: Duration = Duration::from_millis(20);

/// How a run in logical time is to be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pace {
    /// Logical seconds a second; `None` for as fast as possible.
    pub(crate) speed: Option<f64>,
    /// End after so many logical seconds, whatever the referee says.
    pub(crate) until_s: Option<f64>,
    /// The processor for the whole graph.
    pub(crate) cpu: Option<usize>,
    /// Record every message here.
    pub(crate) record: Option<PathBuf>,
}

/// What a run in logical time has come to.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    pub(crate) verdict: Option<RunState>,
    pub(crate) summary: Option<RunSummary>,
    pub(crate) digest: Digest,
    pub(crate) logical_s: f64,
    pub(crate) wall_s: f64,
    pub(crate) turns: u64,
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
) -> Result<Outcome, Box<dyn std::error::Error>> {
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
    let mut supervisor = Supervisor::new(&graph, board, options.logs.as_deref(), true)?;
    let observer = Tap::join(supervisor.host.place().clone(), "observer")
        .map_err(Into::into)
        .and_then(|tap| Observer::new(tap, graph.finish.as_deref(), pace.record.as_deref()));
    let mut observer = match observer {
        Ok(observer) => observer,
        Err(error) => {
            supervisor.stop(&|| true)?;
            return Err(error.into());
        }
    };
    supervisor.start_all();
    let outcome = wait_until_ready(&mut supervisor, signals)
        .and_then(|()| Monitor::new(&supervisor, None).map_err(Into::into))
        .and_then(|mut monitor| play(&mut supervisor, &mut monitor, &mut observer, pace, signals, display));
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
    let recorded = observer.finish();
    drop(observer);
    supervisor.stop(&|| signals.count() > 1)?;
    recorded?;
    outcome
}

fn wait_until_ready(
    supervisor: &mut Supervisor,
    signals: &Signals,
) -> Result<(), Box<dyn std::error::Error>> {
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

fn play(
    supervisor: &mut Supervisor,
    monitor: &mut Monitor,
    observer: &mut Observer,
    pace: &Pace,
    signals: &Signals,
    display: &mut dyn Display,
) -> Result<Outcome, Box<dyn std::error::Error>> {
    let mut conductor = Conductor::new(&supervisor.host);
    let began = clock::monotonic();
    let mut next_glance = began.after(GLANCE);
    let limit = pace.until_s.map_or(Time::from_nanos(u64::MAX), Time::from_secs_f64);
    let mut interrupted = false;
    while observer.verdict().is_none() && conductor.now() < limit {
        let pids: Vec<(String, Option<u32>)> =
            supervisor.services.iter().map(|service| (service.service.role.clone(), service.pid())).collect();
        let mut lives = |role: &str| {
            let pid = pids.iter().find(|(known, _)| known == role).and_then(|(_, pid)| *pid);
            pid.is_some_and(board::switchboard::process_lives)
        };
        // Many instants for one glance: the glance looks at processes and the screen.
        loop {
            let mut seen = Ok(());
            let mut look = |_, _| {
                if seen.is_ok() {
                    seen = observer.look();
                }
            };
            let played = conductor.play_instant(&supervisor.host, &mut look, &mut lives);
            seen?;
            match played {
                Ok(()) => {}
                // Everything has been said: a run without a referee ends so.
                Err(Discord::Over { .. })
                    if supervisor.services.iter().any(|service| service.phase == Phase::Finished) =>
                {
                    return Ok(outcome(&conductor, observer, began, false));
                }
                Err(discord) => return Err(discord.into()),
            }
            if observer.verdict().is_some() || conductor.now() >= limit || clock::monotonic() >= next_glance {
                break;
            }
            if let Some(speed) = pace.speed {
                let ahead = conductor.now().as_secs_f64() / speed - clock::monotonic().seconds_since(began);
                if ahead > 0.0 {
                    clock::sleep(Duration::from_secs_f64(ahead.min(0.02)));
                }
            }
        }
        next_glance = clock::monotonic().after(GLANCE);
        observer.tick(clock::monotonic())?;
        supervisor.tick();
        monitor.update(supervisor);
        display.show(supervisor, monitor);
        if signals.count() > 0 || display.wants_to_leave() {
            interrupted = true;
            break;
        }
    }
    Ok(outcome(&conductor, observer, began, interrupted))
}

fn outcome(conductor: &Conductor, observer: &Observer, began: Time, interrupted: bool) -> Outcome {
    Outcome {
        verdict: observer.verdict(),
        summary: observer.summary().copied(),
        digest: observer.digest(),
        logical_s: conductor.now().as_secs_f64(),
        wall_s: clock::monotonic().seconds_since(began),
        turns: conductor.turns,
        interrupted,
    }
}

/// `launch up --lockstep`, with its last lines.
pub(crate) fn up(graph: &Checked, options: &Options, pace: &Pace, display: &mut dyn Display) -> ExitCode {
    let run = || -> Result<Outcome, Box<dyn std::error::Error>> {
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
    let word = outcome.summary.as_ref().map(|word| summary::text(word, 0)).unwrap_or_default();
    let interrupted = if outcome.interrupted { "interrupted after " } else { "" };
    format!(
        "{word}{interrupted}{:.3} s of logical time in {:.3} s: {:.0} x real time, {} turns\ndigest {} ({} messages)\n",
        outcome.logical_s,
        outcome.wall_s,
        outcome.logical_s / outcome.wall_s.max(1e-9),
        outcome.turns,
        outcome.digest.digest,
        outcome.digest.messages,
    )
}

fn as_json(outcome: &Outcome) -> String {
    let run =
        outcome.summary.as_ref().map(|word| summary::json(word, 0)).unwrap_or_else(|| "null".to_owned());
    let run: serde_json::Value = serde_json::from_str(&run).unwrap_or_default();
    let value = serde_json::json!({
        "run": run,
        "logical_s": outcome.logical_s,
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
