//! How the other commands talk to a running launcher: one JSON line there, one back, over a socket in the board's folder, which belongs to
//! its owner alone.

mod ear;

pub(crate) use ear::Ear;

use crate::event::Event;
use crate::graph::{Overrides, ViewSettings};
use crate::supervise::{Phase, SwapRequest, SwapState};
use board::host;
use board::place::Place;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

const SOCKET: &str = "control.sock";
/// For so long a launcher may take to answer a command.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// What is asked of the launcher.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Request {
    /// How does everything stand?
    Status,
    /// End a service and start it again.
    Restart {
        /// Its name.
        role: String,
    },
    /// Let another service play a role.
    Swap(Box<SwapRequest>),
    /// Send the newcomer of a role away, or bring back its predecessor.
    SwapBack {
        /// The role.
        role: String,
    },
    /// Change how fast logical time goes.
    Pace(PaceChange),
    /// Stop the robot, then the services.
    Stop {
        /// Without waiting for anybody.
        fast: bool,
    },
}

/// What is changed about the pace of logical time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PaceChange {
    /// Stand still, or go on.
    Pause(bool),
    /// While it stands still: play so much.
    Step(Duration),
    /// So many times as fast as now; from as fast as possible it comes down to real time.
    Times(f64),
    /// As fast as possible.
    Fastest,
}

/// The pace of logical time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tempo {
    /// Logical seconds a second; `None` for as fast as possible.
    pub(crate) speed: Option<f64>,
    /// Whether it stands still.
    pub(crate) paused: bool,
    /// While it stands still: how much is still to be played.
    pub(crate) step_ns: u64,
    /// Counts the changes.
    #[serde(skip)]
    pub(crate) changes: u32,
}

impl Tempo {
    /// Of a run that begins.
    pub(crate) fn new(speed: Option<f64>) -> Self {
        Self { speed, paused: false, step_ns: 0, changes: 0 }
    }

    /// Changes it.
    pub(crate) fn change(&mut self, change: PaceChange) {
        self.changes = self.changes.wrapping_add(1);
        match change {
            PaceChange::Pause(paused) => (self.paused, self.step_ns) = (paused, 0),
            PaceChange::Step(length) => {
                self.paused = true;
                self.step_ns = u64::try_from(length.as_nanos()).unwrap_or(u64::MAX);
            }
            PaceChange::Times(factor) if factor.is_finite() && factor > 0.0 => {
                self.speed = Some(self.speed.map_or(1.0, |speed| speed * factor).clamp(0.01, 1000.0));
            }
            PaceChange::Times(_) => {}
            PaceChange::Fastest => self.speed = None,
        }
    }
}

/// What the launcher answers.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Answer {
    /// It is being done.
    Done,
    /// How everything stands.
    Status(Box<Status>),
    /// It cannot be done.
    Refused(String),
}

/// How a running graph stands.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Status {
    /// The board.
    pub(crate) board: String,
    /// The graph's file.
    pub(crate) graph: String,
    /// The launcher's process.
    pub(crate) launcher_pid: u32,
    /// Seconds since `up`.
    pub(crate) uptime_s: f64,
    /// What differs from the graph's file.
    pub(crate) overrides: Overrides,
    /// Where the logs are.
    pub(crate) logs: String,
    /// `live` or `lockstep`.
    pub(crate) mode: String,
    /// The graph's folder, from which the files of the view count.
    pub(crate) folder: String,
    /// What a view shows.
    pub(crate) view: ViewSettings,
    /// The file into which all messages are recorded.
    pub(crate) recording: Option<String>,
    /// In lockstep: how fast logical time goes.
    pub(crate) tempo: Option<Tempo>,
    /// In lockstep: the logical moment.
    pub(crate) logical_s: Option<f64>,
    /// The services, in the order of the graph.
    pub(crate) services: Vec<ServiceStatus>,
    /// What happened lately.
    pub(crate) events: Vec<EventLine>,
}

/// What happened, for the wire.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct EventLine {
    /// Seconds since `up`.
    pub(crate) at_s: f64,
    /// The service, empty for the whole set.
    pub(crate) role: String,
    /// What happened.
    pub(crate) text: String,
    /// Whether something went wrong.
    pub(crate) is_trouble: bool,
}

impl From<&Event> for EventLine {
    fn from(event: &Event) -> Self {
        Self {
            at_s: event.at_s,
            role: event.role.clone(),
            text: event.text.clone(),
            is_trouble: event.is_trouble,
        }
    }
}

/// How one service stands.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct ServiceStatus {
    /// Its name in the graph.
    pub(crate) role: String,
    /// Its binary.
    pub(crate) run: String,
    /// What it is doing.
    pub(crate) state: String,
    /// Its process, while it lives.
    pub(crate) pid: Option<u32>,
    /// Starts after the first.
    pub(crate) restarts: u32,
    /// Steps per second, over the last second.
    pub(crate) rate_hz: f64,
    /// Share of one processor, over the last second.
    pub(crate) cpu_percent: f64,
    /// Memory that is its own and present.
    pub(crate) memory_kib: u64,
    /// Median step.
    pub(crate) step_p50_us: f64,
    /// 99 % of the steps are shorter.
    pub(crate) step_p99_us: f64,
    /// Longest step.
    pub(crate) step_max_us: f64,
    /// Steps that began more than a period late.
    pub(crate) late_steps: u64,
    /// Messages lost by overflow.
    pub(crate) lost_messages: u64,
    /// Messages that could not be read as what they claim to be.
    pub(crate) invalid_messages: u64,
    /// How its last swap stands.
    pub(crate) swap: Option<SwapState>,
}

/// The name of a phase, as people read it.
pub(crate) fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Starting => "starting",
        Phase::Running => "running",
        Phase::Waiting => "restarting",
        Phase::Finished => "finished",
        Phase::Failed => "failed",
    }
}

/// Where a board's launcher listens.
fn socket(place: &Place) -> PathBuf {
    place.file(SOCKET)
}

/// Asks the launcher of a board.
///
/// # Errors
/// When it refuses, or does not answer: with what it is busy with, as far as can be seen.
pub(crate) fn ask(place: &Place, request: &Request) -> Result<Answer, String> {
    ask_within(place, request, ANSWER_WITHIN)
}

/// As [`ask`], for those who know what to do when there is no answer.
///
/// # Errors
/// As [`ask`].
pub(crate) fn ask_within(place: &Place, request: &Request, limit: Duration) -> Result<Answer, String> {
    let line = converse(place, request, limit).map_err(|error| no_answer(place, &error))?;
    match serde_json::from_str(&line) {
        Ok(Answer::Refused(why)) => Err(why),
        Ok(answer) => Ok(answer),
        Err(_) if line.is_empty() => Err(no_answer(place, &io::ErrorKind::UnexpectedEof.into())),
        Err(error) => Err(format!("the launcher of `{}` answers nonsense: {error}", place.name())),
    }
}

fn converse(place: &Place, request: &Request, limit: Duration) -> io::Result<String> {
    use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
    // Without blocking: a launcher that stands still has a full waiting room, before which `connect` waits for ever.
    let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
    let stream = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    connect(&stream, &SocketAddrUnix::new(socket(place))?)?;
    let mut stream = UnixStream::from(stream);
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(limit))?;
    stream.set_write_timeout(Some(limit))?;
    let line = serde_json::to_string(request)?;
    writeln!(stream, "{line}")?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line)?;
    Ok(line)
}

/// Why there is no answer, in words for the operator.
fn no_answer(place: &Place, error: &io::Error) -> String {
    let board = place.name();
    let pid = match host::living_launcher(place) {
        Ok(Some(pid)) => pid,
        Ok(None) => return format!("the board `{board}` is down"),
        Err(error) => return error.to_string(),
    };
    if is_suspended(pid) {
        return format!(
            "the launcher of `{board}` (process {pid}) is suspended; `kill -CONT {pid}` lets it go on, `launch stop` ends the robot"
        );
    }
    let why = match error.kind() {
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => "it has not said a word in time".to_owned(),
        io::ErrorKind::UnexpectedEof => "it hung up".to_owned(),
        io::ErrorKind::NotFound => "it has just come up, or is going down".to_owned(),
        _ => error.to_string(),
    };
    format!("the launcher of `{board}` (process {pid}) does not answer: {why}")
}

/// Whether a process was stopped by a signal or by a debugger.
pub(crate) fn is_suspended(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let state = stat.rsplit(')').next().and_then(|rest| rest.trim_start().chars().next());
    matches!(state, Some('T' | 't'))
}

/// Whether the launcher of a board lives.
///
/// # Errors
/// When that cannot be told.
pub(crate) fn is_up(place: &Place) -> Result<bool, String> {
    host::living_launcher(place).map(|launcher| launcher.is_some()).map_err(|error| error.to_string())
}

/// The board that is meant: the one named, or the only one that is up.
///
/// # Errors
/// When it is not up, or the choice is not clear.
pub(crate) fn choose(name: Option<&str>) -> Result<Place, String> {
    let mut running = host::boards_up().map_err(|error| error.to_string())?;
    let names = || running.iter().map(|place| format!("`{}`", place.name())).collect::<Vec<_>>().join(", ");
    match name {
        Some(name) => match running.iter().position(|place| place.name() == name) {
            Some(index) => Ok(running.swap_remove(index)),
            None if running.is_empty() => {
                Err(format!("no board `{name}` is up, and no other; start one with `launch up {name}`"))
            }
            None => Err(format!("no board `{name}` is up; there is {}", names())),
        },
        None => match running.len() {
            0 => Err("no board is up; start one with `launch up coffee`".to_owned()),
            1 => Ok(running.swap_remove(0)),
            _ => Err(format!("several boards are up: {}; choose one with --board", names())),
        },
    }
}
