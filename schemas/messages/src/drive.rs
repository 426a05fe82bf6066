//! Wheels: what is wanted, what is done, what was travelled.

use crate::{InvalidMessage, Message};
use geometry::Pose2;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The wheel speeds that the controller wants. Published by the controller on `wheels/desired`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct WheelSpeeds {
    /// Speed of the left wheel's rim, forward positive.
    pub left_mps: f64,
    /// Speed of the right wheel's rim, forward positive.
    pub right_mps: f64,
}

impl WheelSpeeds {
    /// Both wheels at rest.
    pub const ZERO: Self = Self { left_mps: 0.0, right_mps: 0.0 };

    /// Whether both numbers are finite and within ±`limit_mps`.
    pub fn is_within(&self, limit_mps: f64) -> bool {
        self.left_mps.abs() <= limit_mps && self.right_mps.abs() <= limit_mps
    }
}

crate::state! {
    /// Why the wheels do what they do.
    DriveReason, DriveReasonName {
        /// Nothing was decided yet: the safe state in which a base driver begins.
        Start = 0,
        /// A fresh GO and a fresh command: the command is carried out.
        Driving = 1,
        /// The collision guard says STOP.
        GuardStop = 2,
        /// No GO, or none younger than the deadline.
        StaleGuard = 3,
        /// No command, or none younger than the deadline.
        StaleCommand = 4,
        /// A command that is NaN, infinite or beyond the wheels' limits.
        InvalidCommand = 5,
        /// A message of the guard that has no meaning.
        InvalidGuard = 6,
        /// The motor controller does not answer, or the encoders do not show what the wheels are told.
        DeviceFault = 7,
        /// The driver is leaving.
        ShuttingDown = 8,
        /// The guard stops for something in front only, and the command leads slowly backwards, away from it.
        Escaping = 9,
        /// The command leads into something that the guard knows of, backwards over ground that was not
        /// driven, or beyond what was ordered.
        NoRoom = 10,
        /// The guard's word names no radius in which the robot could stop.
        NothingGuarded = 11,
    }
}

/// What the motors were told. Published by `base-driver`, and by nobody else, on `wheels/applied`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct AppliedWheels {
    /// Speed of the left wheel's rim, forward positive; zero whenever the reason is neither `Driving` nor
    /// `Escaping`.
    pub left_mps: f64,
    /// Speed of the right wheel's rim, forward positive; zero whenever the reason is neither `Driving` nor
    /// `Escaping`.
    pub right_mps: f64,
    /// How often since its start the driver stopped the wheels because a GO or a command was late.
    pub deadline_misses: u64,
    /// Why.
    pub reason: DriveReason,
    /// Always zero.
    pub reserved: u32,
}

/// Dead reckoning from the wheels. Published by `base-driver` or `log-player` on `wheels/odometry`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Odometry {
    /// Place in the odometry frame, which begins where the driver started.
    pub x_m: f64,
    /// Place in the odometry frame.
    pub y_m: f64,
    /// Heading in the odometry frame, in (-π, π].
    pub heading_rad: f64,
    /// Speed forward.
    pub forward_mps: f64,
    /// Turning speed, counter-clockwise.
    pub turn_rad_per_s: f64,
    /// Path of the left wheel since the start, forward positive.
    pub left_travel_m: f64,
    /// Path of the right wheel since the start, forward positive.
    pub right_travel_m: f64,
}

impl Odometry {
    /// The pose in the odometry frame.
    ///
    /// # Errors
    /// When one of its numbers is not finite.
    pub fn pose(&self) -> Result<Pose2, InvalidMessage> {
        let pose = Pose2 { x_m: self.x_m, y_m: self.y_m, heading_rad: self.heading_rad };
        if pose.is_finite() {
            Ok(Pose2::new(pose.x_m, pose.y_m, pose.heading_rad))
        } else {
            Err(InvalidMessage::UnusableNumber { field: "Odometry pose" })
        }
    }
}

crate::state! {
    /// What the navigator wants the controller to do.
    DriveMode, DriveModeName {
        /// Stand still.
        Hold = 0,
        /// Follow the path that answers `request_id`.
        FollowPath = 1,
        /// Turn on the spot to `heading_rad`.
        TurnTo = 2,
        /// Drive slowly straight ahead along `heading_rad`, watching for a door.
        Creep = 3,
        /// Drive slowly backwards, out of a tight place.
        BackOff = 4,
    }
}

/// The motion that the mission needs now. Published by `navigator` on `drive/command`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct DriveCommand {
    /// Which path to follow (`Path::request_id`).
    pub request_id: u64,
    /// Direction in the map for `TurnTo` and `Creep`, in (-π, π].
    pub heading_rad: f64,
    /// Speed limit, not negative.
    pub max_speed_mps: f64,
    /// What to do.
    pub mode: DriveMode,
    /// Always zero.
    pub reserved: u32,
}
