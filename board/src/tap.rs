//! The board from outside: for tools, recorders, bridges and tests, which read and publish topics that they know by name alone.

use crate::clock;
use crate::gate;
use crate::manifest::{Manifest, Topic};
use crate::node::{JoinError, Joined};
use crate::place::Place;
use crate::port::{PublisherLink, ReaderLink};
use crate::private::Version;
use crate::switchboard::{SlotState, Switchboard};
use crate::transport::{RawMessage, TransportError};
use messages::{Envelope, Message, Time, View};
use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::sync::atomic::Ordering;
use std::time::Duration;

pub use crate::port::OUTSIDE_ROUND;

/// A tool's place on a board.
pub struct Tap {
    joined: Joined,
    topology: Cell<u32>,
    /// The topics that wake it.
    wakes: RefCell<Vec<u32>>,
    /// The table of contents, as it was last read.
    manifest_file: Option<Version>,
}

impl std::fmt::Debug for Tap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tap").field("board", &self.joined.place.name()).finish_non_exhaustive()
    }
}

impl Tap {
    /// Joins a board that is up.
    ///
    /// # Errors
    /// When it is not, or all its places are taken.
    pub fn join(place: Place, tool: &str) -> Result<Self, JoinError> {
        let board = || place.name().to_owned();
        match crate::host::living_launcher(&place) {
            Ok(Some(_)) => {}
            Ok(None) => return Err(JoinError::NoBoard { board: board() }),
            Err(source) => return Err(JoinError::Unreadable { board: board(), source }),
        }
        let manifest_file = Manifest::version(&place);
        let joined = Joined::join(place, tool, None)?;
        if let Some(slot) = joined.shared.own_slot() {
            slot.set_state(SlotState::Running);
        }
        Ok(Self { joined, topology: Cell::new(0), wakes: RefCell::default(), manifest_file })
    }

    /// Reads the table of contents again if it has changed; the places in it of the topics that are new.
    /// Those that were there stay where they were. Costs one look at a file while nothing changes.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn refresh(&mut self) -> Result<Range<usize>, JoinError> {
        let known = self.joined.manifest.topics.len();
        let file = Manifest::version(&self.joined.place);
        // While the board is being taken down there is none.
        if file.is_some() && file != self.manifest_file {
            let board = || self.joined.place.name().to_owned();
            let manifest = Manifest::read(&self.joined.place)
                .map_err(|source| JoinError::Unreadable { board: board(), source })?;
            self.manifest_file = file;
            if manifest.topics.len() > known {
                self.joined.manifest = manifest;
            }
        }
        Ok(known..self.joined.manifest.topics.len())
    }

    /// The board's table of contents.
    pub fn manifest(&self) -> &Manifest {
        &self.joined.manifest
    }

    /// The board's shared page.
    pub fn switchboard(&self) -> &Switchboard {
        &self.joined.shared.switchboard
    }

    /// Reads a topic from its last message on.
    ///
    /// # Errors
    /// When there is no such topic, or it takes no more readers.
    pub fn reader(&self, topic: &str) -> Result<TapReader, JoinError> {
        let (index, entry) = self.topic(topic)?;
        let link = self.joined.open_reader(topic, entry.message.fingerprint(), entry.depth)?;
        self.joined.shared.keep_awake(index);
        self.wakes.borrow_mut().push(index);
        self.switchboard().announce_reader();
        Ok(TapReader { link, held: None })
    }

    /// Publishes on a topic: as the outside does where the graph says so, and otherwise in the name of its publisher, beside it.
    ///
    /// # Errors
    /// When there is no such topic, or it takes no more publishers.
    pub fn publisher(&mut self, topic: &str) -> Result<TapPublisher, JoinError> {
        let fingerprint = self.topic(topic)?.1.message.fingerprint();
        Ok(TapPublisher { link: self.joined.open_publisher(topic, fingerprint, true)? })
    }

    /// Sleeps until a topic that is read has a new message, at most for `timeout`. Look for messages first: `heard` is the bell before the look.
    /// Readers that have joined since get the last message of each publisher of this tap.
    pub fn wait(&self, heard: u32, timeout: Duration) {
        self.serve_new_readers();
        if let Some(slot) = self.joined.shared.own_slot() {
            slot.hold_claim();
            self.wakes.borrow().iter().for_each(|&topic| self.joined.shared.keep_awake(topic));
            slot.heartbeat_ns.store(clock::monotonic().as_nanos(), Ordering::Relaxed);
            slot.wait(heard, Some(timeout));
        }
    }

    /// Gives readers that have joined since the last message of each publisher of this tap.
    pub fn serve_new_readers(&self) {
        let topology = self.switchboard().header().topology.load(Ordering::Acquire);
        if self.topology.replace(topology) != topology {
            self.joined.publishers.iter().for_each(|link| link.publisher.update());
        }
    }

    /// The bell's count, for `wait`.
    pub fn bell(&self) -> u32 {
        self.joined.shared.own_slot().map_or(0, |slot| slot.bell())
    }

    fn topic(&self, name: &str) -> Result<(u32, &Topic), JoinError> {
        self.joined.manifest.topic(name).ok_or_else(|| JoinError::NoTopic {
            topic: name.to_owned(),
            board: self.joined.place.name().to_owned(),
        })
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.joined.shared.switchboard.release(self.joined.shared.slot);
    }
}

/// Reads the bytes of a topic.
pub struct TapReader {
    link: ReaderLink,
    held: Option<RawMessage>,
}

impl std::fmt::Debug for TapReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TapReader").field("topic", &self.link.topic).finish_non_exhaustive()
    }
}

impl TapReader {
    /// The next message: its envelope and its bytes, borrowed from shared memory.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> Option<(Envelope, &[u8])> {
        // A tool sees everything that is there, in lockstep too.
        let message = self.link.receive()?;
        let envelope = message.envelope();
        self.link.count_gap(envelope.sequence);
        Some((envelope, self.held.insert(message).bytes()))
    }

    /// The newest message that waits, if one does and is of that type.
    pub fn newest<T: Message>(&mut self) -> Option<T> {
        let mut newest = None;
        while let Some((_, bytes)) = self.next() {
            newest = View::<T>::parse(bytes).ok().map(|view| *view.message).or(newest);
        }
        newest
    }

    /// Messages that were overwritten before they were read, on any topic of this reader's tap.
    pub fn lost(&self) -> u64 {
        self.link.shared.lost.get()
    }

    /// Messages that were not what they said, on any topic of this reader's tap.
    pub fn invalid(&self) -> u64 {
        self.link.shared.invalid.get()
    }
}

/// Publishes bytes on a topic.
pub struct TapPublisher {
    link: PublisherLink,
}

impl std::fmt::Debug for TapPublisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TapPublisher").field("topic", &self.link.topic).finish_non_exhaustive()
    }
}

impl TapPublisher {
    /// Publishes these bytes, whatever they are.
    ///
    /// # Errors
    /// When the transport has no memory left.
    pub fn publish(&self, bytes: &[u8]) -> Result<(), TransportError> {
        let mut loan = self.link.loan(bytes.len())?;
        loan.bytes().copy_from_slice(bytes);
        let board = &self.link.shared.switchboard;
        // Host time would lie in a lockstep's far future, and block the readers for ever.
        let send = || self.link.send_as_outsider(loan, now(board));
        if self.link.shared.lockstep { gate::between_instants(board, send) } else { send() }
    }

    /// Publishes these bytes with this envelope: for whoever has a run's messages on record, and is the conductor's own.
    ///
    /// # Errors
    /// When the transport has no memory left.
    pub fn publish_as(&self, envelope: Envelope, bytes: &[u8]) -> Result<(), TransportError> {
        let mut loan = self.link.loan(bytes.len())?;
        loan.bytes().copy_from_slice(bytes);
        self.link.send_as(loan, envelope)
    }
}

/// The moment on a board's clock.
pub fn now(switchboard: &Switchboard) -> Time {
    let header = switchboard.header();
    if header.lockstep.load(Ordering::Acquire) != 0 {
        Time::from_nanos(header.logical_ns.load(Ordering::Acquire))
    } else {
        clock::monotonic()
    }
}
