//! The collision guard's word.

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// Whether the robot may move.
    GuardSignal, Verdict {
        /// Halt: the value of a guard that knows nothing (COF-061).
        Stop = 0,
        /// No obstacle within the private sphere.
        Go = 1,
    }
}

crate::state! {
    /// Why the guard says what it says.
    GuardReason, GuardReasonName {
        /// Nothing was confirmed yet.
        Start = 0,
        /// All faces are clear.
        Clear = 1,
        /// Something is within a radius.
        Violation = 2,
        /// Clear again, but not for long enough.
        Settling = 3,
        /// An obstacle that vanished at close range is remembered.
        Remembered = 4,
        /// A sensor cannot be trusted.
        SensorFault = 5,
        /// No reading for too long.
        Stale = 6,
    }
}

/// The faces of the robot, as bits of `Clearance::violated_faces`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Face {
    /// Sensors 2 to 5.
    Front = 1,
    /// Sensors 0 and 1.
    Right = 2,
    /// Sensors 6 and 7.
    Left = 4,
}

/// May the robot move? Published by `collision-avoidance` on `safety/clearance` for every sensor frame (COF-044, COF-066, COF-067).
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Clearance {
    /// Stop or go.
    pub signal: GuardSignal,
    /// Why.
    pub reason: GuardReason,
    /// Which faces are violated: sum of the `Face` bits.
    pub violated_faces: u32,
    /// Nearest reading in front; infinite when nothing is seen.
    pub front_m: f32,
    /// Nearest reading on the right; infinite when nothing is seen.
    pub right_m: f32,
    /// Nearest reading on the left; infinite when nothing is seen.
    pub left_m: f32,
    /// How often the signal has changed since the guard started.
    pub changes: u64,
}
