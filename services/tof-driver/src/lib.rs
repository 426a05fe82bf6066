//! Eight VL53L1X time-of-flight sensors around the coffee robot (COF-020 to COF-030): one frame a period,
//! every reading with the status that the sensor gives it (note 2.1).

mod params;
mod simulated;

#[cfg(test)]
mod scene_tests;
#[cfg(test)]
mod tests;

pub use params::{Device, DistanceMode, NoiseProfile, Params, ParamsError};
pub use simulated::SimulatedTof;

use messages::{Parameters, RangeStatus, Stamped, TOF_COUNT, Time, TofRanges, WorldTruth};

/// Why the sensors cannot be read now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// They were never heard.
    #[error("the sensors have not answered yet")]
    NeverHeard,
    /// They were last heard too long ago.
    #[error("the sensors have been silent for {silent_ms} ms")]
    Silent {
        /// For how long.
        silent_ms: u64,
    },
}

/// What eight sensors on one bus have to offer.
pub trait TofDevice: std::fmt::Debug {
    /// The newest truth, shown before every reading. Only simulated sensors look at it.
    fn see(&mut self, _truth: Option<Stamped<'_, WorldTruth>>) {}

    /// A frame of all sensors.
    ///
    /// # Errors
    /// When the bus does not answer; a single broken sensor is a status in the frame.
    fn read(&mut self, now: Time) -> Result<TofRanges, DeviceError>;
}

/// What the driver looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest of `world/truth`, for simulated sensors.
    pub truth: Option<Stamped<'a, WorldTruth>>,
}

/// What the driver says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `tof/ranges`; nothing until the sensors have answered for the first time.
    pub ranges: Option<TofRanges>,
}

/// The driver: sensors, and what to say when they are silent.
#[derive(Debug)]
pub struct TofDriver {
    device: Box<dyn TofDevice>,
}

impl TofDriver {
    /// A driver of the sensors that the parameters name. `seed` is for simulated ones.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self { device: params.open_device(seed)? })
    }

    /// A driver of these sensors.
    pub fn with_device(device: Box<dyn TofDevice>) -> Self {
        Self { device }
    }

    /// One frame.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        self.device.see(inputs.truth);
        let ranges = match self.device.read(now) {
            Ok(ranges) => Some(ranges),
            Err(DeviceError::NeverHeard) => None,
            // A bus that fell silent is eight broken sensors, and not eight old readings.
            Err(DeviceError::Silent { .. }) => Some(ALL_BROKEN),
        };
        Outputs { ranges }
    }
}

/// A frame in which every sensor reports a hardware failure (status 5).
pub const ALL_BROKEN: TofRanges =
    TofRanges { range_m: [0.0; TOF_COUNT], status: [RangeStatus(5); TOF_COUNT] };
