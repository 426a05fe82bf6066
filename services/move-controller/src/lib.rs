//! Carries out single motions: Move, Turn, and Turnback when a wall is too near (NXT-020 to NXT-024). While
//! it drives ahead it watches what lies there, slows down before it, and drives back where the guard says
//! STOP; the report tells that to the service that ordered the motion.

mod motion;
mod params;

#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError};

use messages::{
    Clearance, GuardReasonName, MotionCommand, MotionReport, MotionStateName, Odometry, Parameters, Stamped,
    Time, Verdict, WheelSpeeds,
};
use motion::{Motion, Phase};
use std::time::Duration;

/// Odometry and words of the guard that are older are not used.
const MAX_AGE: Duration = Duration::from_millis(150);

/// What the controller looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The motion that is wanted.
    pub command: Option<Stamped<'a, MotionCommand>>,
    /// How far the wheels have gone.
    pub odometry: Option<Stamped<'a, Odometry>>,
    /// What the guard says.
    pub clearance: Option<Stamped<'a, Clearance>>,
}

/// What the controller says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `wheels/desired`.
    pub desired: WheelSpeeds,
    /// For `motion/report`.
    pub report: MotionReport,
}

/// The controller.
#[derive(Debug, Clone)]
pub struct MoveController {
    params: Params,
    motion: Option<Motion>,
    refused: Option<u64>,
    last_odometry: Option<Odometry>,
}

/// What the guard's word means for a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ahead {
    /// Free, with the nearest thing so far beyond the place where the guard stops the robot; negative where
    /// that is unclear.
    Free(f64),
    /// Something is too near.
    TooNear,
    /// Nobody knows.
    Unknown,
}

impl MoveController {
    /// A controller at rest.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self { params, motion: None, refused: None, last_odometry: None })
    }

    /// Goes on with the motion.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if let Some(command) = inputs.command {
            self.accept(command.message);
        }
        let odometry = inputs.odometry.and_then(|odometry| odometry.fresh(now, MAX_AGE));
        let usable = odometry.filter(|odometry| odometry.pose().is_ok() && is_finite(odometry));
        if let Some(odometry) = usable {
            let last = self.last_odometry.replace(*odometry);
            if let (Some(motion), Some(last)) = (&mut self.motion, last) {
                motion.follow(&last, odometry.message);
            }
        }
        let ahead = ahead(now, inputs.clearance);
        let desired = match (&mut self.motion, usable) {
            (Some(motion), Some(odometry)) => motion.steer(now, &self.params, ahead, odometry.message),
            _ => WheelSpeeds::ZERO,
        };
        Outputs { desired, report: self.report() }
    }

    fn accept(&mut self, command: &MotionCommand) {
        let id = command.command_id;
        let known = self.motion.as_ref().is_some_and(|motion| motion.id == id) || self.refused == Some(id);
        if id == 0 || known {
            return;
        }
        self.motion = Motion::new(command);
        self.refused = self.motion.is_none().then_some(id);
    }

    fn report(&self) -> MotionReport {
        let Some(motion) = &self.motion else {
            let state = if self.refused.is_some() { MotionStateName::Refused } else { MotionStateName::Idle };
            return MotionReport {
                command_id: self.refused.unwrap_or(0),
                state: state.into(),
                ..MotionReport::default()
            };
        };
        let state = match motion.phase {
            Phase::Running | Phase::Retreating { .. } => MotionStateName::Running,
            Phase::Ended(state) => state,
        };
        MotionReport {
            command_id: motion.id,
            travelled_m: motion.travelled_m,
            turned_rad: motion.turned_rad,
            retreated_m: motion.retreated_m,
            state: state.into(),
            reserved: 0,
        }
    }
}

fn is_finite(odometry: &Odometry) -> bool {
    [odometry.left_travel_m, odometry.right_travel_m, odometry.forward_mps, odometry.turn_rad_per_s]
        .iter()
        .all(|number| number.is_finite())
}

fn ahead(now: Time, clearance: Option<Stamped<'_, Clearance>>) -> Ahead {
    let Some(word) = clearance.and_then(|word| word.fresh(now, MAX_AGE)) else { return Ahead::Unknown };
    match (word.signal.get(), word.reason.get()) {
        (Ok(Verdict::Go), Ok(_)) if !(word.front_m - word.front_radius_m).is_nan() => {
            Ahead::Free(f64::from(word.front_m) - f64::from(word.front_radius_m))
        }
        (Ok(Verdict::Stop), Ok(GuardReasonName::Violation)) => Ahead::TooNear,
        _ => Ahead::Unknown,
    }
}
