//! Gathers what the other services say into one message that always holds the newest of everything: place,
//! orientation, floor, angle from the hallway's straight line, move instructions and delivery status. Source:
//! the coffee robot's paper, section IV (COF-047, COF-048).
//!
//! Nothing is computed here and nothing is passed on unchecked: in place of an invalid number the last valid
//! one is kept, an unknown state becomes the careful one (`Halt`, `Fault`, `Stop`), and every part says how
//! old it is.

mod params;
#[cfg(test)]
mod tests;

pub use params::Params;

use geometry::Pose2;
use messages::{
    Clearance, CurrentState, DeliveryStatus, DeliveryStatusName, DriveCommand, DriveModeName, GuardSignal,
    HeadingCorrection, Misfit, MissionStatus, MoveInstruction, MoveInstructionName, Parameters, PoseEstimate,
    RoomName, Stamped, Time, Verdict,
};
use std::time::Duration;

/// What others say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// `location/pose`.
    pub location: Option<Stamped<'a, PoseEstimate>>,
    /// `heading/correction`.
    pub correction: Option<Stamped<'a, HeadingCorrection>>,
    /// `mission/status`.
    pub mission: Option<Stamped<'a, MissionStatus>>,
    /// `drive/command`.
    pub command: Option<Stamped<'a, DriveCommand>>,
    /// `safety/clearance`.
    pub clearance: Option<Stamped<'a, Clearance>>,
}

/// What to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `state/current`, when something has changed or the period is over.
    pub state: Option<CurrentState>,
}

/// A value and when it was published.
#[derive(Debug, Clone, Copy)]
struct Kept<T> {
    value: T,
    stamp: Time,
}

impl<T> Kept<T> {
    fn age(&self, now: Time) -> Duration {
        now.since(self.stamp)
    }
}

/// The newest of everything.
#[derive(Debug, Clone)]
pub struct CurrentStateService {
    params: Params,
    place: Option<Kept<(Pose2, i32)>>,
    /// Whether the localiser's last word was a usable pose.
    located: bool,
    angle: Option<Kept<f64>>,
    mission: Option<Kept<(RoomName, DeliveryStatus)>>,
    published: Option<Kept<CurrentState>>,
}

impl CurrentStateService {
    /// Nothing is known yet.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, Misfit> {
        params.check()?;
        Ok(Self { params, place: None, located: false, angle: None, mission: None, published: None })
    }

    /// Takes in the newest messages. Call it for every message and once a period.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if let Some(location) = inputs.location {
            let pose = location.pose();
            self.located = pose.is_ok();
            if let Ok(pose) = pose {
                self.place = Some(Kept { value: (pose, location.floor), stamp: location.stamp });
            }
        }
        if let Some(correction) = inputs.correction
            && correction.valid == 1
            && correction.angle_rad.is_finite()
        {
            self.angle = Some(Kept { value: correction.angle_rad, stamp: correction.stamp });
        }
        if let Some(mission) = inputs.mission {
            let status = mission.status.get().unwrap_or(DeliveryStatusName::Fault);
            self.mission = Some(Kept { value: (mission.room, status.into()), stamp: mission.stamp });
        }

        let state = self.state(now, &inputs);
        let due = self.published.is_none_or(|published| {
            published.age(now) >= self.params.period() || without_ages(published.value) != without_ages(state)
        });
        if due {
            self.published = Some(Kept { value: state, stamp: now });
        }
        Outputs { state: due.then_some(state) }
    }

    fn state(&self, now: Time, inputs: &Inputs<'_>) -> CurrentState {
        let limit = |ms| Duration::from_millis(ms);
        let (pose, floor) = self.place.map_or((Pose2::IDENTITY, 0), |kept| kept.value);
        let located = self.located
            && self.place.is_some_and(|kept| kept.age(now) <= limit(self.params.location_max_age_ms));
        let angled = self.angle.is_some_and(|kept| kept.age(now) <= limit(self.params.angle_max_age_ms));
        let (room, status) =
            self.mission.map_or((RoomName::EMPTY, DeliveryStatusName::Idle.into()), |kept| kept.value);
        CurrentState {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            angle_from_line_rad: self.angle.map_or(0.0, |kept| kept.value),
            location_age_s: age_s(&self.place, now),
            angle_age_s: age_s(&self.angle, now),
            mission_age_s: age_s(&self.mission, now),
            room,
            floor,
            location_valid: located.into(),
            angle_valid: angled.into(),
            instruction: instruction(inputs.command),
            status,
            signal: signal(inputs.clearance, now, limit(self.params.clearance_max_age_ms)),
        }
    }
}

/// Seconds since it was said; infinite for what was never said.
fn age_s<T>(kept: &Option<Kept<T>>, now: Time) -> f64 {
    kept.as_ref().map_or(f64::INFINITY, |kept| kept.age(now).as_secs_f64())
}

/// The navigator's last word, which stands until it says another; no word and nonsense are `Halt`.
fn instruction(command: Option<Stamped<'_, DriveCommand>>) -> MoveInstruction {
    let mode = command.and_then(|command| command.mode.get().ok()).unwrap_or(DriveModeName::Hold);
    let instruction = match mode {
        DriveModeName::Hold => MoveInstructionName::Halt,
        DriveModeName::FollowPath => MoveInstructionName::Follow,
        DriveModeName::TurnTo => MoveInstructionName::Turn,
        DriveModeName::Creep => MoveInstructionName::Creep,
        DriveModeName::BackOff => MoveInstructionName::BackOff,
    };
    instruction.into()
}

/// GO only while a fresh clearance says so.
fn signal(clearance: Option<Stamped<'_, Clearance>>, now: Time, max_age: Duration) -> GuardSignal {
    let fresh = clearance.and_then(|clearance| clearance.fresh(now, max_age));
    let verdict = fresh.and_then(|clearance| clearance.signal.get().ok()).unwrap_or(Verdict::Stop);
    verdict.into()
}

/// What counts as a change: everything but time passing.
fn without_ages(state: CurrentState) -> CurrentState {
    CurrentState { location_age_s: 0.0, angle_age_s: 0.0, mission_age_s: 0.0, ..state }
}
