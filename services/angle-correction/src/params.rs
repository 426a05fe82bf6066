//! What can be adjusted.

use geometry::world::WorldError;
use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The parameters of `angle-correction`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The world file with walls, doors and marked areas; without one nothing is ever measured.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Whether to measure also along every wall that the world file shows free of doors, not only in its
    /// marked areas (X-2A).
    pub generate_areas: bool,
    /// A generated area keeps this far from a door's edge: at least the sensors' base plus 0.1 m (X-2A).
    #[schemars(range(min = 0.377, max = 3.0))]
    pub door_margin_m: f64,
    /// Both readings of a side must be below this: half of the hallway's width (COF-086).
    #[schemars(range(min = 0.05, max = 4.0))]
    pub half_hallway_m: f64,
    /// Frames that make an average; the first frame in an area is published at once, alone (COF-084, X-22).
    #[schemars(range(min = 1, max = 25))]
    pub averaged_frames: u32,
    /// The most frames that an average holds (X-22: 25 for a standard deviation of 0.3 degrees).
    #[schemars(range(min = 1, max = 500))]
    pub window_frames: u32,
    /// Angles of at least this are marked as worth a correction; the default is 5 degrees (COF-092, X-21).
    #[schemars(range(min = 0.0, max = 1.5))]
    pub correct_from_rad: f64,
    /// Standard deviation of a reading (COF-021).
    #[schemars(range(min = 0.0001, max = 0.1))]
    pub range_sigma_m: f64,
    /// What averaging cannot take away: uneven walls and sensors mounted askew (COF-093).
    #[schemars(range(min = 0.0, max = 0.2))]
    pub mounting_sigma_rad: f64,
    /// A front reading below this is an unexpected obstacle, and nothing is measured (COF-091).
    #[schemars(range(min = 0.0, max = 4.0))]
    pub obstacle_m: f64,
    /// Readings older than this are not used.
    #[schemars(range(min = 10, max = 5000))]
    pub ranges_max_age_ms: u64,
    /// A pose older than this is not used.
    #[schemars(range(min = 10, max = 10_000))]
    pub location_max_age_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            generate_areas: true,
            door_margin_m: 0.377,
            half_hallway_m: 0.850,
            averaged_frames: 5,
            window_frames: 25,
            correct_from_rad: 5.0_f64.to_radians(),
            range_sigma_m: 0.005,
            mounting_sigma_rad: 0.2_f64.to_radians(),
            obstacle_m: 0.200,
            ranges_max_age_ms: 300,
            location_max_age_ms: 1000,
        }
    }
}

impl Params {
    pub(crate) fn ranges_max_age(&self) -> Duration {
        Duration::from_millis(self.ranges_max_age_ms)
    }

    pub(crate) fn location_max_age(&self) -> Duration {
        Duration::from_millis(self.location_max_age_ms)
    }
}

/// Parameters that make no sense.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// An average that needs more frames than it may hold.
    #[error("window_frames = {window_frames} is below averaged_frames = {averaged_frames}; widen the window")]
    NarrowWindow {
        /// Frames that an average may hold.
        window_frames: u32,
        /// Frames that it needs.
        averaged_frames: u32,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let (window_frames, averaged_frames) = (self.window_frames, self.averaged_frames);
        if window_frames < averaged_frames {
            return Err(ParamsError::NarrowWindow { window_frames, averaged_frames });
        }
        Ok(())
    }
}
