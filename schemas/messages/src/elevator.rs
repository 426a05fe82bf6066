//! The elevator between the floors (COF-133, X-28).

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The robot's wish to the elevator. Published by `navigator` on `elevator/call`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct ElevatorCall {
    /// Counts calls. Zero is no call.
    pub call_id: u64,
    /// The floor to which the car shall come, or go.
    pub floor: i32,
    /// 1 while the doors must stay open for the robot.
    pub hold_doors: u32,
}

crate::state! {
    /// What the car does.
    CarStateField, CarState {
        /// Standing with closed doors.
        Closed = 0,
        /// The doors open.
        Opening = 1,
        /// Standing with open doors.
        Open = 2,
        /// The doors close.
        Closing = 3,
        /// Between the floors.
        Moving = 4,
    }
}

/// Where the car is. Published by the elevator's interface, in simulation by `simulator`, on
/// `elevator/state`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct ElevatorState {
    /// The call that it serves.
    pub call_id: u64,
    /// The floor at which it is, or the one that it left last.
    pub floor: i32,
    /// What it does.
    pub state: CarStateField,
}
