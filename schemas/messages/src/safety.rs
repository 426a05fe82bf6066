//! The collision guard's word.

use crate::Message;
use geometry::Pose2;
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

/// Something that the guard sees, or saw a moment ago, near the robot's hull.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct NearPoint {
    /// Ahead of the robot's centre of motion, in the robot's frame at the pose that the header names.
    pub x_m: f32,
    /// Left of the robot's centre of motion, likewise.
    pub y_m: f32,
}

/// May the robot move, and what is near it? Published by `collision-avoidance` and `proximity-guard` on
/// `safety/clearance` for every sensor frame (COF-044, COF-066, COF-067): the header, then what the guard
/// knows to be near the hull.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = NearPoint)]
#[repr(C)]
pub struct Clearance {
    /// Stop or go.
    pub signal: GuardSignal,
    /// Why.
    pub reason: GuardReason,
    /// Which faces are violated: sum of the `Face` bits.
    pub violated_faces: u32,
    /// From the hull to the nearest thing in front; infinite when nothing is seen, 0 when nobody can see.
    pub front_m: f32,
    /// From the hull to the nearest thing on the right; infinite when nothing is seen, 0 when nobody can see.
    pub right_m: f32,
    /// From the hull to the nearest thing on the left; infinite when nothing is seen, 0 when nobody can see.
    pub left_m: f32,
    /// What is nearer than this in front is a STOP: the way in which the robot must be able to stop.
    pub front_radius_m: f32,
    /// What is nearer than this on the right is a STOP; 0 where no sensor looks.
    pub right_radius_m: f32,
    /// What is nearer than this on the left is a STOP; 0 where no sensor looks.
    pub left_radius_m: f32,
    /// No reading behind a GO is older than this.
    pub max_age_ms: u32,
    /// How often the signal has changed since the guard started.
    pub changes: u64,
    /// Where the robot was along x, in the frame of odometry, when the points were written down; NaN when
    /// unknown.
    pub at_x_m: f64,
    /// Where the robot was along y, in the frame of odometry, when the points were written down; NaN when
    /// unknown.
    pub at_y_m: f64,
    /// The robot's heading, in the frame of odometry, when the points were written down; NaN when unknown.
    pub at_heading_rad: f64,
}

impl Clearance {
    /// Where the robot was, in the frame of odometry, when the points were written down; `None` when nobody
    /// knew.
    pub fn at(&self) -> Option<Pose2> {
        let at = Pose2 { x_m: self.at_x_m, y_m: self.at_y_m, heading_rad: self.at_heading_rad };
        at.is_finite().then(|| Pose2::new(at.x_m, at.y_m, at.heading_rad))
    }
}
