//! The parameters of the controller.

use crate::Ahead;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The longest time from one command for the wheels to the next.
    #[schemars(range(min = 5, max = 100))]
    pub period_ms: u32,
    /// Distance between the middles of the two driven wheels.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub wheel_track_m: f64,
    /// Speed of a long way.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub speed_mps: f64,
    /// Speed of a long turn.
    #[schemars(range(min = 0.05, max = 7.0))]
    pub turn_rate_rad_per_s: f64,
    /// Ways end with this deceleration.
    #[schemars(range(min = 0.02, max = 5.0))]
    pub braking_m_per_s2: f64,
    /// Turns end with this deceleration.
    #[schemars(range(min = 0.1, max = 30.0))]
    pub braking_rad_per_s2: f64,
    /// The least speed at the end of a way, until the robot is there.
    #[schemars(range(min = 0.001, max = 0.1))]
    pub creep_mps: f64,
    /// The least turning speed at the end of a turn, until the robot has turned.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub creep_rad_per_s: f64,
    /// A way that is shorter than ordered by no more than this is done.
    #[schemars(range(min = 0.0, max = 0.02))]
    pub tolerance_m: f64,
    /// A turn that is smaller than ordered by no more than this is done.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub turn_tolerance_rad: f64,
    /// Speed for each metre between the robot and where the guard would stop it.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub approach_per_s: f64,
    /// How far the robot drives back from a wall that is too near, unless the order says less.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub retreat_m: f64,
    /// Speed of a retreat from a wall, and of every way back: within what `base-driver` lets pass.
    #[schemars(range(min = 0.01, max = 0.3))]
    pub retreat_speed_mps: f64,
    /// Wheels that stand for this long although they should turn are blocked.
    #[schemars(range(min = 0.1, max = 30.0))]
    pub patience_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            period_ms: 20,
            wheel_track_m: 0.12,
            speed_mps: 0.20,
            turn_rate_rad_per_s: 90.0_f64.to_radians(),
            braking_m_per_s2: 0.25,
            braking_rad_per_s2: 2.5,
            creep_mps: 0.01,
            creep_rad_per_s: 0.08,
            tolerance_m: 0.0005,
            turn_tolerance_rad: 0.003,
            approach_per_s: 2.0,
            retreat_m: 0.10,
            retreat_speed_mps: 0.10,
            patience_s: 2.0,
        }
    }
}

/// Why parameters of the controller are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Creeping faster than driving.
    #[error("{creep_name} = {creep} is above {name} = {speed}; lower the first")]
    CreepTooFast {
        /// The creeping speed.
        creep_name: &'static str,
        /// Its value.
        creep: f64,
        /// The driving speed.
        name: &'static str,
        /// Its value.
        speed: f64,
    },
}

impl Params {
    /// Between two commands for the wheels.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }

    /// The speed at which the robot stops in time.
    pub(crate) fn braking_mps(&self, left_m: f64) -> f64 {
        (2.0 * self.braking_m_per_s2 * left_m.max(0.0)).sqrt().max(self.creep_mps)
    }

    pub(crate) fn braking_rad_per_s(&self, left_rad: f64) -> f64 {
        (2.0 * self.braking_rad_per_s2 * left_rad.max(0.0)).sqrt().max(self.creep_rad_per_s)
    }

    /// No faster ahead than what lies there allows; not at all while nobody knows.
    pub(crate) fn approach_mps(&self, ahead: Ahead) -> f64 {
        match ahead {
            Ahead::Free(free_m) => (self.approach_per_s * free_m).clamp(self.creep_mps, self.speed_mps),
            Ahead::TooNear | Ahead::Unknown => 0.0,
        }
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let pairs = [
            ("creep_mps", self.creep_mps, "speed_mps", self.speed_mps),
            ("creep_rad_per_s", self.creep_rad_per_s, "turn_rate_rad_per_s", self.turn_rate_rad_per_s),
        ];
        match pairs.iter().find(|(_, creep, _, speed)| creep > speed) {
            Some(&(creep_name, creep, name, speed)) => {
                Err(ParamsError::CreepTooFast { creep_name, creep, name, speed })
            }
            None => Ok(()),
        }
    }
}
