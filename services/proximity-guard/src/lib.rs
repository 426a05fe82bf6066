//! Says whether the robot may drive: GO while the ultrasonic sensor watches ahead and sees nothing nearer
//! than the threshold in two of three readings (NXT-024, NXT-091, NXT-092, X-05). `base-driver` lets the
//! robot drive back, away from what is too near ahead, and nowhere else.
//!
//! The sensor looks ahead only, and not at all while it turns around for a scan: then the guard says STOP.
//! What lies at the sides and behind it does not know, and says so: 0 m. A robot with this guard moves by the
//! orders of a service that has looked around (`base-driver`, room "ordered").
//!
//! "No echo" is the answer of an open space, and also that of a sensor that is deaf. It counts as free only
//! while echoes are heard now and then, ahead or in a scan.

mod hearing;
mod params;

#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError};

use hearing::Hearing;
use messages::{
    Clearance, Face, GuardReasonName, Odometry, Once, Parameters, RangeScan, SonarAhead, Stamped, Time,
    Verdict,
};

/// Readings that vote.
const VOTERS: usize = 3;
/// Votes that decide.
const MAJORITY: usize = 2;

/// What the guard looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest of `sonar/ahead`.
    pub ahead: Option<Stamped<'a, SonarAhead>>,
    /// The newest of `sonar/raw`: its echoes tell that the sensor hears.
    pub scan: Option<Stamped<'a, RangeScan>>,
    /// The newest of `wheels/odometry`: how far the robot has driven since.
    pub odometry: Option<Stamped<'a, Odometry>>,
}

/// What the guard says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `safety/clearance`.
    pub clearance: Clearance,
}

/// The guard. It begins with a STOP.
#[derive(Debug, Clone)]
pub struct ProximityGuard {
    params: Params,
    seen: Once,
    /// The last readings, the newest first.
    readings_m: [Option<f64>; VOTERS],
    hearing: Hearing,
    go: bool,
    changes: u64,
}

impl ProximityGuard {
    /// A guard that knows nothing.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self {
            params,
            seen: Once::default(),
            readings_m: [None; VOTERS],
            hearing: Hearing::default(),
            go: false,
            changes: 0,
        })
    }

    /// Takes a reading into the vote, and says how it stands.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        self.hearing.follow(inputs.odometry);
        self.hearing.hear_scan(inputs.scan);
        use GuardReasonName::{SensorFault, Start};
        let fresh = inputs.ahead.and_then(|ahead| ahead.fresh(now, self.params.max_age()));
        let (reason, violated_faces) = match fresh {
            None => {
                self.readings_m = [None; VOTERS];
                (if inputs.ahead.is_none() { Start } else { GuardReasonName::Stale }, 0)
            }
            Some(ahead) => match ahead.distance_m() {
                None => {
                    self.readings_m = [None; VOTERS];
                    (SensorFault, 0)
                }
                Some(distance_m) => {
                    self.hearing.hear(distance_m);
                    if self.seen.take(ahead).is_some() {
                        self.readings_m.rotate_right(1);
                        self.readings_m[0] = Some(distance_m);
                    }
                    match self.vote() {
                        (GuardReasonName::Clear, _) if !self.hearing.hears(self.params.deaf_way_m) => {
                            (if self.hearing.has_heard() { SensorFault } else { Start }, 0)
                        }
                        vote => vote,
                    }
                }
            },
        };
        let go = reason == GuardReasonName::Clear;
        self.changes += u64::from(go != self.go);
        self.go = go;
        let signal = if go { Verdict::Go } else { Verdict::Stop };
        // From the hull: the sensor sits above the centre of motion.
        let front_m = (self.front_m() - self.params.hull_front_m).max(0.0) as f32;
        let front_radius_m = (self.params.stop_distance_m - self.params.hull_front_m) as f32;
        Outputs {
            clearance: Clearance {
                signal: signal.into(),
                reason: reason.into(),
                violated_faces,
                front_m,
                front_radius_m,
                max_age_ms: self.params.max_age_ms,
                changes: self.changes,
                at_x_m: f64::NAN,
                at_y_m: f64::NAN,
                at_heading_rad: f64::NAN,
                // Nobody looks there.
                right_m: 0.0,
                left_m: 0.0,
                right_radius_m: 0.0,
                left_radius_m: 0.0,
            },
        }
    }

    fn vote(&self) -> (GuardReasonName, u32) {
        let count = |near: bool| {
            let votes = self.readings_m.iter().flatten();
            votes.filter(|distance_m| (**distance_m < self.params.stop_distance_m) == near).count()
        };
        if count(true) >= MAJORITY {
            (GuardReasonName::Violation, Face::Front as u32)
        } else if count(false) >= MAJORITY {
            (GuardReasonName::Clear, 0)
        } else {
            // The sensor has just begun to look.
            (GuardReasonName::Settling, 0)
        }
    }

    /// The middle of the readings there are; 0 without any.
    fn front_m(&self) -> f64 {
        let mut readings: Vec<f64> = self.readings_m.iter().flatten().copied().collect();
        readings.sort_by(f64::total_cmp);
        readings.get(readings.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
    }
}
