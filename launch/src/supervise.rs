//! Starts the services, sees at once when one dies or hangs, cleans up after it, and starts it again.

mod cleaner;
mod process;
mod swap;

use crate::graph::{Checked, CheckedService, CheckedTopic, Overrides};
use board::host::{self, Host, HostError};
use board::manifest::{Manifest, Topic};
use board::switchboard::SlotState;
use board::{EXIT_SETUP, clock};
use cleaner::Cleaner;
use messages::{Health, Message as _, Time};
use process::{Process, Surroundings, death};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::Signal;
use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd as _, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;
use swap::{Newcomer, Predecessor};
pub(crate) use swap::{SwapRequest, SwapState};

/// Whoever publishes this drives the wheels, and leaves first when the robot is stopped.
const WHEELS: &str = "wheels/applied";
/// How long a service may take to join the board.
const START_LIMIT: Duration = Duration::from_secs(10);
/// A service that ran for so long was sound: its next restart is immediate again.
const SOUND_AFTER: Duration = Duration::from_millis(500);
const EVENTS_KEPT: usize = 200;

/// Something that the operator wants to know.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(crate) struct Event {
    /// Seconds since `up`.
    pub(crate) at_s: f64,
    /// The service, empty for the whole set.
    pub(crate) role: String,
    /// What happened.
    pub(crate) text: String,
    /// Whether something went wrong.
    pub(crate) is_trouble: bool,
}

/// What the launcher does with a service now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Phase {
    /// Its process lives and has not joined yet.
    Starting,
    /// It takes steps.
    Running,
    /// It died and will be started again.
    Waiting,
    /// It ended by itself, without an error.
    Finished,
    /// It is given up.
    Failed,
}

/// One service under supervision.
#[derive(Debug)]
pub(crate) struct Supervised {
    pub(crate) service: CheckedService,
    pub(crate) phase: Phase,
    /// Starts after the first.
    pub(crate) restarts: u32,
    process: Option<Process>,
    /// A process beside it: one that is to take its place, or a shadow.
    newcomer: Option<Newcomer>,
    /// What it was before each swap, so that it can be had back.
    predecessors: Vec<Predecessor>,
    /// How its last swap stands.
    swap: Option<SwapState>,
    /// Deaths in a row, without a sound run between them.
    failures: u32,
    restart_at: Option<Time>,
    died_at: Option<Time>,
}

impl Supervised {
    fn of(service: CheckedService) -> Self {
        Self {
            service,
            phase: Phase::Waiting,
            restarts: 0,
            process: None,
            newcomer: None,
            predecessors: Vec::new(),
            swap: None,
            failures: 0,
            restart_at: None,
            died_at: None,
        }
    }

    /// The number of its process, while it lives.
    pub(crate) fn pid(&self) -> Option<u32> {
        self.process.as_ref().map(Process::pid)
    }

    /// Its place on the board, while it lives.
    pub(crate) fn slot(&self) -> Option<u32> {
        self.process.as_ref().map(|process| process.slot)
    }
}

/// The set of services on one board.
pub(crate) struct Supervisor {
    pub(crate) host: Host,
    pub(crate) services: Vec<Supervised>,
    pub(crate) events: VecDeque<Event>,
    /// Events so far, so that a reader knows which are new.
    pub(crate) event_count: usize,
    pub(crate) began: Time,
    /// What differs from the graph's file: by the command line, and by swaps since.
    pub(crate) overrides: Overrides,
    folder: PathBuf,
    logs: PathBuf,
    /// Processes that were swapped out and are on their way, with the moment at which they are ended.
    leaving: Vec<(Process, Time)>,
    cleaner: Cleaner,
    last_tick: Time,
}

impl Supervisor {
    /// Makes the board of a checked graph; nothing is started yet.
    pub(crate) fn new(
        graph: &Checked,
        board: &str,
        logs: Option<&Path>,
        lockstep: bool,
    ) -> Result<Self, HostError> {
        let host = Host::create(board, manifest_of(graph), lockstep)?;
        let logs = logs.map_or_else(|| host.place().file("logs"), Path::to_owned);
        std::fs::create_dir_all(&logs)?;
        let now = clock::monotonic();
        Ok(Self {
            host,
            services: graph.services.iter().cloned().map(Supervised::of).collect(),
            events: VecDeque::new(),
            event_count: 0,
            began: now,
            overrides: graph.overrides.clone(),
            folder: graph.folder.clone(),
            logs,
            leaving: Vec::new(),
            cleaner: Cleaner::default(),
            last_tick: now,
        })
    }

    /// The file into which a service logs.
    pub(crate) fn log_file(&self, role: &str) -> PathBuf {
        self.logs.join(format!("{role}.log"))
    }

    /// Starts every service, in the order of the file; they wait for each other by themselves.
    pub(crate) fn start_all(&mut self) {
        for index in 0..self.services.len() {
            self.start(index);
        }
    }

    /// Looks after the services: whoever died, hangs or is due again. Call it when a child's descriptor is ready, and every 100 ms.
    pub(crate) fn tick(&mut self) {
        let now = clock::monotonic();
        // When we were held up ourselves, silent heartbeats say nothing.
        let held_up = now.since(self.last_tick) > Duration::from_millis(500);
        self.last_tick = now;
        for index in 0..self.services.len() {
            self.reap(index, now);
            self.note_ready(index, now);
            if !held_up {
                self.end_if_hanging(index, now);
            }
            self.tend_newcomer(index, now);
            if self.services[index].restart_at.is_some_and(|at| at <= now) {
                self.services[index].restart_at = None;
                self.services[index].restarts += 1;
                self.start(index);
            }
        }
        self.see_off(now);
        self.tend_cleaner(now);
    }

    /// When `tick` is due at the latest.
    pub(crate) fn next_due(&self, now: Time) -> Duration {
        let starting =
            self.services.iter().any(|service| service.phase == Phase::Starting || service.awaits_newcomer());
        let most = if starting { Duration::from_millis(3) } else { Duration::from_millis(100) };
        let restarts = self.services.iter().filter_map(|service| service.restart_at);
        restarts.map(|at| at.since(now)).fold(most, Duration::min)
    }

    /// Descriptors that become readable when a service dies.
    pub(crate) fn descriptors(&self) -> impl Iterator<Item = &OwnedFd> {
        let services = self.services.iter().filter_map(|service| service.process.as_ref());
        let newcomers = self.services.iter().filter_map(Supervised::newcomer_process);
        let leaving = self.leaving.iter().map(|(process, _)| process);
        services.chain(newcomers).chain(leaving).map(|process| &process.pidfd)
    }

    /// Whether every service has joined the board.
    pub(crate) fn all_ready(&self) -> bool {
        self.services.iter().all(|service| matches!(service.phase, Phase::Running | Phase::Finished))
    }

    /// Whether every service has ended by itself.
    pub(crate) fn all_finished(&self) -> bool {
        !self.services.is_empty() && self.services.iter().all(|service| service.phase == Phase::Finished)
    }

    /// The service that is given up, if one is.
    pub(crate) fn failed(&self) -> Option<&Supervised> {
        self.services.iter().find(|service| service.phase == Phase::Failed)
    }

    /// Ends a service and starts it again; `false` when there is none of that name.
    pub(crate) fn restart(&mut self, role: &str) -> bool {
        let Some(index) = self.services.iter().position(|service| service.service.role == role) else {
            return false;
        };
        self.note(role, "restart asked for", false);
        let service = &mut self.services[index];
        service.failures = 0;
        match &service.process {
            Some(process) => process.ask_to_leave(),
            None => service.restart_at = Some(clock::monotonic()),
        }
        // A process that leaves when asked ends without an error; it is to come back all the same.
        service.phase = if service.process.is_some() { Phase::Waiting } else { service.phase };
        true
    }

    /// Kills a service, waits for its end and cleans up after it: for logical time, which stands still meanwhile.
    pub(crate) fn end_at_once(&mut self, role: &str) {
        let Some(service) = self.services.iter_mut().find(|service| service.service.role == role) else {
            return;
        };
        service.phase = Phase::Waiting;
        if let Some(mut process) = service.process.take() {
            process.signal(Signal::KILL);
            process.wait();
            self.host.switchboard().release(process.slot);
        }
        self.clean();
        while self.cleaner.is_busy() {
            clock::sleep(Duration::from_millis(1));
            self.tend_cleaner(clock::monotonic());
        }
    }

    /// Starts a service again that was ended so, and waits until it has joined and has the last message of every topic that it reads.
    ///
    /// # Errors
    /// When it does not join.
    pub(crate) fn begin_again(&mut self, role: &str) -> Result<(), String> {
        let Some(index) = self.services.iter().position(|service| service.service.role == role) else {
            return Ok(());
        };
        self.services[index].restarts += 1;
        self.start(index);
        let deadline = clock::monotonic().after(START_LIMIT);
        while self.services[index].phase != Phase::Running || !self.have_served() {
            self.tick();
            if self.services[index].phase == Phase::Failed || clock::monotonic() > deadline {
                return Err(format!("`{role}` does not come back"));
            }
            clock::sleep(Duration::from_micros(200));
        }
        Ok(())
    }

    /// Whether every service has given the readers that have joined its last message.
    fn have_served(&self) -> bool {
        let board = self.host.switchboard();
        let topology = board.header().topology.load(Ordering::Acquire);
        let slots = self.services.iter().filter_map(|service| board.slot(service.slot()?));
        slots.into_iter().all(|slot| slot.served.load(Ordering::Acquire) == topology)
    }

    /// Notes an event.
    pub(crate) fn note(&mut self, role: &str, text: impl Into<String>, is_trouble: bool) {
        if self.events.len() == EVENTS_KEPT {
            self.events.pop_front();
        }
        let at_s = clock::monotonic().seconds_since(self.began);
        self.events.push_back(Event { at_s, role: role.to_owned(), text: text.into(), is_trouble });
        self.event_count += 1;
    }

    /// The last lines of a service's log.
    pub(crate) fn last_log_lines(&self, role: &str, count: usize) -> Vec<String> {
        let text = std::fs::read(self.log_file(role)).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(count)..].iter().map(|line| (*line).to_owned()).collect()
    }

    /// Stops the robot first, then the services, and takes the board down.
    ///
    /// # Errors
    /// When something of the board cannot be removed.
    pub(crate) fn stop(mut self, hurry: &dyn Fn() -> bool) -> io::Result<()> {
        self.cleaner.stop();
        for index in 0..self.services.len() {
            self.dismiss(index);
        }
        let driver = self.host.manifest().topic(WHEELS).and_then(|(_, topic)| topic.publisher.clone());
        let (first, rest): (Vec<usize>, Vec<usize>) = (0..self.services.len())
            .partition(|&index| Some(&self.services[index].service.role) == driver.as_ref());
        self.end(&first, hurry);
        self.end(&rest, hurry);
        for (process, _) in &mut self.leaving {
            process.signal(Signal::KILL);
            process.wait();
        }
        self.host.take_down()
    }

    fn end(&mut self, group: &[usize], hurry: &dyn Fn() -> bool) {
        let asked = clock::monotonic();
        for &index in group {
            if let Some(process) = &self.services[index].process {
                process.ask_to_leave();
            }
        }
        loop {
            let now = clock::monotonic();
            let mut waiting = Vec::new();
            for &index in group {
                let service = &mut self.services[index];
                let Some(process) = &mut service.process else { continue };
                if process.ended().is_some() {
                    service.process = None;
                    continue;
                }
                let limit =
                    if hurry() { Duration::from_millis(50) } else { service.service.launch.stop_after };
                if now.since(asked) > limit {
                    process.signal(Signal::KILL);
                }
                waiting.push(index);
            }
            if waiting.is_empty() {
                return;
            }
            let mut descriptors: Vec<PollFd<'_>> = waiting
                .iter()
                .filter_map(|&index| self.services[index].process.as_ref())
                .map(|process| PollFd::from_borrowed_fd(process.pidfd.as_fd(), PollFlags::IN))
                .collect();
            let pause = rustix::time::Timespec { tv_sec: 0, tv_nsec: 10_000_000 };
            let _ = poll(&mut descriptors, Some(&pause));
        }
    }

    fn start(&mut self, index: usize) {
        let role = self.services[index].service.role.clone();
        match self.spawn(index) {
            Ok(process) => {
                self.services[index].process = Some(process);
                self.services[index].phase = Phase::Starting;
            }
            Err(error) => {
                self.services[index].phase = Phase::Failed;
                self.note(&role, format!("cannot be started: {error}"), true);
            }
        }
    }

    fn spawn(&self, index: usize) -> io::Result<Process> {
        let service = &self.services[index].service;
        let slot = self
            .host
            .prepare(&service.role, true)
            .ok_or_else(|| io::Error::other("the board has no place left"))?;
        let log = self.log_file(&service.role);
        Process::spawn(self.surroundings(&log), service, slot, false)
    }

    fn surroundings<'a>(&'a self, log: &'a Path) -> Surroundings<'a> {
        Surroundings { host: &self.host, folder: &self.folder, log }
    }

    fn note_ready(&mut self, index: usize, now: Time) {
        let service = &mut self.services[index];
        let Some(process) = &mut service.process else { return };
        let slot = self.host.switchboard().slot(process.slot);
        if process.ready.is_some() || slot.is_none_or(|slot| slot.state() != SlotState::Running) {
            return;
        }
        process.ready = Some(now);
        let took = now.seconds_since(process.started);
        if service.phase == Phase::Starting {
            service.phase = Phase::Running;
        }
        let role = service.service.role.clone();
        if let Some(died) = service.died_at.take() {
            let healed_ms = now.seconds_since(died) * 1e3;
            self.note(&role, format!("back after {healed_ms:.0} ms"), false);
        } else {
            self.note(&role, format!("ready after {:.0} ms", took * 1e3), false);
        }
    }

    fn reap(&mut self, index: usize, now: Time) {
        let service = &mut self.services[index];
        let Some(process) = &mut service.process else { return };
        let Some(status) = process.ended() else { return };
        let was_sound = process.ready.is_some_and(|ready| now.since(ready) >= SOUND_AFTER);
        let role = service.service.role.clone();
        self.host.switchboard().release(process.slot);
        service.process = None;
        if self.stands_in(index, status, now) {
            return;
        }
        let service = &mut self.services[index];
        if status.success() && service.phase == Phase::Waiting {
            service.restart_at = Some(now);
            service.died_at = Some(now);
            return;
        }
        if status.success() {
            service.phase = Phase::Finished;
            self.note(&role, "has finished", false);
            return;
        }
        service.failures = if was_sound { 1 } else { service.failures + 1 };
        let failures = service.failures;
        // In logical time a death that nobody planned ends the run.
        let lockstep = self.host.switchboard().header().lockstep.load(Ordering::Relaxed) != 0;
        let policy = service.service.launch.restart.filter(|_| !lockstep);
        let setup = status.code() == Some(i32::from(EXIT_SETUP));
        let how = death(status);
        let next = match policy {
            None => Err("it is not to be restarted".to_owned()),
            Some(_) if setup => Err("its set-up is wrong".to_owned()),
            Some(policy) => policy.pause_after(failures).ok_or_else(|| format!("{failures} deaths in a row")),
        };
        service.died_at.get_or_insert(now);
        match next {
            Ok(pause) => {
                service.phase = Phase::Waiting;
                service.restart_at = Some(now.after(pause));
                let when = if pause.is_zero() {
                    "at once".to_owned()
                } else {
                    format!("in {} ms", pause.as_millis())
                };
                self.note(&role, format!("{how}; starting it again {when}"), true);
            }
            Err(why) => {
                service.phase = Phase::Failed;
                let last = self.last_log_lines(&role, 1).pop().unwrap_or_default();
                self.note(&role, format!("{how}; given up ({why}): {last}"), true);
            }
        }
        self.clean();
    }

    fn end_if_hanging(&mut self, index: usize, now: Time) {
        let service = &self.services[index];
        let Some(process) = &service.process else { return };
        let Some(slot) = self.host.switchboard().slot(process.slot) else { return };
        let limit = service.service.launch.hang_after;
        let lockstep = self.host.switchboard().header().lockstep.load(Ordering::Relaxed) != 0;
        let silence = match process.ready {
            Some(_) if lockstep => return,
            // Of a place that says nonsense nothing can be told; the process writes over it at its next look.
            Some(_) => slot.silence(now).unwrap_or_default(),
            None if now.since(process.started) > START_LIMIT => now.since(process.started),
            None => return,
        };
        if silence <= limit {
            return;
        }
        let what = if process.ready.is_none() { "did not join the board" } else { "hangs" };
        let text = format!("{what}: silent for {:.1} s; ending it", silence.as_secs_f64());
        process.signal(Signal::KILL);
        let role = service.service.role.clone();
        self.note(&role, text, true);
    }

    fn tend_cleaner(&mut self, now: Time) {
        if let Err(error) = self.cleaner.tend(self.host.place().name(), now) {
            self.note("", format!("cleaning up after the dead: {error}"), true);
        }
    }

    /// Cleans up after the dead.
    fn clean(&mut self) {
        if let Err(error) = self.cleaner.clean(self.host.place().name()) {
            self.note("", format!("nothing cleans up after the dead: {error}"), true);
        }
    }
}

fn manifest_of(graph: &Checked) -> Manifest {
    let mut topics: Vec<Topic> = graph.topics.iter().map(topic_of).collect();
    topics.extend(graph.services.iter().map(|service| health_of(&service.role)));
    Manifest {
        graph: graph.file.display().to_string(),
        seed: graph.seed,
        topics,
        services: graph.services.iter().map(|service| service.role.clone()).collect(),
        launcher_pid: 0,
    }
}

fn topic_of(topic: &CheckedTopic) -> Topic {
    Topic {
        name: topic.name.clone(),
        publisher: topic.publisher.role().map(str::to_owned),
        readers: topic.readers.iter().map(|reader| reader.role.clone()).collect(),
        depth: topic.depth,
        elements: topic.elements,
        message: topic.message.clone(),
    }
}

fn health_of(role: &str) -> Topic {
    Topic {
        name: host::health_topic(role),
        publisher: Some(role.to_owned()),
        readers: Vec::new(),
        depth: 4,
        elements: 0,
        message: Health::description(),
    }
}
