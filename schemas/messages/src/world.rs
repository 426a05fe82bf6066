//! The truth, known to the simulator alone; simulated sensors look at it, and referees judge by it.

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// What kind of body stands in the world (COF-120..125).
    BodyKindField, BodyKind {
        /// None.
        None = 0,
        /// A person who walks.
        Walker = 1,
        /// A mail cart with a low shelf and bars at the corners.
        MailCart = 2,
        /// A chair on one leg.
        SpinningChair = 3,
        /// A sofa.
        Sofa = 4,
        /// A chair on four legs.
        WoodenChair = 5,
        /// A cardboard box.
        CardboardBox = 6,
    }
}

/// One body in the world.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct TrueBody {
    /// Place in the map.
    pub x_m: f64,
    /// Place in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub heading_rad: f64,
    /// The floor on which it stands.
    pub floor: i32,
    /// What it is.
    pub kind: BodyKindField,
}

/// The state of the world: the header, then every body. Published by `simulator` on `world/truth`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = TrueBody)]
#[repr(C)]
pub struct WorldTruth {
    /// Place of the robot's centre of motion in the map.
    pub x_m: f64,
    /// Place of the robot's centre of motion in the map.
    pub y_m: f64,
    /// Heading of the robot in the map.
    pub heading_rad: f64,
    /// True speed of the left wheel's rim, slip included.
    pub left_mps: f64,
    /// True speed of the right wheel's rim, slip included.
    pub right_mps: f64,
    /// What the left wheel's encoder has counted since the start (without slip).
    pub left_travel_m: f64,
    /// What the right wheel's encoder has counted since the start (without slip).
    pub right_travel_m: f64,
    /// Doors that stand open, one bit each in the order of the world file; doors beyond 128 are closed.
    pub open_doors: [u64; 2],
    /// The world's time since its start.
    pub world_time_s: f64,
    /// How often the robot has touched something since the start.
    pub contacts: u64,
    /// The robot's floor.
    pub floor: i32,
    /// How far the elevator's door stands open on the robot's floor, in percent.
    pub elevator_door_percent: u32,
}
