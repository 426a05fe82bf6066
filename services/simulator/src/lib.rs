//! A simulated robot in a simulated building. It publishes the truth and nothing else: sensors and referees
//! are other services that look at it. Differential drive with two unlike motors (COF-012), furniture,
//! people, doors and the elevator of a world file (COF-120, COF-133).

mod drive;
mod elevator;
mod kept;
mod obstacles;
mod params;
mod people;

#[cfg(test)]
mod building_tests;
#[cfg(test)]
mod tests;

pub use kept::Snapshot;
pub use params::{MotionErrors, Params, ParamsError};

use drive::Drive;
use elevator::{Car, Rider};
use geometry::{Pose2, World};
use messages::{
    AppliedWheels, BodyKind, ElevatorCall, ElevatorState, Parameters, Stamped, Time, TrueBody, WheelSpeeds,
    WorldTruth, body_kind,
};
use obstacles::{Footprint, LeafOf, Obstacles, RELEASE_M};
use people::{Person, RobotSeen};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::time::Duration;

/// No step makes up for more lost time than this: a computer that slept does not wake to a leap.
const MOST_STEPS_AT_ONCE: u32 = 50;
/// The longest time from one message of the elevator to the next.
const ELEVATOR_PERIOD_S: f64 = 0.1;
/// The fastest that a motor turns, whatever it is told.
const FASTEST_MPS: f64 = 3.0;
/// Tells the random numbers of a start from those of the wheels.
const START_STREAM: u64 = 0x5747_4152_5453;

/// What the simulator looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// What the motors are told: the newest of `wheels/applied`.
    pub applied: Option<Stamped<'a, AppliedWheels>>,
    /// The newest of `elevator/call`.
    pub call: Option<Stamped<'a, ElevatorCall>>,
}

/// What the simulator says.
#[derive(Debug, Clone, Copy)]
pub struct Outputs<'a> {
    /// The header for `world/truth`.
    pub truth: &'a WorldTruth,
    /// The elements for `world/truth`: the world file's furniture, then its people, each in the file's order.
    pub bodies: &'a [TrueBody],
    /// For `elevator/state`: with every change, and ten times a second.
    pub elevator: Option<ElevatorState>,
}

/// The world's state.
#[derive(Debug, Clone)]
pub struct Simulator {
    params: Params,
    rng: Pcg64,
    footprint: Footprint,
    last_step: Option<Time>,
    pose: Pose2,
    drive: Drive,
    in_contact: bool,
    doors: Vec<DoorMotion>,
    people: Vec<Person>,
    car: Option<Car>,
    floors: Vec<Obstacles>,
    truth: WorldTruth,
    bodies: Vec<TrueBody>,
    elevator_said: Option<(f64, ElevatorState)>,
}

#[derive(Debug, Clone)]
struct DoorMotion {
    door: geometry::world::Door,
    place: Pose2,
    moves_since_s: Option<f64>,
    fraction: f64,
}

impl Simulator {
    /// A world at its beginning.
    ///
    /// # Errors
    /// When a parameter makes no sense, the world file cannot be read, or the robot has no free place in it.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::in_world(params, &world, seed)
    }

    /// A simulator in a world that is at hand already; `params.world` only names it.
    ///
    /// # Errors
    /// When a parameter makes no sense, or the robot has no free place in the world.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        let (name, robot) = (params.world.clone(), params.robot.clone());
        let random = params.random_start && !world.floors.is_empty();
        let (floor, pose) = match world.start(&robot) {
            _ if random => (world.floors[0].number, Pose2::IDENTITY),
            Some(start) => (start.floor, start.pose),
            None if world.floors.is_empty() => (0, Pose2::IDENTITY),
            None => return Err(ParamsError::NoStart { world: name, robot }),
        };
        let footprint =
            Footprint { half_length_m: 0.5 * params.body_length_m, half_width_m: 0.5 * params.body_width_m };
        let numbers = world.floors.iter().map(|floor| floor.number);
        let floors = numbers.map(|number| Obstacles::new(world, number, params.body_height_m)).collect();
        let doors = world.doors.iter().map(|door| {
            let place = Pose2::new(door.at[0], door.at[1], 0.0);
            DoorMotion { door: door.clone(), place, moves_since_s: None, fraction: f64::NAN }
        });
        let furniture = world.furniture.iter().map(|item| TrueBody {
            x_m: item.pose.x_m,
            y_m: item.pose.y_m,
            heading_rad: item.pose.heading_rad,
            floor: item.floor,
            kind: body_kind(item.kind).into(),
        });
        let people: Vec<_> = world.walkers.iter().cloned().map(Person::new).collect();
        let walkers = people.iter().map(|person| TrueBody {
            floor: person.floor(),
            kind: BodyKind::Walker.into(),
            ..TrueBody::default()
        });
        let mut simulator = Self {
            rng: Pcg64::seed_from_u64(seed),
            footprint,
            last_step: None,
            pose,
            drive: Drive::default(),
            in_contact: false,
            doors: doors.collect(),
            bodies: furniture.chain(walkers).collect(),
            people,
            car: world.elevators.first().and_then(|lift| Car::new(world, lift)),
            floors,
            truth: WorldTruth { floor, ..WorldTruth::default() },
            elevator_said: None,
            params,
        };
        simulator.move_doors(0.0);
        if random {
            simulator.pose = simulator.random_pose(world, seed)?;
        }
        simulator.write_truth();
        if simulator.touched(simulator.pose, 0.0) {
            return Err(ParamsError::StartBlocked { world: name, robot });
        }
        Ok(simulator)
    }

    /// Somewhere within the outline of the first floor, away from its walls, in any direction in which the
    /// body touches nothing.
    fn random_pose(&mut self, world: &World, seed: u64) -> Result<Pose2, ParamsError> {
        const TRIES: usize = 100;
        let clearance_m = self.params.start_clearance_m;
        let outline = world.floors.first().and_then(geometry::world::Floor::outline_polygon);
        // A stream of its own: what happens later does not depend on how often a pose was refused.
        let mut rng = Pcg64::seed_from_u64(seed ^ START_STREAM);
        for _ in 0..TRIES {
            let place =
                outline.as_ref().and_then(|outline| outline.random_place(clearance_m, || rng.random()));
            let Some(place) = place else { break };
            let pose = Pose2::new(place.x, place.y, std::f64::consts::TAU * rng.random::<f64>());
            if !self.touched(pose, RELEASE_M) {
                return Ok(pose);
            }
        }
        Err(ParamsError::NoRandomStart { world: self.params.world.clone(), clearance_m })
    }

    /// Lets the world's time catch up with `now`, in fixed steps.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        let period = self.params.period();
        let told = self.told(now, inputs.applied);
        let call = inputs.call.map(|call| *call.message);
        match self.last_step {
            None => self.last_step = Some(now),
            Some(mut last) => {
                let mut steps = 0;
                while now.since(last) >= period {
                    last = last.after(period);
                    steps += 1;
                    if steps > MOST_STEPS_AT_ONCE {
                        last = now;
                        break;
                    }
                    self.advance(period.as_secs_f64(), told, call.as_ref());
                }
                self.last_step = Some(last);
            }
        }
        self.write_truth();
        let elevator = self.elevator_news();
        Outputs { truth: &self.truth, bodies: &self.bodies, elevator }
    }

    /// What the motor controller makes of the newest command: nothing without one, and nothing of one that is
    /// too old, as the watchdogs of real motor controllers have it.
    fn told(&self, now: Time, applied: Option<Stamped<'_, AppliedWheels>>) -> WheelSpeeds {
        let watchdog = Duration::from_millis(self.params.watchdog_ms.into());
        let speeds = applied
            .and_then(|applied| applied.fresh(now, watchdog))
            .map(|applied| WheelSpeeds { left_mps: applied.left_mps, right_mps: applied.right_mps });
        speeds.filter(|speeds| speeds.is_within(FASTEST_MPS)).unwrap_or(WheelSpeeds::ZERO)
    }

    fn advance(&mut self, seconds: f64, told: WheelSpeeds, call: Option<&ElevatorCall>) {
        self.truth.world_time_s += seconds;
        self.move_doors(seconds);
        self.move_car(seconds, call);
        self.move_people(seconds);
        self.move_robot(seconds, told);
    }

    fn move_doors(&mut self, seconds: f64) {
        let now_s = self.truth.world_time_s;
        for (index, motion) in self.doors.iter_mut().enumerate() {
            if motion.moves_since_s.is_none()
                && let Some(trigger) = motion.door.moves
            {
                let here = motion.door.floor == self.truth.floor;
                let distance_m = if here { motion.place.distance_m(self.pose) } else { f64::INFINITY };
                motion.moves_since_s = trigger.goes_off(now_s, distance_m).then_some(now_s - seconds);
            }
            let fraction = motion.door.opening_fraction(motion.moves_since_s.map(|since_s| now_s - since_s));
            if fraction.to_bits() == motion.fraction.to_bits() {
                continue;
            }
            motion.fraction = fraction;
            if let Some(bits) = self.truth.open_doors.get_mut(index / 64) {
                let bit = 1 << (index % 64);
                *bits = if fraction >= 0.5 { *bits | bit } else { *bits & !bit };
            }
            for floor in self.floors.iter_mut().filter(|floor| floor.floor == motion.door.floor) {
                floor.open(LeafOf::Door(index), fraction);
            }
        }
    }

    fn move_car(&mut self, seconds: f64, call: Option<&ElevatorCall>) {
        let Some(car) = &mut self.car else { return };
        let before = car.opening_at(self.truth.floor);
        let robot = Rider { floor: self.truth.floor, pose: self.pose, footprint: self.footprint };
        if let Some(floor) = car.step(seconds, call, &robot) {
            self.truth.floor = floor;
        }
        if car.opening_at(self.truth.floor).to_bits() != before.to_bits() {
            for floor in self.floors.iter_mut().filter(|floor| car.floors().contains(&floor.floor)) {
                floor.open(LeafOf::Elevator(0), car.opening_at(floor.floor));
            }
        }
    }

    fn move_people(&mut self, seconds: f64) {
        let stands = self.drive.ground.is_within(0.01);
        let robot = RobotSeen { floor: self.truth.floor, pose: self.pose, stands, footprint: self.footprint };
        for person in &mut self.people {
            person.walk(&self.params, self.truth.world_time_s, seconds, &robot);
        }
    }

    fn move_robot(&mut self, seconds: f64, told: WheelSpeeds) {
        let next = self.drive.turn(&self.params, told, self.pose, seconds, &mut self.rng);
        let blocked = self.touched(next, 0.0);
        if blocked {
            self.drive.stall();
        } else {
            self.drive.count(seconds);
            self.pose = next;
        }
        // One contact lasts until there is air again between the body and everything else.
        if blocked && !self.in_contact {
            self.truth.contacts += 1;
        }
        self.in_contact = blocked || (self.in_contact && self.touched(self.pose, RELEASE_M));
    }

    /// Whether the robot's body, grown by a margin, would touch something at `pose`.
    fn touched(&mut self, pose: Pose2, margin_m: f64) -> bool {
        let (floor, footprint) = (self.truth.floor, self.footprint.grown(margin_m));
        let mut people = self.people.iter().filter(|person| person.floor() == floor);
        people.any(|person| person.is_touched(&footprint, pose))
            || self.floors.iter_mut().any(|level| level.floor == floor && level.touched(&footprint, pose))
    }

    fn write_truth(&mut self) {
        let (truth, drive) = (&mut self.truth, &self.drive);
        (truth.x_m, truth.y_m, truth.heading_rad) = (self.pose.x_m, self.pose.y_m, self.pose.heading_rad);
        (truth.left_mps, truth.right_mps) = (drive.ground.left_mps, drive.ground.right_mps);
        (truth.left_travel_m, truth.right_travel_m) = (drive.left_travel_m, drive.right_travel_m);
        let opening = self.car.as_ref().map_or(0.0, |car| car.opening_at(truth.floor));
        truth.elevator_door_percent = (100.0 * opening).round() as u32;
        let walkers = self.bodies.len() - self.people.len();
        for (body, person) in self.bodies[walkers..].iter_mut().zip(&self.people) {
            (body.x_m, body.y_m, body.heading_rad) =
                (person.pose.x_m, person.pose.y_m, person.pose.heading_rad);
        }
    }

    fn elevator_news(&mut self) -> Option<ElevatorState> {
        let state = self.car.as_ref()?.say();
        let now_s = self.truth.world_time_s;
        let is_old = |(said_s, said): (f64, ElevatorState)| {
            said != state || now_s - said_s >= ELEVATOR_PERIOD_S - 1e-9
        };
        if self.elevator_said.is_none_or(is_old) {
            self.elevator_said = Some((now_s, state));
            return Some(state);
        }
        None
    }
}
