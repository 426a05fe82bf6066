//! Messages as plain bytes, and the checked views through which they are read.

use crate::{Description, Field, Time};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The fixed part of a message and, in `Element`, the type of what may follow it. Derived, never written by
/// hand.
pub trait Message:
    Field + FromBytes + IntoBytes + Immutable + KnownLayout + Copy + std::fmt::Debug + 'static
{
    /// The type of the elements behind the fixed part; `NoElement` when there are none.
    type Element: Element;
    /// Whether elements may follow.
    const HAS_ELEMENTS: bool;
    /// The type's name.
    const NAME: &'static str;
    /// The type's run-time description.
    fn description() -> Description;
}

/// A type that may follow a message's fixed part any number of times.
pub trait Element: FromBytes + IntoBytes + Immutable + Copy + std::fmt::Debug + 'static {}
impl<T: FromBytes + IntoBytes + Immutable + Copy + std::fmt::Debug + 'static> Element for T {}

/// Stands for the elements of a message that has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(transparent)]
pub struct NoElement(u8);

/// Bytes from a message's beginning to its elements: the fixed part, rounded up to 8.
pub const fn elements_offset(fixed_size: usize) -> usize {
    fixed_size.next_multiple_of(8)
}

/// A message that cannot be read as what it claims to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InvalidMessage {
    /// Too few bytes, or a fraction of an element too many.
    #[error("a message of {bytes} bytes where {fixed} and whole elements of {element} are expected")]
    WrongSize {
        /// Bytes received.
        bytes: usize,
        /// Bytes of the fixed part.
        fixed: usize,
        /// Bytes of one element.
        element: usize,
    },
    /// The bytes do not lie as the type needs.
    #[error("a message that is not aligned")]
    Misaligned,
    /// A state that has no name.
    #[error("{value} is no state of {state}")]
    UnknownState {
        /// The state type.
        state: &'static str,
        /// The value received.
        value: u32,
    },
    /// A number that is NaN, infinite or beyond its limits.
    #[error("{field} is not a usable number")]
    UnusableNumber {
        /// The field.
        field: &'static str,
    },
}

/// A message as it lies in memory: the fixed part and the elements, borrowed.
#[derive(Debug)]
pub struct View<'a, T: Message> {
    /// The fixed part.
    pub message: &'a T,
    /// What follows it; empty for messages without elements.
    pub elements: &'a [T::Element],
}

impl<'a, T: Message> View<'a, T> {
    /// Reads bytes as a message, in place.
    ///
    /// # Errors
    /// When the size or the alignment does not fit the type. The content is not judged.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, InvalidMessage> {
        let fixed = size_of::<T>();
        let element = if T::HAS_ELEMENTS { size_of::<T::Element>() } else { 0 };
        let wrong = InvalidMessage::WrongSize { bytes: bytes.len(), fixed, element };
        let (message, _) = T::ref_from_prefix(bytes).map_err(|error| match error {
            zerocopy::CastError::Alignment(_) => InvalidMessage::Misaligned,
            _ => wrong,
        })?;
        if element == 0 {
            return if bytes.len() == fixed { Ok(Self { message, elements: &[] }) } else { Err(wrong) };
        }
        let rest = bytes.get(elements_offset(fixed)..).ok_or(wrong)?;
        if !rest.len().is_multiple_of(element) {
            return Err(wrong);
        }
        let elements = <[T::Element]>::ref_from_bytes(rest).map_err(|_| InvalidMessage::Misaligned)?;
        Ok(Self { message, elements })
    }
}

/// A message together with when it was published and how old the sensor reading behind it is.
#[derive(Debug)]
pub struct Stamped<'a, T: Message> {
    /// When it was published.
    pub stamp: Time,
    /// When the oldest sensor reading behind it was taken.
    pub origin: Time,
    /// The publisher's count of messages on this topic.
    pub sequence: u64,
    /// The fixed part.
    pub message: &'a T,
    /// What follows it; empty for messages without elements.
    pub elements: &'a [T::Element],
}

impl<T: Message> Clone for Stamped<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Message> Copy for Stamped<'_, T> {}

impl<'a, T: Message> Stamped<'a, T> {
    /// A message published, and measured, at `stamp`: for tests and for callers that hold plain values.
    pub fn new(stamp: Time, message: &'a T) -> Self {
        Self { stamp, origin: stamp, sequence: 0, message, elements: &[] }
    }

    /// A message with elements, published and measured at `stamp`.
    pub fn with_elements(stamp: Time, message: &'a T, elements: &'a [T::Element]) -> Self {
        Self { stamp, origin: stamp, sequence: 0, message, elements }
    }

    /// Which message this is.
    pub fn id(self) -> MessageId {
        MessageId { stamp: self.stamp, sequence: self.sequence }
    }

    /// The message if it was published no longer than `max_age` ago, and not farther ahead than that either:
    /// a stamp from the far future would stay fresh for ever.
    pub fn fresh(self, now: Time, max_age: std::time::Duration) -> Option<Self> {
        (now.since(self.stamp) <= max_age && self.stamp.since(now) <= max_age).then_some(self)
    }
}

impl<T: Message> std::ops::Deref for Stamped<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        self.message
    }
}

/// What tells a message from all others of its topic: when it was published, and the publisher's count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MessageId {
    /// When it was published.
    pub stamp: Time,
    /// The publisher's count; a successor counts anew.
    pub sequence: u64,
}

/// Lets each message through once. A step is given the newest message of a topic whenever anything is new, so
/// it sees one message many times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Once {
    last: Option<MessageId>,
}

impl Once {
    /// The message, unless it is the one that was let through last.
    pub fn take<'a, T: Message>(&mut self, message: Stamped<'a, T>) -> Option<Stamped<'a, T>> {
        let is_new = self.is_new(&message);
        self.last = Some(message.id());
        is_new.then_some(message)
    }

    /// Whether [`take`](Self::take) would let it through.
    pub fn is_new<T: Message>(&self, message: &Stamped<'_, T>) -> bool {
        self.last != Some(message.id())
    }

    /// Which one was let through last.
    pub fn last(&self) -> Option<MessageId> {
        self.last
    }
}

/// Declares a state: a transparent 32-bit integer with named values and a checked reading.
///
/// `state! { /// What it says. Signal, Verdict { /// Halt. Stop = 0, /// Drive. Go = 1 } }` declares the
/// field type `Signal` and the enum `Verdict`; `Signal::from(Verdict::Go)`, `signal.get()?`.
#[macro_export]
macro_rules! state {
    ($(#[$doc:meta])* $field:ident, $names:ident { $($(#[$variant_doc:meta])* $variant:ident = $value:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Default,
            $crate::__zerocopy::FromBytes, $crate::__zerocopy::IntoBytes, $crate::__zerocopy::Immutable, $crate::__zerocopy::KnownLayout)]
        #[zerocopy(crate = "::messages::__zerocopy")]
        #[repr(transparent)]
        pub struct $field(pub u32);

        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $names { $($(#[$variant_doc])* $variant),+ }

        impl $field {
            /// The state by name.
            ///
            /// # Errors
            /// When the value has no name.
            pub fn get(self) -> Result<$names, $crate::InvalidMessage> {
                match self.0 {
                    $($value => Ok($names::$variant),)+
                    value => Err($crate::InvalidMessage::UnknownState { state: stringify!($field), value }),
                }
            }
        }
        impl std::fmt::Debug for $field {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self.get() {
                    Ok(name) => write!(f, "{name:?}"),
                    Err(_) => write!(f, "{}?", self.0),
                }
            }
        }
        impl From<$names> for $field {
            fn from(name: $names) -> Self {
                match name { $($names::$variant => Self($value)),+ }
            }
        }
        impl PartialEq<$names> for $field {
            fn eq(&self, name: &$names) -> bool {
                *self == Self::from(*name)
            }
        }
        impl $crate::Field for $field {
            fn kind() -> $crate::Kind {
                $crate::Kind::State { names: vec![$(($value, stringify!($variant).to_owned())),+] }
            }
        }
    };
}
