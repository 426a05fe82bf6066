//! The last link of the chain: the wheels turn only while a fresh GO of the collision guard and a fresh,
//! sound command are at hand; whatever is missing, late or nonsense means zero at once. The encoders of the
//! two wheels become odometry (Siegwart and Nourbakhsh 2011, section 5.2.4, with exact arcs).
//!
//! # Whatever a controller asks
//! - **Ahead** no corner of the hull is faster than the guard's front radius allows: from the age that
//!   readings may have, the deadlines and the motors' deceleration follows a speed from which the robot stops
//!   within it (`speed`).
//! - **Aside**, in a curve, a corner comes where no sensor looks: the narrower the curve, the slower the
//!   robot.
//! - **Around** the hull moves only where it can stop before it comes too near to anything that the guard
//!   sees or has just seen (`stopping`); what leads there is done as slowly as it takes, or not at all.
//! - **Back**, where no sensor looks, it goes only over ground that the hull has just covered, and slowly, as
//!   somebody may have stepped there (`trail`). That is also the way out when the guard says STOP for
//!   something in front.
//! - A robot whose sensor looks **ahead only** turns and drives as far as was ordered by a service that has
//!   looked around, and no farther (`orders`).
//! - It **begins** with what the motors do: after a pause, or as a successor, it gains speed from what the
//!   encoders show.
//! - Encoders that jump, or do not show what the wheels are told, are a fault: the wheels rest.

mod device;
mod motors;
mod odometry;
mod orders;
mod params;
mod speed;
mod stopping;
mod trail;

#[cfg(test)]
mod tests;

pub use device::{BaseDevice, DeviceError, Encoders, SimulatedBase, WheelTravel};
pub use odometry::Snapshot;
pub use params::{Device, Params, ParamsError, Room};

use geometry::{Hull, Point2, Pose2};
use messages::{
    AppliedWheels, Clearance, DriveReasonName, Face, GuardReasonName, MotionCommand, Odometry, Parameters,
    Stamped, Time, Verdict, WheelSpeeds,
};
use motors::Motors;
use odometry::DeadReckoning;
use orders::Orders;
use std::time::Duration;
use trail::Trail;

/// The shares of its speed at which a command that leads too near to something is tried, one after the other.
const SHARES: [f64; 6] = [1.0, 0.75, 0.5, 0.3, 0.15, 0.07];
/// What the guard's side radius keeps free, and a little: so the guard need not stop the robot for what the
/// driver can see coming.
const OFF_SIDES_M: f64 = 0.030;
/// The most that a guard keeps free at the sides.
const MOST_M: f64 = 1.0;

/// What the driver looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The guard's newest word, from `safety/clearance`.
    pub clearance: Option<Stamped<'a, Clearance>>,
    /// The controller's newest wish, from `wheels/desired`.
    pub desired: Option<Stamped<'a, WheelSpeeds>>,
    /// What was ordered, from `motion/command`, where that counts.
    pub order: Option<Stamped<'a, MotionCommand>>,
    /// What the encoders say now; `None` when the motor controller does not answer.
    pub encoders: Option<Encoders>,
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
    hull: Hull,
    applied: AppliedWheels,
    /// What the wheels were told last, once it is known what they do.
    told: Option<WheelSpeeds>,
    last_step: Option<Time>,
    motors: Motors,
    trail: Trail,
    orders: Orders,
    reckoning: DeadReckoning,
}

/// What the driver makes of its inputs.
type Decision<T> = Result<T, DriveReasonName>;

/// A command that may be obeyed, and the guard's word that allows it.
struct Wanted<'a> {
    speeds: WheelSpeeds,
    reason: DriveReasonName,
    clearance: Stamped<'a, Clearance>,
}

impl BaseDriver {
    /// A driver in its safe state.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self {
            hull: params.hull(),
            reckoning: DeadReckoning::new(params.wheel_track_m, params.period()),
            params,
            applied: AppliedWheels::default(),
            told: None,
            last_step: None,
            motors: Motors::default(),
            trail: Trail::default(),
            orders: Orders::default(),
        })
    }

    /// What a successor needs so that the odometry goes on in the same frame, and to know where it may go
    /// back; of the command nothing is kept, since a driver that starts begins safe.
    pub fn snapshot(&self) -> Option<Snapshot> {
        self.reckoning.snapshot(self.trail.kept())
    }

    /// Takes over the odometry of a predecessor, before the first step.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.trail = self.reckoning.restore(snapshot);
    }

    /// Decides what the wheels do from now on, and counts how far they went.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        let encoders = inputs.encoders.filter(|encoders| encoders.travel.is_finite());
        let here = self.look(now, &inputs, encoders);
        let decision = self.decide(now, &inputs).and_then(|wanted| self.allow(now, here, &wanted));
        let (speeds, reason) = match decision {
            Ok((told, reason)) => (told, reason),
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
        if self.told.is_some() || self.motors.rims().is_some() {
            self.told = Some(speeds);
        }
        self.last_step = Some(now);
        let travel = encoders.map(|encoders| encoders.travel);
        Outputs { applied: self.applied, odometry: self.reckoning.step(now, travel) }
    }

    /// The last word before the driver leaves: zero.
    pub fn leave(&mut self) -> AppliedWheels {
        let deadline_misses = self.applied.deadline_misses;
        let reason = DriveReasonName::ShuttingDown.into();
        self.applied = AppliedWheels { deadline_misses, reason, ..AppliedWheels::default() };
        self.applied
    }

    /// Looks at what the motors do, and where that has brought the robot in the frame of odometry; `None`
    /// when nobody knows.
    fn look(&mut self, now: Time, inputs: &Inputs<'_>, encoders: Option<Encoders>) -> Option<Pose2> {
        let Some(encoders) = encoders else {
            self.motors.lose_sight();
            return None;
        };
        let told = WheelSpeeds { left_mps: self.applied.left_mps, right_mps: self.applied.right_mps };
        self.motors.look(now, encoders, told);
        let here = self.reckoning.here(encoders.travel).unwrap_or(Pose2::IDENTITY);
        if self.motors.jumped {
            self.trail.forget();
            return None;
        }
        self.trail.follow(here, self.params.trail_m);
        self.orders.follow(inputs.order.map(|order| order.message), here);
        Some(here)
    }

    /// Whether GO and command are fresh and sound, or the robot may free itself.
    fn decide<'a>(&mut self, now: Time, inputs: &Inputs<'a>) -> Decision<Wanted<'a>> {
        use DriveReasonName::{
            DeviceFault, Driving, Escaping, GuardStop, InvalidCommand, InvalidGuard, StaleCommand, StaleGuard,
        };
        let guard_deadline = Duration::from_millis(self.params.guard_deadline_ms.into());
        let command_deadline = Duration::from_millis(self.params.command_deadline_ms.into());

        let clearance =
            inputs.clearance.and_then(|word| word.fresh(now, guard_deadline)).ok_or(StaleGuard)?;
        let verdict = clearance.signal.get().map_err(|_| InvalidGuard)?;
        let guard_reason = clearance.reason.get().map_err(|_| InvalidGuard)?;
        if verdict == Verdict::Go && clearance.violated_faces != 0 {
            return Err(InvalidGuard);
        }
        let desired =
            inputs.desired.and_then(|wish| wish.fresh(now, command_deadline)).ok_or(match verdict {
                Verdict::Go => StaleCommand,
                Verdict::Stop => GuardStop,
            })?;
        let speeds = *desired.message;
        let is_sound = speeds.is_within(self.params.max_wheel_speed_mps);
        let may_follow = is_sound && self.motors.follow(now, speeds);
        if inputs.encoders.is_none_or(|encoders| !encoders.travel.is_finite()) || (is_sound && !may_follow) {
            return Err(DeviceFault);
        }
        match verdict {
            Verdict::Go if is_sound => Ok(Wanted { speeds, reason: Driving, clearance }),
            Verdict::Go => Err(InvalidCommand),
            Verdict::Stop if is_sound && self.may_escape(&clearance, guard_reason, speeds) => {
                Ok(Wanted { speeds, reason: Escaping, clearance })
            }
            Verdict::Stop => Err(GuardStop),
        }
    }

    /// Whether a command may pass although the guard says STOP: only backwards, and only away from something
    /// in front and nowhere else.
    fn may_escape(&self, clearance: &Clearance, guard_reason: GuardReasonName, wanted: WheelSpeeds) -> bool {
        let in_front_only = clearance.violated_faces == Face::Front as u32;
        let known = matches!(
            guard_reason,
            GuardReasonName::Violation | GuardReasonName::Remembered | GuardReasonName::Settling
        );
        let backwards = wanted.left_mps <= 0.0 && wanted.right_mps <= 0.0;
        self.params.allow_escape && in_front_only && known && backwards
    }

    /// As much of the wanted motion as there is room for, gained gently.
    fn allow(
        &self,
        now: Time,
        here: Option<Pose2>,
        wanted: &Wanted<'_>,
    ) -> Decision<(WheelSpeeds, DriveReasonName)> {
        let reason = wanted.reason;
        if wanted.speeds == WheelSpeeds::ZERO {
            return Ok((WheelSpeeds::ZERO, reason));
        }
        let from = self.motors.begin_from(&self.params, self.told, self.pause_s(now));
        if self.params.room == Room::Unchecked {
            return Ok((self.speed_up_gently(now, from, wanted.speeds), reason));
        }
        let here = here.ok_or(DriveReasonName::DeviceFault)?;
        let slowed = self.slowed(wanted)?;
        let rims = self.motors.rims().unwrap_or(from);
        let near = self.near(here, &wanted.clearance)?;
        let tried = SHARES.iter().map(|share| self.speed_up_gently(now, from, speed::scaled(slowed, *share)));
        let told = tried.into_iter().find(|told| {
            let way = stopping::way(&self.params, rims, *told);
            match self.params.room {
                Room::Ordered => self.orders.allows(&way),
                Room::Seen | Room::Unchecked => {
                    let margin_m = off_m(&wanted.clearance);
                    // What is not told to go back may go on, also from behind the ground that is known.
                    let is_back = told.left_mps + told.right_mps < 0.0;
                    let places = way.iter().map(|pose| here.compose(*pose));
                    (!is_back || self.trail.allows(&self.hull, places))
                        && stopping::keeps_off(&self.hull, &way, &near, margin_m)
                }
            }
        });
        told.map(|told| (told, reason)).ok_or(DriveReasonName::NoRoom)
    }

    /// The wanted motion, no faster than the guard's word allows.
    fn slowed(&self, wanted: &Wanted<'_>) -> Decision<WheelSpeeds> {
        let (params, clearance) = (&self.params, wanted.clearance.message);
        let radius_m = clearance.front_radius_m;
        // In an arena nothing moves but the robot: as far as the sensor sees, it is free.
        let way_m = if params.room == Room::Ordered { radius_m.max(clearance.front_m) } else { radius_m };
        let ahead_mps = match wanted.reason {
            // Somebody in front is no reason to be slower backwards.
            DriveReasonName::Escaping => params.reverse_speed_mps,
            _ => speed::ahead_mps(params, clearance, way_m).ok_or(DriveReasonName::NothingGuarded)?,
        };
        let corner_mps = if params.room == Room::Ordered { f64::INFINITY } else { ahead_mps };
        let curving_mps = if params.room == Room::Ordered {
            f64::INFINITY
        } else {
            let reaction_s = params.reaction_s(clearance.max_age_ms);
            let (hull, track_m, loss) = (&self.hull, params.wheel_track_m, params.deceleration_m_per_s2);
            speed::curving_mps(wanted.speeds, hull, track_m, reaction_s, loss)
        };
        let ahead_mps = ahead_mps.min(curving_mps);
        let limits = [corner_mps, ahead_mps, params.reverse_speed_mps, params.top_speed_mps];
        Ok(speed::slowed(wanted.speeds, &self.hull, params.wheel_track_m, limits))
    }

    /// What the guard knows to be near, as the robot sees it now. A guard that does not know where it saw it
    /// knows nothing.
    fn near(&self, here: Pose2, clearance: &Stamped<'_, Clearance>) -> Decision<Vec<Point2<f64>>> {
        if self.params.room != Room::Seen {
            return Ok(Vec::new());
        }
        let at = clearance.at().ok_or(DriveReasonName::NoRoom)?;
        let moved = here.to(at);
        let points = clearance.elements.iter().filter(|point| point.x_m.is_finite() && point.y_m.is_finite());
        Ok(points.map(|point| moved.transform(Point2::new(point.x_m.into(), point.y_m.into()))).collect())
    }

    /// `wanted`, with no wheel gaining more speed than the limit allows since the last step. A wheel that is
    /// to turn the other way stops first.
    fn speed_up_gently(&self, now: Time, from: WheelSpeeds, wanted: WheelSpeeds) -> WheelSpeeds {
        // After a long pause the step is that of one period: a pause is no reason to jump.
        let gain_mps =
            self.params.max_speed_up_m_per_s2 * self.pause_s(now).min(self.params.period().as_secs_f64());
        WheelSpeeds {
            left_mps: gain_at_most(from.left_mps, wanted.left_mps, gain_mps),
            right_mps: gain_at_most(from.right_mps, wanted.right_mps, gain_mps),
        }
    }

    fn pause_s(&self, now: Time) -> f64 {
        self.last_step.map_or(0.0, |last| now.seconds_since(last))
    }
}

fn gain_at_most(present_mps: f64, wanted_mps: f64, gain_mps: f64) -> f64 {
    let from_mps = if present_mps * wanted_mps > 0.0 { present_mps.abs() } else { 0.0 };
    wanted_mps.abs().min(from_mps + gain_mps).copysign(wanted_mps)
}

/// How far from the hull things shall stay.
fn off_m(clearance: &Clearance) -> f64 {
    let side_m = f64::from(clearance.right_radius_m.max(clearance.left_radius_m));
    // A radius that is no number may be any.
    (if side_m.is_nan() { MOST_M } else { side_m.clamp(0.0, MOST_M) }) + OFF_SIDES_M
}

/// Whether the reason is one with which wheels may turn.
fn moves(reason: DriveReasonName) -> bool {
    matches!(reason, DriveReasonName::Driving | DriveReasonName::Escaping)
}
