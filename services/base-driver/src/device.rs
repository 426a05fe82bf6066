//! The seam to the motor controller.

use messages::{Stamped, Time, WorldTruth};
use std::time::Duration;

/// What two encoders have counted since they were switched on, forward positive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WheelTravel {
    /// Path of the left wheel's rim in metres.
    pub left_m: f64,
    /// Path of the right wheel's rim in metres.
    pub right_m: f64,
}

/// A reading of both encoders.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Encoders {
    /// When it was taken.
    pub taken: Time,
    /// What they had counted then.
    pub travel: WheelTravel,
}

impl WheelTravel {
    /// Whether both numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.left_m.is_finite() && self.right_m.is_finite()
    }
}

/// Why a motor controller cannot be used now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// It was never heard.
    #[error("the motor controller has not answered yet")]
    NeverHeard,
    /// It was last heard too long ago.
    #[error("the motor controller has been silent for {silent_ms} ms")]
    Silent {
        /// For how long.
        silent_ms: u64,
    },
}

/// What a motor controller has to offer. The wheels' speeds reach it by [`BaseDevice::drive`], after every
/// step.
pub trait BaseDevice: std::fmt::Debug {
    /// The newest truth, shown before every step. Only simulated motors look at it.
    fn see(&mut self, _truth: Option<Stamped<'_, WorldTruth>>) {}

    /// What the encoders have counted.
    ///
    /// # Errors
    /// When the controller does not answer; the wheels are then told to stop.
    fn encoders(&mut self, now: Time) -> Result<Encoders, DeviceError>;

    /// Tells the motors their speeds. A controller must stop its motors by itself when it hears nothing for
    /// [`crate::Params::motor_watchdog_ms`].
    ///
    /// # Errors
    /// When the controller does not answer.
    fn drive(&mut self, left_mps: f64, right_mps: f64) -> Result<(), DeviceError>;
}

/// The motors of the simulator: it reads `wheels/applied` itself, and its encoders stand in `world/truth`.
#[derive(Debug, Clone)]
pub struct SimulatedBase {
    deadline: Duration,
    heard: Option<Encoders>,
}

impl SimulatedBase {
    /// A controller not heard yet, which counts as silent after `deadline`.
    pub fn new(deadline: Duration) -> Self {
        Self { deadline, heard: None }
    }
}

impl BaseDevice for SimulatedBase {
    fn see(&mut self, truth: Option<Stamped<'_, WorldTruth>>) {
        if let Some(truth) = truth {
            let travel = WheelTravel { left_m: truth.left_travel_m, right_m: truth.right_travel_m };
            self.heard = Some(Encoders { taken: truth.stamp, travel });
        }
    }

    fn encoders(&mut self, now: Time) -> Result<Encoders, DeviceError> {
        let heard = self.heard.ok_or(DeviceError::NeverHeard)?;
        let silent = now.since(heard.taken);
        if silent <= self.deadline {
            Ok(heard)
        } else {
            Err(DeviceError::Silent { silent_ms: u64::try_from(silent.as_millis()).unwrap_or(u64::MAX) })
        }
    }

    fn drive(&mut self, _left_mps: f64, _right_mps: f64) -> Result<(), DeviceError> {
        Ok(())
    }
}
