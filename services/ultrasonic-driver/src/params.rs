//! The parameters of the ultrasonic driver.

use crate::{DeviceError, SimulatedSonar, UltrasonicDevice};
use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// A sensor that looks at `world/truth`.
    #[default]
    Simulated,
}

/// How readings err.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseProfile {
    /// A cone whose nearest echo counts, with a centimetre of noise that grows with the angle of incidence,
    /// lost and late echoes, a least and a largest range (NXT-032 to NXT-034, NXT-037, NXT-101).
    #[default]
    Paper,
    /// As the BotSim simulator has it (note 1.2): a single ray whose end scatters in x and in y, and no
    /// largest range.
    Botsim,
    /// A cone without any error: for comparisons.
    None,
}

/// The parameters of the ultrasonic driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What measures.
    pub device: Device,
    /// The world file of the simulated device, relative to the working directory; empty for an empty plane.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Time from one step to the next, and from one look ahead to the next.
    #[schemars(range(min = 5, max = 200))]
    pub period_ms: u32,
    /// Readings of a scan, evenly all around (NXT-027: one a degree).
    #[schemars(range(min = 8, max = 3600))]
    pub readings: u32,
    /// How long the sensor takes for a reading of a scan, the servo's turn included.
    #[schemars(range(min = 1, max = 200))]
    pub reading_ms: u32,
    /// How many times faster than in a scan the servo turns back.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub return_speedup: f64,
    /// The smallest reading: nothing nearer can be measured (note 1.3, unconfirmed).
    #[schemars(range(min = 0.0, max = 0.2))]
    pub range_min_m: f64,
    /// The largest reading, which says that there was no echo: 255 cm.
    #[schemars(range(min = 0.3, max = 20.0))]
    pub range_max_m: f64,
    /// Half of the cone's opening angle (X-06, unconfirmed).
    #[schemars(range(min = 0.0, max = 45.0))]
    pub half_cone_deg: f64,
    /// Angle from one ray of the simulated cone to the next.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub ray_step_deg: f64,
    /// How readings err.
    pub noise: NoiseProfile,
    /// Standard deviation of a reading straight on a wall (NXT-101).
    #[schemars(range(min = 0.0, max = 0.2))]
    pub sigma_m: f64,
    /// The sensor counts whole steps of this; 0 means no steps.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub resolution_m: f64,
    /// Weak echoes are noticed late: by this times `sigma_m` times the squared tangent of the angle of
    /// incidence (NXT-034), up to `latest_m`.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub incidence_growth: f64,
    /// The most by which an echo is noticed late.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub latest_m: f64,
    /// An edge, where a wall ends, is heard as well as a wall that is met at this angle of incidence. Corners
    /// are heard well.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub edge_deg: f64,
    /// Angle of incidence from which echoes begin to be lost.
    #[schemars(range(min = 0.0, max = 89.0))]
    pub lost_from_deg: f64,
    /// Angle of incidence from which `lost_share` of the echoes is lost.
    #[schemars(range(min = 1.0, max = 90.0))]
    pub lost_to_deg: f64,
    /// The share of echoes that is lost from `lost_to_deg` on.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lost_share: f64,
    /// The share of lost echoes that come back late, by way of another wall; the others give no reading.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub late_share: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            device: Device::Simulated,
            world: String::new(),
            period_ms: 20,
            readings: 360,
            reading_ms: 5,
            return_speedup: 4.0,
            range_min_m: 0.03,
            range_max_m: 2.55,
            half_cone_deg: 15.0,
            ray_step_deg: 1.0,
            noise: NoiseProfile::Paper,
            sigma_m: 0.01,
            resolution_m: 0.01,
            incidence_growth: 3.0,
            latest_m: 0.30,
            edge_deg: 45.0,
            lost_from_deg: 25.0,
            lost_to_deg: 60.0,
            lost_share: 0.6,
            late_share: 0.7,
        }
    }
}

/// Why parameters of the ultrasonic driver are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Two bounds the wrong way around.
    #[error("{low_name} = {low} is not below {high_name} = {high}; lower the first")]
    BoundsCross {
        /// The lower one.
        low_name: &'static str,
        /// Its value.
        low: f64,
        /// The upper one.
        high_name: &'static str,
        /// Its value.
        high: f64,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// The device does not answer.
    #[error("device: {0}")]
    Device(#[from] DeviceError),
}

impl Params {
    /// From step to step.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }

    /// The sensor that they name. `seed` is for simulated ones.
    ///
    /// # Errors
    /// When the world file cannot be used.
    pub fn open_device(&self, seed: u64) -> Result<Box<dyn UltrasonicDevice>, ParamsError> {
        match self.device {
            Device::Simulated => Ok(Box::new(SimulatedSonar::new(self.clone(), seed)?)),
        }
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let (low, high) = (self.lost_from_deg, self.lost_to_deg);
        if low >= high {
            let (low_name, high_name) = ("lost_from_deg", "lost_to_deg");
            return Err(ParamsError::BoundsCross { low_name, low, high_name, high });
        }
        Ok(())
    }
}
