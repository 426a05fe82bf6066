//! The parameters of the guard.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of the guard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Nothing ahead may be nearer to the sensor, which sits above the centre of motion: half of the robot's
    /// length and a centimetre.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub stop_distance_m: f64,
    /// From the centre of motion, above which the sensor sits, to the hull's front edge.
    #[schemars(range(min = 0.005, max = 2.0))]
    pub hull_front_m: f64,
    /// A sensor without a single echo, ahead or in a scan, for this long a way counts as deaf, and so does
    /// one before its first echo: STOP. 0 switches this off, for places that are larger than the sensor's
    /// range.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub deaf_way_m: f64,
    /// Readings older than this count for nothing.
    #[schemars(range(min = 10, max = 1000))]
    pub max_age_ms: u32,
    /// The longest time from one message of the guard to the next.
    #[schemars(range(min = 5, max = 100))]
    pub period_ms: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self { stop_distance_m: 0.09, hull_front_m: 0.08, deaf_way_m: 3.0, max_age_ms: 100, period_ms: 40 }
    }
}

/// Why parameters of the guard are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A threshold within the robot.
    #[error(
        "stop_distance_m = {stop_m} is not above hull_front_m = {hull_m}, so the robot would touch before it stops; raise the first"
    )]
    StopsTooLate {
        /// The threshold.
        stop_m: f64,
        /// The hull's front edge.
        hull_m: f64,
    },
}

impl Params {
    /// Between two words without a reading.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }

    /// How old a reading may be.
    pub fn max_age(&self) -> Duration {
        Duration::from_millis(self.max_age_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.stop_distance_m <= self.hull_front_m {
            return Err(ParamsError::StopsTooLate {
                stop_m: self.stop_distance_m,
                hull_m: self.hull_front_m,
            });
        }
        Ok(())
    }
}
