//! The parameters of the executive.

use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of the executive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The world file, relative to the working directory; empty for none, and then the robot stays where it
    /// is.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// The target: a place of the world file.
    pub target: String,
    /// Whether the target is a random place within the outline of the world's first floor instead.
    pub random_target: bool,
    /// A random target lies at least this far from a wall.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub target_clearance_m: f64,
    /// For a target nearer to a wall than this the robot aims at a place that is this far from the wall: its
    /// body could touch the wall as it arrives.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub aim_clearance_m: f64,
    /// The place at which the robot aims instead of a target near a wall lies no farther than this from the
    /// target.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub aim_shift_m: f64,
    /// The robot has arrived when it believes to be at most this far from the target (NXT-096).
    #[schemars(range(min = 0.001, max = 1.0))]
    pub close_enough_m: f64,
    /// How often the robot tries to come nearer to the target (NXT-096).
    #[schemars(range(min = 1, max = 100))]
    pub max_rounds: u32,
    /// After this many scans the robot gives up.
    #[schemars(range(min = 2, max = 10000))]
    pub max_scans: u32,
    /// Length of the robot's body.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub body_length_m: f64,
    /// Width of the robot's body.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub body_width_m: f64,
    /// Room that is kept around the body when it turns.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub turn_margin_m: f64,
    /// Further room, beside `turn_margin_m`, where the place is not known and only a scan shows the walls.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub scan_margin_m: f64,
    /// Room around the body that a way must keep, however wrong the pose may be.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub way_margin_m: f64,
    /// By how many standard deviations the pose may be wrong: a way that would then be too near to a wall is
    /// broken off for another scan.
    #[schemars(range(min = 0.0, max = 6.0))]
    pub way_sigmas: f64,
    /// No way is broken off before it is this long, once another look has not helped.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub shortest_way_m: f64,
    /// A robot whose heading is at most this far from the direction to a place drives there without a turn.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub heading_tolerance_rad: f64,
    /// Whether the robot turns to the nearest wall before it measures, where there is room (NXT-040, X-04).
    /// Where there is no room, or when this is false, the windows are turned instead.
    pub turn_to_wall: bool,
    /// The least distance of a wall that the robot turns to face: the guard would take a nearer one for an
    /// obstacle.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub face_wall_from_m: f64,
    /// How far the robot may drive back from a wall that is too near.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub retreat_m: f64,
    /// How far the robot drives towards open space where no better way is found to tell places apart (note
    /// 1.6).
    #[schemars(range(min = 0.01, max = 1.0))]
    pub open_space_m: f64,
    /// How far from the target a path may end.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub goal_tolerance_m: f64,
    /// How long other services have to answer.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub patience_s: f64,
    /// Time between two steps when nothing arrives.
    #[schemars(range(min = 5, max = 1000))]
    pub period_ms: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            target: "target".to_owned(),
            random_target: false,
            target_clearance_m: 0.10,
            aim_clearance_m: 0.112,
            aim_shift_m: 0.012,
            close_enough_m: 0.02,
            max_rounds: 3,
            max_scans: 60,
            body_length_m: 0.16,
            body_width_m: 0.14,
            turn_margin_m: 0.012,
            scan_margin_m: 0.015,
            way_margin_m: 0.005,
            way_sigmas: 2.0,
            shortest_way_m: 0.10,
            heading_tolerance_rad: 0.01,
            turn_to_wall: true,
            face_wall_from_m: 0.13,
            retreat_m: 0.10,
            open_space_m: 0.10,
            goal_tolerance_m: 0.03,
            patience_s: 4.0,
            period_ms: 50,
        }
    }
}

/// Why parameters of the executive are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A length and a width that make no hull.
    #[error("body_length_m = {length_m} and body_width_m = {width_m} make no hull")]
    NoBody {
        /// Its length.
        length_m: f64,
        /// Its width.
        width_m: f64,
    },
    /// The target does not exist.
    #[error("the world {world:?} has no [[place]] named {target:?}; add one, or set random_target = true")]
    NoTarget {
        /// The world file.
        world: String,
        /// The place.
        target: String,
    },
    /// No random place lies far enough from the walls.
    #[error(
        "the world {world:?} has no outline with room target_clearance_m = {clearance_m} from its walls; lower it"
    )]
    NoRandomTarget {
        /// The world file.
        world: String,
        /// The distance from walls.
        clearance_m: f64,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl Params {
    /// Between two steps without a message.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;
}
