//! Where the robot is.

use crate::{InvalidMessage, Message};
use geometry::Pose2;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// How far a pose estimate can be trusted.
    LocationState, LocationStateName {
        /// No estimate yet.
        Unknown = 0,
        /// Everything agrees.
        Tracking = 1,
        /// An anchor is dead, readings are outliers, or sensors disagree; the covariance says by how much.
        Degraded = 2,
        /// The estimate is worthless.
        Lost = 3,
    }
}

/// A pose in the map. Published by the localiser on `location/pose`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct PoseEstimate {
    /// Place in the map.
    pub x_m: f64,
    /// Place in the map.
    pub y_m: f64,
    /// Heading in the map, in (-π, π].
    pub heading_rad: f64,
    /// Covariance of (x, y, heading), row by row, in m², m·rad and rad².
    pub covariance: [f64; 9],
    /// Readings that entered the estimate since the start.
    pub accepted: u64,
    /// Readings that were rejected as outliers since the start.
    pub rejected: u64,
    /// The floor the robot is on.
    pub floor: i32,
    /// How far it can be trusted.
    pub state: LocationState,
    /// Anchors heard lately, one bit each in the order of their first hearing.
    pub alive_anchors: u32,
    /// Anchors known but silent or always wrong.
    pub dead_anchors: u32,
}

impl PoseEstimate {
    /// The pose, where it is one.
    ///
    /// # Errors
    /// When a number is not finite, or the state is not one in which the pose means something.
    pub fn pose(&self) -> Result<Pose2, InvalidMessage> {
        let unusable = InvalidMessage::UnusableNumber { field: "PoseEstimate pose" };
        match self.state.get()? {
            LocationStateName::Unknown | LocationStateName::Lost => Err(unusable),
            LocationStateName::Tracking | LocationStateName::Degraded => {
                let pose = Pose2 { x_m: self.x_m, y_m: self.y_m, heading_rad: self.heading_rad };
                if pose.is_finite() {
                    Ok(Pose2::new(pose.x_m, pose.y_m, pose.heading_rad))
                } else {
                    Err(unusable)
                }
            }
        }
    }
}

/// The true pose, known to simulators and to logs with ground truth. Published on `truth/pose`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct TruePose {
    /// Place in the map.
    pub x_m: f64,
    /// Place in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub heading_rad: f64,
    /// The floor.
    pub floor: i32,
    /// 1 with the last message of a log, 0 before.
    pub is_last: u32,
}
