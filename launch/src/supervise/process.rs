//! A service's process: how it is started, asked to leave, and what its death says.

use crate::graph::{CheckedService, Priority};
use board::clock;
use board::host::Host;
use messages::Time;
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt as _;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;

/// A process that was started for a role, in its slot on the board.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    /// Becomes readable when the process dies.
    pub(crate) pidfd: OwnedFd,
    pub(crate) slot: u32,
    pub(crate) started: Time,
    /// When it was seen to take steps.
    pub(crate) ready: Option<Time>,
}

/// Where a process is started.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surroundings<'a> {
    /// The board.
    pub(crate) host: &'a Host,
    /// The working directory: that of the graph's file.
    pub(crate) folder: &'a Path,
    /// Where it logs.
    pub(crate) log: &'a Path,
}

impl Process {
    /// Starts a service in a slot that was prepared for it, which is free again if that fails. As a shadow it publishes on topics beside those of the graph.
    pub(crate) fn spawn(
        surroundings: Surroundings<'_>,
        service: &CheckedService,
        slot: u32,
        as_shadow: bool,
    ) -> io::Result<Self> {
        let started = Self::spawn_in(surroundings, service, slot, as_shadow);
        if started.is_err() {
            surroundings.host.switchboard().release(slot);
        }
        started
    }

    fn spawn_in(
        surroundings: Surroundings<'_>,
        service: &CheckedService,
        slot: u32,
        as_shadow: bool,
    ) -> io::Result<Self> {
        let log = open_log(surroundings.log)?;
        let mut command = Command::new(&service.binary);
        command
            .args(["--board", surroundings.host.place().name(), "--role", &service.role])
            .args(["--slot", &slot.to_string()])
            .args(["--params", &service.parameters.to_string()])
            .env("RUST_LOG", &service.launch.log)
            .current_dir(surroundings.folder)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            // Ctrl-C is for the launcher alone, which stops the robot before the services.
            .process_group(0);
        if as_shadow {
            command.arg("--shadow");
        }
        if let Some(compute) = service.launch.compute {
            command.args(["--compute-ns", &compute.as_nanos().to_string()]);
        }
        for processor in &service.launch.cpu {
            command.args(["--cpu", &processor.to_string()]);
        }
        match service.launch.priority {
            Priority::Normal => {}
            Priority::Fifo(priority) => _ = command.args(["--fifo", &priority.to_string()]),
            Priority::Nice(nice) => _ = command.args(["--nice", &nice.to_string()]),
        }
        let child = command.spawn()?;
        let pidfd = pidfd_open(Pid::from_child(&child), PidfdFlags::empty())?;
        if let Some(entry) = surroundings.host.switchboard().slot(slot) {
            entry.pid.store(child.id(), Ordering::Release);
        }
        Ok(Self { child, pidfd, slot, started: clock::monotonic(), ready: None })
    }

    /// Its number.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Waits for its end.
    pub(crate) fn wait(&mut self) {
        let _ = self.child.wait();
    }

    /// Sends it a signal.
    pub(crate) fn signal(&self, signal: Signal) {
        let _ = kill_process(Pid::from_child(&self.child), signal);
    }

    /// Asks it to leave; one that was stopped is woken, since it could not hear.
    pub(crate) fn ask_to_leave(&self) {
        self.signal(Signal::CONT);
        self.signal(Signal::TERM);
    }
}

/// What a death is called.
pub(crate) fn death(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(9), _) => "was killed (signal 9)".to_owned(),
        (Some(11), _) => "crashed (signal 11)".to_owned(),
        (Some(number), _) => format!("was ended by signal {number}"),
        (None, Some(101)) => "panicked".to_owned(),
        (None, code) => format!("ended with code {}", code.unwrap_or(-1)),
    }
}

fn open_log(path: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).mode(0o600).open(path)
}
