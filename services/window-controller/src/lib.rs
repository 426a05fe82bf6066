//! Follows paths and avoids obstacles by choosing, in each step, the best of the velocities that the wheels
//! can reach by the next one and from which the robot can still stop: the dynamic window approach (Fox,
//! Burgard, Thrun 1997). Takes the place of `fuzzy-controller`.
//!
//! Who decides, first to last: bad or stale input stops; something close ahead forbids driving on; a target
//! far to the side is turned to; else the window's best velocity, and if none is admissible, zero at once.

mod course;
mod memory;
mod params;
#[cfg(test)]
mod tests;
mod window;

pub use params::{Params, ParamsError};
pub use window::Velocity;

use course::Course;
use geometry::{Pose2, angle};
use memory::Memory;
use messages::{
    DriveCommand, DriveModeName, Odometry, Parameters, Path, PlanStateName, PoseEstimate, RangeScan, Stamped,
    Time, TofRanges, WheelSpeeds,
};
use window::{Scene, choose};

/// The measured speed may lag behind the commanded by what the drive changes in this time.
const LAG_S: f64 = 0.3;
/// Turns on the spot aim below the speed from which they could just stop.
const TURN_SHARE: f64 = 0.6;
/// How fast creeping turns for each radian beside its heading.
const CREEP_TURN_PER_S: f64 = 1.5;

/// The newest of each message, as far as there is one.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// What the mission wants.
    pub command: Option<Stamped<'a, DriveCommand>>,
    /// The path to follow.
    pub path: Option<Stamped<'a, Path>>,
    /// Where the robot is.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
    /// Time-of-flight sensors.
    pub ranges: Option<Stamped<'a, TofRanges>>,
    /// A laser's scan; not needed.
    pub scan: Option<Stamped<'a, RangeScan>>,
    /// How fast the robot is.
    pub odometry: Option<Stamped<'a, Odometry>>,
}

/// Who decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Behaviour {
    /// An input is missing, stale or nonsense: zero speed at once. The state before the first step.
    #[default]
    BadInput,
    /// The mission wants the robot to stand.
    Hold,
    /// The path that the mission wants is not there.
    NoPath,
    /// The goal, or the heading, is reached.
    Reached,
    /// The window's best velocity.
    Window,
    /// A turn on the spot.
    Rotation,
    /// Nothing admissible, or something close ahead: zero speed at once.
    Brake,
    /// Slowly along a heading.
    Creep,
    /// Slowly backwards.
    BackOff,
}

/// What one step decides.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outputs {
    /// The wheel speeds wanted.
    pub wheels: WheelSpeeds,
    /// Who decided.
    pub behaviour: Behaviour,
}

/// The controller.
#[derive(Debug, Clone)]
pub struct WindowController {
    params: Params,
    course: Course,
    memory: Memory,
    rotating: bool,
    commanded: Velocity,
    last: Option<Time>,
}

impl WindowController {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the parameter.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self {
            params,
            course: Course::default(),
            memory: Memory::default(),
            rotating: false,
            commanded: Velocity::default(),
            last: None,
        })
    }

    /// The wheel speeds for now.
    pub fn step(&mut self, now: Time, inputs: &Inputs<'_>) -> Outputs {
        let period_s = self.params.period().as_secs_f64();
        let elapsed_s = self.last.map_or(period_s, |last| now.seconds_since(last)).clamp(0.0, 4.0 * period_s);
        self.last = Some(now);
        let (behaviour, wanted, limit_mps) =
            self.decide(now, elapsed_s, inputs).unwrap_or((Behaviour::BadInput, Velocity::default(), 0.0));
        let (reach_mps, reach_rad_per_s) = match behaviour {
            // At once, whatever the acceleration.
            Behaviour::BadInput | Behaviour::Brake => (f64::INFINITY, f64::INFINITY),
            _ => (
                self.params.acceleration_m_per_s2 * elapsed_s,
                self.params.turn_acceleration_rad_per_s2 * elapsed_s,
            ),
        };
        self.commanded = Velocity {
            forward_mps: towards(self.commanded.forward_mps, wanted.forward_mps, reach_mps),
            turn_rad_per_s: towards(self.commanded.turn_rad_per_s, wanted.turn_rad_per_s, reach_rad_per_s),
        };
        let rim_mps = 0.5 * self.params.track_m * self.commanded.turn_rad_per_s;
        let (left_mps, right_mps) =
            (self.commanded.forward_mps - rim_mps, self.commanded.forward_mps + rim_mps);
        let fastest_mps = left_mps.abs().max(right_mps.abs());
        let limit_mps = limit_mps.min(self.params.top_speed_mps);
        // Both alike, so that the curve stays the same.
        let scale = if fastest_mps > limit_mps { limit_mps / fastest_mps } else { 1.0 };
        self.commanded.forward_mps *= scale;
        self.commanded.turn_rad_per_s *= scale;
        Outputs {
            wheels: WheelSpeeds { left_mps: left_mps * scale, right_mps: right_mps * scale },
            behaviour,
        }
    }

    /// `None` for inputs that cannot be trusted.
    fn decide(
        &mut self,
        now: Time,
        elapsed_s: f64,
        inputs: &Inputs<'_>,
    ) -> Option<(Behaviour, Velocity, f64)> {
        let max_age = self.params.input_max_age();
        let pose = inputs.pose?.fresh(now, max_age)?.pose().ok()?;
        let odometry = inputs.odometry?.fresh(now, max_age)?;
        let ranges = inputs.ranges?.fresh(now, max_age)?;
        let front_m = self.memory.take_tof(now, ranges.stamp, ranges.message, pose, &self.params)?;
        if let Some(scan) = inputs.scan.and_then(|scan| scan.fresh(now, max_age)) {
            self.memory.take_scan(now, scan.message, scan.elements, pose);
        }
        let command_age = std::time::Duration::from_millis(self.params.command_max_age_ms);
        let command = inputs.command?.fresh(now, command_age)?;
        let mode = command.mode.get().ok()?;
        let limit_mps = command.max_speed_mps;
        let turns = matches!(mode, DriveModeName::TurnTo | DriveModeName::Creep);
        let sound = limit_mps >= 0.0 && (!turns || command.heading_rad.is_finite());
        let measured = (odometry.forward_mps, odometry.turn_rad_per_s);
        if !(sound && measured.0.is_finite() && measured.1.is_finite()) {
            return None;
        }
        let (behaviour, velocity) = match mode {
            DriveModeName::Hold => {
                self.course.forget();
                self.rotating = false;
                (Behaviour::Hold, Velocity::default())
            }
            DriveModeName::FollowPath => {
                let present = self.present(measured);
                self.follow(
                    now,
                    elapsed_s,
                    inputs,
                    (command.request_id, limit_mps),
                    pose,
                    (front_m, present),
                )?
            }
            DriveModeName::TurnTo => self.turn(angle::difference(command.heading_rad, pose.heading_rad)),
            DriveModeName::Creep => {
                self.creep(angle::difference(command.heading_rad, pose.heading_rad), front_m)
            }
            DriveModeName::BackOff => {
                let forward_mps = -self.params.creep_speed_mps;
                (Behaviour::BackOff, Velocity { forward_mps, turn_rad_per_s: 0.0 })
            }
        };
        Some((behaviour, velocity, limit_mps))
    }

    /// What was commanded last, unless the wheels do something else: then what they do.
    fn present(&self, (forward_mps, turn_rad_per_s): (f64, f64)) -> Velocity {
        let lag_mps = LAG_S * self.params.acceleration_m_per_s2;
        let lag_rad_per_s = LAG_S * self.params.turn_acceleration_rad_per_s2;
        Velocity {
            forward_mps: self.commanded.forward_mps.clamp(forward_mps - lag_mps, forward_mps + lag_mps),
            turn_rad_per_s: self
                .commanded
                .turn_rad_per_s
                .clamp(turn_rad_per_s - lag_rad_per_s, turn_rad_per_s + lag_rad_per_s),
        }
    }

    fn follow(
        &mut self,
        now: Time,
        elapsed_s: f64,
        inputs: &Inputs<'_>,
        (request, limit_mps): (u64, f64),
        pose: Pose2,
        (front_m, present): (f64, Velocity),
    ) -> Option<(Behaviour, Velocity)> {
        let found =
            |path: &Stamped<'_, Path>| path.request_id == request && path.state == PlanStateName::Found;
        let Some(path) = inputs.path.filter(found) else {
            return Some((Behaviour::NoPath, Velocity::default()));
        };
        let aim = self.course.aim((request, path.revision), path.elements, pose, &self.params)?;
        if aim.reached {
            self.rotating = false;
            return Some((Behaviour::Reached, Velocity::default()));
        }
        let error_rad = pose.bearing_rad(aim.point);
        let begins = error_rad.abs() > self.params.rotation_always_rad;
        self.rotating = begins || (self.rotating && error_rad.abs() > self.params.rotation_end_rad);
        let points = self.memory.points(now, pose, &self.params);
        // Near the goal no faster than the brakes allow; with something close ahead not at all.
        let arrival_mps = (self.params.brake_m_per_s2 * aim.way_m).sqrt().max(self.params.rotation_least_mps);
        let is_close = front_m < self.params.brake_distance_m;
        if is_close && present.forward_mps > self.params.rotation_least_mps {
            return Some((Behaviour::Brake, Velocity::default()));
        }
        if self.rotating || is_close {
            return Some((Behaviour::Rotation, self.rotation(error_rad)));
        }
        let scene = Scene {
            present,
            elapsed_s,
            target: pose.inverse_transform(aim.point),
            points: &points,
            limit_mps: limit_mps.min(arrival_mps),
        };
        Some(match choose(&scene, &self.params) {
            Some(velocity) => (Behaviour::Window, velocity),
            None => (Behaviour::Brake, Velocity::default()),
        })
    }

    fn turn(&self, error_rad: f64) -> (Behaviour, Velocity) {
        if error_rad.abs() <= self.params.turn_tolerance_rad {
            return (Behaviour::Reached, Velocity::default());
        }
        (Behaviour::Rotation, self.rotation(error_rad))
    }

    /// As fast as the turn can still end in time, but not slower than the wheels can.
    fn rotation(&self, error_rad: f64) -> Velocity {
        let least = self.params.rotation_least_mps / (0.5 * self.params.track_m);
        let soft = TURN_SHARE * (2.0 * self.params.turn_acceleration_rad_per_s2 * error_rad.abs()).sqrt();
        let latency = error_rad.abs() / (self.params.latency_s + self.params.period().as_secs_f64());
        let speed = soft.min(TURN_SHARE * latency).max(least).min(self.params.top_turn_rad_per_s);
        Velocity { forward_mps: 0.0, turn_rad_per_s: speed.copysign(error_rad) }
    }

    fn creep(&self, error_rad: f64, front_m: f64) -> (Behaviour, Velocity) {
        if front_m < self.params.brake_distance_m {
            return (Behaviour::Brake, Velocity::default());
        }
        let top = self.params.top_turn_rad_per_s;
        let turn_rad_per_s = (CREEP_TURN_PER_S * error_rad).clamp(-top, top);
        (Behaviour::Creep, Velocity { forward_mps: self.params.creep_speed_mps, turn_rad_per_s })
    }
}

/// From one value towards another by at most `reach`.
fn towards(from: f64, to: f64, reach: f64) -> f64 {
    from + (to - from).clamp(-reach, reach)
}
