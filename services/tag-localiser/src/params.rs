//! The parameters of `tag-localiser`.

use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What `tag-localiser` can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file with the walls that the side sensors are compared with; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Pose at the start, where it is known; without it the first ranges and a short drive find it.
    pub start: Option<Start>,
    /// Standard deviation of a good range, its slowly changing bias included.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub range_sigma_m: f64,
    /// Ranges beyond this are rejected.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub longest_range_m: f64,
    /// Readings of less quality are rejected.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub min_quality_percent: f64,
    /// Standard deviation of the module's own position, used where there are fewer than two ranges.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub position_sigma_m: f64,
    /// Chance that an anchor heard rightly is heard wrongly the next time: an outlier, or the begin of a
    /// wrong spell.
    #[schemars(range(min = 0.0001, max = 0.5))]
    pub outlier_chance: f64,
    /// Chance that an anchor heard wrongly is heard rightly the next time.
    #[schemars(range(min = 0.0001, max = 0.9))]
    pub recovery_chance: f64,
    /// Odometry: standard deviation of the place after 1 m of path; grows with the root of the path.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub distance_sigma_m: f64,
    /// Odometry: standard deviation of the heading after 1 m of path; grows with the root of the path.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drift_sigma_rad: f64,
    /// Odometry: standard deviation of the heading after 1 rad of turning; grows with the root of the turn.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub turn_sigma_rad: f64,
    /// Odometry that jumps farther from one message to the next has begun anew.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub odometry_jump_m: f64,
    /// The published place is never claimed to be better than this: ranges share biases that averaging does
    /// not remove.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor_sigma_m: f64,
    /// Standard deviation of a side sensor's distance to a wall of the world, the drawing's error included.
    #[schemars(range(min = 0.005, max = 0.5))]
    pub side_sigma_m: f64,
    /// Time between two uses of the side sensors, so that one bump in the wall does not count many times.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub side_period_s: f64,
    /// Without a tag message for this long the estimate is degraded.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub tag_timeout_s: f64,
    /// An anchor near enough to be heard, but not heard for this many tag messages, is dead.
    #[schemars(range(min = 2, max = 10000))]
    pub silent_messages: u32,
    /// Tag messages in a row from another floor that mean that the robot is there.
    #[schemars(range(min = 1, max = 1000))]
    pub floor_messages: u32,
    /// Tag messages in a row that the estimate cannot explain, and another place can, after which that place
    /// is tried as well.
    #[schemars(range(min = 1, max = 1000))]
    pub recovery_messages: u32,
    /// With a larger standard deviation of the place the robot is lost.
    #[schemars(range(min = 0.2, max = 100.0))]
    pub lost_sigma_m: f64,
}

/// A known pose at the start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Place in the map.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub x_m: f64,
    /// Place in the map.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub y_m: f64,
    /// Heading in the map.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub heading_rad: f64,
    /// Standard deviation of the place.
    #[serde(default = "start_sigma_m")]
    #[schemars(range(min = 0.001, max = 100.0))]
    pub sigma_m: f64,
    /// Standard deviation of the heading.
    #[serde(default = "start_sigma_rad")]
    #[schemars(range(min = 0.001, max = 1.0))]
    pub sigma_rad: f64,
    /// The floor.
    #[serde(default)]
    pub floor: i32,
}

fn start_sigma_m() -> f64 {
    0.3
}

fn start_sigma_rad() -> f64 {
    0.2
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            start: None,
            range_sigma_m: 0.15,
            longest_range_m: 60.0,
            min_quality_percent: 30.0,
            position_sigma_m: 0.20,
            outlier_chance: 0.03,
            recovery_chance: 0.08,
            distance_sigma_m: 0.05,
            drift_sigma_rad: 0.02,
            turn_sigma_rad: 0.03,
            odometry_jump_m: 3.0,
            floor_sigma_m: 0.06,
            side_sigma_m: 0.05,
            side_period_s: 0.1,
            tag_timeout_s: 3.0,
            silent_messages: 15,
            floor_messages: 5,
            recovery_messages: 8,
            lost_sigma_m: 2.0,
        }
    }
}

/// Parameters that make no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A wrong spell that could not be told from a right one.
    #[error(
        "outlier_chance = {outlier_chance} and recovery_chance = {recovery_chance} add up to more than 0.9: an anchor would change between right and wrong at random; lower one of them"
    )]
    RestlessAnchors {
        /// Chance of a right anchor to become wrong.
        outlier_chance: f64,
        /// Chance of a wrong anchor to become right.
        recovery_chance: f64,
    },
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.outlier_chance + self.recovery_chance > 0.9 {
            return Err(ParamsError::RestlessAnchors {
                outlier_chance: self.outlier_chance,
                recovery_chance: self.recovery_chance,
            });
        }
        Ok(())
    }
}
