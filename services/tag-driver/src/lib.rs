//! A DWM1001 radio tag: ten times a second its distances to the nearest anchors, and the module's own idea of
//! where it is (COF-130, note 2.3).

mod params;
mod position;
mod simulated;

#[cfg(test)]
mod tests;

pub use params::{Device, Params, ParamsError};
pub use position::position_from;
pub use simulated::SimulatedTag;

use messages::{Parameters, Stamped, TagRanges, Time, WorldTruth};

/// Why the tag cannot be read now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// It was never heard.
    #[error("the tag has not answered yet")]
    NeverHeard,
    /// It was last heard too long ago.
    #[error("the tag has been silent for {silent_ms} ms")]
    Silent {
        /// For how long.
        silent_ms: u64,
    },
}

/// What a tag has to offer.
pub trait TagDevice: std::fmt::Debug {
    /// The newest truth, shown before every reading. Only a simulated tag looks at it.
    fn see(&mut self, _truth: Option<Stamped<'_, WorldTruth>>) {}

    /// What the tag heard.
    ///
    /// # Errors
    /// When it does not answer.
    fn read(&mut self, now: Time) -> Result<TagRanges, DeviceError>;
}

/// What the driver looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest of `world/truth`, for a simulated tag.
    pub truth: Option<Stamped<'a, WorldTruth>>,
}

/// What the driver says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `tag/ranges`; nothing while the tag does not answer, so that a reader sees the age of what it has.
    pub ranges: Option<TagRanges>,
}

/// The driver.
#[derive(Debug)]
pub struct TagDriver {
    device: Box<dyn TagDevice>,
}

impl TagDriver {
    /// A driver of the tag that the parameters name. `seed` is for a simulated one.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self { device: params.open_device(seed)? })
    }

    /// A driver of this tag.
    pub fn with_device(device: Box<dyn TagDevice>) -> Self {
        Self { device }
    }

    /// One message.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        self.device.see(inputs.truth);
        Outputs { ranges: self.device.read(now).ok() }
    }
}
