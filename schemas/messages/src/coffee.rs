//! The coffee robot: orders, the mission, the hallway and its doors.

use crate::{FixedText, Message};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// A room's name, such as `207`.
pub type RoomName = FixedText<8>;

crate::state! {
    /// A side of the robot.
    SideField, Side {
        /// Neither.
        None = 0,
        /// Sensors 0 and 1.
        Right = 1,
        /// Sensors 6 and 7.
        Left = 2,
    }
}

/// Coffee is wanted. Published from outside (`launch order 207`) on `mission/orders`; every order counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Order {
    /// The customer's number for it; repeated orders with one number count once. Zero lets the navigator
    /// number it.
    pub order_id: u64,
    /// Where to.
    pub room: RoomName,
}

crate::state! {
    /// Where a delivery stands (note 2.4).
    DeliveryStatus, DeliveryStatusName {
        /// Waiting for an order.
        Idle = 0,
        /// An order is accepted.
        Ordered = 1,
        /// On the way to the tea room, or loading there.
        Collecting = 2,
        /// On the way to the room.
        Travelling = 3,
        /// Calling, entering, riding or leaving the elevator.
        Elevator = 4,
        /// Near the door, looking for it with the side sensors.
        NearDoor = 5,
        /// Halted at the door.
        AtDoor = 6,
        /// The coffee was taken.
        Delivered = 7,
        /// On the way back.
        Returning = 8,
        /// The way is blocked; waiting or re-planning.
        Blocked = 9,
        /// Human help is needed.
        Fault = 10,
    }
}

crate::state! {
    /// What became of an order.
    OrderState, OrderStateName {
        /// It waits for its turn.
        Accepted = 1,
        /// An order with this number was accepted before; it counts once.
        Repeated = 2,
        /// It cannot be carried out; the remark says why.
        Refused = 3,
        /// It has been carried out.
        Delivered = 4,
    }
}

/// What became of an order. Published by `navigator` on `mission/reports`, one message for each order and
/// change; every one counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct OrderReport {
    /// The order's number: the customer's, or the navigator's where the customer gave none; zero for one that
    /// was refused without a number.
    pub order_id: u64,
    /// The room that was named.
    pub room: RoomName,
    /// What became of it.
    pub state: OrderState,
    /// Orders that wait before it, when it was accepted.
    pub before: u32,
    /// Why it was refused, in words; empty otherwise.
    pub remark: FixedText<128>,
}

/// What the robot is about. Published by `navigator` on `mission/status`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct MissionStatus {
    /// The order being served, zero for none.
    pub order_id: u64,
    /// Orders delivered since the start.
    pub delivered: u64,
    /// Paths asked for since the start.
    pub plans: u64,
    /// Goal of the present leg in the map.
    pub goal_x_m: f64,
    /// Goal of the present leg in the map.
    pub goal_y_m: f64,
    /// Straight distance to it.
    pub distance_m: f64,
    /// The room being served.
    pub room: RoomName,
    /// Where the delivery stands.
    pub status: DeliveryStatus,
    /// Orders that wait.
    pub waiting: u32,
    /// Why it is blocked or at fault, in words; empty otherwise.
    pub remark: FixedText<64>,
}

/// The angle between the robot and the hallway. Published by `angle-correction` on `heading/correction`
/// (COF-080..093).
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct HeadingCorrection {
    /// Nose to the left of the wall's direction is positive (X-2A); meaningful where `valid` is 1.
    pub angle_rad: f64,
    /// Direction of the wall in the map, in (-π, π].
    pub wall_heading_rad: f64,
    /// Standard deviation of the angle.
    pub sigma_rad: f64,
    /// The marked area in which it was measured; empty outside.
    pub area: FixedText<24>,
    /// 1 when an angle was measured, 0 when not.
    pub valid: u32,
    /// 1 when the angle is large enough to be corrected.
    pub correct: u32,
    /// The side measured.
    pub side: SideField,
    /// Frames averaged.
    pub frames: u32,
}

crate::state! {
    /// What a door looks like from the hallway.
    DoorStateField, DoorState {
        /// Not known.
        Unknown = 0,
        /// Close-ranged and clean (COF-110).
        Closed = 1,
        /// Noisy (COF-110).
        Open = 2,
    }
}

/// A door seen from the side. Published by `door-locator` on `door/sighting` (COF-046, COF-100..112).
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct DoorSighting {
    /// Middle of the door in the map.
    pub centre_x_m: f64,
    /// Middle of the door in the map.
    pub centre_y_m: f64,
    /// From the robot's centre forward to the door's centre line, along the hallway.
    pub offset_m: f64,
    /// 0 to 1.
    pub confidence: f64,
    /// Counts sightings; grows by one with each door found.
    pub sightings: u64,
    /// The room behind it.
    pub room: RoomName,
    /// 1 when the robot stands at the entrance, or almost past it.
    pub at_entrance: u32,
    /// On which side of the robot it is.
    pub side: SideField,
    /// Open or closed.
    pub state: DoorStateField,
    /// The floor.
    pub floor: i32,
}

crate::state! {
    /// What the robot should do, in one word.
    MoveInstruction, MoveInstructionName {
        /// Stand still.
        Halt = 0,
        /// Drive along the path.
        Follow = 1,
        /// Turn on the spot.
        Turn = 2,
        /// Drive slowly.
        Creep = 3,
        /// Drive backwards.
        BackOff = 4,
    }
}

/// The newest of everything. Published by `current-state` on `state/current` (COF-047, COF-048).
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct CurrentState {
    /// Place in the map.
    pub x_m: f64,
    /// Place in the map.
    pub y_m: f64,
    /// Heading in the map, in (-π, π].
    pub heading_rad: f64,
    /// Angle from the hallway's straight line, nose to the left positive.
    pub angle_from_line_rad: f64,
    /// Age of the place; infinite before the first.
    pub location_age_s: f64,
    /// Age of the angle; infinite before the first.
    pub angle_age_s: f64,
    /// Age of the mission's word; infinite before the first.
    pub mission_age_s: f64,
    /// The room being served.
    pub room: RoomName,
    /// The floor.
    pub floor: i32,
    /// 1 when the place is known.
    pub location_valid: u32,
    /// 1 when the angle was measured and is young enough to use.
    pub angle_valid: u32,
    /// What the robot should do.
    pub instruction: MoveInstruction,
    /// Where the delivery stands.
    pub status: DeliveryStatus,
    /// Stop or go, by the collision guard.
    pub signal: crate::GuardSignal,
}
