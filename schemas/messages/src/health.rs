//! How a service fares. Every node publishes this by itself.

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// What a service is doing.
    ServiceStateField, ServiceState {
        /// Joining the board.
        Starting = 0,
        /// Joined; a publisher it needs has not spoken yet.
        Waiting = 1,
        /// Taking steps.
        Running = 2,
        /// Leaving.
        Stopping = 3,
    }
}

/// How a service fares since the last message of this kind. Published by every service's node on
/// `health/<service>`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Health {
    /// Steps since the start.
    pub steps: u64,
    /// Median duration of a step.
    pub step_p50_ns: u64,
    /// Duration that 99 % of the steps stay below.
    pub step_p99_ns: u64,
    /// Longest step.
    pub step_max_ns: u64,
    /// Steps since the start that began more than a period late.
    pub late_steps: u64,
    /// Messages lost since the start: overwritten before they were read, or not sent for want of memory.
    pub lost_messages: u64,
    /// Messages since the start that could not be read as what they claim to be.
    pub invalid_messages: u64,
    /// Age of the oldest input at the last step.
    pub oldest_input_ns: u64,
    /// The process.
    pub pid: u32,
    /// What it is doing.
    pub state: ServiceStateField,
}
