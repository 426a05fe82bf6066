//! The parameters of the simulator.

use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Errors that a whole motion makes, from standing to standing, beside those of every single step. Encoders
/// do not see them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MotionErrors {
    /// No such errors.
    #[default]
    None,
    /// Errors that are the same for every motion, whatever its length: a way errs by `motion_error_m`, a turn
    /// by `motion_error_rad` (NXT-101, X-11).
    Absolute,
    /// As the BotSim simulator has it (note 1.2): in proportion, and every way begins with a turn of its own.
    Proportional,
}

/// The parameters of the simulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The world file, relative to the working directory; empty for an empty plane.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Which of the file's starts is the robot's.
    pub robot: String,
    /// Whether the robot begins at a random pose within the outline of the world's first floor instead.
    pub random_start: bool,
    /// A random start lies at least this far from a wall.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub start_clearance_m: f64,
    /// The fixed step of the simulation; the truth is published after each.
    #[schemars(range(min = 1, max = 50))]
    pub period_ms: u32,
    /// Distance between the middles of the two driven wheels.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub wheel_track_m: f64,
    /// How many times faster than it is told the left motor turns (COF-012).
    #[schemars(range(min = 0.5, max = 1.5))]
    pub left_gain: f64,
    /// How many times faster than it is told the right motor turns: it is of another kind (COF-012).
    #[schemars(range(min = 0.5, max = 1.5))]
    pub right_gain: f64,
    /// A motor changes its wheel's speed no faster than this, up and down.
    #[schemars(range(min = 0.05, max = 20.0))]
    pub wheel_acceleration_m_per_s2: f64,
    /// The share of a wheel's turn that is lost to slip.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub slip_fraction: f64,
    /// Standard deviation of a wheel's way over ground after one metre; it grows with the root of the way.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub way_noise_m: f64,
    /// Errors of whole motions.
    pub motion_errors: MotionErrors,
    /// Standard deviation of a way, where errors are absolute.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub motion_error_m: f64,
    /// Standard deviation of a turn, where errors are absolute.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub motion_error_rad: f64,
    /// Standard deviation of a way as a share of it, where errors are proportional.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub way_error_fraction: f64,
    /// Standard deviation of a turn as a share of it, and in radians of the turn that a way begins with,
    /// where errors are proportional.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub turn_error_fraction: f64,
    /// The motor controller stops the wheels when `wheels/applied` is older than this.
    #[schemars(range(min = 10, max = 1000))]
    pub watchdog_ms: u32,
    /// Length of the robot's body (COF-003).
    #[schemars(range(min = 0.05, max = 2.0))]
    pub body_length_m: f64,
    /// Width of the robot's body (COF-003).
    #[schemars(range(min = 0.05, max = 2.0))]
    pub body_width_m: f64,
    /// Height of the robot's body: what is higher up cannot be touched.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub body_height_m: f64,
    /// Whether people wait for the robot instead of walking into it.
    pub walkers_wait: bool,
    /// The distance from the robot's body at which people wait.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub walkers_wait_m: f64,
    /// Time after which people in front of a robot at rest squeeze past it, without touching it.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub walkers_patience_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            robot: "coffee".to_owned(),
            random_start: false,
            start_clearance_m: 0.10,
            period_ms: 10,
            wheel_track_m: 0.40,
            left_gain: 1.0,
            right_gain: 0.97,
            wheel_acceleration_m_per_s2: 0.8,
            slip_fraction: 0.01,
            way_noise_m: 0.004,
            motion_errors: MotionErrors::None,
            motion_error_m: 0.001,
            motion_error_rad: 0.005,
            way_error_fraction: 0.01,
            turn_error_fraction: 0.005,
            watchdog_ms: 100,
            body_length_m: 0.61,
            body_width_m: 0.51,
            body_height_m: 1.0,
            walkers_wait: true,
            walkers_wait_m: 0.4,
            walkers_patience_s: 3.0,
        }
    }
}

/// Why parameters of the simulator are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// The world has no place for the robot to begin.
    #[error(
        "the world {world:?} has no [[start]] for robot {robot:?}; add one, or name a robot that it knows"
    )]
    NoStart {
        /// The world file.
        world: String,
        /// The robot.
        robot: String,
    },
    /// No random pose has room for the robot.
    #[error(
        "the world {world:?} has no outline with room for a robot start_clearance_m = {clearance_m} from its walls; lower it, or name a start"
    )]
    NoRandomStart {
        /// The world file.
        world: String,
        /// The distance from walls.
        clearance_m: f64,
    },
    /// The robot begins inside something.
    #[error("the start of robot {robot:?} in {world:?} lies in a wall or a body; move it")]
    StartBlocked {
        /// The world file.
        world: String,
        /// The robot.
        robot: String,
    },
}

impl Params {
    /// The fixed step.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;
}
