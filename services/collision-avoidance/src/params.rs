//! What can be adjusted.

use geometry::{Hull, WorldError};
use messages::{Face, Parameters, TofRanges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Which sensor the guard watches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// The eight time-of-flight sensors on `tof/ranges` (COF-020).
    Tof,
    /// A laser scanner on `laser/scan`.
    Laser,
}

/// The parameters of `collision-avoidance`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file whose walls count as near while the pose is known; empty for none. The signal does not
    /// depend on it.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Which sensor is watched: "tof" or "laser".
    pub sensor: Sensor,
    /// A reading in front below this is a STOP (COF-064).
    #[schemars(range(min = 0.0, max = 4.0))]
    pub front_radius_m: f64,
    /// A reading on the right below this is a STOP (COF-064).
    #[schemars(range(min = 0.0, max = 4.0))]
    pub right_radius_m: f64,
    /// A reading on the left below this is a STOP (COF-064).
    #[schemars(range(min = 0.0, max = 4.0))]
    pub left_radius_m: f64,
    /// Readings older than this are not used: STOP (COF-069). Three frames of the sensor: one may be late and
    /// one be lost. The longer it is, the slower `base-driver` lets the robot drive.
    #[schemars(range(min = 10, max = 5000))]
    pub max_age_ms: u64,
    /// Sensors that tell nothing but "too little light" or "too much scatter" for longer than this see
    /// nothing at all: STOP for their face, unless half of its sensors are better off.
    #[schemars(range(min = 50, max = 60000))]
    pub scatter_max_ms: u64,
    /// A sensor that sees nothing while the robot drives this far past what its neighbour sees is blind, and
    /// readings that do not change in the least over this distance are old ones: STOP. 0 switches this check
    /// off.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub blind_way_m: f64,
    /// The clearance is published at least this often, so that silence is noticed quickly.
    #[schemars(range(min = 5, max = 1000))]
    pub heartbeat_ms: u64,
    /// Clear readings in a row of every sensor that turn STOP into GO (COF-070).
    #[schemars(range(min = 1, max = 100))]
    pub clear_frames: u32,
    /// The paper's rule to the letter: one clear frame turns STOP into GO, and nothing is remembered.
    pub strict_paper: bool,
    /// A front reading below this that rises suddenly is remembered as an obstacle; 0 remembers
    /// nothing.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub memory_m: f64,
    /// A rise above what the robot's own motion explains by more than this, from one reading to the next, is
    /// sudden: faster than a person walks away.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub memory_jump_m: f64,
    /// A remembered obstacle is forgotten after this long with clear readings and no forward motion.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub memory_release_s: f64,
    /// Speeds up to this do not count as forward motion.
    #[schemars(range(min = 0.0, max = 0.2))]
    pub standstill_mps: f64,
    /// From the robot's centre to its front edge (COF-003).
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_front_m: f64,
    /// From the robot's centre to its rear edge (COF-003).
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_rear_m: f64,
    /// Half of the robot's width (COF-003).
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_side_m: f64,
    /// A laser's face reaches beyond the body's edges by this; what lies diagonally beyond belongs to no
    /// face.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub laser_margin_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            sensor: Sensor::Tof,
            front_radius_m: 0.200,
            right_radius_m: 0.050,
            left_radius_m: 0.050,
            max_age_ms: 300,
            scatter_max_ms: 500,
            blind_way_m: 2.0,
            heartbeat_ms: 25,
            clear_frames: 3,
            strict_paper: false,
            memory_m: 0.400,
            memory_jump_m: 0.250,
            memory_release_s: 3.0,
            standstill_mps: 0.02,
            hull_front_m: 0.305,
            hull_rear_m: 0.305,
            hull_side_m: 0.255,
            laser_margin_m: 0.05,
        }
    }
}

impl Params {
    /// The longest time between two messages.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.heartbeat_ms)
    }

    pub(crate) fn max_age(&self) -> Duration {
        Duration::from_millis(self.max_age_ms)
    }

    pub(crate) fn scatter_max(&self) -> Duration {
        Duration::from_millis(self.scatter_max_ms)
    }

    /// The robot from above.
    pub(crate) fn hull(&self) -> Hull {
        Hull { front_m: self.hull_front_m, rear_m: self.hull_rear_m, side_m: self.hull_side_m }
    }

    pub(crate) fn radius_m(&self, face: Face) -> f64 {
        match face {
            Face::Front => self.front_radius_m,
            Face::Right => self.right_radius_m,
            Face::Left => self.left_radius_m,
        }
    }

    pub(crate) fn frames_to_clear(&self) -> u32 {
        if self.strict_paper { 1 } else { self.clear_frames }
    }

    pub(crate) fn memory_range_m(&self) -> f64 {
        if self.strict_paper { 0.0 } else { self.memory_m }
    }
}

/// Parameters that make no sense.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A radius that no time-of-flight reading can violate.
    #[error(
        "{name} = {radius_m} is not above the sensors' smallest reading of {minimum_m} m, so no obstacle could ever violate it; \
         choose a larger radius"
    )]
    RadiusBelowSensor {
        /// The parameter.
        name: &'static str,
        /// Its value.
        radius_m: f64,
        /// The smallest reading.
        minimum_m: f32,
    },
    /// The memory begins inside the private sphere.
    #[error(
        "memory_m = {memory_m} is below front_radius_m = {front_radius_m}, so an obstacle that stopped the robot could be forgotten; \
         set memory_m to 0 (remember nothing) or to at least front_radius_m"
    )]
    MemoryInsideRadius {
        /// Where memory begins.
        memory_m: f64,
        /// The front radius.
        front_radius_m: f64,
    },
    /// Silence would be noticed too late.
    #[error(
        "heartbeat_ms = {heartbeat_ms} is above max_age_ms = {max_age_ms}, so silence is noticed late; shorten the heartbeat"
    )]
    SlowHeartbeat {
        /// The heartbeat.
        heartbeat_ms: u64,
        /// The age limit.
        max_age_ms: u64,
    },
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let minimum_m = TofRanges::MINIMUM_M;
        let radii = [
            ("front_radius_m", self.front_radius_m),
            ("right_radius_m", self.right_radius_m),
            ("left_radius_m", self.left_radius_m),
        ];
        for (name, radius_m) in radii {
            if self.sensor == Sensor::Tof && radius_m as f32 <= minimum_m {
                return Err(ParamsError::RadiusBelowSensor { name, radius_m, minimum_m });
            }
        }
        if self.memory_m > 0.0 && self.memory_m < self.front_radius_m {
            let (memory_m, front_radius_m) = (self.memory_m, self.front_radius_m);
            return Err(ParamsError::MemoryInsideRadius { memory_m, front_radius_m });
        }
        if self.heartbeat_ms > self.max_age_ms {
            let (heartbeat_ms, max_age_ms) = (self.heartbeat_ms, self.max_age_ms);
            return Err(ParamsError::SlowHeartbeat { heartbeat_ms, max_age_ms });
        }
        Ok(())
    }
}
