//! A service's process: how it is started, asked to leave, and what its death says.

use crate::graph::{CheckedService, Priority};
use crate::signals::forget_in_child;
use board::clock;
use board::host::Host;
use messages::Time;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, kill_process_group, pidfd_open};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::fs::OpenOptionsExt as _;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// What every process that belongs to a board has in its environment, so that it can be told from others.
pub(super) const MARK: &str = "CORKBOARD_BOARD";

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
            .env(MARK, surroundings.host.place().name())
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
        let memory = service.launch.memory_max.unwrap_or_else(default_memory_max);
        // SAFETY: plain system calls without memory of their own, between fork and exec.
        unsafe {
            command.pre_exec(move || {
                inherit_no_descriptors();
                forget_in_child();
                limit_memory(memory)
            });
        }
        let mut child = command.spawn()?;
        let pidfd = pidfd_open(Pid::from_child(&child), PidfdFlags::empty()).inspect_err(|_| {
            // One whose end could not be seen is not to run.
            let _ = child.kill();
            let _ = child.wait();
        })?;
        if let Some(entry) = surroundings.host.switchboard().slot(slot) {
            entry.pid.store(child.id(), Ordering::Release);
        }
        Ok(Self { child, pidfd, slot, started: clock::monotonic(), ready: None })
    }

    /// Its number.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, if it has. What it has started ends with it.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        let mut descriptors = [PollFd::from_borrowed_fd(self.pidfd.as_fd(), PollFlags::IN)];
        let now = rustix::time::Timespec { tv_sec: 0, tv_nsec: 0 };
        if !poll(&mut descriptors, Some(&now)).is_ok_and(|ready| ready > 0) {
            return None;
        }
        // Dead, and not waited for yet: its number, and that of its group, is still its own.
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
        self.child.try_wait().ok().flatten()
    }

    /// Kills it and waits for its end; not for ever, since a process that waits for a device cannot be killed.
    pub(crate) fn end_now(&mut self, limit: Duration) -> bool {
        self.signal(Signal::KILL);
        let deadline = clock::monotonic().after(limit);
        while self.ended().is_none() {
            if clock::monotonic() > deadline {
                return false;
            }
            clock::sleep(Duration::from_millis(1));
        }
        true
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
        (Some(6), _) => "aborted (signal 6)".to_owned(),
        (Some(7), _) => "lost its memory (signal 7: shared memory is full, or was cut)".to_owned(),
        (Some(9), _) => "was killed (signal 9)".to_owned(),
        (Some(11), _) => "crashed (signal 11)".to_owned(),
        (Some(number), _) => format!("was ended by signal {number}"),
        (None, Some(0)) => "ended without being asked".to_owned(),
        (None, Some(101)) => "panicked".to_owned(),
        (None, code) => format!("ended with code {}", code.unwrap_or(-1)),
    }
}

fn open_log(path: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).mode(0o600).open(path)
}

/// Descriptors of the launcher (its terminal, the board's files, the sockets of others) are nobody else's business, whoever opened them.
fn inherit_no_descriptors() {
    // SAFETY: a plain system call; on an old kernel it fails, and what is not marked is inherited.
    unsafe {
        libc::syscall(libc::SYS_close_range, 3_u32, u32::MAX, libc::CLOSE_RANGE_CLOEXEC);
    }
}

/// A service that takes all memory would take the others, or the whole machine, with it. What it cannot have, it fails to get.
fn limit_memory(bytes: u64) -> io::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let present = getrlimit(Resource::Data);
    let bytes = present.maximum.map_or(bytes, |most| most.min(bytes));
    Ok(setrlimit(Resource::Data, Rlimit { current: Some(bytes), maximum: present.maximum })?)
}

/// Two gigabytes, or half of a small machine.
fn default_memory_max() -> u64 {
    const MOST: u64 = 2 << 30;
    let known = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let total = known
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    total.map_or(MOST, |kib| (kib * 512).min(MOST))
}
