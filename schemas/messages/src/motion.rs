//! Single motions, one after the other: so far ahead, so far around (NXT-020 to NXT-024).

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// What to do.
    MotionKind, MotionKindName {
        /// Stand.
        Stop = 0,
        /// Drive straight ahead by `distance_m`; backwards where it is negative.
        Move = 1,
        /// Turn on the spot by `turn_rad`.
        Turn = 2,
    }
}

/// One motion. Published by `executive` on `motion/command`; a new number is a new motion, and ends the last
/// one.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct MotionCommand {
    /// Counts motions. Zero is none.
    pub command_id: u64,
    /// How far to drive, ahead positive.
    pub distance_m: f64,
    /// How far to turn, counter-clockwise; more than π is the long way.
    pub turn_rad: f64,
    /// So much is free behind the robot where the motion begins: no farther may it drive back when it comes
    /// too near to a wall.
    pub retreat_m: f64,
    /// What to do.
    pub kind: MotionKind,
    /// Always zero.
    pub reserved: u32,
}

crate::state! {
    /// How a motion stands.
    MotionState, MotionStateName {
        /// None was ordered.
        Idle = 0,
        /// It goes on.
        Running = 1,
        /// It is done.
        Done = 2,
        /// A wall was too near: the motion was broken off, and the robot has driven back (NXT-022, NXT-024).
        NearWall = 3,
        /// The wheels do not turn.
        Blocked = 4,
        /// The order makes no sense.
        Refused = 5,
    }
}

/// How the newest motion stands. Published by `move-controller` on `motion/report`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct MotionReport {
    /// The motion.
    pub command_id: u64,
    /// How far it has led ahead so far, without the retreat.
    pub travelled_m: f64,
    /// How far it has led around so far.
    pub turned_rad: f64,
    /// How far the robot has driven back from a wall.
    pub retreated_m: f64,
    /// How it stands.
    pub state: MotionState,
    /// Always zero.
    pub reserved: u32,
}
