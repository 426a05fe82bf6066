//! The parameters of the fuzzy controller; their defaults are those of a PowerBot (note 3.1, 3.6 to 3.8).

use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Which sensors tell the distance of obstacles. All that are named must be fresh, or the robot stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RangeSource {
    /// The eight time-of-flight sensors.
    #[default]
    Tof,
    /// A laser's scan.
    Scan,
    /// The time-of-flight sensors and the laser; the nearer reading counts.
    Both,
    /// No sensor: no avoidance.
    None,
}

/// The parameters of the fuzzy controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file whose walls the hull keeps away from, as from what was seen; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Distance between the wheels, in metres.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub track_m: f64,
    /// The fastest that a wheel is told to turn; the speeds in the rule files are scaled by it.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub top_speed_mps: f64,
    /// The top speed for which the rule files are written.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub rules_top_speed_mps: f64,
    /// The most that a wheel's speed changes in a second, stops apart.
    #[schemars(range(min = 0.01, max = 20.0))]
    pub acceleration_m_per_s2: f64,
    /// Time between two steps.
    #[schemars(range(min = 1, max = 1000))]
    pub period_ms: u64,
    /// Poses and ranges older than this stop the robot.
    #[schemars(range(min = 1, max = 10000))]
    pub input_max_age_ms: u64,
    /// A command older than this stops the robot.
    #[schemars(range(min = 1, max = 3600000))]
    pub command_max_age_ms: u64,
    /// The last waypoint is reached within this distance.
    #[schemars(range(min = 0.005, max = 2.0))]
    pub reach_tolerance_m: f64,
    /// An intermediate waypoint is passed within this distance, or when it lies behind.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub pass_distance_m: f64,
    /// How far ahead on the path the robot aims. 0 aims at the next waypoint, as the paper does.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub lookahead_m: f64,
    /// Targets, and corners of the path, nearer than this are turned at before driving (ASN-146).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub rotation_distance_m: f64,
    /// A turn on the spot begins above this error.
    #[schemars(range(min = 0.01, max = std::f64::consts::PI))]
    pub rotation_begin_rad: f64,
    /// A turn on the spot ends below this error.
    #[schemars(range(min = 0.005, max = std::f64::consts::PI))]
    pub rotation_end_rad: f64,
    /// Above this error the robot turns on the spot however far the target is; π: never.
    #[schemars(range(min = 0.01, max = std::f64::consts::PI))]
    pub rotation_always_rad: f64,
    /// The least wheel speed in a turn on the spot.
    #[schemars(range(min = 0.0))]
    pub rotation_least_mps: f64,
    /// A commanded turn ends below this error.
    #[schemars(range(min = 0.002, max = 1.0))]
    pub turn_tolerance_rad: f64,
    /// Speed of creeping and of backing off.
    #[schemars(range(min = 0.005))]
    pub creep_speed_mps: f64,
    /// Which sensors tell the distance of obstacles.
    pub range_source: RangeSource,
    /// Avoidance takes over below this clearance in front.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub front_trigger_m: f64,
    /// Avoidance takes over below this clearance at the sides; below the corridor's, or the robot shies at
    /// every wall.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub side_trigger_m: f64,
    /// Below this clearance in front the robot brakes at once, and then only turns.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub brake_distance_m: f64,
    /// In front of an obstacle the robot turns to its path, which will lead around it, instead of away by the
    /// rules; without such a path it waits.
    pub turns_by_path: bool,
    /// No motion brings the hull nearer than this to what the time-of-flight sensors saw a moment ago; 0
    /// switches this off.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub keep_away_m: f64,
    /// Deceleration of the drive, for the speed ahead of obstacles (note 2.5).
    #[schemars(range(min = 0.01, max = 20.0))]
    pub brake_m_per_s2: f64,
    /// Time from a reading to the wheels.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub latency_s: f64,
    /// By how much clearances beside the laser cones, from 50 to 110 degrees, are stretched.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub lateral_factor: f64,
    /// This near to the goal there is no avoidance (note 3.7).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub goal_without_avoidance_m: f64,
    /// Avoidance for longer than this without progress is reported as blocked (note 3.8).
    #[schemars(range(min = 100, max = 3600000))]
    pub blocked_after_ms: u64,
    /// What counts as progress.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub progress_m: f64,
    /// The hull ahead of the turning centre.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_front_m: f64,
    /// The hull behind the turning centre.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_rear_m: f64,
    /// Half of the hull's width.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_side_m: f64,
    /// A file with the motion controller's rules in FCL; empty for the built-in ones.
    #[schemars(extend("format" = "path"))]
    pub motion_rules: String,
    /// A file with the avoidance controller's rules in FCL; empty for the built-in ones.
    #[schemars(extend("format" = "path"))]
    pub avoidance_rules: String,
    /// A file with the rotation controller's rules in FCL; empty for the built-in ones.
    #[schemars(extend("format" = "path"))]
    pub rotation_rules: String,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            track_m: 0.536,
            top_speed_mps: 0.47,
            rules_top_speed_mps: 0.47,
            acceleration_m_per_s2: 0.3,
            period_ms: 50,
            input_max_age_ms: 500,
            command_max_age_ms: 1000,
            reach_tolerance_m: 0.05,
            pass_distance_m: 0.20,
            lookahead_m: 0.6,
            rotation_distance_m: 0.5,
            rotation_begin_rad: 20_f64.to_radians(),
            rotation_end_rad: 5_f64.to_radians(),
            rotation_always_rad: std::f64::consts::PI,
            rotation_least_mps: 0.03,
            turn_tolerance_rad: 2_f64.to_radians(),
            creep_speed_mps: 0.10,
            range_source: RangeSource::Tof,
            front_trigger_m: 0.5,
            side_trigger_m: 0.5,
            brake_distance_m: 0.2,
            turns_by_path: false,
            keep_away_m: 0.0,
            brake_m_per_s2: 0.5,
            latency_s: 0.2,
            lateral_factor: 1.5,
            goal_without_avoidance_m: 0.3,
            blocked_after_ms: 8000,
            progress_m: 0.3,
            hull_front_m: 0.369,
            hull_rear_m: 0.542,
            hull_side_m: 0.340,
            motion_rules: String::new(),
            avoidance_rules: String::new(),
            rotation_rules: String::new(),
        }
    }
}

impl Params {
    /// The hull as the turning centre sees it.
    pub(crate) fn hull(&self) -> geometry::Hull {
        geometry::Hull { front_m: self.hull_front_m, rear_m: self.hull_rear_m, side_m: self.hull_side_m }
    }

    /// Time between two steps.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }
}

/// What is wrong with the parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A speed that the wheels do not reach.
    #[error("{name} = {speed_mps} is above top_speed_mps = {top_mps}; lower the first")]
    AboveTopSpeed {
        /// The speed.
        name: &'static str,
        /// Its value.
        speed_mps: f64,
        /// The top speed.
        top_mps: f64,
    },
    /// Two that must differ in this order do not.
    #[error("{small_name} = {small} must be below {large_name} = {large}")]
    Order {
        /// The parameter that must be smaller.
        small_name: &'static str,
        /// Its value.
        small: f64,
        /// The parameter that must be larger.
        large_name: &'static str,
        /// Its value.
        large: f64,
    },
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        for (name, speed_mps) in
            [("rotation_least_mps", self.rotation_least_mps), ("creep_speed_mps", self.creep_speed_mps)]
        {
            if speed_mps > self.top_speed_mps {
                return Err(ParamsError::AboveTopSpeed { name, speed_mps, top_mps: self.top_speed_mps });
            }
        }
        for (small_name, small, large_name, large) in [
            ("rotation_end_rad", self.rotation_end_rad, "rotation_begin_rad", self.rotation_begin_rad),
            ("brake_distance_m", self.brake_distance_m, "front_trigger_m", self.front_trigger_m),
        ] {
            if small >= large {
                return Err(ParamsError::Order { small_name, small, large_name, large });
            }
        }
        Ok(())
    }
}
