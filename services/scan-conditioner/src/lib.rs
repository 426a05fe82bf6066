//! Keeps the part of an ultrasonic scan that can be trusted: four windows at right angles that look straight
//! at walls (NXT-035, NXT-040 to NXT-044, X-15). Of every scan it also says where the nearest wall is, so
//! that the robot can turn to it.

mod nearest;
mod params;
mod ring;
mod windows;

#[cfg(test)]
mod tests;

pub use nearest::nearest;
pub use params::{Params, ParamsError};
pub use ring::Ring;
pub use windows::{Window, windows};

use messages::{Once, Parameters, RangeScan, SonarCommand, Stamped, Time, WallSurvey};

/// What the conditioner looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The next raw scan.
    pub raw: Option<Stamped<'a, RangeScan>>,
    /// The order that it answers: the newest of `sonar/command`.
    pub command: Option<Stamped<'a, SonarCommand>>,
}

/// What the conditioner says.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs<'a> {
    /// For `sonar/survey`: with every raw scan.
    pub survey: Option<WallSurvey>,
    /// For `sonar/scan`: with every raw scan to localise by. Readings that were not kept are zero.
    pub scan: Option<(RangeScan, &'a [f32])>,
}

/// The conditioner.
#[derive(Debug, Clone)]
pub struct ScanConditioner {
    params: Params,
    seen: Once,
    kept: Vec<f32>,
}

impl ScanConditioner {
    /// A conditioner that has seen nothing.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self { params, seen: Once::default(), kept: Vec::new() })
    }

    /// Looks at a scan; one that was given before is ignored.
    pub fn step(&mut self, _now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        let none = Outputs { survey: None, scan: None };
        let Some(raw) = inputs.raw.and_then(|raw| self.seen.take(raw)) else { return none };
        let order = inputs.command.map(|command| *command.message).unwrap_or_default();
        let mut survey = WallSurvey {
            command_id: order.command_id,
            bearing_rad: f64::NAN,
            range_m: f64::NAN,
            ..WallSurvey::default()
        };
        let Some(ring) = Ring::of_scan(raw.message, raw.elements) else {
            return Outputs { survey: Some(survey), scan: None };
        };
        if let Some((bearing_rad, range_m)) = nearest(&ring, &self.params) {
            (survey.bearing_rad, survey.range_m) = (bearing_rad, range_m);
        }
        if order.measure != 1 {
            return Outputs { survey: Some(survey), scan: None };
        }
        let first_rad = if order.window_rad.is_finite() { order.window_rad } else { 0.0 };
        self.kept.clear();
        self.kept.resize(ring.len(), 0.0);
        for (bit, window) in windows(&ring, first_rad, &self.params).iter().enumerate() {
            if window.is_kept {
                survey.kept_windows |= 1 << bit;
                for index in ring.around(window.centre, window.half) {
                    self.kept[index] = ring.range_m(index).unwrap_or(0.0) as f32;
                }
            }
        }
        survey.readings = self.kept.iter().filter(|range_m| **range_m > 0.0).count() as u32;
        Outputs { survey: Some(survey), scan: Some((*raw.message, &self.kept)) }
    }
}
