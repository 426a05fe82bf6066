//! The parameters of the referee.

use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Coffee is delivered: against `world/truth`.
    #[default]
    Delivery,
    /// A robot is located in a log: `location/pose` against `truth/pose`.
    Localisation,
    /// A robot finds its way to a target in an arena: against `world/truth`.
    Arena,
}

/// The parameters of the referee.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What is judged.
    pub mode: Mode,
    /// The world file, relative to the working directory; empty for an empty plane.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Time from one look at the truth to the next.
    #[schemars(range(min = 10, max = 1000))]
    pub sample_ms: u32,
    /// Time from one summary to the next.
    #[schemars(range(min = 10, max = 10000))]
    pub period_ms: u32,
    /// Deliveries after which the run has passed, once no order is under way and none waits.
    #[schemars(range(min = 1, max = 1000))]
    pub deliveries: u32,
    /// How far from the door's centre line, along the hallway, the robot may halt.
    #[schemars(range(min = 0.001, max = 5.0))]
    pub max_halt_error_m: f64,
    /// Time after which the run has failed; 0 means no limit.
    #[schemars(range(min = 0.0, max = 1000000.0))]
    pub time_limit_s: f64,
    /// How long the mission may report a fault.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub fault_limit_s: f64,
    /// The largest median error of the localisation with which a run passes.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub max_median_m: f64,
    /// Error that 95 % of the poses must stay below.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub max_p95_m: f64,
    /// How far from its target a robot in an arena may end.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub max_target_error_m: f64,
    /// Offset of the configuration space in which the shortest path is measured: half of the robot's length
    /// (NXT-070, NXT-104).
    #[schemars(range(min = 0.0, max = 2.0))]
    pub offset_m: f64,
    /// A pose that is said to be certain is wrong when it is farther off than this.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub wrong_pose_m: f64,
    /// Poses between two true poses are compared with the straight line between these; otherwise only the
    /// newest pose before each true one counts: for logs whose true poses lie far apart, or whose time stamps
    /// say nothing.
    pub between_truths: bool,
    /// The largest median error of the heading with which a run passes, in degrees; 180 means no bound.
    #[schemars(range(min = 0.01, max = 180.0))]
    pub max_median_heading_deg: f64,
    /// Length of the robot's body.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub body_length_m: f64,
    /// Width of the robot's body.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub body_width_m: f64,
    /// Height of the robot's body.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub body_height_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            mode: Mode::Delivery,
            world: String::new(),
            sample_ms: 50,
            period_ms: 200,
            deliveries: 1,
            max_halt_error_m: 0.10,
            time_limit_s: 600.0,
            fault_limit_s: 10.0,
            max_median_m: 0.25,
            max_p95_m: 0.8,
            max_target_error_m: 0.03,
            offset_m: 0.08,
            wrong_pose_m: 0.05,
            between_truths: true,
            max_median_heading_deg: 180.0,
            body_length_m: 0.61,
            body_width_m: 0.51,
            body_height_m: 1.0,
        }
    }
}

/// Why parameters of the referee are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A bound on the many below that on the half.
    #[error("max_p95_m = {p95_m} is below max_median_m = {median_m}; raise the first")]
    BoundsCross {
        /// The bound on 95 %.
        p95_m: f64,
        /// The bound on the median.
        median_m: f64,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl Params {
    /// From look to look.
    pub fn sample_period(&self) -> Duration {
        Duration::from_millis(self.sample_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.max_p95_m < self.max_median_m {
            return Err(ParamsError::BoundsCross { p95_m: self.max_p95_m, median_m: self.max_median_m });
        }
        Ok(())
    }
}
