//! The messages of Corkboard: plain bytes with units, frames and limits, which describe themselves.
//!
//! A message is a `#[repr(C)]` struct without padding in which every bit pattern is valid (`zerocopy` proves
//! both at compile time), so a message from a broken or hostile process may be nonsense and is never
//! undefined behaviour. One declaration gives the type, its fingerprint, its JSON and its schema for
//! recordings.
//!
//! ```
//! use messages::Message;
//! use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};
//!
//! /// How warm it is. Published by `thermometer` on `air/temperature`.
//! #[derive(Debug, Clone, Copy, Default, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
//! #[repr(C)]
//! struct AirTemperature {
//!     /// In the shade; NaN when unknown.
//!     air_c: f64,
//!     /// Height of the sensor above the floor.
//!     height_m: f64,
//! }
//!
//! let description = AirTemperature::description();
//! assert_eq!(description.fields[1].unit, "m");
//! let json = description.to_json(AirTemperature { air_c: 21.5, height_m: 0.5 }.as_bytes());
//! assert_eq!(json, serde_json::json!({ "air_c": 21.5, "height_m": 0.5 }));
//! ```
//!
//! The messages of the robots stand in files by subject; [`catalogue`] lists them. What lies around a message
//! is its [`Envelope`]; a step reads it as [`Stamped`]. The [`Parameters`] of a service are checked here too,
//! by the [`Schema`] that they derive.

// The derive writes `::messages::..`, also for the messages of this very crate.
extern crate self as messages;

mod catalogue;
mod json;
mod kind;
mod message;
mod params;
pub mod ros2msg;
mod text;
mod time;

mod coffee;
mod contract;
mod drive;
mod elevator;
mod health;
mod journey;
mod location;
mod map;
mod motion;
mod plan;
mod range;
mod safety;
mod schema;
mod sightings;
mod sonar;
mod summary;
mod surroundings;
mod world;

#[cfg(test)]
mod tests;

pub use catalogue::catalogue;
pub use coffee::*;
pub use contract::{ELEMENTS, Envelope, Topic, health_of, health_topic, is_health};
pub use drive::*;
pub use elevator::*;
pub use health::*;
pub use journey::*;
pub use json::JsonError;
pub use kind::{Description, Field, FieldDescription, Kind, unit_of};
pub use location::*;
pub use map::*;
pub use message::{
    Element, InvalidMessage, Message, MessageId, NoElement, Once, Stamped, View, elements_offset,
};
pub use messages_derive::Message;
pub use motion::*;
pub use params::Parameters;
pub use plan::*;
pub use range::*;
pub use safety::*;
pub use schema::{Bounds, Fault, Misfit, Schema, Step};
pub use sightings::*;
pub use sonar::*;
pub use summary::*;
pub use surroundings::{Surroundings, body_kind};
pub use text::{FixedText, TextTooLong};
pub use time::Time;
pub use world::*;

#[doc(hidden)]
pub use zerocopy as __zerocopy;
