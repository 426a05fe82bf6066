//! How the other commands talk to a running launcher: one JSON line there, one back, over a socket in the board's folder, which belongs to
//! its owner alone.

use crate::graph::Overrides;
use crate::supervise::{Event, Phase, SwapRequest, SwapState};
use board::host;
use board::place::Place;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

const SOCKET: &str = "control.sock";
/// Nobody may keep the launcher waiting for longer.
const PATIENCE: Duration = Duration::from_millis(200);
/// A service's description, with the messages of its topics, takes some.
const LINE_MAX: u64 = 4 * 1024 * 1024;

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
    /// Stop the robot, then the services.
    Stop {
        /// Without waiting for anybody.
        fast: bool,
    },
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
#[derive(Debug, Clone, Serialize, Deserialize)]
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

/// Opens the launcher's ear.
///
/// # Errors
/// When the socket cannot be made.
pub(crate) fn listen(place: &Place) -> io::Result<UnixListener> {
    let listener = UnixListener::bind(place.file(SOCKET))?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Answers whoever knocks now.
pub(crate) fn serve(listener: &UnixListener, mut answer: impl FnMut(Request) -> Answer) {
    while let Ok((stream, _)) = listener.accept() {
        let _ = converse(&stream, &mut answer);
    }
}

fn converse(stream: &UnixStream, answer: &mut impl FnMut(Request) -> Answer) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut line = String::new();
    let mut reader = BufReader::new(io::Read::take(stream, LINE_MAX));
    reader.read_line(&mut line)?;
    let answer = match serde_json::from_str(&line) {
        Ok(request) => answer(request),
        Err(error) => Answer::Refused(format!("not a request: {error}")),
    };
    let mut stream = stream;
    writeln!(stream, "{}", serde_json::to_string(&answer)?)
}

/// Asks the launcher of a board.
///
/// # Errors
/// When it does not answer.
pub(crate) fn ask(place: &Place, request: &Request) -> Result<Answer, String> {
    let no_answer = |error: io::Error| format!("the launcher of `{}` does not answer: {error}", place.name());
    let mut stream = UnixStream::connect(place.file(SOCKET)).map_err(no_answer)?;
    stream.set_read_timeout(Some(Duration::from_secs(5))).map_err(no_answer)?;
    let line = serde_json::to_string(request).map_err(|error| error.to_string())?;
    writeln!(stream, "{line}").map_err(no_answer)?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line).map_err(no_answer)?;
    match serde_json::from_str(&line) {
        Ok(Answer::Refused(why)) => Err(why),
        Ok(answer) => Ok(answer),
        Err(error) => Err(format!("the launcher of `{}` answers nonsense: {error}", place.name())),
    }
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
