//! Starts the services, sees at once when one dies or hangs, cleans up after it, and starts it again.

mod cleaner;
mod process;
pub(crate) mod pulse;
mod strays;
mod swap;

use crate::event::Event;
use crate::graph::{Checked, CheckedService, CheckedTopic, Overrides};
use crate::journal::{self, Journal};
use crate::runs::RunFolder;
use board::host::{Host, HostError};
use board::manifest::{Manifest, Topic};
use board::switchboard::SlotState;
use board::terminal::harmless;
use board::{EXIT_SETUP, clock};
use cleaner::Cleaner;
use messages::{Health, Message as _, Time};
use process::{Process, Surroundings, death};
pub(crate) use pulse::{Pulse, vitals};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::Signal;
use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::sync::atomic::Ordering;
use std::time::Duration;
use strays::Strays;
use swap::{Newcomer, Predecessor};
pub(crate) use swap::{SwapRequest, SwapState};

/// Whoever publishes this drives the wheels, and leaves first when the robot is stopped.
const WHEELS: &str = "wheels/applied";
/// How long a service may take to join the board, in time of its own: a map that is read, not a processor that is not to be had.
const START_LIMIT: Duration = Duration::from_secs(10);
/// After so long it is said that a service takes its time to join the board.
const START_SAID: Duration = Duration::from_secs(5);
/// A service that ran for so long was sound: its next restart is immediate again.
const SOUND_AFTER: Duration = Duration::from_millis(500);
/// So long after its end is asked for, a process that was killed and is still there is left to the kernel: it waits for a device.
const KILLED_LIMIT: Duration = Duration::from_secs(5);
/// Lines of a log in which the reason of a death is looked for.
const LOOK_BACK: usize = 200;
/// Between two looks at what lies in shared memory.
const PLACE_PERIOD: Duration = Duration::from_secs(1);
const EVENTS_KEPT: usize = 200;

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
    pulse: Pulse,
    /// What was last said of its slow start or its hanging, so that it is said once.
    said: Option<u32>,
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
            pulse: Pulse::default(),
            said: None,
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
    logs: RunFolder,
    journal: Journal,
    /// Processes that were swapped out and are on their way, with the moment at which they are ended.
    leaving: Vec<(Process, Time)>,
    cleaner: Cleaner,
    last_tick: Time,
    next_look: Time,
    /// What happened to the board's place in shared memory, once it is gone.
    lost: Option<String>,
    /// What services have started and left behind.
    strays: Strays,
    /// What could not be left in order at the end.
    unclean: Vec<String>,
}

impl Supervisor {
    /// Makes the board of a checked graph; nothing is started yet. Without a folder for the logs that was asked for, the run gets one of its own on disk.
    ///
    /// # Errors
    /// When the board cannot be made, or the folder that was asked for.
    pub(crate) fn new(
        graph: &Checked,
        board: &str,
        logs: Option<&Path>,
        lockstep: bool,
    ) -> Result<Self, HostError> {
        let host = Host::create(board, manifest_of(graph), lockstep)?;
        let (logs, trouble) = match RunFolder::make(logs, board) {
            Ok(folder) => (folder, None),
            Err(error) if logs.is_some() => return Err(error.into()),
            // A robot on a read-only disk drives all the same.
            Err(error) => (RunFolder::make(Some(&host.place().file("logs")), board)?, Some(error)),
        };
        let now = clock::monotonic();
        let mut supervisor = Self {
            host,
            services: graph.services.iter().cloned().map(Supervised::of).collect(),
            events: VecDeque::new(),
            event_count: 0,
            began: now,
            overrides: graph.overrides.clone(),
            folder: graph.folder.clone(),
            journal: Journal::begin(logs.path()),
            logs,
            leaving: Vec::new(),
            cleaner: Cleaner::default(),
            last_tick: now,
            next_look: now,
            lost: None,
            strays: Strays::begin(),
            unclean: Vec::new(),
        };
        if let Some(error) = trouble {
            supervisor.note(
                "",
                format!("{error}; the logs lie in shared memory, and go with the board"),
                true,
            );
        }
        Ok(supervisor)
    }

    /// The folder of this run's logs.
    pub(crate) fn logs(&self) -> &RunFolder {
        &self.logs
    }

    /// The file into which a service logs.
    fn log_file(&self, role: &str) -> PathBuf {
        journal::log_file(self.logs.path(), role)
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
            if held_up {
                self.services[index].pulse.begin_anew();
            }
            self.end_if_hanging(index, now);
            self.tend_newcomer(index, now);
            if self.services[index].restart_at.is_some_and(|at| at <= now) {
                self.services[index].restart_at = None;
                self.services[index].restarts += 1;
                self.start(index);
            }
        }
        self.see_off(now);
        self.tend_cleaner(now);
        self.end_strays();
        if now >= self.next_look {
            self.next_look = now.after(PLACE_PERIOD);
            self.look_at_the_place();
        }
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
        self.processes().map(|process| &process.pidfd)
    }

    /// The processes that play a role, or are to.
    fn players(&self) -> impl Iterator<Item = &Process> {
        let playing = self.services.iter().filter_map(|service| service.process.as_ref());
        playing.chain(self.services.iter().filter_map(Supervised::newcomer_process))
    }

    /// Those, and the ones that were asked to leave.
    fn processes(&self) -> impl Iterator<Item = &Process> {
        self.players().chain(self.leaving.iter().map(|(process, _)| process))
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

    /// Why the board cannot go on: somebody has removed what it lies on.
    pub(crate) fn lost(&self) -> Option<&str> {
        self.lost.as_deref()
    }

    /// A robot whose board is gone from shared memory cannot be reached by anybody, and a second one could be started beside it.
    fn look_at_the_place(&mut self) {
        if self.lost.is_none() && !self.host.is_in_place() {
            let root = self.host.place().root().display();
            let text = format!(
                "{root} was removed or replaced while the board was up: nobody can reach this robot any more; stopping it"
            );
            self.note("", text.clone(), true);
            self.lost = Some(text);
        }
        if self.lost.is_some() {
            return;
        }
        let living: Vec<(u32, u32)> = self.players().map(|process| (process.slot, process.pid())).collect();
        for damage in self.host.repair(&living) {
            self.note("", damage, true);
        }
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
        service.phase = Phase::Waiting;
        true
    }

    /// Kills a service, waits for its end and cleans up after it: for logical time, which stands still meanwhile.
    pub(crate) fn end_at_once(&mut self, role: &str) {
        let Some(service) = self.services.iter_mut().find(|service| service.service.role == role) else {
            return;
        };
        service.phase = Phase::Waiting;
        if let Some(mut process) = service.process.take() {
            process.end_now(KILLED_LIMIT);
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
        let event = Event { at_s, role: role.to_owned(), text: text.into(), is_trouble };
        self.journal.note(&event);
        self.events.push_back(event);
        self.event_count += 1;
    }

    /// The last lines of a service's log, fit for a terminal.
    pub(crate) fn last_log_lines(&self, role: &str, count: usize) -> Vec<String> {
        let lines = journal::last_lines(self.logs.path(), role, count);
        lines.iter().map(|line| harmless(line)).collect()
    }

    /// Stops the robot: who drives its wheels leaves, and nobody comes in its place. Nothing that has to do with people or disks comes before.
    pub(crate) fn halt(&mut self, hurry: &dyn Fn() -> bool) {
        let driver = self.host.manifest().topic(WHEELS).and_then(|(_, topic)| topic.publisher.clone());
        let is_driver = |index: &usize| Some(&self.services[*index].service.role) == driver.as_ref();
        let drivers: Vec<usize> = (0..self.services.len()).filter(is_driver).collect();
        drivers.iter().for_each(|&index| self.dismiss(index));
        self.end(&drivers, hurry);
    }

    /// Stops the robot first, then the services, and takes the board down. What services could not leave in order, a sentence each.
    ///
    /// # Errors
    /// When something of the board cannot be removed.
    pub(crate) fn stop(mut self, hurry: &dyn Fn() -> bool) -> io::Result<Vec<String>> {
        self.halt(hurry);
        self.cleaner.stop();
        for index in 0..self.services.len() {
            self.dismiss(index);
        }
        let all: Vec<usize> = (0..self.services.len()).collect();
        self.end(&all, hurry);
        for (process, _) in &mut self.leaving {
            process.end_now(KILLED_LIMIT);
        }
        let deadline = clock::monotonic().after(KILLED_LIMIT);
        while self.strays.end_all(self.host.place().name(), &[]) && clock::monotonic() < deadline {
            clock::sleep(Duration::from_millis(1));
        }
        self.journal.end();
        let unclean = std::mem::take(&mut self.unclean);
        self.host.take_down().map(|()| unclean)
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
                let Some(status) = process.ended() else {
                    let limit =
                        if hurry() { Duration::from_millis(50) } else { service.service.launch.stop_after };
                    if now.since(asked) > limit {
                        process.signal(Signal::KILL);
                    }
                    if now.since(asked) <= limit + KILLED_LIMIT {
                        waiting.push(index);
                    }
                    continue;
                };
                service.process = None;
                let role = service.service.role.clone();
                if !hurry() {
                    self.note_last_word(&role, status);
                }
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

    /// A service that was asked to leave and could not do so in order has lost something that it was to leave behind.
    fn note_last_word(&mut self, role: &str, status: ExitStatus) {
        if status.success() || status.signal() == Some(libc::SIGTERM) {
            return;
        }
        let how = match status.signal() {
            Some(libc::SIGKILL) => {
                "did not leave in time, and was killed: what it had to save is lost".to_owned()
            }
            _ => format!("{} as it left: {}", death(status), self.last_word(role)),
        };
        self.unclean.push(format!("`{role}` {how}"));
        self.note(role, how, true);
    }

    fn start(&mut self, index: usize) {
        let role = self.services[index].service.role.clone();
        match self.spawn(index) {
            Ok(process) => {
                let service = &mut self.services[index];
                service.process = Some(process);
                service.phase = Phase::Starting;
                service.pulse.begin_anew();
                service.said = None;
            }
            Err(error) => {
                // A file that is being replaced, a machine that is full: another time it may go. In logical time nothing depends on when.
                let now = clock::monotonic();
                let service = &mut self.services[index];
                service.failures += 1;
                service.died_at.get_or_insert(now);
                let policy = service.service.launch.restart.unwrap_or_default();
                let text = format!("cannot be started: {error}");
                match policy.pause_after(service.failures.saturating_add(1)) {
                    Some(pause) => {
                        service.phase = Phase::Waiting;
                        service.restart_at = Some(now.after(pause));
                        self.note(&role, format!("{text}; trying again in {} ms", pause.as_millis()), true);
                    }
                    None => {
                        service.phase = Phase::Failed;
                        self.note(&role, format!("{text}; given up"), true);
                    }
                }
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
        self.strays.expect();
        if self.stands_in(index, status, now) {
            return;
        }
        let service = &mut self.services[index];
        if service.phase == Phase::Waiting && (status.success() || status.signal() == Some(libc::SIGTERM)) {
            // It was asked to leave, to be started again.
            service.restart_at = Some(now);
            service.died_at = Some(now);
            return;
        }
        if status.success() && service.service.launch.may_end {
            service.phase = Phase::Finished;
            self.note(&role, "has finished", false);
            return;
        }
        service.failures = if was_sound { 1 } else { service.failures + 1 };
        let failures = service.failures;
        // In logical time a death that nobody planned ends the run.
        let policy = service.service.launch.restart.filter(|_| !self.host.is_lockstep());
        let setup = status.code() == Some(i32::from(EXIT_SETUP));
        let how = death(status);
        let next = match policy {
            None => Err("it is not to be restarted".to_owned()),
            Some(_) if setup => Err("its set-up is wrong".to_owned()),
            Some(policy) => policy.pause_after(failures).ok_or_else(|| format!("{failures} deaths in a row")),
        };
        service.died_at.get_or_insert(now);
        if (next.is_err() || self.is_on_probation(index, now)) && self.give_back(index, &how, now) {
            self.clean();
            return;
        }
        let service = &mut self.services[index];
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
                let last = self.last_word(&role);
                self.note(&role, format!("{how}; given up ({why}): {last}"), true);
            }
        }
        self.clean();
    }

    fn end_if_hanging(&mut self, index: usize, now: Time) {
        let lockstep = self.host.is_lockstep();
        let service = &mut self.services[index];
        let Some(process) = &service.process else { return };
        let Some(slot) = self.host.switchboard().slot(process.slot) else { return };
        // In logical time the conductor knows whose turn it is.
        if process.ready.is_some() && lockstep {
            return;
        }
        let is_joining = process.ready.is_none();
        let limit = if is_joining { START_LIMIT } else { service.service.launch.hang_after };
        let pid = process.pid();
        let silence = service.pulse.look(now, slot.heartbeat_ns.load(Ordering::Relaxed), || vitals(pid));
        let role = service.service.role.clone();
        if silence.own > limit && service.said != Some(pid) {
            process.signal(Signal::KILL);
            service.said = Some(pid);
            let what = if is_joining { "did not join the board" } else { "hangs" };
            let text = format!(
                "{what}: silent for {:.1} s, {:.1} s of them without waiting for a processor; ending it",
                silence.all.as_secs_f64(),
                silence.own.as_secs_f64()
            );
            self.note(&role, text, true);
        } else if is_joining && silence.all > START_SAID && service.said.is_none() {
            service.said = Some(0);
            let text = format!(
                "has not joined the board after {:.0} s ({:.1} s of its own time): it reads much, or the machine is busy",
                silence.all.as_secs_f64(),
                silence.own.as_secs_f64()
            );
            self.note(&role, text, false);
        }
    }

    /// What a service said last, in one line: the message of its panic, or the last line that is no frame of a backtrace.
    fn last_word(&self, role: &str) -> String {
        let lines = self.last_log_lines(role, LOOK_BACK);
        match lines.iter().rposition(|line| line.contains("panicked at")) {
            // The message stands below the place.
            Some(panic) => lines[panic..].iter().take(2).cloned().collect::<Vec<_>>().join(" "),
            None => lines.last().cloned().unwrap_or_else(|| "it has said nothing".to_owned()),
        }
    }

    /// The last lines of a log that tell why a service cannot go on: from its panic on, if there was one.
    pub(crate) fn telling_lines(&self, role: &str, count: usize) -> Vec<String> {
        let mut lines = self.last_log_lines(role, LOOK_BACK);
        let panic = lines.iter().rposition(|line| line.contains("panicked at"));
        let begin = panic.unwrap_or(lines.len().saturating_sub(count));
        lines.drain(..begin);
        lines.truncate(count);
        lines
    }

    /// What a dead service had started, and could not be ended with its group.
    fn end_strays(&mut self) {
        if !self.strays.are_expected() {
            return;
        }
        let ours: Vec<u32> = self.processes().map(Process::pid).chain(self.cleaner.pid()).collect();
        self.strays.end_all(self.host.place().name(), &ours);
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
        name: messages::health_topic(role),
        publisher: Some(role.to_owned()),
        readers: Vec::new(),
        depth: 4,
        elements: 0,
        message: Health::description(),
    }
}
