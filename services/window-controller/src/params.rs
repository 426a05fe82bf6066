//! The parameters of the window controller. Those that `fuzzy-controller` has too have its names, so that a
//! graph's table suits both.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of the window controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Distance between the wheels.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub track_m: f64,
    /// The fastest that a wheel is told to turn.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub top_speed_mps: f64,
    /// The most that the speed forward changes in a second, stops apart: half of the window's height.
    #[schemars(range(min = 0.01, max = 20.0))]
    pub acceleration_m_per_s2: f64,
    /// The most that the turning speed changes in a second: half of the window's width.
    #[schemars(range(min = 0.05, max = 50.0))]
    pub turn_acceleration_rad_per_s2: f64,
    /// The fastest turn.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub top_turn_rad_per_s: f64,
    /// Speeds from which this deceleration does not stop before the obstacle are not admissible (note 2.5).
    #[schemars(range(min = 0.01, max = 20.0))]
    pub brake_m_per_s2: f64,
    /// Time from a command to the wheels (note 2.5).
    #[schemars(range(min = 0.0, max = 2.0))]
    pub latency_s: f64,
    /// Time between two steps.
    #[schemars(range(min = 1, max = 1000))]
    pub period_ms: u64,
    /// Poses, ranges and odometry older than this stop the robot.
    #[schemars(range(min = 1, max = 10000))]
    pub input_max_age_ms: u64,
    /// A command older than this stops the robot.
    #[schemars(range(min = 1, max = 3600000))]
    pub command_max_age_ms: u64,
    /// The last waypoint is reached within this distance.
    #[schemars(range(min = 0.005, max = 2.0))]
    pub reach_tolerance_m: f64,
    /// How far ahead on the path the robot aims.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub lookahead_m: f64,
    /// How far ahead a velocity's course is followed to see where it leads.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub horizon_s: f64,
    /// Above this error the robot turns on the spot.
    #[schemars(range(min = 0.1, max = std::f64::consts::PI))]
    pub rotation_always_rad: f64,
    /// A turn on the spot ends below this error.
    #[schemars(range(min = 0.01, max = 3.0))]
    pub rotation_end_rad: f64,
    /// The least wheel speed in a turn on the spot.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub rotation_least_mps: f64,
    /// A commanded turn ends below this error.
    #[schemars(range(min = 0.002, max = 1.0))]
    pub turn_tolerance_rad: f64,
    /// Speed of creeping and of backing off.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub creep_speed_mps: f64,
    /// What the objective gives for a course towards the target.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub heading_weight: f64,
    /// What the objective gives for the way to the first obstacle.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_weight: f64,
    /// What the objective gives for speed.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub velocity_weight: f64,
    /// Beyond this much way to the first obstacle, more is no better.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub front_trigger_m: f64,
    /// At top speed courses keep this distance at the sides, slower ones less in proportion.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub side_trigger_m: f64,
    /// Below this clearance in front the robot brakes at once, and then only turns.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub brake_distance_m: f64,
    /// How long what was seen is remembered: eight sensors leave most directions unseen.
    #[schemars(range(min = 0, max = 60000))]
    pub memory_ms: u64,
    /// The hull ahead of the turning centre.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_front_m: f64,
    /// The hull behind the turning centre.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_rear_m: f64,
    /// Half of the hull's width.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_side_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            track_m: 0.40,
            top_speed_mps: 0.36,
            acceleration_m_per_s2: 0.4,
            turn_acceleration_rad_per_s2: 2.0,
            top_turn_rad_per_s: 1.0,
            brake_m_per_s2: 0.5,
            latency_s: 0.2,
            period_ms: 50,
            input_max_age_ms: 500,
            command_max_age_ms: 1000,
            reach_tolerance_m: 0.05,
            lookahead_m: 0.6,
            horizon_s: 1.0,
            rotation_always_rad: 1.0,
            rotation_end_rad: 0.15,
            rotation_least_mps: 0.03,
            turn_tolerance_rad: 2_f64.to_radians(),
            creep_speed_mps: 0.15,
            heading_weight: 0.8,
            clearance_weight: 0.1,
            velocity_weight: 0.15,
            front_trigger_m: 0.6,
            side_trigger_m: 0.10,
            brake_distance_m: 0.25,
            memory_ms: 1500,
            hull_front_m: 0.305,
            hull_rear_m: 0.305,
            hull_side_m: 0.255,
        }
    }
}

/// Parameters that make no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A turn that would end before it begins.
    #[error("rotation_end_rad = {end_rad} is not below rotation_always_rad = {begin_rad}: lower the first")]
    RotationEndsEarly {
        /// Where it ends.
        end_rad: f64,
        /// Where it begins.
        begin_rad: f64,
    },
    /// Nothing to choose by.
    #[error("heading_weight is 0: without it no target is ever reached; raise it")]
    NoHeading,
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.rotation_end_rad >= self.rotation_always_rad {
            let (end_rad, begin_rad) = (self.rotation_end_rad, self.rotation_always_rad);
            return Err(ParamsError::RotationEndsEarly { end_rad, begin_rad });
        }
        if self.heading_weight == 0.0 { Err(ParamsError::NoHeading) } else { Ok(()) }
    }
}

impl Params {
    /// Time between two steps.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }

    pub(crate) fn input_max_age(&self) -> Duration {
        Duration::from_millis(self.input_max_age_ms)
    }
}
