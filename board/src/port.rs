//! The typed ports of a service: thin checked views over bytes in shared memory.

use crate::shared::{Held, Shared, Visibility};
use crate::transport::{Forged, RawLoan, RawMessage, RawPublisher, RawReader, TransportError};
use messages::{Envelope, Message, Stamped, Time, View, elements_offset};
use std::marker::PhantomData;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use zerocopy::FromBytes as _;

/// Lockstep: the round of messages from outside. They are published between two instants, and seen from the next one on.
pub const OUTSIDE_ROUND: u32 = u32::MAX;

/// A port that reads a topic.
pub trait Reader {
    /// The topic's name.
    fn topic(&self) -> &str;
}

/// A subscription that has joined: bytes in the order of their publication.
pub(crate) struct ReaderLink {
    pub(crate) shared: Rc<Shared>,
    pub(crate) topic: u32,
    pub(crate) reader: RawReader,
    pub(crate) generation: u32,
    pub(crate) sequence: Option<u64>,
    /// Lockstep: a message that was taken from the transport and may not be seen yet.
    pub(crate) early: Option<RawMessage>,
}

impl ReaderLink {
    /// Takes the newest message that this step may see and that is `valid`, into `held`. A message that is not what its topic says is left
    /// out; the last good one stays. One call into this crate for the whole look, since it is made over and over where somebody polls.
    #[inline(never)]
    fn newest(&mut self, held: &mut Option<RawMessage>, valid: fn(&[u8]) -> bool) {
        while let Some(message) = self.next() {
            let sequence = message.envelope().sequence;
            if valid(message.bytes()) {
                *held = Some(message);
            } else {
                self.shared.count_invalid();
            }
            // The count says whether another one waits; asking the transport costs as much as a message.
            let count = self
                .shared
                .switchboard
                .topic(self.topic)
                .map_or(u64::MAX, |entry| entry.count.load(Ordering::Acquire));
            if sequence >= count {
                break;
            }
        }
    }

    /// Takes the next message in order that is `valid` into `held`; false when there is none.
    #[inline(never)]
    fn next_in_order(&mut self, held: &mut Option<RawMessage>, valid: fn(&[u8]) -> bool) -> bool {
        while let Some(message) = self.next() {
            self.count_gap(message.envelope().sequence);
            if valid(message.bytes()) {
                *held = Some(message);
                return true;
            }
            self.shared.count_invalid();
        }
        false
    }

    /// The next message that this step may see.
    #[inline(always)]
    fn next(&mut self) -> Option<RawMessage> {
        loop {
            let message = match self.early.take() {
                None => self.receive()?,
                Some(early) => early,
            };
            let envelope = message.envelope();
            match self.shared.visibility(Time::from_nanos(envelope.stamp_ns), envelope.round) {
                Visibility::Now => {}
                Visibility::Later => {
                    self.early = Some(message);
                    return None;
                }
                Visibility::Never => {
                    self.shared.count_invalid();
                    continue;
                }
            }
            // After a hand-over the last words of the predecessor may still arrive; they do not count.
            if envelope.generation < self.generation && self.has_heard_true() {
                continue;
            }
            self.generation = envelope.generation;
            return Some(message);
        }
    }

    /// The next message that waits, seen or not by this step's clock. One that is not what it says is counted
    /// and left out.
    #[inline(always)]
    pub(crate) fn receive(&mut self) -> Option<RawMessage> {
        loop {
            match self.reader.receive()? {
                Ok(message) => return Some(message),
                Err(Forged) => self.shared.count_invalid(),
            }
        }
    }

    /// Whether the launcher has given the generation that was heard last. One that it has not given yet is
    /// forged, and would mute the topic's true publisher for ever.
    #[cold]
    fn has_heard_true(&self) -> bool {
        self.generation <= self.shared.switchboard.header().generations.load(Ordering::Acquire)
    }

    /// Counts the messages that overflow has swallowed before this one.
    pub(crate) fn count_gap(&mut self, sequence: u64) {
        if let Some(last) = self.sequence
            && sequence > last
        {
            // A sequence is data: a forged one must not overflow the count.
            self.shared.lost.set(self.shared.lost.get().saturating_add(sequence - last - 1));
        }
        self.sequence = Some(sequence);
    }
}

/// The newest message of a topic, however often it changed.
pub struct Latest<T> {
    name: String,
    link: Option<ReaderLink>,
    held: Option<RawMessage>,
    ages: bool,
    marker: PhantomData<T>,
}

impl<T: Message> Latest<T> {
    pub(crate) fn new(name: &str, link: Option<ReaderLink>, ages: bool) -> Self {
        Self { name: name.to_owned(), link, held: None, ages, marker: PhantomData }
    }

    /// The newest message, borrowed from shared memory; the same one again if nothing came since. `None` before the first.
    pub fn read(&mut self) -> Option<Stamped<'_, T>> {
        let link = self.link.as_mut()?;
        link.newest(&mut self.held, |bytes| View::<T>::parse(bytes).is_ok());
        let stamped = stamped(self.held.as_ref()?)?;
        if self.ages {
            link.shared.note_origin(stamped.origin);
        }
        Some(stamped)
    }

    /// Whether the process that publishes this topic is there and takes steps.
    pub fn publisher_lives(&self) -> bool {
        let Some(link) = &self.link else { return false };
        let Some(entry) = link.shared.switchboard.topic(link.topic) else { return false };
        let publisher = link.shared.switchboard.slot(entry.publisher.load(Ordering::Acquire));
        publisher.is_some_and(|slot| slot.state() == crate::switchboard::SlotState::Running)
    }
}

impl<T> Reader for Latest<T> {
    fn topic(&self) -> &str {
        &self.name
    }
}

/// Every message of a topic, in order.
pub struct Queue<T> {
    name: String,
    link: Option<ReaderLink>,
    held: Option<RawMessage>,
    marker: PhantomData<T>,
}

impl<T: Message> Queue<T> {
    pub(crate) fn new(name: &str, link: Option<ReaderLink>) -> Self {
        Self { name: name.to_owned(), link, held: None, marker: PhantomData }
    }

    /// The next message that was not read yet, borrowed from shared memory. Messages that overflow has swallowed are counted in the health.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> Option<Stamped<'_, T>> {
        let link = self.link.as_mut()?;
        if !link.next_in_order(&mut self.held, |bytes| View::<T>::parse(bytes).is_ok()) {
            return None;
        }
        let stamped = stamped(self.held.as_ref()?)?;
        link.shared.note_origin(stamped.origin);
        Some(stamped)
    }
}

impl<T> Reader for Queue<T> {
    fn topic(&self) -> &str {
        &self.name
    }
}

fn stamped<T: Message>(message: &RawMessage) -> Option<Stamped<'_, T>> {
    let envelope = message.envelope();
    let view = View::<T>::parse(message.bytes()).ok()?;
    Some(Stamped {
        stamp: Time::from_nanos(envelope.stamp_ns),
        origin: Time::from_nanos(envelope.origin_ns),
        sequence: envelope.sequence,
        message: view.message,
        elements: view.elements,
    })
}

/// A publication that has joined.
#[derive(Clone)]
pub(crate) struct PublisherLink {
    pub(crate) shared: Rc<Shared>,
    pub(crate) topic: u32,
    pub(crate) publisher: Rc<RawPublisher>,
    /// Whether its messages are readings of the world: they are as old as themselves, whatever else was read in the step.
    pub(crate) measures: bool,
}

impl PublisherLink {
    pub(crate) fn loan(&self, bytes: usize) -> Result<RawLoan, TransportError> {
        self.publisher.loan(bytes)
    }

    /// Whether this process's messages count: in a swap the newcomer is mute until the launcher hands it the topic.
    pub(crate) fn is_heard(&self) -> bool {
        let entry = self.shared.switchboard.topic(self.topic);
        entry.is_some_and(|entry| entry.generation.load(Ordering::Acquire) == self.shared.generation)
    }

    /// A newcomer that may: this topic is its own from this message on, so that not even one is missed. Whoever else is mute counts what it would have said.
    #[cold]
    fn takes_over(&self) -> bool {
        let Some(slot) = self.shared.own_slot() else { return false };
        slot.muted.fetch_add(1, Ordering::Relaxed);
        if slot.may_take_over.load(Ordering::Acquire) == 0 {
            return false;
        }
        let Some(entry) = self.shared.switchboard.topic(self.topic) else { return false };
        // The launcher may have started a successor in between, whose generation is newer.
        let before = entry.generation.fetch_max(self.shared.generation, Ordering::AcqRel);
        if before > self.shared.generation {
            return false;
        }
        entry.publisher.store(self.shared.slot, Ordering::Release);
        true
    }

    pub(crate) fn send(&self, loan: RawLoan) -> Result<(), TransportError> {
        if !self.is_heard() && !self.takes_over() {
            return Ok(());
        }
        let now = self.shared.clock();
        let origin = if self.measures { now } else { self.shared.origin(now) };
        self.send_stamped(loan, now, origin)
    }

    pub(crate) fn send_stamped(
        &self,
        loan: RawLoan,
        stamp: Time,
        origin: Time,
    ) -> Result<(), TransportError> {
        if !self.is_heard() {
            return Ok(());
        }
        if self.shared.computes.get() {
            self.hold(loan, origin);
            return Ok(());
        }
        self.send_in_generation(loan, stamp, origin, self.shared.generation)
    }

    /// Keeps a message until its step has been computed. A copy, since the transport lends each publisher few places at once.
    fn hold(&self, mut loan: RawLoan, origin: Time) {
        let bytes = loan.bytes().to_vec();
        let publisher = Rc::clone(&self.publisher);
        self.shared.held.borrow_mut().push(Held { topic: self.topic, publisher, bytes, origin });
    }

    /// For tools: in the name of whoever publishes the topic. In lockstep after the last round of the present instant.
    pub(crate) fn send_as_outsider(&self, loan: RawLoan, stamp: Time) -> Result<(), TransportError> {
        let Some(entry) = self.shared.switchboard.topic(self.topic) else { return Ok(()) };
        self.send_as(
            loan,
            Envelope {
                stamp_ns: stamp.as_nanos(),
                origin_ns: stamp.as_nanos(),
                sequence: entry.count.load(Ordering::Relaxed).wrapping_add(1),
                generation: entry.generation.load(Ordering::Acquire),
                round: if self.shared.lockstep { OUTSIDE_ROUND } else { 0 },
            },
        )
    }

    fn send_in_generation(
        &self,
        loan: RawLoan,
        stamp: Time,
        origin: Time,
        generation: u32,
    ) -> Result<(), TransportError> {
        let Some(entry) = self.shared.switchboard.topic(self.topic) else { return Ok(()) };
        let sequence = entry.count.load(Ordering::Relaxed).wrapping_add(1);
        self.send_as(
            loan,
            Envelope {
                stamp_ns: stamp.as_nanos(),
                origin_ns: origin.as_nanos(),
                sequence,
                generation,
                round: self.shared.round(),
            },
        )
    }

    /// With all that lies in front of it given.
    pub(crate) fn send_as(&self, loan: RawLoan, envelope: Envelope) -> Result<(), TransportError> {
        let Some(entry) = self.shared.switchboard.topic(self.topic) else { return Ok(()) };
        loan.send(envelope)?;
        entry.last_stamp_ns.store(envelope.stamp_ns, Ordering::Relaxed);
        entry.count.store(envelope.sequence, Ordering::Release);
        // In lockstep the conductor says whose turn it is.
        if !self.shared.lockstep {
            self.shared.switchboard.ring_readers(self.topic);
        }
        Ok(())
    }
}

/// Publishes what was held back while the step was computed, in the moment that [`Shared::begin_step`] has set.
pub(crate) fn release_held(shared: &Rc<Shared>) {
    let held = std::mem::take(&mut *shared.held.borrow_mut());
    for Held { topic, publisher, bytes, origin } in held {
        let link = PublisherLink { shared: Rc::clone(shared), topic, publisher, measures: false };
        let sent = link.loan(bytes.len()).and_then(|mut loan| {
            loan.bytes().copy_from_slice(&bytes);
            link.send_in_generation(loan, shared.clock(), origin, shared.generation)
        });
        if let Err(error) = sent {
            shared.lose(&format!("number {topic}"), &error);
        }
    }
}

/// The right to publish on a topic.
pub struct Publisher<T> {
    name: String,
    link: Option<PublisherLink>,
    marker: PhantomData<T>,
}

impl<T: Message> Publisher<T> {
    pub(crate) fn new(name: &str, link: Option<PublisherLink>) -> Self {
        Self { name: name.to_owned(), link, marker: PhantomData }
    }

    /// Publishes a message without elements.
    pub fn publish(&mut self, message: &T) {
        self.publish_with(message, &[]);
    }

    /// Publishes a message with elements, which are copied into shared memory. Large ones are written in place, with `loan`.
    pub fn publish_with(&mut self, message: &T, elements: &[T::Element]) {
        let Some(mut loan) = self.loan(elements.len()) else { return };
        let (place, places) = loan.parts();
        *place = *message;
        places.copy_from_slice(elements);
        loan.send();
    }

    /// Memory for a message with so many elements, to be filled in place and sent. What is not written holds old bytes.
    ///
    /// `None` when the transport has no memory left, which counts as a lost message, and is reported once a
    /// second at most.
    pub fn loan(&mut self, elements: usize) -> Option<Loan<'_, T>> {
        let bytes = if T::HAS_ELEMENTS {
            elements_offset(size_of::<T>()) + elements * size_of::<T::Element>()
        } else {
            size_of::<T>()
        };
        let link = self.link.as_ref()?;
        match link.loan(bytes) {
            Ok(mut raw) => {
                // The bytes between the fixed part and the elements belong to neither; equal messages shall be equal bytes.
                if T::HAS_ELEMENTS {
                    raw.bytes()[size_of::<T>()..elements_offset(size_of::<T>())].fill(0);
                }
                Some(Loan { raw, link, name: &self.name, elements, marker: PhantomData })
            }
            Err(error) => {
                link.shared.lose(&self.name, &error);
                None
            }
        }
    }
}

/// A message that is being written in shared memory.
pub struct Loan<'a, T> {
    raw: RawLoan,
    link: &'a PublisherLink,
    name: &'a str,
    elements: usize,
    marker: PhantomData<T>,
}

impl<T: Message> Loan<'_, T> {
    /// The fixed part and the elements, to be written.
    pub fn parts(&mut self) -> (&mut T, &mut [T::Element]) {
        let bytes = self.raw.bytes();
        let offset = elements_offset(size_of::<T>()).min(bytes.len());
        let (fixed, rest) = bytes.split_at_mut(offset);
        let message = T::mut_from_prefix(fixed).map(|(message, _)| message);
        let message = message.unwrap_or_else(|_| unreachable!("loans are aligned to 64 and long enough"));
        let elements = if T::HAS_ELEMENTS && self.elements > 0 {
            <[T::Element]>::mut_from_bytes(rest)
                .unwrap_or_else(|_| unreachable!("loans are aligned to 64 and hold whole elements"))
        } else {
            &mut []
        };
        (message, elements)
    }

    /// Publishes it.
    pub fn send(self) {
        if let Err(error) = self.link.send(self.raw) {
            self.link.shared.lose(self.name, &error);
        }
    }
}

/// The bytes of a plain message.
pub(crate) fn bytes_of<T: Message>(message: &T) -> &[u8] {
    message.as_bytes()
}
