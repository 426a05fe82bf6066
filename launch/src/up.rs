//! `launch up`: from a checked graph to a running robot, and back to an empty machine.

use crate::control::{self, Answer, Request};
use crate::graph::Checked;
use crate::monitor::Monitor;
use crate::summary;
use crate::supervise::Supervisor;
use board::clock;
use messages::{RunState, Time};
use rustix::event::{PollFd, PollFlags, poll};
use std::io::{Read as _, Write as _};
use std::os::fd::AsFd as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// What shows the run to a person.
pub(crate) trait Display {
    /// Called about ten times a second, and when something happened.
    fn show(&mut self, supervisor: &Supervisor, monitor: &mut Monitor);
    /// Whether the person wants to leave.
    fn wants_to_leave(&mut self) -> bool;
    /// Gives the terminal back.
    fn close(&mut self);
}

/// How a run is to be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Options {
    /// Another name for the board than the graph's.
    pub(crate) board: Option<String>,
    /// Keep logs here instead of on the board.
    pub(crate) logs: Option<PathBuf>,
    /// Print the end as JSON.
    pub(crate) json: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
enum End {
    /// The referee said so.
    Finished(RunState),
    /// Somebody asked.
    Asked,
    /// A service is beyond help.
    Broken(String),
    /// All services have finished.
    AllFinished,
}

/// Runs a graph until it ends; the exit code tells how.
pub(crate) fn up(graph: &Checked, options: &Options, display: &mut dyn Display) -> ExitCode {
    match run(graph, options, display) {
        Ok(code) => code,
        Err(error) => {
            display.close();
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(
    graph: &Checked,
    options: &Options,
    display: &mut dyn Display,
) -> Result<ExitCode, Box<dyn std::error::Error>> {
    for swept in board::host::sweep_named(options.board.as_deref())? {
        eprintln!("{}", summary::swept(&swept));
    }
    let board = options.board.as_deref().unwrap_or(&graph.name);
    let signals = Signals::catch()?;
    let mut supervisor = Supervisor::new(graph, board, options.logs.as_deref(), false)?;
    let listener = control::listen(supervisor.host.place())?;
    supervisor.start_all();
    let mut monitor = Monitor::new(&supervisor, graph.finish.as_deref())?;
    let end = watch(graph, &mut supervisor, &mut monitor, &listener, &signals, display);
    display.show(&supervisor, &mut monitor);
    display.close();
    let final_word = monitor.summary().copied();
    let logs = match &end {
        End::Broken(role) => supervisor.last_log_lines(role, 12),
        _ => Vec::new(),
    };
    let restarts = supervisor.services.iter().map(|service| service.restarts).sum();
    drop(monitor);
    drop(listener);
    supervisor.stop(&|| signals.count() > 1)?;
    if let End::Broken(role) = &end {
        eprintln!("error: `{role}` cannot go on; the last lines of its log:");
        logs.iter().for_each(|line| eprintln!("  {line}"));
    }
    if let Some(word) = &final_word {
        print!(
            "{}",
            if options.json { summary::json(word, restarts) } else { summary::text(word, restarts) }
        );
    }
    Ok(match end {
        End::Finished(RunState::Passed) | End::Asked | End::AllFinished => ExitCode::SUCCESS,
        End::Finished(_) | End::Broken(_) => ExitCode::FAILURE,
    })
}

fn watch(
    graph: &Checked,
    supervisor: &mut Supervisor,
    monitor: &mut Monitor,
    listener: &UnixListener,
    signals: &Signals,
    display: &mut dyn Display,
) -> End {
    let mut announced = false;
    let mut next_look = Time::ZERO;
    let mut asked = false;
    loop {
        supervisor.tick();
        let now = clock::monotonic();
        if !announced && supervisor.all_ready() {
            announced = true;
            let took_ms = now.seconds_since(supervisor.began) * 1e3;
            let count = supervisor.services.len();
            supervisor.note("", format!("all {count} services are ready after {took_ms:.0} ms"), false);
        }
        control::serve(listener, |request| answer(request, supervisor, monitor, graph, &mut asked));
        if now >= next_look {
            next_look = now.after(Duration::from_millis(100));
            monitor.update(supervisor);
            display.show(supervisor, monitor);
        }
        if let Some(word) = monitor.summary()
            && let Ok(state @ (RunState::Passed | RunState::Failed)) = word.state.get()
        {
            return End::Finished(state);
        }
        if let Some(failed) = supervisor.failed() {
            return End::Broken(failed.service.role.clone());
        }
        if signals.count() > 0 || asked || display.wants_to_leave() {
            return End::Asked;
        }
        if supervisor.all_finished() {
            return End::AllFinished;
        }
        let pause = supervisor.next_due(now).min(next_look.since(now));
        let pause = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(pause.subsec_nanos()) };
        let mut descriptors = vec![
            PollFd::from_borrowed_fd(listener.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(signals.reader.as_fd(), PollFlags::IN),
        ];
        descriptors
            .extend(supervisor.descriptors().map(|fd| PollFd::from_borrowed_fd(fd.as_fd(), PollFlags::IN)));
        let _ = poll(&mut descriptors, Some(&pause));
        drop(descriptors);
        signals.drain();
    }
}

fn answer(
    request: Request,
    supervisor: &mut Supervisor,
    monitor: &Monitor,
    graph: &Checked,
    asked: &mut bool,
) -> Answer {
    match request {
        Request::Status => Answer::Status(Box::new(monitor.status(supervisor, &graph.file))),
        Request::Restart { role } if supervisor.restart(&role) => Answer::Done,
        Request::Restart { role } => {
            let known: Vec<&str> =
                supervisor.services.iter().map(|service| service.service.role.as_str()).collect();
            Answer::Refused(format!("there is no service `{role}`; there are {}", known.join(", ")))
        }
        Request::Swap(request) => done(supervisor.swap(*request)),
        Request::SwapBack { role } => done(supervisor.swap_back(&role)),
        Request::Stop { .. } => {
            *asked = true;
            Answer::Done
        }
    }
}

fn done(result: Result<(), String>) -> Answer {
    result.map_or_else(Answer::Refused, |()| Answer::Done)
}

/// INT, TERM and HUP as a readable descriptor and a count.
#[derive(Debug)]
pub(crate) struct Signals {
    reader: UnixStream,
    count: Arc<AtomicUsize>,
}

impl Signals {
    pub(crate) fn catch() -> std::io::Result<Self> {
        let (reader, writer) = UnixStream::pair()?;
        reader.set_nonblocking(true)?;
        writer.set_nonblocking(true)?;
        let count = Arc::new(AtomicUsize::new(0));
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
            let (count, writer) = (Arc::clone(&count), writer.try_clone()?);
            // SAFETY: the handler counts up an atomic and writes one byte, both allowed in signal handlers.
            unsafe {
                signal_hook::low_level::register(signal, move || {
                    count.fetch_add(1, Ordering::AcqRel);
                    let _ = (&writer).write(&[1]);
                })?;
            }
        }
        Ok(Self { reader, count })
    }

    pub(crate) fn count(&self) -> usize {
        self.count.load(Ordering::Acquire)
    }

    fn drain(&self) {
        let mut bytes = [0; 64];
        while matches!((&self.reader).read(&mut bytes), Ok(read) if read > 0) {}
    }
}
