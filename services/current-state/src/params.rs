//! What can be adjusted.

use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of `current-state`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The state is published at each change and at least this often.
    #[schemars(range(min = 5, max = 10_000))]
    pub period_ms: u64,
    /// A pose older than this is shown, and marked as not valid.
    #[schemars(range(min = 10, max = 60_000))]
    pub location_max_age_ms: u64,
    /// An angle older than this is shown, and marked as not valid.
    #[schemars(range(min = 10, max = 60_000))]
    pub angle_max_age_ms: u64,
    /// A clearance older than this shows as STOP.
    #[schemars(range(min = 10, max = 5000))]
    pub clearance_max_age_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self { period_ms: 100, location_max_age_ms: 1000, angle_max_age_ms: 2000, clearance_max_age_ms: 300 }
    }
}

impl Params {
    /// The longest time between two messages.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }
}

/// Parameters that make no sense.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParamsError {
    /// A number outside of its range.
    #[error("{name} = {value} lies outside of {min} to {max}; choose a value within")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: u64,
        /// Smallest value.
        min: u64,
        /// Largest value.
        max: u64,
    },
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check(&self) -> Result<(), ParamsError> {
        let ranges = [
            ("period_ms", self.period_ms, 5, 10_000),
            ("location_max_age_ms", self.location_max_age_ms, 10, 60_000),
            ("angle_max_age_ms", self.angle_max_age_ms, 10, 60_000),
            ("clearance_max_age_ms", self.clearance_max_age_ms, 10, 5000),
        ];
        match ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((name, value, min, max)) => Err(ParamsError::OutOfRange { name, value, min, max }),
            None => Ok(()),
        }
    }
}
