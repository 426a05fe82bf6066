//! What the view shows at one moment.

use super::keys::Choice;
use crate::control::Status;
use geometry::Pose2;
use messages::{BodyKind, Clearance, MissionStatus, RunSummary};

/// Everything that one frame shows.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    /// Board, uptime, services, events.
    pub(crate) status: Status,
    /// The referee's word.
    pub(crate) summary: Option<RunSummary>,
    /// What the robot is about.
    pub(crate) mission: Option<MissionStatus>,
    /// The guard's word.
    pub(crate) clearance: Option<Clearance>,
    /// What moves on the map.
    pub(crate) scene: Scene,
    /// The last lines of the log that is shown.
    pub(crate) log: Vec<String>,
    /// Whether the robot goes on when the view is left.
    pub(crate) is_attached: bool,
    /// What the person has chosen to see.
    pub(crate) choice: Choice,
}

/// What moves on the map.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scene {
    /// The floor that is shown.
    pub(crate) floor: i32,
    /// Where the robot is, in truth or, where no truth is known, by its own estimate.
    pub(crate) robot: Option<Pose2>,
    /// Where the robot believes to be.
    pub(crate) estimate: Option<Pose2>,
    /// Where it came along, oldest first.
    pub(crate) trail: Vec<[f64; 2]>,
    /// The path it follows.
    pub(crate) path: Vec<[f64; 2]>,
    /// Who and what stands about on this floor.
    pub(crate) bodies: Vec<BodyMark>,
    /// Doors that stand open, one bit each in the order of the world file.
    pub(crate) open_doors: u128,
}

/// A body on the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BodyMark {
    /// What it is.
    pub(crate) kind: BodyKind,
    /// Where it is.
    pub(crate) pose: Pose2,
}
