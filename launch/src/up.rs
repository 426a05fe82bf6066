//! `launch up`: from a checked graph to a running robot, and back to an empty machine.

use crate::console::{Console, warn};
use crate::desk::{Desk, Face};
use crate::graph::Checked;
use crate::monitor::Monitor;
use crate::record::Recording;
use crate::runs::{self, Ended, Record};
use crate::signals::Signals;
use crate::summary;
use crate::supervise::Supervisor;
use board::clock;
use messages::RunState;
use rustix::event::{PollFd, PollFlags, poll};
use std::os::fd::AsFd as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// How a run is to be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Options {
    /// Another name for the board than the graph's.
    pub(crate) board: Option<String>,
    /// Keep logs here instead of among the runs of the board.
    pub(crate) logs: Option<PathBuf>,
    /// Record every message here; in logical time the pace says so.
    pub(crate) record: Option<PathBuf>,
    /// Print the end as JSON.
    pub(crate) json: bool,
    /// Go on when the judge has spoken.
    pub(crate) stay: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
enum End {
    /// The referee said so.
    Finished(RunState),
    /// Somebody asked.
    Asked(&'static str),
    /// A service is beyond help.
    Broken(String),
    /// The board is gone.
    Lost(String),
    /// All services have finished.
    AllFinished,
}

/// Runs a graph until it ends; the exit code tells how.
pub(crate) fn up(graph: &Checked, options: &Options, face: Face) -> ExitCode {
    let console = Console::start();
    let code = match run(graph, options, face, &console) {
        Ok(code) => code,
        Err(error) => {
            console.release();
            console.error(&format!("error: {error}"));
            1
        }
    };
    console.flush();
    ExitCode::from(code)
}

fn run(
    graph: &Checked,
    options: &Options,
    face: Face,
    console: &Console,
) -> Result<u8, Box<dyn std::error::Error>> {
    for swept in board::host::sweep_named(options.board.as_deref())? {
        console.error(&summary::swept(&swept));
    }
    let board = options.board.as_deref().unwrap_or(&graph.name);
    let signals = Signals::catch()?;
    let mut desk = Desk::new(graph, console.clone(), &signals, face);
    let mut supervisor = Supervisor::new(graph, board, options.logs.as_deref(), false)?;
    let begun = begin(graph, options, &mut supervisor, &mut desk);
    let (mut monitor, mut recording) = match begun {
        Ok(begun) => begun,
        Err(error) => {
            supervisor.stop(&|| true)?;
            return Err(error);
        }
    };
    let mut record = Record::begin(board, &graph.file, graph.seed, false);
    keep(&mut supervisor, &record);
    let end = watch(options, &mut supervisor, &mut monitor, &mut recording, &mut desk);
    let hurry = || signals.count() > 1;
    supervisor.halt(&hurry);
    supervisor.note(
        "",
        why(&end),
        !matches!(end, End::Finished(RunState::Passed) | End::Asked(_) | End::AllFinished),
    );
    desk.close(&supervisor, &monitor, None);
    let final_word = monitor.summary().copied();
    let logs = match &end {
        End::Broken(role) => supervisor.telling_lines(role, 12),
        _ => Vec::new(),
    };
    let restarts = supervisor.services.iter().map(|service| service.restarts).sum();
    drop(monitor);
    let recorded = recording.map_or(Ok(()), Recording::end);
    let folder = supervisor.logs().clone();
    let stopped = supervisor.stop(&hurry);
    console.release();
    if let End::Broken(role) = &end {
        console.error(&format!("error: `{role}` cannot go on; the last lines of its log:"));
        logs.iter().for_each(|line| console.error(&format!("  {line}")));
    }
    let mut failures: Vec<String> = Vec::new();
    if let End::Lost(words) = &end {
        failures.push(words.clone());
    }
    match stopped {
        Ok(unclean) => failures.extend(unclean),
        Err(error) => failures.push(format!("something of the board is left behind: {error}")),
    }
    failures.extend(recorded.err().map(|error| format!("the recording is not whole: {error}")));
    failures.iter().for_each(|failure| console.error(&format!("error: {failure}")));
    let text = final_word.as_ref().map(|word| summary::text(word, restarts)).unwrap_or_default();
    if let Some(word) = &final_word {
        console.print(&if options.json { summary::json(word, restarts) } else { text.clone() });
    }
    let code = match end {
        _ if !failures.is_empty() => 1,
        End::Finished(RunState::Passed) | End::Asked(_) | End::AllFinished => 0,
        End::Finished(_) | End::Broken(_) | End::Lost(_) => 1,
    };
    record.end = Some(Ended {
        at_unix_s: runs::unix_s(),
        why: failures.first().cloned().unwrap_or_else(|| why(&end)),
        code,
        summary: text,
        run: final_word.as_ref().map_or(serde_json::Value::Null, |word| summary::value(word, restarts)),
    });
    if let Err(error) = folder.write(&record) {
        console.error(&format!("the end of this run is not kept in {}: {error}", folder.path().display()));
    }
    Ok(code)
}

/// Everything that a run needs beside its services, which are started last.
fn begin(
    graph: &Checked,
    options: &Options,
    supervisor: &mut Supervisor,
    desk: &mut Desk<'_>,
) -> Result<(Monitor, Option<Recording>), Box<dyn std::error::Error>> {
    let place = supervisor.host.place().clone();
    desk.open(&place)?;
    let recording = options.record.as_deref();
    let recording = recording.map(|file| Recording::begin(&place, graph, file)).transpose()?;
    let monitor = Monitor::new(supervisor, graph.finish.as_deref())?;
    supervisor.start_all();
    Ok((monitor, recording))
}

/// Writes down that there is this run, so that its logs can be found while it lasts.
pub(crate) fn keep(supervisor: &mut Supervisor, record: &Record) {
    if let Err(error) = supervisor.logs().write(record) {
        let folder = supervisor.logs().path().display().to_string();
        supervisor.note("", format!("this run is not kept in {folder}: {error}"), true);
    }
}

fn why(end: &End) -> String {
    match end {
        End::Finished(RunState::Passed) => "the judge has ended the run: passed".to_owned(),
        End::Finished(_) => "the judge has ended the run: failed".to_owned(),
        End::Asked(words) => (*words).to_owned(),
        End::Broken(role) => format!("`{role}` cannot go on"),
        End::Lost(why) => why.clone(),
        End::AllFinished => "all services have ended by themselves".to_owned(),
    }
}

fn watch(
    options: &Options,
    supervisor: &mut Supervisor,
    monitor: &mut Monitor,
    recording: &mut Option<Recording>,
    desk: &mut Desk<'_>,
) -> End {
    let mut announced = false;
    let mut judged = false;
    let mut next_look = messages::Time::ZERO;
    loop {
        supervisor.tick();
        let now = clock::monotonic();
        if !announced && supervisor.all_ready() {
            announced = true;
            let took_ms = now.seconds_since(supervisor.began) * 1e3;
            let count = supervisor.services.len();
            supervisor.note("", format!("all {count} services are ready after {took_ms:.0} ms"), false);
        }
        if now >= next_look {
            next_look = now.after(std::time::Duration::from_millis(100));
            monitor.update(supervisor);
            if let Some((text, is_trouble)) = monitor.standstill(now).filter(|_| announced) {
                supervisor.note("", text, is_trouble);
            }
            if let Some(trouble) = recording.as_mut().and_then(Recording::trouble) {
                supervisor.note("", format!("the recording cannot go on: {trouble}"), true);
            }
        }
        desk.serve(now, supervisor, monitor, recording.as_ref(), &mut None);
        if let Some(word) = monitor.summary()
            && let Ok(state @ (RunState::Passed | RunState::Failed)) = word.state.get()
        {
            if !options.stay {
                return End::Finished(state);
            }
            if !std::mem::replace(&mut judged, true) {
                supervisor.note("", "the judge has spoken, and the robot stays up, as --stay says", false);
            }
        }
        if let Some(failed) = supervisor.failed() {
            return End::Broken(failed.service.role.clone());
        }
        if let Some(why) = supervisor.lost() {
            return End::Lost(why.to_owned());
        }
        if desk.signals.count() > 0 {
            return End::Asked(desk.signals.why());
        }
        if supervisor.all_finished() {
            return End::AllFinished;
        }
        let pause = supervisor.next_due(now).min(next_look.since(now));
        let pause = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(pause.subsec_nanos()) };
        let mut descriptors = vec![PollFd::from_borrowed_fd(desk.signals.as_fd(), PollFlags::IN)];
        descriptors
            .extend(supervisor.descriptors().map(|fd| PollFd::from_borrowed_fd(fd.as_fd(), PollFlags::IN)));
        let _ = poll(&mut descriptors, Some(&pause));
        drop(descriptors);
        desk.signals.drain();
    }
}

/// What an operator may want to know before a robot is left alone.
pub(crate) fn say_what_is_unwise(graph: &Checked) {
    if !graph.faults.is_empty() {
        warn("the faults of the graph happen in logical time only: with --lockstep");
    }
}
