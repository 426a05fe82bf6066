//! Drives to waypoints and around obstacles by fuzzy rules: the paper's FLMC with its three controllers MM,
//! OAM and CSM (ASN-140 to ASN-149, note 3.6 to 3.8), whose rules are FCL files. The engine that runs them is
//! in [`fuzzy`].
//!
//! Who decides, first to last: bad or stale input stops; something close ahead brakes, and then the robot
//! only turns; something near is avoided; a close target to the side is turned to; else the robot drives to
//! it.

mod clearance;
mod controllers;
mod course;
mod params;
mod surround;
#[cfg(test)]
mod tests;

pub use clearance::Clearances;
pub use controllers::{Controller, Controllers, SetupError};
pub use params::{Params, ParamsError, RangeSource};

use clearance::TofMemory;
use controllers::Wheels;
use course::Course;
use geometry::{Pose2, Segment, World, angle};
use messages::{
    DriveCommand, DriveModeName, Odometry, Parameters, Path, PlanStateName, PoseEstimate, RangeScan, Stamped,
    Time, TofRanges, WheelSpeeds,
};
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;
pub use surround::Snapshot;
use surround::Surround;

/// In the rule files avoidance takes over at this clearance; clearances are scaled to it.
const RULES_TRIGGER_M: f64 = 0.5;
/// Slower than this forward is standing.
const STANDING_MPS: f64 = 0.02;
/// For creeping, the motion controller is told a target this far along the heading.
const CREEP_TARGET_M: f64 = 0.6;
/// Targets this nearly behind keep the side to which the robot already turns.
const BEHIND_RAD: f64 = 2.9;

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
    /// A laser's scan.
    pub scan: Option<Stamped<'a, RangeScan>>,
    /// The way by the wheels: what was seen a moment ago is remembered in its frame.
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
    /// MM drives.
    Motion,
    /// CSM turns on the spot.
    Rotation,
    /// OAM avoids an obstacle.
    Avoidance,
    /// Something is close ahead: zero speed at once.
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
    /// Direction of the target from the robot's heading, left positive; NaN without a target.
    pub error_rad: f64,
    /// Way to the target; NaN without one.
    pub distance_m: f64,
    /// Where the robot will be after one period by its kinematics (ASN-148).
    pub predicted: Option<Pose2>,
    /// The robot avoids and avoids and comes no further: a new path is needed (note 3.8).
    pub blocked: bool,
}

/// A decision before the limits of speed and acceleration.
#[derive(Debug, Clone, Copy)]
struct Decision {
    behaviour: Behaviour,
    wheels: Wheels,
    /// At once, whatever the acceleration.
    at_once: bool,
    speed_limit_mps: f64,
    error_rad: f64,
    distance_m: f64,
}

impl Decision {
    fn stand(behaviour: Behaviour) -> Self {
        let at_once = matches!(behaviour, Behaviour::BadInput | Behaviour::Brake);
        let (error_rad, distance_m) = (f64::NAN, f64::NAN);
        Self { behaviour, wheels: [0.0; 2], at_once, speed_limit_mps: 0.0, error_rad, distance_m }
    }
}

/// Where and when the robot last got on, to notice that it does not.
#[derive(Debug, Clone, Copy)]
struct Progress {
    place: Pose2,
    since: Time,
    avoided: bool,
}

/// The controller.
#[derive(Debug, Clone)]
pub struct FuzzyController {
    params: Params,
    controllers: Controllers,
    course: Course,
    tof: TofMemory,
    surround: Surround,
    /// The walls of each floor.
    walls: Vec<(i32, Vec<Segment>)>,
    rotating: bool,
    last_error_rad: f64,
    wheels: Wheels,
    last: Option<Time>,
    progress: Option<Progress>,
}

impl FuzzyController {
    /// Checks the parameters and compiles the rules.
    ///
    /// # Errors
    /// Names the parameter, or the rule file with line and column.
    pub fn new(params: Params) -> Result<Self, SetupError> {
        params.check()?;
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        let floors = world.floors.iter().map(|floor| (floor.number, world.wall_segments(floor.number)));
        Ok(Self {
            walls: floors.collect(),
            controllers: Controllers::new(&params)?,
            params,
            course: Course::default(),
            tof: TofMemory::default(),
            surround: Surround::default(),
            rotating: false,
            last_error_rad: 0.0,
            wheels: [0.0; 2],
            last: None,
            progress: None,
        })
    }

    /// The three controllers with the activations of their rules in the last step that they took part in.
    pub fn controllers(&self) -> &Controllers {
        &self.controllers
    }

    /// What a successor needs to know of the robot's surroundings.
    pub fn snapshot(&self) -> Snapshot {
        self.surround.snapshot()
    }

    /// Takes over what a predecessor knew of the robot's surroundings, before the first step.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.surround.restore(snapshot);
    }

    /// The wheel speeds for now.
    pub fn step(&mut self, now: Time, inputs: &Inputs<'_>) -> Outputs {
        let period_s = self.params.period_ms as f64 * 1e-3;
        let elapsed_s = self.last.map_or(period_s, |last| now.seconds_since(last)).min(4.0 * period_s);
        self.last = Some(now);

        let max_age = Duration::from_millis(self.params.input_max_age_ms);
        let pose = inputs.pose.and_then(|pose| pose.fresh(now, max_age)).and_then(|pose| pose.pose().ok());
        let here = inputs.odometry.and_then(|way| way.fresh(now, max_age)).and_then(|way| way.pose().ok());
        let ranges = inputs.ranges.map(|ranges| (ranges.stamp, ranges.message));
        self.surround.observe(now, here, ranges, &self.params);
        let floor = inputs.pose.map(|pose| pose.floor);
        let walls = self.walls.iter().find(|(number, _)| Some(*number) == floor);
        self.surround.show_walls(pose, walls.map_or(&[], |(_, walls)| walls.as_slice()));

        let wanted = match pose {
            Some(pose) => self.decide(now, inputs, pose),
            None => Decision::stand(Behaviour::BadInput),
        };
        let sound = wanted.wheels.iter().all(|speed| speed.is_finite());
        let wanted = if sound { wanted } else { Decision::stand(Behaviour::BadInput) };

        let slow_enough = limited(wanted.wheels, wanted.speed_limit_mps.min(self.params.top_speed_mps));
        // Only on a path, and not when it leads back.
        let may_advance = wanted.distance_m.is_finite() && wanted.error_rad.abs() < FRAC_PI_2;
        let allowed = self.surround.allowed(slow_enough, may_advance, &self.params);
        self.surround.judge(now, slow_enough, allowed, wanted.behaviour == Behaviour::BadInput);
        let change_mps =
            if wanted.at_once { f64::INFINITY } else { self.params.acceleration_m_per_s2 * elapsed_s };
        self.wheels = eased(self.wheels, allowed, change_mps);
        let [left_mps, right_mps] = self.wheels;

        let predicted = pose.map(|pose| {
            let turn_rad = (right_mps - left_mps) / self.params.track_m * period_s;
            pose.after_arc(0.5 * (left_mps + right_mps) * period_s, turn_rad)
        });
        Outputs {
            wheels: WheelSpeeds { left_mps, right_mps },
            behaviour: wanted.behaviour,
            error_rad: wanted.error_rad,
            distance_m: wanted.distance_m,
            predicted,
            blocked: self.is_blocked(now, pose, wanted.behaviour),
        }
    }

    fn decide(&mut self, now: Time, inputs: &Inputs<'_>, pose: Pose2) -> Decision {
        let clearances = self.clearances(now, inputs);
        let max_age = Duration::from_millis(self.params.command_max_age_ms);
        let command = inputs.command.and_then(|command| command.fresh(now, max_age));
        let (Some(command), Some(clearances)) = (command, clearances) else {
            return Decision::stand(Behaviour::BadInput);
        };
        let speed_limit_mps = command.max_speed_mps;
        let turns = matches!(command.mode.get(), Ok(DriveModeName::TurnTo | DriveModeName::Creep));
        if speed_limit_mps.is_nan() || speed_limit_mps < 0.0 || (turns && !command.heading_rad.is_finite()) {
            return Decision::stand(Behaviour::BadInput);
        }
        let decision = match command.mode.get() {
            Err(_) => Decision::stand(Behaviour::BadInput),
            Ok(DriveModeName::Hold) => {
                self.course.forget();
                self.rotating = false;
                Decision::stand(Behaviour::Hold)
            }
            Ok(DriveModeName::FollowPath) => self.follow(inputs, command.request_id, pose, clearances),
            Ok(DriveModeName::TurnTo) => self.turn(angle::difference(command.heading_rad, pose.heading_rad)),
            Ok(DriveModeName::Creep) => {
                self.creep(angle::difference(command.heading_rad, pose.heading_rad), clearances)
            }
            Ok(DriveModeName::BackOff) => {
                let wheels = [-self.params.creep_speed_mps; 2];
                Decision { wheels, ..Decision::stand(Behaviour::BackOff) }
            }
        };
        Decision { speed_limit_mps, ..decision }
    }

    /// The fresh clearances of all sensors that the parameters name; `None` if one is missing.
    fn clearances(&mut self, now: Time, inputs: &Inputs<'_>) -> Option<Clearances> {
        let max_age = Duration::from_millis(self.params.input_max_age_ms);
        let mut clearances = Clearances::FREE;
        if matches!(self.params.range_source, RangeSource::Tof | RangeSource::Both) {
            let ranges = inputs.ranges.and_then(|ranges| ranges.fresh(now, max_age))?;
            clearances = clearances.nearer(self.tof.clearances(now, ranges.message, &self.params)?);
        }
        if matches!(self.params.range_source, RangeSource::Scan | RangeSource::Both) {
            let scan = inputs.scan.and_then(|scan| scan.fresh(now, max_age))?;
            clearances = clearances.nearer(Clearances::of_scan(scan.message, scan.elements, &self.params)?);
        }
        // Thin things flicker (COF-123): what was seen ahead a moment ago is still there.
        clearances.front_m = clearances.front_m.min(self.surround.front_m(&self.params));
        Some(clearances).filter(|clearances| clearances.is_usable())
    }

    /// The arbitration of note 3.8, from its second rule on.
    fn follow(&mut self, inputs: &Inputs<'_>, request: u64, pose: Pose2, clearances: Clearances) -> Decision {
        let found =
            |path: &Stamped<'_, Path>| path.request_id == request && path.state == PlanStateName::Found;
        let Some(path) = inputs.path.filter(found) else {
            return Decision::stand(Behaviour::NoPath);
        };
        let Some(aim) = self.course.aim((request, path.revision), path.elements, pose, &self.params) else {
            return Decision::stand(Behaviour::BadInput);
        };
        if aim.reached {
            self.rotating = false;
            return Decision { distance_m: aim.goal_m, ..Decision::stand(Behaviour::Reached) };
        }
        let error_rad = self.steady_error(pose.bearing_rad(aim.point));
        let (behaviour, wheels) = if clearances.front_m < self.params.brake_distance_m {
            self.rotating = false;
            if self.moves_forward() {
                (Behaviour::Brake, [0.0; 2])
            } else if !self.params.turns_by_path {
                (Behaviour::Avoidance, self.turn_away(clearances))
            } else if error_rad.abs() > 2.0 * self.params.rotation_end_rad {
                // The planner knows of the obstacle too, and its new path leads around it.
                (Behaviour::Avoidance, self.rotate(error_rad))
            } else {
                (Behaviour::Brake, [0.0; 2])
            }
        } else if self.is_near(clearances) && aim.goal_m >= self.params.goal_without_avoidance_m {
            self.rotating = false;
            (Behaviour::Avoidance, self.avoid(clearances))
        } else if self.must_rotate(aim.close_m, error_rad) {
            (Behaviour::Rotation, self.rotate(error_rad))
        } else {
            let wheels = self.controllers.motion.step([aim.way_m, error_rad.to_degrees()]);
            (Behaviour::Motion, self.scaled(wheels))
        };
        let at_once = behaviour == Behaviour::Brake;
        let wheels = limited(wheels, self.speed_before_mps(clearances.front_m));
        Decision { behaviour, wheels, at_once, speed_limit_mps: 0.0, error_rad, distance_m: aim.way_m }
    }

    fn turn(&mut self, error_rad: f64) -> Decision {
        let error_rad = self.steady_error(error_rad);
        if error_rad.abs() <= self.params.turn_tolerance_rad {
            return Decision { error_rad, ..Decision::stand(Behaviour::Reached) };
        }
        let wheels = self.rotate(error_rad);
        Decision { wheels, error_rad, ..Decision::stand(Behaviour::Rotation) }
    }

    fn creep(&mut self, error_rad: f64, clearances: Clearances) -> Decision {
        let error_rad = self.steady_error(error_rad);
        if clearances.front_m < self.params.brake_distance_m {
            return Decision { error_rad, ..Decision::stand(Behaviour::Brake) };
        }
        let wheels = self.controllers.motion.step([CREEP_TARGET_M, error_rad.to_degrees()]);
        let wheels = limited(self.scaled(wheels), self.params.creep_speed_mps);
        Decision { wheels, error_rad, ..Decision::stand(Behaviour::Creep) }
    }

    /// With a target almost behind, noise must not make the robot change the side to which it turns.
    fn steady_error(&mut self, error_rad: f64) -> f64 {
        let flipped = error_rad.abs() > BEHIND_RAD
            && self.last_error_rad.abs() > BEHIND_RAD - 0.3
            && error_rad * self.last_error_rad < 0.0;
        let steady = if flipped { error_rad + 2.0 * PI * self.last_error_rad.signum() } else { error_rad };
        self.last_error_rad = steady;
        steady
    }

    /// The speed from which the robot stops before it must brake (note 2.5), and never less than a creep.
    fn speed_before_mps(&self, front_m: f64) -> f64 {
        let room_m = (front_m - self.params.brake_distance_m).max(0.0);
        let (brake, latency) = (self.params.brake_m_per_s2, self.params.latency_s);
        let lost = brake * latency;
        ((lost * lost + 2.0 * brake * room_m).sqrt() - lost).max(self.params.creep_speed_mps)
    }

    fn moves_forward(&self) -> bool {
        0.5 * (self.wheels[0] + self.wheels[1]) > STANDING_MPS
    }

    fn is_near(&self, clearances: Clearances) -> bool {
        clearances.front_m < self.params.front_trigger_m
            || clearances.left_m.min(clearances.right_m) < self.params.side_trigger_m
    }

    /// Begins above one error and ends below a smaller one.
    fn must_rotate(&mut self, close_m: f64, error_rad: f64) -> bool {
        let close = close_m < self.params.rotation_distance_m;
        let begins = close && error_rad.abs() > self.params.rotation_begin_rad;
        let always = error_rad.abs() > self.params.rotation_always_rad;
        self.rotating = (self.rotating && error_rad.abs() > self.params.rotation_end_rad) || begins || always;
        self.rotating
    }

    fn rotate(&mut self, error_rad: f64) -> Wheels {
        let wheels = self.controllers.rotation.step([error_rad.to_degrees()]);
        let [left, right] = self.scaled(wheels);
        let rim_mps = 0.5 * (right - left);
        if !rim_mps.is_finite() {
            return [f64::NAN; 2];
        }
        let rim_mps = rim_mps.abs().max(self.params.rotation_least_mps).copysign(error_rad);
        [-rim_mps, rim_mps]
    }

    fn avoid(&mut self, clearances: Clearances) -> Wheels {
        let side = RULES_TRIGGER_M / self.params.side_trigger_m;
        let front = RULES_TRIGGER_M / self.params.front_trigger_m;
        let scaled = [side * clearances.left_m, front * clearances.front_m, side * clearances.right_m];
        let wheels = self.controllers.avoidance.step(scaled);
        self.scaled(wheels)
    }

    /// The turning part of what avoidance wants; if it wants none, to the right like its ties.
    fn turn_away(&mut self, clearances: Clearances) -> Wheels {
        let [left, right] = self.avoid(clearances);
        let rim_mps = 0.5 * (right - left);
        if rim_mps.is_nan() {
            return [f64::NAN; 2];
        }
        let least_mps = self.params.rotation_least_mps;
        let rim_mps = if rim_mps.abs() < least_mps { least_mps.copysign(rim_mps.min(-0.0)) } else { rim_mps };
        [-rim_mps, rim_mps]
    }

    fn scaled(&self, wheels: Wheels) -> Wheels {
        wheels.map(|speed| speed * self.params.top_speed_mps / self.params.rules_top_speed_mps)
    }

    fn is_blocked(&mut self, now: Time, pose: Option<Pose2>, behaviour: Behaviour) -> bool {
        let avoids = matches!(behaviour, Behaviour::Avoidance | Behaviour::Brake);
        let (Some(place), true) =
            (pose, avoids || matches!(behaviour, Behaviour::Motion | Behaviour::Rotation))
        else {
            self.progress = None;
            return false;
        };
        let mut progress = self.progress.unwrap_or(Progress { place, since: now, avoided: false });
        if place.distance_m(progress.place) >= self.params.progress_m {
            progress = Progress { place, since: now, avoided: false };
        }
        progress.avoided |= avoids;
        self.progress = Some(progress);
        progress.avoided && now.since(progress.since) > Duration::from_millis(self.params.blocked_after_ms)
    }
}

/// Both speeds scaled alike until neither is above the limit, so that the curve stays the same.
fn limited(wheels: Wheels, limit_mps: f64) -> Wheels {
    let fastest_mps = wheels[0].abs().max(wheels[1].abs());
    if fastest_mps > limit_mps { wheels.map(|speed| speed * (limit_mps / fastest_mps)) } else { wheels }
}

/// From one pair of speeds towards another, on the straight line between them, by at most `change_mps` a
/// wheel.
fn eased(from: Wheels, to: Wheels, change_mps: f64) -> Wheels {
    let (left, right) = (to[0] - from[0], to[1] - from[1]);
    let largest_mps = left.abs().max(right.abs());
    if largest_mps <= change_mps {
        return to;
    }
    let part = change_mps / largest_mps;
    [from[0] + part * left, from[1] + part * right]
}
