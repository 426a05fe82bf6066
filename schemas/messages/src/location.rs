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

/// How many places a particle cloud names.
pub const CLUSTER_CAPACITY: usize = 8;

/// A place where the robot may be: a group of particles that hang together.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct PoseCluster {
    /// Mean place in the map.
    pub x_m: f64,
    /// Mean place in the map.
    pub y_m: f64,
    /// Mean heading in the map.
    pub heading_rad: f64,
    /// Standard deviation of the place.
    pub sigma_m: f64,
    /// Standard deviation of the heading.
    pub sigma_rad: f64,
    /// Its part of the whole weight, 0 to 1.
    pub share: f64,
}

/// One particle.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Particle {
    /// Place from the cloud's origin, along the map's x axis.
    pub x_m: f32,
    /// Place from the cloud's origin, along the map's y axis.
    pub y_m: f32,
    /// Heading in the map.
    pub heading_rad: f32,
    /// Its part of the weight of all particles, relative to the mean: 1 when all weigh the same.
    pub weight: f32,
}

/// What a particle localiser believes, for viewing: the header, then a selection of its particles. Published
/// by `particle-localiser`, at most every so often, on `location/particles`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = Particle)]
#[repr(C)]
pub struct ParticleCloud {
    /// Place in the map from which the particles' places are counted.
    pub origin_x_m: f64,
    /// Place in the map from which the particles' places are counted.
    pub origin_y_m: f64,
    /// Effective sample size, 1 to `count`, when the last scan had been weighed.
    pub effective_count: f64,
    /// How well the last scan fits the belief, 0 to 1.
    pub fit: f64,
    /// Places where the robot may be, the likeliest first; the first `cluster_count` are valid.
    pub clusters: [PoseCluster; CLUSTER_CAPACITY],
    /// Particles of the localiser, of which the elements are a selection.
    pub count: u32,
    /// Particles that the belief needs; more than `count` where the bound of the update or the parameters
    /// lowered it.
    pub wanted_count: u32,
    /// Valid entries of `clusters`.
    pub cluster_count: u32,
    /// All places, also those that are not in `clusters`.
    pub clusters_in_all: u32,
    /// Passes over the last scan.
    pub passes: u32,
    /// 1 when the bound of the update lowered the number of particles or passes, else 0.
    pub limited: u32,
    /// Particles scattered anew after the last scan.
    pub scattered: u32,
    /// Beams used of the last scan.
    pub beams: u32,
}

impl ParticleCloud {
    /// The places named, whatever the count claims.
    pub fn places(&self) -> &[PoseCluster] {
        &self.clusters[..(self.cluster_count as usize).min(CLUSTER_CAPACITY)]
    }
}
