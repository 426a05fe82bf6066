//! A service's node: where its ports are declared, and what wakes it.

use crate::host::{shadow_role, shadow_topic};
use crate::interface::{Direction, PortDescription};
use crate::kept::{Home, Kept};
use crate::lack::Lack;
use crate::manifest::Manifest;
use crate::place::Place;
use crate::port::{Latest, Publisher, PublisherLink, Queue, Reader, ReaderLink};
use crate::shared::Shared;
use crate::switchboard::Switchboard;
use crate::transport::{Member, Room, TransportError};
use messages::{ELEMENTS, Message, health_topic};
use serde::{Serialize, de::DeserializeOwned};
use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Messages that may wait for the reader of a state: one being read, and those of one instant in lockstep.
const LATEST_DEPTH: usize = 4;
/// Messages that may wait for the reader of events.
const QUEUE_DEPTH: usize = 64;

/// Why a process cannot take its place on a board.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// No such board.
    #[error("there is no board `{board}`; start one with `launch up`")]
    NoBoard {
        /// The board asked for.
        board: String,
    },
    /// Something of the board cannot be read.
    #[error("the board `{board}` cannot be read: {source}")]
    Unreadable {
        /// The board.
        board: String,
        /// Why.
        source: std::io::Error,
    },
    /// All places are taken.
    #[error("the board `{board}` has {} processes already", crate::switchboard::SLOTS)]
    Full {
        /// The board.
        board: String,
    },
    /// The topic is not on the board.
    #[error("topic `{topic}` is not on the board `{board}`: the graph names no service that publishes it")]
    NoTopic {
        /// The topic.
        topic: String,
        /// The board.
        board: String,
    },
    /// The topic carries messages of another layout.
    #[error(
        "topic `{topic}`: {difference} (here: this service, layout {ours:016x}; there: the board, layout {theirs:016x}); build both from one state of the sources"
    )]
    Layout {
        /// The topic.
        topic: String,
        /// The first difference, in words.
        difference: String,
        /// Our layout's fingerprint.
        ours: u64,
        /// The board's.
        theirs: u64,
    },
    /// Somebody else publishes the topic.
    #[error(
        "topic `{topic}` is published by `{publisher}`; one topic has one publisher, so `{role}` is refused"
    )]
    SecondPublisher {
        /// The topic.
        topic: String,
        /// Who publishes it.
        publisher: String,
        /// Who asked.
        role: String,
    },
    /// The transport failed.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// A service has said what it is, and was asked for nothing more: see [`Node::declared`].
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("only asked what it is, this service does not start")]
pub struct Declared;

/// A process's place on a board.
pub(crate) struct Joined {
    pub(crate) shared: Rc<Shared>,
    pub(crate) manifest: Manifest,
    pub(crate) member: Member,
    pub(crate) place: Place,
    pub(crate) publishers: Vec<PublisherLink>,
    /// Files that its ports may still come to open.
    expected_files: Cell<u64>,
}

/// Files that a reader opens for a publisher that it meets.
const FILES_A_PUBLISHER: u64 = 2;

impl Joined {
    /// Joins the board as `role`, in a slot that the launcher has prepared or in a free one.
    pub(crate) fn join(place: Place, role: &str, prepared: Option<u32>) -> Result<Self, JoinError> {
        let board = place.name().to_owned();
        let unreadable = |source| JoinError::Unreadable { board: board.clone(), source };
        if !place.exists() {
            return Err(JoinError::NoBoard { board });
        }
        let switchboard = Switchboard::open(&place.file(crate::switchboard::FILE)).map_err(unreadable)?;
        let manifest = Manifest::read(&place).map_err(unreadable)?;
        let slot = match prepared {
            Some(slot) => slot,
            None => switchboard
                .claim(role, std::process::id(), false)
                .ok_or_else(|| JoinError::Full { board: board.clone() })?,
        };
        let generation = match (prepared, switchboard.slot(slot)) {
            (Some(_), Some(slot)) => slot.generation.load(Ordering::Acquire),
            _ => 0,
        };
        // The launcher writes this too, but may die before it comes to it; then whoever clears the board away finds us here.
        if let Some(slot) = switchboard.slot(slot) {
            slot.pid.store(std::process::id(), Ordering::Release);
        }
        let member = Member::join(&place).inspect_err(|_| {
            if prepared.is_none() {
                switchboard.release(slot);
            }
        })?;
        let shared = Rc::new(Shared::new(switchboard, slot, generation));
        let expected_files = Cell::new(0);
        Ok(Self { shared, manifest, member, place, publishers: Vec::new(), expected_files })
    }

    pub(crate) fn open_reader(
        &self,
        topic: &str,
        fingerprint: u64,
        depth: usize,
    ) -> Result<ReaderLink, JoinError> {
        let (index, _) = self.manifest.topic(topic).ok_or_else(|| self.no_topic(topic))?;
        self.expect_files(topic, FILES_A_PUBLISHER)?;
        let reader = self.member.open(topic, fingerprint)?.reader(depth)?;
        Ok(ReaderLink {
            shared: Rc::clone(&self.shared),
            topic: index,
            reader,
            generation: 0,
            sequence: None,
            early: None,
        })
    }

    pub(crate) fn open_publisher(
        &mut self,
        topic: &str,
        fingerprint: u64,
        grows: bool,
    ) -> Result<PublisherLink, JoinError> {
        let (index, entry) = self.manifest.topic(topic).ok_or_else(|| self.no_topic(topic))?;
        let room = Room { bytes: entry.room_bytes(), grows };
        // One for each reader that it meets, and one for a tool.
        self.expect_files(topic, entry.readers.len() as u64 + 1)?;
        let publisher = Rc::new(self.member.open(topic, fingerprint)?.publisher(room)?);
        let link =
            PublisherLink { shared: Rc::clone(&self.shared), topic: index, publisher, measures: false };
        self.publishers.push(link.clone());
        Ok(link)
    }

    /// The others of a topic come later, and whom a process then cannot open a file for hears nothing of it:
    /// so it is refused now.
    fn expect_files(&self, topic: &str, more: u64) -> Result<(), TransportError> {
        self.expected_files.set(self.expected_files.get() + more);
        match Lack::of_files(self.expected_files.get()) {
            Some(lack) => Err(TransportError::lacking(&format!("topic `{topic}` cannot be opened"), lack)),
            None => Ok(()),
        }
    }

    fn no_topic(&self, topic: &str) -> JoinError {
        JoinError::NoTopic { topic: topic.to_owned(), board: self.place.name().to_owned() }
    }

    fn check_layout<T: Message>(&self, topic: &str) -> Result<u64, JoinError> {
        let ours = T::description();
        let fingerprint = ours.fingerprint();
        let (_, entry) = self.manifest.topic(topic).ok_or_else(|| self.no_topic(topic))?;
        let theirs = entry.message.fingerprint();
        if fingerprint == theirs {
            return Ok(fingerprint);
        }
        let difference =
            ours.first_difference(&entry.message).unwrap_or_else(|| "the layouts differ".to_owned());
        Err(JoinError::Layout { topic: topic.to_owned(), difference, ours: fingerprint, theirs })
    }
}

/// Where a service declares its ports and what wakes it, before its first step.
pub struct Node {
    role: String,
    pub(crate) joined: Option<Joined>,
    /// It publishes beside the topics of its role, to be compared.
    is_shadow: bool,
    pub(crate) ports: Vec<PortDescription>,
    pub(crate) wakes: Vec<u32>,
    pub(crate) period: Option<Duration>,
}

impl Node {
    pub(crate) fn describing(role: &str) -> Self {
        Self {
            role: role.to_owned(),
            joined: None,
            is_shadow: false,
            ports: Vec::new(),
            wakes: Vec::new(),
            period: None,
        }
    }

    pub(crate) fn joined(role: &str, joined: Joined, is_shadow: bool) -> Self {
        Self { joined: Some(joined), is_shadow, ..Self::describing(role) }
    }

    /// The service's name in the graph.
    pub fn role(&self) -> &str {
        &self.role
    }

    /// The service's random seed, derived from the graph's seed and the service's name: equal in every run of one graph.
    pub fn seed(&self) -> u64 {
        let graph = self.joined.as_ref().map_or(0, |joined| joined.manifest.seed);
        let hash = self.role.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
        // SplitMix64 (Steele, Lea, Flood 2014): neighbouring seeds give unrelated streams.
        let mut mixed = (graph ^ hash).wrapping_add(0x9e37_79b9_7f4a_7c15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// The newest message of a topic, which some service must publish.
    ///
    /// # Errors
    /// When the topic is not on the board, or carries messages of another layout.
    pub fn latest<T: Message>(&mut self, topic: &str) -> Result<Latest<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Latest, true, LATEST_DEPTH)?;
        Ok(Latest::new(topic, link, true))
    }

    /// The newest message of a topic, which nobody needs to publish.
    ///
    /// # Errors
    /// When the topic carries messages of another layout.
    pub fn optional<T: Message>(&mut self, topic: &str) -> Result<Latest<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Latest, false, LATEST_DEPTH)?;
        Ok(Latest::new(topic, link, true))
    }

    /// As `latest`, for what is no sensor reading (a plan, a command, a map): its age does not count as the age of the outputs.
    ///
    /// # Errors
    /// When the topic is not on the board, or carries messages of another layout.
    pub fn reference<T: Message>(&mut self, topic: &str) -> Result<Latest<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Latest, true, LATEST_DEPTH)?;
        Ok(Latest::new(topic, link, false))
    }

    /// As `reference`, for what nobody needs to publish.
    ///
    /// # Errors
    /// When the topic carries messages of another layout.
    pub fn optional_reference<T: Message>(&mut self, topic: &str) -> Result<Latest<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Latest, false, LATEST_DEPTH)?;
        Ok(Latest::new(topic, link, false))
    }

    /// Every message of a topic in order, which some service must publish.
    ///
    /// # Errors
    /// When the topic is not on the board, or carries messages of another layout.
    pub fn queue<T: Message>(&mut self, topic: &str) -> Result<Queue<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Queue, true, QUEUE_DEPTH)?;
        Ok(Queue::new(topic, link))
    }

    /// As `queue`, for what nobody needs to publish.
    ///
    /// # Errors
    /// When the topic carries messages of another layout.
    pub fn optional_queue<T: Message>(&mut self, topic: &str) -> Result<Queue<T>, JoinError> {
        let link = self.reader::<T>(topic, Direction::Queue, false, QUEUE_DEPTH)?;
        Ok(Queue::new(topic, link))
    }

    /// The right to publish on a topic.
    ///
    /// # Errors
    /// When the topic is not on the board, carries messages of another layout, or belongs to another service.
    pub fn publisher<T: Message>(&mut self, topic: &str) -> Result<Publisher<T>, JoinError> {
        self.publisher_of(topic, false, ELEMENTS)
    }

    /// As `publisher`, for messages of up to so many elements. Their memory is reserved before the robot
    /// starts; that of longer ones is asked for when they come, and may not be there.
    ///
    /// # Errors
    /// As `publisher`.
    pub fn publisher_holding<T: Message>(
        &mut self,
        topic: &str,
        elements: usize,
    ) -> Result<Publisher<T>, JoinError> {
        self.publisher_of(topic, false, elements)
    }

    /// As `publisher`, for readings of the world: their age begins with their publication, whatever else was read in the same step. Without it the age of
    /// a command would run around the loop from the wheels through odometry and pose back to the wheels for ever.
    ///
    /// # Errors
    /// As `publisher`.
    pub fn sensor_publisher<T: Message>(&mut self, topic: &str) -> Result<Publisher<T>, JoinError> {
        self.publisher_of(topic, true, ELEMENTS)
    }

    fn publisher_of<T: Message>(
        &mut self,
        topic: &str,
        measures: bool,
        elements: usize,
    ) -> Result<Publisher<T>, JoinError> {
        self.describe::<T>(topic, Direction::Publish, true, 0, if T::HAS_ELEMENTS { elements } else { 0 });
        let role = self.role.clone();
        let Some(joined) = &mut self.joined else { return Ok(Publisher::new(topic, None)) };
        let (role, topic) =
            if self.is_shadow { (shadow_role(&role), shadow_topic(topic)) } else { (role, topic.to_owned()) };
        let topic = topic.as_str();
        let fingerprint = joined.check_layout::<T>(topic)?;
        let owner = joined.manifest.topic(topic).and_then(|(_, entry)| entry.publisher.clone());
        if let Some(publisher) = owner.filter(|owner| *owner != role) {
            return Err(JoinError::SecondPublisher { topic: topic.to_owned(), publisher, role });
        }
        let mut link = joined.open_publisher(topic, fingerprint, T::HAS_ELEMENTS)?;
        link.measures = measures;
        if let Some(entry) = joined.shared.switchboard.topic(link.topic)
            && link.is_heard()
        {
            entry.publisher.store(joined.shared.slot, Ordering::Release);
        }
        Ok(Publisher::new(topic, Some(link)))
    }

    /// A message on this port makes the service take a step.
    pub fn wake_on(&mut self, port: &impl Reader) {
        let topic = port.topic();
        for description in self.ports.iter_mut().filter(|port| port.topic == topic) {
            description.wakes |= description.direction != Direction::Publish;
        }
        if let Some(joined) = &self.joined
            && let Some((index, _)) = joined.manifest.topic(topic)
        {
            self.wakes.push(index);
        }
    }

    /// The service takes a step at least once in every such period, on the multiples of it.
    pub fn every(&mut self, period: Duration) {
        self.period = Some(period.max(Duration::from_micros(10)));
    }

    /// Says that all ports are declared, and that what follows may take its time, such as reading a map. Hand
    /// the result on with `?`.
    ///
    /// A service that is only asked for its interface goes no further, so what it is does not wait for its
    /// data. What stands before should be quick, and refuse what is wrong: parameters, a map's header, a log
    /// that is not there.
    ///
    /// # Errors
    /// When the service is only asked for its interface.
    pub fn declared(&self) -> Result<(), Declared> {
        if self.joined.is_some() { Ok(()) } else { Err(Declared) }
    }

    /// A state that outlives the process: saved by its predecessor of the same role, restored after a crash or a swap.
    ///
    /// A newcomer restores what its predecessor has saved so far, and saves nothing of its own before it takes over.
    pub fn kept<S: Serialize + DeserializeOwned>(&self) -> Kept<S> {
        let health = health_topic(&self.role);
        let home = self.joined.as_ref().and_then(|joined| {
            let (health, _) = joined.manifest.topic(&health)?;
            let file = joined.place.file(&format!("state-{}", self.role));
            Some(Home { file, shared: Rc::clone(&joined.shared), health })
        });
        Kept::new(home)
    }

    fn reader<T: Message>(
        &mut self,
        topic: &str,
        direction: Direction,
        required: bool,
        depth: usize,
    ) -> Result<Option<ReaderLink>, JoinError> {
        self.describe::<T>(topic, direction, required, depth, 0);
        let Some(joined) = &self.joined else { return Ok(None) };
        if !required && joined.manifest.topic(topic).is_none() {
            return Ok(None);
        }
        let fingerprint = joined.check_layout::<T>(topic)?;
        Ok(Some(joined.open_reader(topic, fingerprint, depth)?))
    }

    fn describe<T: Message>(
        &mut self,
        topic: &str,
        direction: Direction,
        required: bool,
        depth: usize,
        elements: usize,
    ) {
        let message = T::description();
        let fingerprint = format!("{:016x}", message.fingerprint());
        self.ports.push(PortDescription {
            topic: topic.to_owned(),
            direction,
            required,
            depth,
            elements,
            wakes: false,
            message,
            fingerprint,
        });
    }
}
