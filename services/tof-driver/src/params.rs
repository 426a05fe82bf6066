//! The parameters of the time-of-flight driver.

use crate::{DeviceError, SimulatedTof, TofDevice};
use geometry::WorldError;
use messages::TOF_COUNT;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// Eight sensors that look at `world/truth`.
    #[default]
    Simulated,
}

/// The distance modes of a VL53L1X (note 2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DistanceMode {
    /// To 1.3 m, hardly troubled by light; a timing budget of 20 ms is enough.
    Short,
    /// To 2.9 m in the dark, 0.7 m in strong light: the paper's mode (COF-029).
    #[default]
    Medium,
    /// To 3.6 m in the dark, 4 m with a timing budget of 140 ms; 0.7 m in strong light.
    Long,
}

/// How much readings below the noisy range scatter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseProfile {
    /// The paper's ±5 mm (COF-021): a standard deviation of 5 mm.
    #[default]
    Paper,
    /// The manufacturer's ±20 mm in the dark, ±25 mm in strong light, taken as three standard deviations.
    Datasheet,
    /// No noise: for comparisons.
    None,
}

/// The parameters of the time-of-flight driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What measures.
    pub device: Device,
    /// The world file of the simulated device, relative to the working directory; empty for an empty plane.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// Time from one frame to the next. All sensors measure at the same time (X-2C).
    #[schemars(range(min = 24, max = 1000))]
    pub period_ms: u32,
    /// How long a sensor collects light for a reading: at least 20 ms in the short mode and 33 ms in the
    /// others; 4 ms more must fit into the period.
    #[schemars(range(min = 20, max = 996))]
    pub timing_budget_ms: u32,
    /// The distance mode.
    pub mode: DistanceMode,
    /// Whether the sensors look into strong light.
    pub strong_light: bool,
    /// How much readings scatter.
    pub noise: NoiseProfile,
    /// Readings above this are noise (COF-030).
    #[schemars(range(min = 0.2, max = 4.0))]
    pub noise_above_m: f64,
    /// The share of readings above `noise_above_m` that are "no target".
    #[schemars(range(min = 0.0, max = 1.0))]
    pub no_target_fraction: f64,
    /// Height of the sensors above the floor (COF-026).
    #[schemars(range(min = 0.01, max = 2.0))]
    pub height_m: f64,
    /// Full field of view, across and upright (COF-021).
    #[schemars(range(min = 15.0, max = 27.0))]
    pub field_of_view_deg: f64,
    /// Rays across, and as many upright, in a simulated field of view.
    #[schemars(range(min = 1, max = 16))]
    pub rays_per_side: u32,
    /// What fills this share of the field of view is always seen; what fills less is seen in proportion.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub sure_fill_fraction: f64,
    /// Sensors that report a hardware failure, by number.
    pub broken_sensors: Vec<u32>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            device: Device::Simulated,
            world: String::new(),
            period_ms: 100,
            timing_budget_ms: 33,
            mode: DistanceMode::Medium,
            strong_light: false,
            noise: NoiseProfile::Paper,
            noise_above_m: 1.0,
            no_target_fraction: 0.5,
            height_m: 0.25,
            field_of_view_deg: 27.0,
            rays_per_side: 7,
            sure_fill_fraction: 0.2,
            broken_sensors: Vec::new(),
        }
    }
}

/// Why parameters of the time-of-flight driver are refused.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// The mode needs more light.
    #[error(
        "timing_budget_ms = {budget_ms} is below the {needed_ms} ms that mode {mode:?} needs; lengthen it"
    )]
    BudgetTooShort {
        /// The budget.
        budget_ms: u32,
        /// What the mode needs.
        needed_ms: u32,
        /// The mode.
        mode: DistanceMode,
    },
    /// No time for a reading.
    #[error(
        "period_ms = {period_ms} has no room for timing_budget_ms = {budget_ms} and 4 ms; lengthen the first or shorten the second"
    )]
    PeriodTooShort {
        /// The period.
        period_ms: u32,
        /// The budget.
        budget_ms: u32,
    },
    /// A sensor that does not exist.
    #[error("broken_sensors names {sensor}; the sensors are 0 to 7")]
    NoSuchSensor {
        /// The number.
        sensor: u32,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// The device does not answer.
    #[error("device: {0}")]
    Device(#[from] DeviceError),
}

impl DistanceMode {
    /// The shortest timing budget.
    pub fn shortest_budget_ms(self) -> u32 {
        match self {
            Self::Short => 20,
            Self::Medium | Self::Long => 33,
        }
    }

    /// The farthest reading.
    pub fn reach_m(self, strong_light: bool, timing_budget_ms: u32) -> f64 {
        match (self, strong_light) {
            (Self::Short, _) => 1.3,
            (Self::Medium | Self::Long, true) => 0.7,
            (Self::Medium, false) => 2.9,
            (Self::Long, false) if timing_budget_ms >= 140 => 4.0,
            (Self::Long, false) => 3.6,
        }
    }
}

impl Params {
    /// From frame to frame.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }

    /// The farthest reading of their mode.
    pub fn reach_m(&self) -> f64 {
        self.mode.reach_m(self.strong_light, self.timing_budget_ms)
    }

    /// The sensors that they name. `seed` is for simulated ones.
    ///
    /// # Errors
    /// When the world file cannot be used.
    pub fn open_device(&self, seed: u64) -> Result<Box<dyn TofDevice>, ParamsError> {
        match self.device {
            Device::Simulated => Ok(Box::new(SimulatedTof::new(self.clone(), seed)?)),
        }
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let (period_ms, budget_ms, mode) = (self.period_ms, self.timing_budget_ms, self.mode);
        let needed_ms = mode.shortest_budget_ms();
        if budget_ms < needed_ms {
            return Err(ParamsError::BudgetTooShort { budget_ms, needed_ms, mode });
        }
        if period_ms < budget_ms + 4 {
            return Err(ParamsError::PeriodTooShort { period_ms, budget_ms });
        }
        match self.broken_sensors.iter().find(|&&sensor| sensor as usize >= TOF_COUNT) {
            Some(&sensor) => Err(ParamsError::NoSuchSensor { sensor }),
            None => Ok(()),
        }
    }
}
