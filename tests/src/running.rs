//! A graph that runs.

use crate::binaries::launcher;
use board::clock;
use board::place::Place;
use board::switchboard::SlotState;
use board::tap::{Tap, TapPublisher, TapReader};
use messages::{Message, View};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A running graph on a board of its own. It is stopped, and its board taken down, when this is dropped.
pub struct Running {
    board: String,
    place: Place,
    launcher: RefCell<Child>,
    /// One a topic: a board takes few publishers beside the rightful one.
    publishers: RefCell<BTreeMap<String, TapPublisher>>,
    tap: RefCell<Option<Tap>>,
    output: PathBuf,
}

impl std::fmt::Debug for Running {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Running").field("board", &self.board).finish_non_exhaustive()
    }
}

#[allow(clippy::panic)]
impl Running {
    pub(crate) fn start(graph: &Path, board: &str, arguments: &[String]) -> Self {
        let output = std::env::temp_dir().join(format!("corkboard-{board}.out"));
        let file =
            std::fs::File::create(&output).unwrap_or_else(|error| panic!("{}: {error}", output.display()));
        let copy = file.try_clone().unwrap_or_else(|error| panic!("{}: {error}", output.display()));
        let launcher = Command::new(launcher())
            .arg("up")
            .arg(graph)
            .args(["--plain", "--no-build", "--board", board])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(file)
            .stderr(copy)
            .spawn()
            .unwrap_or_else(|error| panic!("the launcher does not start: {error}"));
        let place = Place::new(board).unwrap_or_else(|error| panic!("{error}"));
        let running = Self {
            board: board.to_owned(),
            place,
            launcher: RefCell::new(launcher),
            publishers: RefCell::new(BTreeMap::new()),
            tap: RefCell::new(None),
            output,
        };
        running.wait_until_ready();
        running
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
        let description = self.with_tap(|tap| match tap.manifest().topic(topic) {
            Some((_, topic)) => topic.message.clone(),
            None => panic!("there is no topic {topic}"),
        });
        let bytes = description.from_json(&message).unwrap_or_else(|error| panic!("{error}"));
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

    /// Waits until a message on the topic, as JSON, meets the condition, and returns it.
    pub fn wait_for(&self, topic: &str, condition: impl Fn(&Value) -> bool, deadline: Duration) -> Value {
        let description = self.with_tap(|tap| match tap.manifest().topic(topic) {
            Some((_, topic)) => topic.message.clone(),
            None => panic!("there is no topic {topic}"),
        });
        let mut reader = self.reader(topic);
        let mut found = None;
        let mut last = Value::Null;
        self.until(deadline, &format!("`{topic}` never met the condition"), || {
            while let Some((_, bytes)) = reader.next() {
                last = description.to_json(bytes);
                if condition(&last) {
                    found = Some(last.clone());
                    return true;
                }
            }
            self.with_tap(|tap| tap.wait(tap.bell(), Duration::from_millis(2)));
            false
        });
        found.unwrap_or(last)
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

    /// Lets another service play a role while the graph runs, as `launch swap` does, and returns what it says.
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

    /// Kills a service (signal 9) and returns the moment.
    pub fn kill(&self, role: &str) -> messages::Time {
        signal(self.pid(role), "KILL");
        clock::monotonic()
    }

    /// Kills the launcher (signal 9).
    pub fn kill_launcher(&self) {
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
        for entry in std::fs::read_dir(self.place.file("logs")).into_iter().flatten().flatten() {
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
        self.publishers.borrow_mut().clear();
        self.tap.borrow_mut().take();
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
    }
}

/// Sends a signal to a process that the test's graph has started.
pub fn signal(pid: u32, name: &str) {
    let _ = Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status();
}
