//! A graph that runs.

use crate::binaries::launcher;
use crate::failure;
use crate::graph::Graph;
use crate::keeper::{self, Keeper};
use crate::steering::Steering;
use board::clock;
use board::place::Place;
use board::switchboard::SlotState;
use board::tap::{Tap, TapPublisher, TapReader};
use messages::{Description, Message, Time, View};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A running graph on a board of its own. It is stopped, and its board taken down, when this is dropped, also
/// in a panic.
pub struct Running {
    pub(crate) board: String,
    place: Place,
    launcher: RefCell<Child>,
    /// One a topic: a board takes few publishers beside the rightful one.
    publishers: RefCell<BTreeMap<String, TapPublisher>>,
    tap: RefCell<Option<Tap>>,
    output: PathBuf,
    /// The folder of the services' logs.
    logs: PathBuf,
    /// In logical time.
    steering: Option<Steering>,
    /// In host time, while the graph runs.
    keeper: RefCell<Option<Keeper>>,
    /// The recording, unless none is kept.
    recording: Option<PathBuf>,
}

impl std::fmt::Debug for Running {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Running").field("board", &self.board).finish_non_exhaustive()
    }
}

/// Between two looks at the messages while logical time goes on. No service publishes so often that a
/// reader's places run out.
const SLICE: Duration = Duration::from_millis(10);

#[allow(clippy::panic)]
impl Running {
    pub(crate) fn start(graph: &Graph) -> Self {
        let board = Graph::board_name();
        let output = std::env::temp_dir().join(format!("corkboard-{board}.out"));
        let file =
            std::fs::File::create(&output).unwrap_or_else(|error| panic!("{}: {error}", output.display()));
        let copy = file.try_clone().unwrap_or_else(|error| panic!("{}: {error}", output.display()));
        let recording = graph.is_recorded().then(|| keeper::file(&board));
        let logs = std::env::temp_dir().join(format!("corkboard-{board}.logs"));
        let mut command = Command::new(launcher());
        command.arg("up").arg(graph.file()).args(["--no-build", "--board", &board]).args(graph.arguments());
        command.arg("--log-dir").arg(&logs);
        if graph.is_in_lockstep() {
            command
                .args(["--lockstep", "--steered", "--no-view"])
                .stdin(Stdio::piped())
                .stdout(Stdio::piped());
            if let Some(recording) = &recording {
                command.arg("--record").arg(recording);
            }
        } else {
            command.arg("--plain").stdin(Stdio::null()).stdout(file);
        }
        let mut launcher = command
            .stderr(copy)
            .spawn()
            .unwrap_or_else(|error| panic!("the launcher does not start: {error}"));
        let steering = graph.is_in_lockstep().then(|| Steering::new(&mut launcher));
        let place = Place::new(&board).unwrap_or_else(|error| panic!("{error}"));
        let running = Self {
            board,
            place,
            launcher: RefCell::new(launcher),
            publishers: RefCell::new(BTreeMap::new()),
            tap: RefCell::new(None),
            output,
            logs,
            steering,
            keeper: RefCell::new(None),
            recording,
        };
        running.wait_until_ready();
        match &running.steering {
            Some(_) => running.hear(),
            None => {
                let file = running.recording.as_deref();
                *running.keeper.borrow_mut() = file.map(|file| Keeper::start(&running.place, file));
            }
        }
        running
    }

    /// Lets so much logical time pass.
    ///
    /// # Panics
    /// When a service dies unplanned, and for a graph in host time.
    pub fn advance(&self, duration: Duration) {
        self.order(&format!("advance {}", duration.as_secs_f64()));
    }

    /// The moment on the board's clock: logical time in lockstep.
    pub fn now(&self) -> Time {
        self.with_tap(|tap| board::tap::now(tap.switchboard()))
    }

    /// Whether the run in logical time is over: the referee has spoken.
    pub fn has_ended(&self) -> bool {
        self.steering.as_ref().is_some_and(Steering::has_ended)
    }

    fn order(&self, order: &str) {
        let Some(steering) = &self.steering else {
            panic!("`{order}` is for graphs in logical time: Graph::lockstep")
        };
        steering.tell(order);
        self.hear();
    }

    fn hear(&self) {
        if let Some(steering) = &self.steering
            && let Err(error) = steering.hear()
        {
            panic!("{error}\n{}", self.output());
        }
    }

    /// Every message of a topic since the start of the graph, as JSON, with the moment of its publication.
    ///
    /// # Panics
    /// When there is no such topic, or the graph is not recorded.
    pub fn collect(&self, topic: &str) -> Vec<(Time, Value)> {
        let Some(file) = &self.recording else { panic!("this graph is not recorded") };
        let _ = self.description(topic);
        if self.steering.is_some() && !self.has_ended() {
            self.order("look");
        }
        if let Some(keeper) = self.keeper.borrow().as_ref() {
            keeper.look();
        }
        keeper::messages(file, topic).unwrap_or_else(|error| panic!("{error}"))
    }

    fn wait_until_ready(&self) {
        self.until(Duration::from_secs(20), "the services are not ready", || {
            if self.exited().is_some() {
                panic!("the graph ended at its start:\n{}", self.output());
            }
            let mut tap = self.tap.borrow_mut();
            if tap.is_none() {
                *tap = Tap::join(self.place.clone(), "test").ok();
            }
            let Some(tap) = tap.as_ref() else { return false };
            let services = board::host::services(tap.switchboard());
            let wanted = &tap.manifest().services;
            wanted.iter().all(|role| {
                services.iter().any(|(_, known, state)| known == role && *state == SlotState::Running)
            })
        });
    }

    /// The board's name.
    pub fn board(&self) -> &str {
        &self.board
    }

    /// Where the board lies.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// What the launcher has printed.
    pub fn output(&self) -> String {
        std::fs::read_to_string(&self.output).unwrap_or_default()
    }

    /// A reader of a topic's bytes, from its last message on.
    pub fn reader(&self, topic: &str) -> TapReader {
        self.with_tap(|tap| tap.reader(topic).unwrap_or_else(|error| panic!("{error}")))
    }

    /// Publishes a message, given as JSON, from outside.
    pub fn publish(&self, topic: &str, message: Value) {
        let bytes = self.description(topic).from_json(&message).unwrap_or_else(|error| panic!("{error}"));
        self.publish_bytes(topic, &bytes);
    }

    /// Publishes bytes, whatever they are, in the name of whoever publishes the topic.
    pub fn publish_bytes(&self, topic: &str, bytes: &[u8]) {
        let mut publishers = self.publishers.borrow_mut();
        let publisher = publishers.entry(topic.to_owned()).or_insert_with(|| {
            self.with_tap(|tap| {
                tap.publisher(topic).unwrap_or_else(|error| panic!("{error}\n{}", self.output()))
            })
        });
        publisher.publish(bytes).unwrap_or_else(|error| panic!("{error}\n{}", self.output()));
    }

    /// Waits until a message on the topic, as JSON, meets the condition, and returns it. The deadline is in
    /// logical time for graphs in lockstep, which go on only in such calls; they look every 10 ms.
    ///
    /// # Panics
    /// When the deadline passes, or a run in logical time ends before.
    pub fn wait_for(&self, topic: &str, condition: impl Fn(&Value) -> bool, deadline: Duration) -> Value {
        let description = self.description(topic);
        let mut reader = self.reader(topic);
        let mut last = Value::Null;
        let mut look = |last: &mut Value| {
            while let Some((_, bytes)) = reader.next() {
                *last = description.to_json(bytes);
                if condition(last) {
                    return true;
                }
            }
            false
        };
        let what = format!("`{topic}` never met the condition");
        if self.steering.is_none() {
            self.until(deadline, &what, || {
                let is_met = look(&mut last);
                if !is_met {
                    self.with_tap(|tap| tap.wait(tap.bell(), Duration::from_millis(2)));
                }
                is_met
            });
            return last;
        }
        // The last message was served before the first look, or it would be seen a slice later in some runs.
        self.until(Duration::from_secs(5), "the services do not serve a new reader", || {
            self.with_tap(|tap| {
                let board = tap.switchboard();
                let topology = board.header().topology.load(Ordering::Acquire);
                let mut services =
                    board.taken().filter(|(_, slot)| slot.is_service.load(Ordering::Acquire) != 0);
                services.all(|(_, slot)| slot.served.load(Ordering::Acquire) == topology)
            })
        });
        let end = self.now().after(deadline);
        while !look(&mut last) {
            let now = self.now();
            assert!(!self.has_ended(), "{what} before the run was over; the last message: {last}");
            assert!(now < end, "{what} within {deadline:?} of logical time; the last message: {last}");
            self.advance(SLICE.min(end.since(now)));
        }
        last
    }

    fn description(&self, topic: &str) -> Description {
        self.with_tap(|tap| match tap.manifest().topic(topic) {
            Some((_, topic)) => topic.message.clone(),
            None => panic!("there is no topic {topic}"),
        })
    }

    /// The newest message of a topic that waits for this reader.
    pub fn newest<T: Message>(reader: &mut TapReader) -> Option<T> {
        let mut newest = None;
        while let Some((_, bytes)) = reader.next() {
            newest = View::<T>::parse(bytes).ok().map(|view| *view.message).or(newest);
        }
        newest
    }

    /// The process of a service; it must live.
    pub fn pid(&self, role: &str) -> u32 {
        let mut pid = 0;
        self.until(Duration::from_secs(10), &format!("`{role}` does not run"), || {
            pid = self.with_tap(|tap| {
                tap.switchboard()
                    .taken()
                    .find(|(_, slot)| slot.role() == role && slot.state() == SlotState::Running)
                    .map_or(0, |(_, slot)| slot.pid.load(Ordering::Acquire))
            });
            pid != 0
        });
        pid
    }

    /// Every service with its process.
    pub fn services(&self) -> Vec<(String, u32)> {
        let roles = self.with_tap(|tap| tap.manifest().services.clone());
        roles.into_iter().map(|role| (role.clone(), self.pid(&role))).collect()
    }

    /// The launcher's process.
    pub fn launcher_pid(&self) -> u32 {
        self.launcher.borrow().id()
    }

    /// Lets another service play a role while the graph runs, as `launch swap` does, and returns what it
    /// says.
    pub fn swap(&self, role: &str, binary: &str) -> Value {
        self.try_swap(role, binary).unwrap_or_else(|| panic!("no swap of `{role}`:\n{}", self.output()))
    }

    /// As `swap`, for a graph that may end at any time.
    pub fn try_swap(&self, role: &str, binary: &str) -> Option<Value> {
        let output = Command::new(launcher())
            .args(["swap", &format!("{role}={binary}"), "--json", "--no-build", "--board", self.board()])
            .output()
            .unwrap_or_else(|error| panic!("the launcher does not start: {error}"));
        serde_json::from_slice(&output.stdout).ok()
    }

    /// Kills a service (signal 9) and returns the moment. In logical time its successor takes its first step
    /// 0.1 s later.
    pub fn kill(&self, role: &str) -> Time {
        if self.steering.is_some() {
            self.order(&format!("kill {role}"));
            return self.now();
        }
        signal(self.pid(role), "KILL");
        clock::monotonic()
    }

    /// Kills the launcher (signal 9).
    pub fn kill_launcher(&self) {
        self.keeper.borrow_mut().take();
        let _ = self.launcher.borrow_mut().kill();
    }

    /// How the launcher ended; waits for it.
    pub fn wait_for_end(&self, deadline: Duration) -> ExitStatus {
        let mut status = None;
        self.until(deadline, "the graph does not end", || {
            status = self.exited();
            status.is_some()
        });
        status.unwrap_or_else(|| panic!("the graph does not end"))
    }

    /// Asks the launcher to stop, as Ctrl-C does, and waits for its end.
    pub fn stop(&self) -> ExitStatus {
        self.keeper.borrow_mut().take();
        if let Some(steering) = &self.steering {
            steering.end();
        }
        signal(self.launcher.borrow().id(), "INT");
        self.wait_for_end(Duration::from_secs(10))
    }

    fn exited(&self) -> Option<ExitStatus> {
        self.launcher.borrow_mut().try_wait().ok().flatten()
    }

    fn with_tap<R>(&self, act: impl FnOnce(&mut Tap) -> R) -> R {
        match self.tap.borrow_mut().as_mut() {
            Some(tap) => act(tap),
            None => panic!("the test has not joined the board"),
        }
    }

    fn until(&self, deadline: Duration, what: &str, mut condition: impl FnMut() -> bool) {
        let end = clock::monotonic().after(deadline);
        while !condition() {
            assert!(
                clock::monotonic() < end,
                "{what} within {deadline:?}:\n{}\n{}",
                self.output(),
                self.logs()
            );
            clock::sleep(Duration::from_millis(2));
        }
    }

    /// The last lines of every service's log.
    pub fn logs(&self) -> String {
        let mut text = String::new();
        let entries = std::fs::read_dir(&self.logs).into_iter().flatten().flatten();
        for entry in entries.filter(|entry| entry.path().extension().is_some_and(|end| end == "log")) {
            let log = std::fs::read_to_string(entry.path()).unwrap_or_default();
            let lines: Vec<&str> = log.lines().collect();
            if !lines.is_empty() {
                text += &format!("--- {}\n", entry.file_name().to_string_lossy());
                text += &lines[lines.len().saturating_sub(5)..].join("\n");
                text.push('\n');
            }
        }
        text
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let has_failed = std::thread::panicking();
        let (logs, output) = if has_failed { (self.logs(), self.output()) } else { Default::default() };
        self.publishers.borrow_mut().clear();
        self.tap.borrow_mut().take();
        self.keeper.borrow_mut().take();
        if let Some(steering) = &self.steering {
            steering.end();
        }
        if self.exited().is_none() {
            signal(self.launcher.borrow().id(), "TERM");
            let end = clock::monotonic().after(Duration::from_secs(5));
            while self.exited().is_none() && clock::monotonic() < end {
                clock::sleep(Duration::from_millis(5));
            }
            let _ = self.launcher.borrow_mut().kill();
            let _ = self.launcher.borrow_mut().wait();
        }
        let _ = board::host::clear(&self.place);
        let _ = std::fs::remove_file(&self.output);
        let _ = std::fs::remove_dir_all(&self.logs);
        match self.recording.as_deref() {
            Some(file) if has_failed => eprintln!("{}", failure::report(&self.board, file, &output, &logs)),
            Some(file) => _ = std::fs::remove_file(file),
            None if has_failed => eprintln!("{output}\n{logs}"),
            None => {}
        }
    }
}

/// Sends a signal to a process that the test's graph has started.
pub fn signal(pid: u32, name: &str) {
    let _ = Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status();
}
