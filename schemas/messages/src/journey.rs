//! How the way to a place in an arena stands.

use crate::{FixedText, Message};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// What the robot is about (NXT-095).
    JourneyStage, JourneyStageName {
        /// It waits for its sensors.
        Waiting = 0,
        /// It looks around for the nearest wall.
        Surveying = 1,
        /// It turns to the wall.
        Aligning = 2,
        /// It scans, and finds out where it is.
        Measuring = 3,
        /// Several places look like this one: it drives where they differ.
        Resolving = 4,
        /// It waits for a path.
        Planning = 5,
        /// It drives along the path.
        Driving = 6,
        /// It is there.
        Arrived = 7,
        /// It gave up.
        Failed = 8,
    }
}

/// How the journey stands. Published by `executive` on `journey/status`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct JourneyStatus {
    /// The target in the map.
    pub target_x_m: f64,
    /// The target in the map.
    pub target_y_m: f64,
    /// Distance from the target as the robot believes; NaN while it does not know its place.
    pub distance_m: f64,
    /// Scans since the start, of both kinds.
    pub scans: u64,
    /// Measuring scans after which the robot knew its place.
    pub located: u64,
    /// Measuring scans after which it did not: several places were alike, or none was certain.
    pub ambiguous: u64,
    /// Times that a wall was too near.
    pub retreats: u64,
    /// Paths asked for.
    pub plans: u64,
    /// Places that looked alike after the last measuring scan.
    pub places: u32,
    /// Arrivals at the target, or what was taken for it.
    pub rounds: u32,
    /// 1 while the robot moves only to find out where it is, else 0.
    pub only_localising: u32,
    /// What it is about.
    pub stage: JourneyStage,
    /// Why it gave up, in words; empty otherwise.
    pub remark: FixedText<64>,
}
