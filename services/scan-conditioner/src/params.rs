//! The parameters of the conditioner.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parameters of the conditioner.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Readings whose mean tells the nearest wall; odd.
    #[schemars(range(min = 1, max = 99))]
    pub neighbours: u32,
    /// How far on either side of the lowest readings the middle of the wall's echo is looked for; 0 takes the
    /// lowest readings themselves.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub search_deg: f64,
    /// How far on either side of the middle of the wall's echo the readings are compared.
    #[schemars(range(min = 1.0, max = 90.0))]
    pub mirror_deg: f64,
    /// Readings above the lowest by no more than this may be the same wall.
    #[schemars(range(min = 0.0, max = 0.2))]
    pub alike_m: f64,
    /// Half of a window's width (NXT-041).
    #[schemars(range(min = 1.0, max = 45.0))]
    pub window_deg: f64,
    /// Whether windows that look at walls askew are dropped.
    pub perpendicular_only: bool,
    /// By how much the middle of a window may lie above its sides.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub slope_tolerance_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            neighbours: 5,
            search_deg: 25.0,
            mirror_deg: 40.0,
            alike_m: 0.02,
            window_deg: 15.0,
            perpendicular_only: true,
            slope_tolerance_m: 0.01,
        }
    }
}

/// Why parameters of the conditioner are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Neighbours without a middle.
    #[error("neighbours = {neighbours} is even and has no middle; choose an odd number")]
    NoMiddle {
        /// How many.
        neighbours: u32,
    },
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.neighbours.is_multiple_of(2) {
            return Err(ParamsError::NoMiddle { neighbours: self.neighbours });
        }
        Ok(())
    }
}
