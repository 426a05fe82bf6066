//! What the tests share: a board of their own, services on it, and waiting for what comes.

use crate::services::{Count, Picture, Seen, WHICH};
use board::host::Host;
use board::manifest::{Manifest, Topic};
use board::place::Place;
use board::switchboard::SlotState;
use board::tap::{Tap, TapReader};
use board::{Envelope, clock};
use messages::health_topic;
use messages::{Health, Message};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Longest wait for anything: a condition that does not come fails the test, on a loaded machine too.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A name that no other test has.
pub(crate) fn board_name() -> String {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    format!("t{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed))
}

pub(crate) fn topic<T: Message>(name: &str, publisher: Option<&str>, depth: usize) -> Topic {
    Topic {
        name: name.to_owned(),
        publisher: publisher.map(str::to_owned),
        readers: vec![],
        depth,
        elements: 64,
        message: T::description(),
    }
}

/// The topics of the services of these tests.
pub(crate) fn manifest(publishers: &[(&str, &str)]) -> Manifest {
    let publisher = |topic: &str| publishers.iter().find(|(name, _)| *name == topic).map(|(_, role)| *role);
    Manifest {
        graph: "test".into(),
        topics: vec![
            topic::<Count>("count", publisher("count"), 64),
            topic::<Count>("relayed", publisher("relayed"), 64),
            topic::<Picture>("picture", publisher("picture"), 4),
            topic::<Seen>("seen", publisher("seen"), 64),
            topic::<messages::RangeScan>("scan", None, 4),
            topic::<messages::TofRanges>("ranges", None, 64),
            topic::<Health>(&health_topic("slow-collector"), None, 4),
            topic::<Health>(&health_topic("gullible"), None, 4),
            topic::<Health>(&health_topic("painter"), None, 4),
        ],
        ..Manifest::default()
    }
}

/// A board, and the services on it, which are ended with it.
pub(crate) struct Robot {
    pub(crate) host: Host,
    services: Vec<Child>,
}

impl Robot {
    pub(crate) fn new(publishers: &[(&str, &str)]) -> Self {
        let host = Host::create(&board_name(), manifest(publishers), false).expect("a board");
        Self { host, services: Vec::new() }
    }

    pub(crate) fn name(&self) -> &str {
        self.host.place().name()
    }

    pub(crate) fn tap(&self) -> Tap {
        Tap::join(Place::new(self.name()).unwrap(), "test").expect("a place on the board")
    }

    /// A command that becomes a service of this board.
    pub(crate) fn command(&self, which: &str) -> Command {
        let mut command = itself(which);
        command.args(["--board", self.name()]);
        command
    }

    /// Starts a service in a place of its own and waits until it takes steps.
    pub(crate) fn start(&mut self, which: &str) -> u32 {
        self.start_with(which, "{}")
    }

    pub(crate) fn start_with(&mut self, which: &str, params: &str) -> u32 {
        let slot = self.host.prepare(which, true).expect("a free place");
        let child = self
            .command(which)
            .args(["--slot", &slot.to_string(), "--params", params])
            .spawn()
            .expect("the test binary starts itself");
        self.services.push(child);
        let entry = self.host.switchboard().slot(slot).unwrap();
        wait_for("the service to run", || entry.state() == SlotState::Running);
        slot
    }

    /// Runs a service that is refused, and returns what it says.
    pub(crate) fn refused(&self, which: &str) -> String {
        let Output { status, stderr, .. } =
            self.command(which).stderr(Stdio::piped()).output().expect("the test binary starts itself");
        assert_eq!(status.code(), Some(i32::from(board::EXIT_SETUP)));
        String::from_utf8_lossy(&stderr).into_owned()
    }

    pub(crate) fn end_services(&mut self) {
        for service in &mut self.services {
            // SAFETY: a signal to our own child, which was not waited for yet.
            unsafe { libc::kill(service.id() as i32, libc::SIGTERM) };
        }
        for service in &mut self.services {
            let mut status = None;
            wait_for("a service to leave", || {
                status = service.try_wait().expect("our child");
                status.is_some()
            });
            assert!(status.is_some_and(|status| status.success()), "a service ended with {status:?}");
        }
        self.services.clear();
    }

    /// Ends the services, takes the board down, and looks whether anything is left.
    pub(crate) fn take_down(mut self) {
        self.end_services();
        let place = self.host.place().clone();
        self.host.take_down().expect("a clean end");
        assert_nothing_left(&place);
    }
}

/// The test binary as something else.
pub(crate) fn itself(which: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a path"));
    command.env(WHICH, which);
    command
}

#[track_caller]
pub(crate) fn assert_nothing_left(place: &Place) {
    assert!(!place.root().exists(), "{} is still there", place.root().display());
    assert_eq!(place.shared_memory(), Vec::<std::path::PathBuf>::new());
}

#[track_caller]
pub(crate) fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = clock::monotonic().after(PATIENCE);
    while !condition() {
        assert!(clock::monotonic() < deadline, "waited in vain for {what}");
        clock::sleep(Duration::from_millis(1));
    }
}

/// The next message of this type for which the condition holds.
#[track_caller]
pub(crate) fn await_message<T: Message>(
    tap: &Tap,
    reader: &mut TapReader,
    condition: impl Fn(&Envelope, &T) -> bool,
) -> T {
    let deadline = clock::monotonic().after(PATIENCE);
    loop {
        let heard = tap.bell();
        while let Some((envelope, bytes)) = reader.next() {
            if let Ok((message, _)) = T::read_from_prefix(bytes)
                && condition(&envelope, &message)
            {
                return message;
            }
        }
        assert!(clock::monotonic() < deadline, "no such {} came", T::NAME);
        tap.wait(heard, Duration::from_millis(100));
    }
}
