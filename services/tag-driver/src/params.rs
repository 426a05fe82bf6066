//! The parameters of the tag driver.

use crate::{DeviceError, SimulatedTag, TagDevice};
use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// A tag that looks at `world/truth`.
    #[default]
    Simulated,
}

/// The parameters of the tag driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What measures.
    pub device: Device,
    /// The world file with the anchors, relative to the working directory; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Time from one message to the next; the module manages ten a second.
    #[schemars(range(min = 100, max = 10000))]
    pub period_ms: u32,
    /// Anchors farther away than this are not heard.
    #[schemars(range(min = 1.0, max = 200.0))]
    pub reach_m: f64,
    /// Standard deviation of a distance.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub sigma_m: f64,
    /// The share of distances that are wrong: too long, by `outlier_m`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub outlier_fraction: f64,
    /// By how much wrong distances are too long, as radio that came a longer way.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub outlier_m: f64,
    /// The share of distances that are missing.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drop_out_fraction: f64,
    /// Anchors that are never heard, by number.
    pub dead_anchors: Vec<u32>,
    /// How far forward of the robot's centre the antenna sits.
    #[schemars(range(min = -2.0, max = 2.0))]
    pub antenna_x_m: f64,
    /// How far to the left of the robot's centre the antenna sits.
    #[schemars(range(min = -2.0, max = 2.0))]
    pub antenna_y_m: f64,
    /// How far above the floor the antenna sits.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub antenna_z_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            device: Device::Simulated,
            world: String::new(),
            period_ms: 100,
            reach_m: 20.0,
            sigma_m: 0.10,
            outlier_fraction: 0.02,
            outlier_m: 1.0,
            drop_out_fraction: 0.02,
            dead_anchors: Vec::new(),
            antenna_x_m: 0.0,
            antenna_y_m: 0.0,
            antenna_z_m: 1.0,
        }
    }
}

/// Why parameters of the tag driver are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// A dead anchor that the world does not have: surely a slip of the pen.
    #[error("dead_anchors names {id:#06x}, which the world {world:?} does not have; correct the number")]
    NoSuchAnchor {
        /// The number.
        id: u32,
        /// The world file.
        world: String,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// The device does not answer.
    #[error("device: {0}")]
    Device(#[from] DeviceError),
}

impl Params {
    /// From message to message.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }

    /// The tag that they name. `seed` is for a simulated one.
    ///
    /// # Errors
    /// When the world file cannot be used, or has no anchor that `dead_anchors` names.
    pub fn open_device(&self, seed: u64) -> Result<Box<dyn TagDevice>, ParamsError> {
        match self.device {
            Device::Simulated => Ok(Box::new(SimulatedTag::new(self.clone(), seed)?)),
        }
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;
}
