//! The parameters of the base driver.

use crate::{BaseDevice, SimulatedBase};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What drives the wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// The motors of the simulator: encoders from `world/truth`.
    #[default]
    Simulated,
}

/// The parameters of the base driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What drives the wheels.
    pub device: Device,
    /// A step at least so often, and odometry exactly so often.
    #[schemars(range(min = 5, max = 50))]
    pub period_ms: u32,
    /// The wheels stop when the guard's last GO is older. The guard speaks at least every 50 ms, so 100 ms is one word missed.
    #[schemars(range(min = 10, max = 1000))]
    pub guard_deadline_ms: u32,
    /// The wheels stop when the last command is older. A controller at 20 Hz may be a whole period late and not more: a longer
    /// deadline would only hide that it missed a step, and a stop of a few milliseconds is smoothed by the motors' own ramps.
    #[schemars(range(min = 10, max = 1000))]
    pub command_deadline_ms: u32,
    /// The wheels stop when the encoders were last heard longer ago.
    #[schemars(range(min = 10, max = 1000))]
    pub device_deadline_ms: u32,
    /// A command with a wheel faster than this is nonsense.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub max_wheel_speed_mps: f64,
    /// A wheel gains speed no faster than this; it loses speed as fast as the motor can.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub max_speed_up_m_per_s2: f64,
    /// Distance between the middles of the two driven wheels.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub wheel_track_m: f64,
    /// Whether a STOP for something in front only lets a slow command backwards pass, so that the robot can free itself.
    pub allow_escape: bool,
    /// The fastest wheel of such a command.
    #[schemars(range(min = 0.01, max = 0.3))]
    pub escape_speed_mps: f64,
    /// How far it may lead, for each STOP.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub escape_distance_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            device: Device::Simulated,
            period_ms: 20,
            guard_deadline_ms: 100,
            command_deadline_ms: 100,
            device_deadline_ms: 100,
            max_wheel_speed_mps: 1.0,
            max_speed_up_m_per_s2: 0.6,
            wheel_track_m: 0.40,
            allow_escape: true,
            escape_speed_mps: 0.12,
            escape_distance_m: 0.35,
        }
    }
}

/// Why parameters of the base driver are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A number outside of what is possible.
    #[error("{name} = {value} is not within {min} to {max}; choose a value in that range")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest possible value.
        min: f64,
        /// Largest possible value.
        max: f64,
    },
    /// The driver would sleep through a deadline.
    #[error(
        "{name} = {deadline_ms} is shorter than period_ms = {period_ms}; lengthen the deadline or shorten the period"
    )]
    DeadlineBelowPeriod {
        /// The deadline.
        name: &'static str,
        /// Its value.
        deadline_ms: u32,
        /// The period.
        period_ms: u32,
    },
    /// Backing out faster than driving.
    #[error("escape_speed_mps = {escape_mps} is above max_wheel_speed_mps = {max_mps}; lower the first")]
    EscapeTooFast {
        /// The escape speed.
        escape_mps: f64,
        /// The wheels' limit.
        max_mps: f64,
    },
}

impl Params {
    /// The motor controller that they name.
    pub fn open_device(&self) -> Box<dyn BaseDevice> {
        match self.device {
            Device::Simulated => {
                Box::new(SimulatedBase::new(Duration::from_millis(self.device_deadline_ms.into())))
            }
        }
    }

    /// Between two steps without a message.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check(&self) -> Result<(), ParamsError> {
        let deadlines = [
            ("guard_deadline_ms", self.guard_deadline_ms),
            ("command_deadline_ms", self.command_deadline_ms),
            ("device_deadline_ms", self.device_deadline_ms),
        ];
        within("period_ms", self.period_ms.into(), 5.0, 50.0)?;
        for (name, deadline_ms) in deadlines {
            within(name, deadline_ms.into(), 10.0, 1000.0)?;
            if deadline_ms < self.period_ms {
                return Err(ParamsError::DeadlineBelowPeriod {
                    name,
                    deadline_ms,
                    period_ms: self.period_ms,
                });
            }
        }
        within("max_wheel_speed_mps", self.max_wheel_speed_mps, 0.05, 3.0)?;
        within("max_speed_up_m_per_s2", self.max_speed_up_m_per_s2, 0.05, 10.0)?;
        within("wheel_track_m", self.wheel_track_m, 0.05, 2.0)?;
        within("escape_speed_mps", self.escape_speed_mps, 0.01, 0.3)?;
        within("escape_distance_m", self.escape_distance_m, 0.01, 1.0)?;
        if self.escape_speed_mps > self.max_wheel_speed_mps {
            let (escape_mps, max_mps) = (self.escape_speed_mps, self.max_wheel_speed_mps);
            return Err(ParamsError::EscapeTooFast { escape_mps, max_mps });
        }
        Ok(())
    }
}

fn within(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), ParamsError> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(ParamsError::OutOfRange { name, value, min, max }) }
}
