//! What can be adjusted.

use messages::{Misfit, Parameters};
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

impl Parameters for Params {
    type Error = Misfit;
}
