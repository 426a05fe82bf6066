//! The transport beneath the board: topics as aligned bytes with an envelope, over iceoryx2. Nothing outside this file names it.

use crate::lack::Lack;
use crate::place::Place;
use crate::segments;
use iceoryx2::config::Config;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use messages::Envelope;
use std::cell::Cell;
use std::fmt;
use std::os::unix::fs::MetadataExt as _;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// What lies in front of a message in shared memory.
#[derive(Debug, Clone, Copy, Default, ZeroCopySend)]
#[type_name("corkboard/Header/3")]
#[repr(C)]
struct Header {
    stamp_ns: u64,
    origin_ns: u64,
    sequence: u64,
    generation: u32,
    round: u32,
    /// Bytes of the message; the rest of its last block holds whatever was there before.
    length: u64,
}

impl Header {
    fn new(envelope: Envelope, length: usize) -> Self {
        let Envelope { stamp_ns, origin_ns, sequence, generation, round } = envelope;
        Self { stamp_ns, origin_ns, sequence, generation, round, length: length as u64 }
    }

    fn envelope(&self) -> Envelope {
        let Self { stamp_ns, origin_ns, sequence, generation, round, .. } = *self;
        Envelope { stamp_ns, origin_ns, sequence, generation, round }
    }
}

/// Alignment of every message in shared memory, in bytes.
const ALIGNMENT: usize = 64;

/// What messages are made of. A slice of single bytes takes 64 times the memory: the transport rounds each
/// element of a slice up to the slice's alignment (iceoryx2 0.10).
#[derive(Debug, Clone, Copy, ZeroCopySend, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[type_name("corkboard/Block/1")]
#[repr(C)]
#[repr(align(64))]
struct Block([u8; ALIGNMENT]);

/// Publishers on a topic at once: the incumbent, the newcomer of a swap, a person with `board publish --force`, and the dead that were not
/// cleaned up after yet.
const PUBLISHERS: usize = 8;

/// Messages that a reader may hold at once: the one that is read, the one that takes its place, and one that
/// came early.
pub(crate) const BORROWED: usize = 3;
/// Messages that a publisher may write at once.
pub(crate) const LOANED: usize = 2;
/// Messages that are kept for readers that come late.
pub(crate) const HISTORY: usize = 1;

/// A failure of the transport: what was being done, what is lacking for it if anything is, and the
/// transport's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TransportError {
    doing: String,
    lack: Option<Lack>,
    cause: String,
}

impl TransportError {
    /// Something cannot be done for want of this.
    pub(crate) fn lacking(doing: &str, lack: Lack) -> Self {
        Self { doing: doing.to_owned(), lack: Some(lack), cause: String::new() }
    }

    /// The resource that has run out, if that is why.
    pub fn lack(&self) -> Option<&Lack> {
        self.lack.as_ref()
    }
}

impl fmt::Display for TransportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { doing, lack, cause } = self;
        match (lack, in_words(cause)) {
            (Some(lack), _) if cause.is_empty() => write!(f, "{doing}: {lack}"),
            (Some(lack), _) => write!(f, "{doing}: {lack} (the transport says {cause})"),
            (None, Some(words)) => write!(f, "{doing}: {words} (the transport says {cause})"),
            (None, None) => write!(f, "{doing}: {cause}"),
        }
    }
}

impl std::error::Error for TransportError {}

/// What the transport's refusals mean that have to do with this crate's settings.
fn in_words(cause: &str) -> Option<String> {
    let tools = "end a tool that holds a place there (`board list` counts them), or clean up after the dead with \
                 `board clean`";
    Some(match cause {
        "ExceedsMaxSupportedSubscribers" => format!("it has as many readers as it takes; {tools}"),
        "ExceedsMaxSupportedPublishers" => {
            format!("it has {PUBLISHERS} publishers, which is as many as it takes; {tools}")
        }
        "ExceedsMaxNumberOfNodes" => {
            format!(
                "{} processes have joined it, which is as many as it takes; {tools}",
                crate::switchboard::SLOTS
            )
        }
        "IncompatibleTypes" => "the board was made by another version of Corkboard".to_owned(),
        "DoesNotExist" => "its files in shared memory were deleted; `launch stop` and `launch up` make them \
                           again"
            .to_owned(),
        _ => return None,
    })
}

fn failed(doing: impl Into<String>) -> impl FnOnce(&dyn fmt::Debug) -> TransportError {
    let doing = doing.into();
    move |cause| TransportError { doing, lack: Lack::look(), cause: format!("{cause:?}") }
}

/// A process's membership in a board.
pub(crate) struct Member {
    node: Node<ipc::Service>,
}

/// How a topic is laid out in shared memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TopicShape {
    pub(crate) fingerprint: u64,
    pub(crate) depth: usize,
    pub(crate) readers: usize,
}

/// The memory of a publisher.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Room {
    /// For messages of so many bytes from the start.
    pub(crate) bytes: usize,
    /// Whether there may be longer ones. Room for them is made when they come, if there is memory.
    pub(crate) grows: bool,
}

/// A topic in the transport; held open by whoever holds this.
pub(crate) struct RawTopic {
    factory: PortFactory<ipc::Service, [Block], Header>,
}

pub(crate) struct RawPublisher {
    publisher: Publisher<ipc::Service, [Block], Header>,
    /// Blocks of the longest message that there is room for at present.
    room: Cell<usize>,
    grows: bool,
}

pub(crate) struct RawReader {
    subscriber: Subscriber<ipc::Service, [Block], Header>,
}

/// A message borrowed from shared memory.
pub(crate) struct RawMessage {
    sample: Sample<ipc::Service, [Block], Header>,
    length: usize,
}

/// A message that says it is longer than the memory it lies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Forged;

/// Memory on loan for a message that is being written.
pub(crate) struct RawLoan {
    sample: SampleMut<ipc::Service, [Block], Header>,
    length: usize,
}

/// The transport's settings for a board: names of its own, nothing cleaned behind anybody's back.
fn config(place: &Place) -> Result<Config, TransportError> {
    let mut config = Config::default();
    config.global.prefix =
        place.prefix().try_into().map_err(|error| failed("the board's prefix is not accepted")(&error))?;
    let root = place.root().to_string_lossy();
    config.global.set_root_path(
        &root.as_ref().try_into().map_err(|error| failed("the board's folder is not accepted")(&error))?,
    );
    // Cleaning up after the dead can hang; the launcher does it, in a helper process with a time limit.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

impl Member {
    /// Joins the transport of a board.
    pub(crate) fn join(place: &Place) -> Result<Self, TransportError> {
        set_log_level(LogLevel::Fatal);
        raise_file_limit();
        refuse_strangers(place)?;
        let node = NodeBuilder::new()
            .config(&config(place)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| failed("the transport does not take this process")(&error))?;
        // Whoever made one of its files in the meantime could scribble on what holds the board together.
        refuse_strangers(place)?;
        Ok(Self { node })
    }

    fn builder(
        &self,
        topic: &str,
    ) -> Result<
        iceoryx2::service::builder::publish_subscribe::Builder<[Block], Header, ipc::Service>,
        TransportError,
    > {
        let name: ServiceName =
            topic.try_into().map_err(|error| failed(format!("`{topic}` cannot be a topic"))(&error))?;
        Ok(self.node.service_builder(&name).publish_subscribe::<[Block]>().user_header::<Header>())
    }

    /// Makes a topic; everybody else opens it.
    pub(crate) fn create(&self, topic: &str, shape: TopicShape) -> Result<RawTopic, TransportError> {
        let doing = || failed(format!("topic `{topic}` cannot be made"));
        let (key, value) = fingerprint_attribute(shape.fingerprint)?;
        let attributes = AttributeSpecifier::new().define(&key, &value).map_err(|error| doing()(&error))?;
        let factory = self
            .builder(topic)?
            .history_size(HISTORY)
            .subscriber_max_buffer_size(shape.depth.max(2))
            .subscriber_max_borrowed_samples(BORROWED)
            .max_publishers(PUBLISHERS)
            .max_subscribers(shape.readers)
            .max_nodes(crate::switchboard::SLOTS)
            .enable_safe_overflow(true)
            .create_with_attributes(&attributes)
            .map_err(|error| doing()(&error))?;
        Ok(RawTopic { factory })
    }

    /// Opens a topic that exists and has this layout.
    pub(crate) fn open(&self, topic: &str, fingerprint: u64) -> Result<RawTopic, TransportError> {
        let (key, value) = fingerprint_attribute(fingerprint)?;
        let verifier = AttributeVerifier::new()
            .require(&key, &value)
            .map_err(|error| failed(format!("topic `{topic}`"))(&error))?;
        retried(|| {
            self.builder(topic)?
                .open_with_attributes(&verifier)
                .map(|factory| RawTopic { factory })
                .map_err(|error| failed(format!("topic `{topic}` cannot be opened"))(&error))
        })
    }

    /// Cleans up after processes that died. May hang: for the helper process only.
    pub(crate) fn clean(&self) -> usize {
        self.node.blocking_cleanup_dead_nodes(Duration::from_secs(1)).failed_cleanups as usize
    }
}

fn fingerprint_attribute(fingerprint: u64) -> Result<(AttributeKey, AttributeValue), TransportError> {
    let key = "fingerprint".try_into().map_err(|error| failed("fingerprint")(&error))?;
    let value =
        format!("{fingerprint:016x}").as_str().try_into().map_err(|error| failed("fingerprint")(&error))?;
    Ok((key, value))
}

/// Every port of a service opens a few files, and the usual limit of 1024 is low for a service that reads
/// many topics.
fn raise_file_limit() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    const ENOUGH: u64 = 4096;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let wanted = maximum.map_or(ENOUGH, |most| most.min(ENOUGH));
    if current.is_some_and(|current| current < wanted) {
        // Where it cannot be raised, what runs out of files says so.
        let _ = setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), maximum });
    }
}

/// Everybody may make files in shared memory, also such as our transport would take for its own.
fn refuse_strangers(place: &Place) -> Result<(), TransportError> {
    let user = rustix::process::getuid().as_raw();
    for file in place.shared_memory() {
        let owner = std::fs::symlink_metadata(&file).map_or(user, |found| found.uid());
        if owner != user {
            return Err(TransportError {
                doing: format!("the board `{}` cannot be joined", place.name()),
                lack: None,
                cause: format!(
                    "{} belongs to user {owner}; have it removed, or choose another name with --board",
                    file.display()
                ),
            });
        }
    }
    Ok(())
}

/// Right after a death, ports and topics can be refused until the remains are cleaned: a few milliseconds.
fn retried<T>(mut attempt: impl FnMut() -> Result<T, TransportError>) -> Result<T, TransportError> {
    for pause_ms in [1, 2, 5, 10, 20, 50, 100, 200, 400] {
        match attempt() {
            Ok(value) => return Ok(value),
            // What is exhausted for the process stays so.
            Err(error) if matches!(error.lack, Some(Lack::Files { .. } | Lack::AddressSpace { .. })) => {
                return Err(error);
            }
            Err(_) => crate::clock::sleep(Duration::from_millis(pause_ms)),
        }
    }
    attempt()
}

/// Ports that could not be connected so far: the transport goes on without a word, and one of the two hears
/// nothing.
static UNCONNECTED: AtomicU64 = AtomicU64::new(0);

/// How many ports of this process could not be connected so far.
pub(crate) fn unconnected() -> u64 {
    UNCONNECTED.load(Ordering::Relaxed)
}

fn note_unconnected(cause: DegradationCause, _: &DegradationInfo) -> DegradationAction {
    if matches!(cause, DegradationCause::FailedToEstablishConnection) {
        UNCONNECTED.fetch_add(1, Ordering::Relaxed);
    }
    DegradationAction::Warn
}

/// A port that was just made, connected to all others of its topic but for such as died in the making.
fn connected<T>(port: T, before: u64, doing: &str) -> Result<T, TransportError> {
    match Lack::look().filter(|_| unconnected() > before) {
        Some(lack) => Err(TransportError::lacking(doing, lack)),
        None => Ok(port),
    }
}

impl RawTopic {
    pub(crate) fn publisher(&self, room: Room) -> Result<RawPublisher, TransportError> {
        const DOING: &str = "the topic takes no further publisher";
        let strategy = if room.grows { AllocationStrategy::BestFit } else { AllocationStrategy::Static };
        let blocks = blocks(room.bytes);
        retried(|| {
            segments::take_refused();
            let before = unconnected();
            let publisher = self
                .factory
                .publisher_builder()
                .initial_max_slice_len(blocks)
                .allocation_strategy(strategy)
                .max_loaned_samples(LOANED)
                .set_degradation_handler(note_unconnected)
                .create()
                .map_err(|error| failed(DOING)(&error))?;
            connected(RawPublisher { publisher, room: Cell::new(blocks), grows: room.grows }, before, DOING)
        })
    }

    pub(crate) fn reader(&self, depth: usize) -> Result<RawReader, TransportError> {
        const DOING: &str = "the topic takes no further reader";
        let most = self.factory.static_config().subscriber_max_buffer_size();
        retried(|| {
            segments::take_refused();
            let before = unconnected();
            let subscriber = self
                .factory
                .subscriber_builder()
                .buffer_size(depth.clamp(2, most.max(2)))
                .set_degradation_handler(note_unconnected)
                .create()
                .map_err(|error| failed(DOING)(&error))?;
            connected(RawReader { subscriber }, before, DOING)
        })
    }
}

/// Bytes that a message of so many bytes takes in shared memory, with all that lies in front of it.
pub(crate) fn message_bytes(bytes: usize) -> usize {
    type TransportHeader = iceoryx2::service::header::publish_subscribe::Header;
    let heads = size_of::<TransportHeader>().next_multiple_of(align_of::<Header>()) + size_of::<Header>();
    heads.next_multiple_of(ALIGNMENT) + blocks(bytes) * ALIGNMENT
}

/// Blocks that a message of so many bytes takes.
fn blocks(bytes: usize) -> usize {
    bytes.div_ceil(ALIGNMENT).max(1)
}

/// The number, up to an eighth more, so that few such numbers lie between one and the next power of two.
fn rounded_up(number: usize) -> usize {
    number.next_multiple_of((1 << number.max(8).ilog2()) >> 3)
}

impl RawPublisher {
    /// Memory for a message of so many bytes, in which every byte has some value.
    pub(crate) fn loan(&self, bytes: usize) -> Result<RawLoan, TransportError> {
        let blocks = blocks(bytes);
        if blocks > self.room.get() && self.grows {
            self.grow(blocks)?;
        }
        let sample = self
            .publisher
            .loan_slice_uninit(blocks)
            .map_err(|error| failed(format!("no memory for a message of {bytes} bytes"))(&error))?;
        // SAFETY: the memory is part of a mapped file, so each byte has a value, if an old one; a block takes
        // any. At once, since what is not yet initialised is four times as large to hand around, which shows
        // at a microsecond a message.
        Ok(RawLoan { sample: unsafe { sample.assume_init() }, length: bytes })
    }

    /// Makes room for longer messages, and somewhat more: a publisher can grow 255 times. Not twice as much, as the
    /// transport would, since there is a message for each place of each reader.
    #[cold]
    fn grow(&self, blocks: usize) -> Result<(), TransportError> {
        let room = rounded_up(blocks);
        let loan = self.publisher.loan_slice_uninit(room);
        loan.map_err(|error| failed(format!("no room for messages of {} bytes", room * ALIGNMENT))(&error))?;
        self.room.set(room);
        Ok(())
    }

    /// Serves readers that have joined since, so that they get the last message.
    pub(crate) fn update(&self) {
        let _ = self.publisher.update_connections();
    }
}

impl RawReader {
    /// The next message that waits.
    #[inline(always)]
    pub(crate) fn receive(&self) -> Option<Result<RawMessage, Forged>> {
        // A connection to a publisher that died in mid-creation cannot be opened; the others go on.
        self.subscriber.receive().ok().flatten().map(RawMessage::check)
    }
}

impl RawMessage {
    #[inline(always)]
    fn check(sample: Sample<ipc::Service, [Block], Header>) -> Result<Self, Forged> {
        // Once: it may be written to by a broken publisher at any time.
        let length = usize::try_from(sample.user_header().length).unwrap_or(usize::MAX);
        if length <= size_of_val(sample.payload()) { Ok(Self { sample, length }) } else { Err(Forged) }
    }

    pub(crate) fn envelope(&self) -> Envelope {
        self.sample.user_header().envelope()
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        // The payload's length too is read from shared memory, every time.
        self.sample.payload().as_bytes().get(..self.length).unwrap_or_default()
    }
}

impl RawLoan {
    pub(crate) fn bytes(&mut self) -> &mut [u8] {
        &mut self.sample.payload_mut().as_mut_bytes()[..self.length]
    }

    pub(crate) fn send(mut self, envelope: Envelope) -> Result<(), TransportError> {
        *self.sample.user_header_mut() = Header::new(envelope, self.length);
        self.sample.send().map(|_| ()).map_err(|error| failed("a message cannot be sent")(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a reader makes of a message of 100 bytes whose header says that it has so many.
    fn received(said: u64) -> Result<Vec<u8>, Forged> {
        let place = Place::new(&format!("t-f-{}-{}", std::process::id(), said % 1000)).unwrap();
        place.create().unwrap();
        let member = Member::join(&place).unwrap();
        let topic = member.create("topic", TopicShape { fingerprint: 1, depth: 2, readers: 1 }).unwrap();
        let reader = topic.reader(2).unwrap();
        let publisher = topic.publisher(Room { bytes: 100, grows: false }).unwrap();
        let mut loan = publisher.loan(100).unwrap();
        loan.bytes().fill(7);
        loan.sample.user_header_mut().length = said;
        loan.sample.send().unwrap();
        let received = reader.receive().unwrap().map(|message| message.bytes().to_vec());
        drop((reader, publisher, topic, member));
        place.remove().unwrap();
        received
    }

    #[test]
    fn a_forged_length_is_no_message() {
        assert_eq!(received(100), Ok(vec![7; 100]));
        assert_eq!(received(1), Ok(vec![7]));
        assert_eq!(received(129), Err(Forged));
        assert_eq!(received(u64::MAX), Err(Forged));
    }

    #[test]
    fn growth_has_few_steps() {
        let mut sizes: Vec<usize> = (1..1_000_000).map(rounded_up).collect();
        assert!(
            (1..1_000_000).zip(&sizes).all(|(wanted, &size)| size >= wanted && size <= wanted + wanted / 8)
        );
        sizes.dedup();
        assert!(sizes.len() < 200, "{}", sizes.len());
    }

    #[test]
    fn a_fixed_message_has_no_room_to_grow() {
        let place = Place::new(&format!("t-g-{}", std::process::id())).unwrap();
        place.create().unwrap();
        let member = Member::join(&place).unwrap();
        let topic = member.create("topic", TopicShape { fingerprint: 1, depth: 2, readers: 1 }).unwrap();
        let fixed = topic.publisher(Room { bytes: 100, grows: false }).unwrap();
        assert!(fixed.loan(128).is_ok() && fixed.loan(129).is_err());
        let growing = topic.publisher(Room { bytes: 100, grows: true }).unwrap();
        for length in [100_000, 50, 100_001, 300_000] {
            assert_eq!(growing.loan(length).unwrap().bytes().len(), length);
        }
        drop((fixed, growing, topic, member));
        place.remove().unwrap();
    }
}
