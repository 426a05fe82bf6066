//! What can be adjusted.

use geometry::world::WorldError;
use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of `door-locator`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The world file with the doors; without one no door is ever found.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Only the paper's sliding window decides; otherwise the edges of the door are located as well, which is
    /// earlier and finer.
    pub strict_paper: bool,
    /// By how much the newer half of the window must be deeper than the older one (COF-104).
    #[schemars(range(min = 0.005, max = 1.0))]
    pub rise_m: f64,
    /// A window that has fired fires again only after its newer half fell by this (note 2.6).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub unlock_m: f64,
    /// The fewest readings in half of the window.
    #[schemars(range(min = 1, max = 64))]
    pub half_window_min: u32,
    /// The most readings in half of the window, however slow the robot is.
    #[schemars(range(min = 1, max = 1024))]
    pub half_window_max: u32,
    /// Readings above this are noise (COF-030).
    #[schemars(range(min = 0.1, max = 4.0))]
    pub noise_m: f64,
    /// A door counts only if the map has one within this of where it was seen.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub gate_m: f64,
    /// A reading deeper than the wall by this begins an edge: half of a door's recess.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub edge_m: f64,
    /// A closed door is deeper than the wall by what the map says, give or take this.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub recess_tolerance_m: f64,
    /// Readings in a row that make an edge; one or two deviating points do not (COF-106).
    #[schemars(range(min = 3, max = 20))]
    pub edge_readings: u32,
    /// An edge counts only when the readings behind it reach at least this far along the wall.
    #[schemars(range(min = 0.0, max = 0.4))]
    pub edge_run_m: f64,
    /// How much later than its axis a sensor's cone leaves the wall, in metres for each metre of wall
    /// distance: the tangent of half the cone, or less. A first guess, improved with each door passed.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub edge_lag_ratio: f64,
    /// Standard deviation of the first guess of `edge_lag_ratio`.
    #[schemars(range(min = 0.001, max = 0.5))]
    pub edge_lag_sigma_ratio: f64,
    /// The second sensor sees the same edge after the sensors' distance, give or take this share of it (note
    /// 2.6).
    #[schemars(range(min = 0.05, max = 1.0))]
    pub confirm_share: f64,
    /// The robot stands at the entrance when the door's centre line is within this.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub entrance_m: f64,
    /// Below this speed the robot stands, and readings are no new points of the wall.
    #[schemars(range(min = 0.001, max = 0.2))]
    pub standstill_mps: f64,
    /// Readings and odometry older than this are not used.
    #[schemars(range(min = 10, max = 5000))]
    pub max_age_ms: u64,
    /// A pose older than this is not used.
    #[schemars(range(min = 10, max = 10_000))]
    pub location_max_age_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            strict_paper: false,
            rise_m: 0.080,
            unlock_m: 0.040,
            half_window_min: 2,
            half_window_max: 128,
            noise_m: 1.0,
            gate_m: 1.5,
            edge_m: 0.050,
            recess_tolerance_m: 0.060,
            edge_readings: 3,
            edge_run_m: 0.08,
            edge_lag_ratio: 0.20,
            edge_lag_sigma_ratio: 0.08,
            confirm_share: 0.30,
            entrance_m: 0.10,
            standstill_mps: 0.01,
            max_age_ms: 300,
            location_max_age_ms: 1000,
        }
    }
}

impl Params {
    pub(crate) fn max_age(&self) -> Duration {
        Duration::from_millis(self.max_age_ms)
    }

    pub(crate) fn location_max_age(&self) -> Duration {
        Duration::from_millis(self.location_max_age_ms)
    }

    /// Readings in half a window: as many as the sensor gives of a door (X-26, COF-112).
    pub(crate) fn half_window(&self, door_width_m: f64, speed_mps: f64, period_s: f64) -> usize {
        let readings = (door_width_m / (speed_mps.abs() * period_s)).round();
        let (min, max) = (f64::from(self.half_window_min), f64::from(self.half_window_max));
        // NaN, as of a robot that stands, is the widest window.
        if readings.is_nan() { max as usize } else { readings.clamp(min, max) as usize }
    }
}

/// Parameters that make no sense.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A window whose smallest size is its largest.
    #[error("half_window_max = {max} is below half_window_min = {min}; raise half_window_max")]
    NoWindow {
        /// Smallest half.
        min: u32,
        /// Largest half.
        max: u32,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.half_window_max < self.half_window_min {
            return Err(ParamsError::NoWindow { min: self.half_window_min, max: self.half_window_max });
        }
        Ok(())
    }
}
