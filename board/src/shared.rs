//! What the ports of one process share: the switchboard, the moment of the present step, and the counters of its health.

use crate::clock;
use crate::switchboard::{Slot, Switchboard};
use crate::transport::{RawPublisher, TransportError};
use messages::Time;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::Ordering;

/// How far a stamp may lie ahead of the last look at the clock.
const FUTURE: std::time::Duration = std::time::Duration::from_millis(5);

/// How often messages that cannot be sent are spoken of.
const COMPLAINT: std::time::Duration = std::time::Duration::from_secs(1);

/// A message of a step that is still being computed.
pub(crate) struct Held {
    pub(crate) topic: u32,
    pub(crate) publisher: Rc<RawPublisher>,
    pub(crate) bytes: Vec<u8>,
    pub(crate) origin: Time,
}

/// The state behind all ports of a node. Ports stay in their thread.
pub(crate) struct Shared {
    pub(crate) switchboard: Switchboard,
    pub(crate) slot: u32,
    pub(crate) generation: u32,
    pub(crate) lockstep: bool,
    /// The moment of the present step.
    now: Cell<Time>,
    round: Cell<u32>,
    /// When the clock was last looked at because of a stamp.
    looked: Cell<Time>,
    /// The oldest origin among the messages read in this step.
    origin: Cell<Option<Time>>,
    /// Lockstep: whether the service computes for a while, so that what it publishes is seen later.
    pub(crate) computes: Cell<bool>,
    /// What was published in the step that is still being computed.
    pub(crate) held: RefCell<Vec<Held>>,
    pub(crate) lost: Cell<u64>,
    pub(crate) invalid: Cell<u64>,
    pub(crate) oldest_input_ns: Cell<u64>,
    /// Messages that could not be sent since the last time this was said, and when it was.
    unsent: Cell<u64>,
    complained: Cell<Option<Time>>,
}

impl Shared {
    pub(crate) fn new(switchboard: Switchboard, slot: u32, generation: u32) -> Self {
        let lockstep = switchboard.header().lockstep.load(Ordering::Acquire) != 0;
        Self {
            switchboard,
            slot,
            generation,
            lockstep,
            now: Cell::new(Time::ZERO),
            round: Cell::new(0),
            looked: Cell::new(Time::ZERO),
            origin: Cell::new(None),
            computes: Cell::new(false),
            held: RefCell::default(),
            lost: Cell::new(0),
            invalid: Cell::new(0),
            oldest_input_ns: Cell::new(0),
            unsent: Cell::new(0),
            complained: Cell::new(None),
        }
    }

    pub(crate) fn own_slot(&self) -> Option<&Slot> {
        self.switchboard.slot(self.slot)
    }

    /// A message was read that is not what it says.
    pub(crate) fn count_invalid(&self) {
        self.invalid.set(self.invalid.get().saturating_add(1));
    }

    /// A message could not be sent: it is counted, and said at most once a second, since the next one will
    /// fare no better.
    #[cold]
    pub(crate) fn lose(&self, topic: &str, error: &TransportError) {
        self.lost.set(self.lost.get().saturating_add(1));
        self.unsent.set(self.unsent.get() + 1);
        let now = clock::monotonic();
        if self.complained.get().is_none_or(|last| now.since(last) >= COMPLAINT) {
            self.complained.set(Some(now));
            tracing::error!(topic, messages = self.unsent.take(), %error, "message lost");
        }
    }

    /// Messages of this topic wake this process.
    pub(crate) fn keep_awake(&self, topic: u32) {
        if let Some(entry) = self.switchboard.topic(topic)
            && !entry.wakes(self.slot)
        {
            entry.set_wake(self.slot, true);
        }
    }

    pub(crate) fn begin_step(&self, now: Time, round: u32) {
        self.now.set(now);
        self.round.set(round);
        self.origin.set(None);
    }

    /// The moment on the board's clock: host time live, the step's moment in lockstep.
    pub(crate) fn clock(&self) -> Time {
        if self.lockstep { self.now.get() } else { clock::monotonic() }
    }

    pub(crate) fn round(&self) -> u32 {
        self.round.get()
    }

    /// Whether a message stamped so may be seen in this step.
    ///
    /// In lockstep a step sees what was published before its round. Live, a stamp from the future is a lie: it would stay fresh for ever. A
    /// step's `now` is a little older than a message that came during the step, hence the tolerance, by which such a lie can gain at most.
    pub(crate) fn visibility(&self, stamp: Time, round: u32) -> Visibility {
        let now = self.now.get();
        if self.lockstep {
            return if (stamp, round) < (now, self.round.get()) {
                Visibility::Now
            } else {
                Visibility::Later
            };
        }
        let horizon = self.looked.get().max(now).after(FUTURE);
        if stamp <= horizon {
            return Visibility::Now;
        }
        // Whoever polls within one step looks at the clock again, but not for every message.
        self.looked.set(clock::monotonic());
        if stamp <= self.looked.get().after(FUTURE) { Visibility::Now } else { Visibility::Never }
    }

    /// Notes that a message with this origin enters the step.
    pub(crate) fn note_origin(&self, origin: Time) {
        let oldest = self.origin.get().map_or(origin, |oldest| oldest.min(origin));
        self.origin.set(Some(oldest));
        self.oldest_input_ns.set(self.now.get().as_nanos().saturating_sub(oldest.as_nanos()));
    }

    /// The origin of what is published now: that of the oldest input, or this moment for a sensor.
    pub(crate) fn origin(&self, now: Time) -> Time {
        self.origin.get().unwrap_or(now).min(now)
    }
}

/// What a step may do with a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Visibility {
    Now,
    Later,
    Never,
}
