//! The transport beneath the board: topics as aligned bytes with an envelope, over iceoryx2. Nothing outside this file names it.

use crate::place::Place;
use iceoryx2::config::Config;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::time::Duration;

/// What lies in front of every message.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("corkboard/Envelope/1")]
#[repr(C)]
pub struct Envelope {
    /// When it was published, in nanoseconds of the board's clock.
    pub stamp_ns: u64,
    /// When the oldest sensor reading behind it was taken.
    pub origin_ns: u64,
    /// The publisher's count of messages on this topic, beginning with 1.
    pub sequence: u64,
    /// Which start of which publisher; a message of an older generation does not count.
    pub generation: u32,
    /// The round within the logical instant, in lockstep.
    pub round: u32,
}

/// Alignment of every message in shared memory, in bytes.
const ALIGNMENT: usize = 64;
/// Publishers on a topic at once: the incumbent, the newcomer of a swap, a person with `board publish --force`, and the dead that were not
/// cleaned up after yet.
const PUBLISHERS: usize = 8;

/// A failure of the transport.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{doing}: {cause}")]
pub struct TransportError {
    doing: String,
    cause: String,
}

fn failed(doing: impl Into<String>) -> impl FnOnce(&dyn std::fmt::Debug) -> TransportError {
    let doing = doing.into();
    move |cause| TransportError { doing, cause: format!("{cause:?}") }
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

/// A topic in the transport; held open by whoever holds this.
pub(crate) struct RawTopic {
    factory: PortFactory<ipc::Service, [u8], Envelope>,
}

pub(crate) struct RawPublisher {
    publisher: Publisher<ipc::Service, [u8], Envelope>,
}

pub(crate) struct RawReader {
    subscriber: Subscriber<ipc::Service, [u8], Envelope>,
}

/// A message borrowed from shared memory.
pub(crate) struct RawMessage {
    sample: Sample<ipc::Service, [u8], Envelope>,
}

/// Memory on loan for a message that is being written.
pub(crate) struct RawLoan {
    sample: SampleMut<ipc::Service, [u8], Envelope>,
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
        let node = NodeBuilder::new()
            .config(&config(place)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| failed("the transport does not take this process")(&error))?;
        Ok(Self { node })
    }

    fn builder(
        &self,
        topic: &str,
    ) -> Result<
        iceoryx2::service::builder::publish_subscribe::Builder<[u8], Envelope, ipc::Service>,
        TransportError,
    > {
        let name: ServiceName =
            topic.try_into().map_err(|error| failed(format!("`{topic}` cannot be a topic"))(&error))?;
        Ok(self
            .node
            .service_builder(&name)
            .publish_subscribe::<[u8]>()
            .user_header::<Envelope>()
            .payload_alignment(
                Alignment::new(ALIGNMENT).unwrap_or(Alignment::new(8).expect("a power of two")),
            ))
    }

    /// Makes a topic; everybody else opens it.
    pub(crate) fn create(&self, topic: &str, shape: TopicShape) -> Result<RawTopic, TransportError> {
        let doing = || failed(format!("topic `{topic}` cannot be made"));
        let (key, value) = fingerprint_attribute(shape.fingerprint)?;
        let attributes = AttributeSpecifier::new().define(&key, &value).map_err(|error| doing()(&error))?;
        let factory = self
            .builder(topic)?
            .history_size(1)
            .subscriber_max_buffer_size(shape.depth.max(2))
            .subscriber_max_borrowed_samples(3)
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

/// Right after a death, ports and topics can be refused until the remains are cleaned: a few milliseconds.
fn retried<T>(mut attempt: impl FnMut() -> Result<T, TransportError>) -> Result<T, TransportError> {
    for pause_ms in [1, 2, 5, 10, 20, 50, 100, 200, 400] {
        match attempt() {
            Ok(value) => return Ok(value),
            Err(_) => crate::clock::sleep(Duration::from_millis(pause_ms)),
        }
    }
    attempt()
}

impl RawTopic {
    pub(crate) fn publisher(&self, initial_bytes: usize) -> Result<RawPublisher, TransportError> {
        retried(|| {
            self.factory
                .publisher_builder()
                .initial_max_slice_len(initial_bytes.max(1))
                .allocation_strategy(AllocationStrategy::PowerOfTwo)
                .max_loaned_samples(2)
                .create()
                .map(|publisher| RawPublisher { publisher })
                .map_err(|error| failed("the topic takes no further publisher")(&error))
        })
    }

    pub(crate) fn reader(&self, depth: usize) -> Result<RawReader, TransportError> {
        let most = self.factory.static_config().subscriber_max_buffer_size();
        retried(|| {
            self.factory
                .subscriber_builder()
                .buffer_size(depth.clamp(2, most.max(2)))
                .create()
                .map(|subscriber| RawReader { subscriber })
                .map_err(|error| failed("the topic takes no further reader")(&error))
        })
    }
}

impl RawPublisher {
    /// Memory for a message of so many bytes, in which every byte has some value.
    pub(crate) fn loan(&self, bytes: usize) -> Result<RawLoan, TransportError> {
        let sample = self
            .publisher
            .loan_slice_uninit(bytes)
            .map_err(|error| failed("no memory for a message")(&error))?;
        // SAFETY: the memory is part of a mapped file, so each byte has a value, if an old one; `u8` takes any. At once, since what is not
        // yet initialised is four times as large to hand around, which shows at a microsecond a message.
        Ok(RawLoan { sample: unsafe { sample.assume_init() } })
    }

    /// Serves readers that have joined since, so that they get the last message.
    pub(crate) fn update(&self) {
        let _ = self.publisher.update_connections();
    }
}

impl RawReader {
    /// The next message that waits.
    #[inline(always)]
    pub(crate) fn receive(&self) -> Option<RawMessage> {
        // A connection to a publisher that died in mid-creation cannot be opened; the others go on.
        self.subscriber.receive().ok().flatten().map(|sample| RawMessage { sample })
    }
}

impl RawMessage {
    pub(crate) fn envelope(&self) -> &Envelope {
        self.sample.user_header()
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl RawLoan {
    pub(crate) fn bytes(&mut self) -> &mut [u8] {
        self.sample.payload_mut()
    }

    pub(crate) fn send(mut self, envelope: Envelope) -> Result<(), TransportError> {
        *self.sample.user_header_mut() = envelope;
        self.sample.send().map(|_| ()).map_err(|error| failed("a message cannot be sent")(&error))
    }
}
