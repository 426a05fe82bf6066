//! The last link of the chain: the wheels turn only while a fresh GO of the collision guard and a fresh, sound command are at
//! hand; whatever is missing, late or nonsense means zero at once. The encoders of the two wheels become odometry
//! (Siegwart and Nourbakhsh 2011, section 5.2.4, with exact arcs).

mod device;
mod odometry;
mod params;

#[cfg(test)]
mod tests;

pub use device::{BaseDevice, DeviceError, SimulatedBase, WheelTravel};
pub use odometry::Snapshot;
pub use params::{Device, Params, ParamsError};

use messages::{
    AppliedWheels, Clearance, DriveReasonName, Face, GuardReasonName, Odometry, Parameters, Stamped, Time,
    Verdict, WheelSpeeds,
};
use odometry::DeadReckoning;
use std::time::Duration;

/// What the driver looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The guard's newest word, from `safety/clearance`.
    pub clearance: Option<Stamped<'a, Clearance>>,
    /// The controller's newest wish, from `wheels/desired`.
    pub desired: Option<Stamped<'a, WheelSpeeds>>,
    /// What the encoders say now; `None` when the motor controller does not answer.
    pub travel: Option<WheelTravel>,
}

/// What the driver says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For the motors, and for `wheels/applied`: with every step.
    pub applied: AppliedWheels,
    /// For `wheels/odometry`: once a period.
    pub odometry: Option<Odometry>,
}

/// The driver's state. It begins safe: wheels at rest, nothing believed.
#[derive(Debug, Clone)]
pub struct BaseDriver {
    params: Params,
    applied: AppliedWheels,
    last_step: Option<Time>,
    escape_began: Option<WheelTravel>,
    reckoning: DeadReckoning,
}

/// What the driver makes of its inputs.
type Decision = Result<(WheelSpeeds, DriveReasonName), DriveReasonName>;

impl BaseDriver {
    /// A driver in its safe state.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let reckoning = DeadReckoning::new(params.wheel_track_m, params.period());
        Ok(Self { params, applied: AppliedWheels::default(), last_step: None, escape_began: None, reckoning })
    }

    /// What a successor needs so that the odometry goes on in the same frame; of the command nothing is kept, since who starts begins safe.
    pub fn snapshot(&self) -> Option<Snapshot> {
        self.reckoning.snapshot()
    }

    /// Takes over the odometry of a predecessor, before the first step.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.reckoning.restore(snapshot);
    }

    /// Decides what the wheels do from now on, and counts how far they went.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        let travel = inputs.travel.filter(WheelTravel::is_finite);
        let decision = self.decide(now, &inputs, travel);
        let (speeds, reason) = match decision {
            Ok((wanted, reason)) => (self.speed_up_gently(now, wanted), reason),
            Err(reason) => (WheelSpeeds::ZERO, reason),
        };
        let moved_before = moves(self.applied.reason.get().unwrap_or(DriveReasonName::Start));
        let late = matches!(reason, DriveReasonName::StaleGuard | DriveReasonName::StaleCommand);
        self.applied = AppliedWheels {
            left_mps: speeds.left_mps,
            right_mps: speeds.right_mps,
            deadline_misses: self.applied.deadline_misses + u64::from(late && moved_before),
            reason: reason.into(),
            reserved: 0,
        };
        self.last_step = Some(now);
        Outputs { applied: self.applied, odometry: self.reckoning.step(now, travel) }
    }

    /// The last word before the driver leaves: zero.
    pub fn leave(&mut self) -> AppliedWheels {
        let deadline_misses = self.applied.deadline_misses;
        let reason = DriveReasonName::ShuttingDown.into();
        self.applied = AppliedWheels { deadline_misses, reason, ..AppliedWheels::default() };
        self.applied
    }

    fn decide(&mut self, now: Time, inputs: &Inputs<'_>, travel: Option<WheelTravel>) -> Decision {
        use DriveReasonName::{
            DeviceFault, Driving, GuardStop, InvalidCommand, InvalidGuard, StaleCommand, StaleGuard,
        };
        let guard_deadline = Duration::from_millis(self.params.guard_deadline_ms.into());
        let command_deadline = Duration::from_millis(self.params.command_deadline_ms.into());

        let clearance =
            inputs.clearance.filter(|word| is_fresh(now, word.stamp, guard_deadline)).ok_or(StaleGuard)?;
        let verdict = clearance.signal.get().map_err(|_| InvalidGuard)?;
        let guard_reason = clearance.reason.get().map_err(|_| InvalidGuard)?;
        if verdict == Verdict::Go {
            self.escape_began = None;
            if clearance.violated_faces != 0 {
                return Err(InvalidGuard);
            }
        }
        let desired = inputs.desired.filter(|wish| is_fresh(now, wish.stamp, command_deadline)).ok_or(
            match verdict {
                Verdict::Go => StaleCommand,
                Verdict::Stop => GuardStop,
            },
        )?;
        let travel = travel.ok_or(DeviceFault)?;
        if verdict == Verdict::Stop {
            return self.escape(&clearance, guard_reason, *desired.message, travel).ok_or(GuardStop);
        }
        if desired.is_within(self.params.max_wheel_speed_mps) {
            Ok((*desired.message, Driving))
        } else {
            Err(InvalidCommand)
        }
    }

    /// Whether a command may pass although the guard says STOP: only slowly backwards, only away from something in front and
    /// nowhere else, and only so far.
    fn escape(
        &mut self,
        clearance: &Clearance,
        guard_reason: GuardReasonName,
        wanted: WheelSpeeds,
        travel: WheelTravel,
    ) -> Option<(WheelSpeeds, DriveReasonName)> {
        let in_front_only = clearance.violated_faces == Face::Front as u32;
        let known = matches!(
            guard_reason,
            GuardReasonName::Violation | GuardReasonName::Remembered | GuardReasonName::Settling
        );
        let allowed = -self.params.escape_speed_mps..=0.0;
        let backwards = allowed.contains(&wanted.left_mps) && allowed.contains(&wanted.right_mps);
        if !(self.params.allow_escape && in_front_only && known && backwards) {
            return None;
        }
        let began = *self.escape_began.get_or_insert(travel);
        let went_m = (began.left_m - travel.left_m).max(began.right_m - travel.right_m);
        (went_m < self.params.escape_distance_m).then_some((wanted, DriveReasonName::Escaping))
    }

    /// `wanted`, with no wheel gaining more speed than the limit allows since the last step. A wheel that is to turn the other
    /// way stops first.
    fn speed_up_gently(&self, now: Time, wanted: WheelSpeeds) -> WheelSpeeds {
        let seconds = self.last_step.map_or(0.0, |last| now.seconds_since(last));
        // After a long pause the step is that of one period: a pause is no reason to jump.
        let gain_mps = self.params.max_speed_up_m_per_s2 * seconds.min(self.params.period().as_secs_f64());
        WheelSpeeds {
            left_mps: gain_at_most(self.applied.left_mps, wanted.left_mps, gain_mps),
            right_mps: gain_at_most(self.applied.right_mps, wanted.right_mps, gain_mps),
        }
    }
}

fn gain_at_most(present_mps: f64, wanted_mps: f64, gain_mps: f64) -> f64 {
    let from_mps = if present_mps * wanted_mps > 0.0 { present_mps.abs() } else { 0.0 };
    wanted_mps.abs().min(from_mps + gain_mps).copysign(wanted_mps)
}

/// Whether the reason is one with which wheels may turn.
fn moves(reason: DriveReasonName) -> bool {
    matches!(reason, DriveReasonName::Driving | DriveReasonName::Escaping)
}

/// Not older than the deadline, and not from farther ahead than that either: a stamp from the far future would stay fresh for ever.
fn is_fresh(now: Time, stamp: Time, deadline: Duration) -> bool {
    now.since(stamp) <= deadline && stamp.since(now) <= deadline
}
