//! An ultrasonic sensor on a servo above the robot's centre of motion (NXT-012, NXT-013, NXT-030 to NXT-037).
//! On an order it turns once around and publishes a scan with a reading a degree; then it turns back and
//! watches ahead (NXT-025 to NXT-027).

mod params;
mod simulated;

#[cfg(test)]
mod tests;

pub use params::{Device, NoiseProfile, Params, ParamsError};
pub use simulated::SimulatedSonar;

use messages::{
    Parameters, RangeScan, SonarAhead, SonarCommand, SonarModeName, SonarStatusName, Stamped, Time,
    WorldTruth,
};
use std::f64::consts::TAU;

/// Why the sensor cannot be read now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// It was never heard.
    #[error("the sensor has not answered yet")]
    NeverHeard,
    /// It was last heard too long ago.
    #[error("the sensor has been silent for {silent_ms} ms")]
    Silent {
        /// For how long.
        silent_ms: u64,
    },
}

/// What one ping brings back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// An echo from this distance.
    Echo {
        /// Half of the way of the sound.
        range_m: f64,
    },
    /// No echo: the code 255 of the NXT sensor.
    Nothing,
    /// Nearer than the sensor can measure.
    TooNear,
}

/// What a turning sensor has to offer.
pub trait UltrasonicDevice: std::fmt::Debug {
    /// The newest truth, shown before every reading. Only simulated sensors look at it.
    fn see(&mut self, _truth: Option<Stamped<'_, WorldTruth>>) {}

    /// Turns the servo so that the sensor looks along `direction_rad` in the robot's frame, and pings.
    ///
    /// # Errors
    /// When the sensor does not answer.
    fn ping(&mut self, now: Time, direction_rad: f64) -> Result<Reading, DeviceError>;
}

/// What the driver looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest order.
    pub command: Option<Stamped<'a, SonarCommand>>,
    /// The newest of `world/truth`, for simulated sensors.
    pub truth: Option<Stamped<'a, WorldTruth>>,
}

/// What the driver says.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs<'a> {
    /// For `sonar/raw`: a whole scan, when the last reading of it was taken.
    pub scan: Option<(RangeScan, &'a [f32])>,
    /// For `sonar/ahead`: while the sensor watches ahead.
    pub ahead: Option<SonarAhead>,
}

/// What the servo is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    /// It looks ahead.
    Watching,
    /// So many readings of a scan are taken.
    Scanning(usize),
    /// It turns back, so many readings' turns are left; then it watches or stays silent.
    Returning { left: f64, then_watch: bool },
    /// It looks ahead, and nobody wants to know.
    Silent,
}

/// The driver: a sensor, and what its servo is doing.
#[derive(Debug)]
pub struct UltrasonicDriver {
    params: Params,
    device: Box<dyn UltrasonicDevice>,
    task: Task,
    obeyed: u64,
    ranges: Vec<f32>,
}

impl UltrasonicDriver {
    /// A driver of the sensor that the parameters name. `seed` is for simulated ones.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        let device = params.open_device(seed)?;
        Self::with_device(params, device)
    }

    /// A driver of this sensor.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn with_device(params: Params, device: Box<dyn UltrasonicDevice>) -> Result<Self, ParamsError> {
        params.check()?;
        let ranges = Vec::with_capacity(params.readings as usize);
        Ok(Self { params, device, task: Task::Watching, obeyed: 0, ranges })
    }

    /// Takes the readings of one period.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        self.device.see(inputs.truth);
        if let Some(command) = inputs.command {
            self.obey(command.message);
        }
        let per_period = f64::from(self.params.period_ms) / f64::from(self.params.reading_ms);
        match self.task {
            Task::Watching => {
                let ahead = ahead(self.device.ping(now, 0.0), &self.params);
                Outputs { scan: None, ahead }
            }
            Task::Silent => Outputs { scan: None, ahead: None },
            Task::Returning { left, then_watch } => {
                let left = left - per_period * self.params.return_speedup;
                self.task = match (left > 0.0, then_watch) {
                    (true, _) => Task::Returning { left, then_watch },
                    (false, true) => Task::Watching,
                    (false, false) => Task::Silent,
                };
                Outputs { scan: None, ahead: None }
            }
            Task::Scanning(taken) => self.scan(now, taken, per_period.max(1.0) as usize),
        }
    }

    fn obey(&mut self, command: &SonarCommand) {
        if command.command_id == 0 || command.command_id == self.obeyed {
            return;
        }
        self.obeyed = command.command_id;
        // The servo turns back the way it came.
        let left = match self.task {
            Task::Scanning(taken) => taken as f64,
            Task::Returning { left, .. } => left,
            Task::Watching | Task::Silent => 0.0,
        };
        self.task = match command.mode.get() {
            Ok(SonarModeName::Ultrascan) => {
                self.ranges.clear();
                Task::Scanning(0)
            }
            Ok(SonarModeName::WatchAhead) => Task::Returning { left, then_watch: true },
            Ok(SonarModeName::Return) => Task::Returning { left, then_watch: false },
            // An order without a meaning changes nothing.
            Err(_) => self.task,
        };
    }

    fn scan(&mut self, now: Time, taken: usize, more: usize) -> Outputs<'_> {
        let count = self.params.readings as usize;
        let step_rad = TAU / count as f64;
        let range_max_m = self.params.range_max_m;
        for index in taken..(taken + more).min(count) {
            let range_m = match self.device.ping(now, index as f64 * step_rad) {
                Ok(Reading::Echo { range_m }) => range_m.min(range_max_m),
                Ok(Reading::TooNear) => self.params.range_min_m,
                Ok(Reading::Nothing) => range_max_m,
                Err(_) => 0.0,
            };
            self.ranges.push(range_m as f32);
        }
        if self.ranges.len() < count {
            self.task = Task::Scanning(self.ranges.len());
            return Outputs { scan: None, ahead: None };
        }
        self.task = Task::Returning { left: count as f64, then_watch: true };
        // As the readings have it, in single precision: "nothing" must not lie below it.
        let range_max_m = f64::from(range_max_m as f32);
        let header = RangeScan { angle_step_rad: step_rad, range_max_m, ..RangeScan::default() };
        Outputs { scan: Some((header, &self.ranges)), ahead: None }
    }
}

fn ahead(reading: Result<Reading, DeviceError>, params: &Params) -> Option<SonarAhead> {
    let (range_m, status) = match reading {
        Ok(Reading::Echo { range_m }) => (range_m, SonarStatusName::Echo),
        Ok(Reading::Nothing) => (params.range_max_m, SonarStatusName::Nothing),
        Ok(Reading::TooNear) => (params.range_min_m, SonarStatusName::TooNear),
        Err(DeviceError::NeverHeard) => return None,
        Err(DeviceError::Silent { .. }) => (0.0, SonarStatusName::Fault),
    };
    Some(SonarAhead { range_m, status: status.into(), reserved: 0 })
}
