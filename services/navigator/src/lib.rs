//! Serves orders for coffee: collects it in the tea room, travels, rides the elevator, halts at the door,
//! returns; when the way is blocked it waits, backs off, plans anew and at last asks for help (COF-001,
//! COF-005, COF-133, X-28; note 2.4).

mod building;
mod docking;
mod mission;
mod navigate;
mod orders;
mod params;
#[cfg(test)]
mod tests;
mod trouble;

pub use building::{Building, Lift, Room, Spot};
pub use mission::{Ride, Snapshot, Stage};
pub use orders::{Job, OrderBook};
pub use params::{Params, ParamsError};

use docking::Docking;
use geometry::{Pose2, World};
use messages::{
    AppliedWheels, Clearance, DeliveryStatus, DeliveryStatusName, DoorSighting, DriveCommand, DriveMode,
    DriveModeName, ElevatorCall, ElevatorState, FixedText, MissionStatus, Order, OrderReport, OrderStateName,
    Parameters, Path, PlanRequest, PoseEstimate, RoomName, Stamped, Time, Verdict,
};
use std::time::Duration;
use trouble::{Remedy, Watch};

/// The longest time from one mission status to the next.
const STATUS_PERIOD_S: f64 = 0.2;
/// Wheels, sightings and the guard's word are used when younger than this.
const FRESH: Duration = Duration::from_millis(500);
/// How long a remark about a refused order stands.
const NOTICE_S: f64 = 10.0;
/// There may be a way when the robot looks from farther back.
const NO_WAY: &str = "there is no way to the goal";
/// A pose missing for longer makes the robot plan anew when it is back.
const LOST_S: f64 = 2.0;

/// What the navigator reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// Orders that arrived since the last step.
    pub orders: &'a [Stamped<'a, Order>],
    /// Where the robot is.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
    /// The planner's answer.
    pub path: Option<Stamped<'a, Path>>,
    /// The door beside the robot.
    pub sighting: Option<Stamped<'a, DoorSighting>>,
    /// May the robot move?
    pub clearance: Option<Stamped<'a, Clearance>>,
    /// Where the elevator is.
    pub elevator: Option<Stamped<'a, ElevatorState>>,
    /// What the wheels do.
    pub wheels: Option<Stamped<'a, AppliedWheels>>,
}

/// What the navigator says; `None` where the last word still holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// What became of orders: one for each that came, and for each that was carried out.
    pub reports: Vec<OrderReport>,
    /// What the robot is about: on change, and five times a second.
    pub status: Option<MissionStatus>,
    /// The path that is wanted: when it is a new one.
    pub request: Option<PlanRequest>,
    /// The motion that is needed now: in every step.
    pub command: DriveCommand,
    /// The wish to the elevator: on change.
    pub call: Option<ElevatorCall>,
}

/// What a step of the mission wants.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wish {
    mode: DriveModeName,
    heading_rad: f64,
    speed_mps: f64,
    /// What to say should the robot not get on: empty when it stands because it wants to.
    hindrance: &'static str,
}

impl Wish {
    /// Standing is what is wanted.
    const STAND: Self = Self { mode: DriveModeName::Hold, heading_rad: 0.0, speed_mps: 0.0, hindrance: "" };

    fn stand_because(hindrance: &'static str) -> Self {
        Self { hindrance, ..Self::STAND }
    }
}

/// What is known in one step, judged.
#[derive(Debug, Clone, Copy)]
struct Senses {
    now: Time,
    floor: i32,
    pose: Pose2,
    speed_mps: f64,
    car: Option<ElevatorState>,
    answer: Option<Path>,
    /// Where the planner's path ends: the goal, or the free place next to it.
    path_end: Option<Pose2>,
    sighting: Option<DoorSighting>,
}

/// The navigator.
#[derive(Debug, Clone)]
pub struct Navigator {
    params: Params,
    building: Building,
    kept: Snapshot,
    /// When the present stage, and the present part of a ride, began in this process.
    stage_since: Option<Time>,
    ride_since: Option<Time>,
    request: Option<PlanRequest>,
    /// A path was asked for in this process.
    has_asked: bool,
    docking: Option<Docking>,
    watch: Watch,
    call: ElevatorCall,
    said_call: Option<ElevatorCall>,
    odometer_m: f64,
    has_wheels: bool,
    last_step: Option<Time>,
    last_pose: Option<(Time, i32, Pose2)>,
    said: Option<(Time, MissionStatus)>,
    notice: Option<(Time, String)>,
}

impl Navigator {
    /// Reads the world that the parameters name; without one every order is refused.
    ///
    /// # Errors
    /// When a parameter or the world cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let building = if params.world.is_empty() {
            Building::default()
        } else {
            Building::from_world(&World::load(&params.world)?, &params.home, params.elevator_wait_m)
        };
        Self::with_building(params, building)
    }

    /// A navigator with the building given.
    ///
    /// # Errors
    /// When a parameter is out of range.
    pub fn with_building(params: Params, building: Building) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self {
            params,
            building,
            kept: Snapshot::default(),
            stage_since: None,
            ride_since: None,
            request: None,
            has_asked: false,
            docking: None,
            watch: Watch::default(),
            call: ElevatorCall::default(),
            said_call: None,
            odometer_m: 0.0,
            has_wheels: false,
            last_step: None,
            last_pose: None,
            said: None,
            notice: None,
        })
    }

    /// All that is needed to go on elsewhere: keep it after every step in which it changed.
    pub fn snapshot(&self) -> Snapshot {
        self.kept.clone()
    }

    /// Goes on from a snapshot: stage, orders and numbers are taken over, the present leg is planned anew. A
    /// room that this building does not have any more ends its order.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.kept = snapshot.clone();
        (self.stage_since, self.ride_since, self.request, self.docking) = (None, None, None, None);
        self.watch = Watch::default();
        // What was called is not known any more; the parts of a ride that need a call make a new one.
        self.call = ElevatorCall::default();
    }

    /// What the world says of the building.
    pub fn building(&self) -> &Building {
        &self.building
    }

    /// Takes orders, decides what to do next, and says so.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        let mut reports = self.take_orders(now, inputs.orders);
        let job_before = (self.kept.delivered, self.kept.job.clone());
        self.count_way(now, &inputs);
        let request_before = self.request;
        let senses = self.sense(now, &inputs);
        let wish = match &senses {
            Some(senses) => {
                let wish = self.pursue(senses);
                let stopped = inputs
                    .clearance
                    .and_then(|word| word.fresh(now, FRESH))
                    .is_some_and(|word| word.signal != Verdict::Go);
                self.supervise(senses, wish, stopped)
            }
            None => Wish::stand_because("location lost"),
        };
        let request = self.request.filter(|request| Some(*request) != request_before);
        let call = (self.call.call_id != 0 && self.said_call != Some(self.call)).then_some(self.call);
        self.said_call = call.or(self.said_call);
        self.last_step = Some(now);
        let command = DriveCommand {
            request_id: self.request.map_or(0, |request| request.request_id),
            heading_rad: wish.heading_rad,
            max_speed_mps: wish.speed_mps,
            mode: DriveMode::from(wish.mode),
            reserved: 0,
        };
        if let (before, Some(job)) = job_before
            && self.kept.delivered > before
        {
            let (room, state) = (FixedText::truncated(&job.room), OrderStateName::Delivered.into());
            reports.push(OrderReport { order_id: job.order_id, room, state, ..OrderReport::default() });
        }
        Outputs { reports, status: self.say(now, senses.as_ref()), request, command, call }
    }

    fn take_orders(&mut self, now: Time, orders: &[Stamped<'_, Order>]) -> Vec<OrderReport> {
        let by_default = self.kept.orders.take_default(&self.params.default_order, &self.building);
        let taken = orders.iter().filter_map(|order| self.kept.orders.take(now, order, &self.building));
        let reports: Vec<OrderReport> = by_default.into_iter().chain(taken).collect();
        let refused = reports.iter().rev().find(|report| report.state == OrderStateName::Refused);
        if let Some(refused) = refused {
            // Here is less space than in the report, whose second half is advice.
            let why = refused.remark.as_str().split(';').next().unwrap_or_default();
            self.notice = Some((now, format!("refused: {why}")));
        }
        reports
    }

    /// Adds up the way travelled forward, by the wheels.
    fn count_way(&mut self, now: Time, inputs: &Inputs<'_>) {
        let speed_mps = speed_of(inputs.wheels, now);
        self.has_wheels |= speed_mps.is_some();
        let passed_s = self.last_step.map_or(0.0, |last| now.seconds_since(last)).min(0.5);
        self.odometer_m += speed_mps.unwrap_or(0.0) * passed_s;
    }

    /// Everything judged; `None` without a pose that can be used.
    fn sense(&mut self, now: Time, inputs: &Inputs<'_>) -> Option<Senses> {
        let estimate = inputs.pose.and_then(|pose| pose.fresh(now, self.params.pose_max_age()))?;
        let pose = estimate.pose().ok()?;
        let floor = estimate.floor;
        if self.last_pose.is_some_and(|(seen, ..)| now.seconds_since(seen) > LOST_S) {
            // It may have been carried meanwhile.
            self.request = None;
        }
        self.last_pose = Some((now, floor, pose));
        let asked = self.request.map(|request| request.request_id);
        let room = self.kept.job.as_ref().map(|job| job.room.as_str());
        let sighting = inputs.sighting.and_then(|sighting| sighting.fresh(now, FRESH));
        let answer = inputs.path.filter(|path| Some(path.request_id) == asked);
        Some(Senses {
            now,
            floor,
            pose,
            speed_mps: speed_of(inputs.wheels, now).unwrap_or(0.0),
            car: inputs.elevator.map(|car| *car),
            answer: answer.map(|path| *path),
            path_end: answer
                .and_then(|path| path.elements.last().map(|end| Pose2::new(end.x_m, end.y_m, 0.0))),
            sighting: sighting
                .map(|seen| *seen)
                .filter(|seen| Some(seen.room.as_str()) == room && seen.floor == floor),
        })
    }

    /// Overrules the mission's wish while the robot does not get on.
    fn supervise(&mut self, senses: &Senses, wish: Wish, stopped: bool) -> Wish {
        let Senses { now, pose, .. } = *senses;
        if wish.hindrance.is_empty() && !self.watch.is_fault() {
            self.watch.content(now, pose);
            return wish;
        }
        let why = if stopped && wish.mode != DriveModeName::Hold {
            "an obstacle is in the way"
        } else {
            wish.hindrance
        };
        match self.watch.judge(now, pose, why, &self.params) {
            Remedy::None => wish,
            Remedy::Fault => Wish::STAND,
            Remedy::BackOff if wish.mode == DriveModeName::Hold && wish.hindrance != NO_WAY => wish,
            Remedy::BackOff => {
                let speed_mps = self.params.back_off_speed_mps;
                Wish { mode: DriveModeName::BackOff, speed_mps, heading_rad: pose.heading_rad, ..wish }
            }
            Remedy::Replan => {
                // The next step asks anew.
                self.request = None;
                self.docking = None;
                self.ride_since = None;
                Wish { mode: DriveModeName::Hold, ..wish }
            }
        }
    }

    fn say(&mut self, now: Time, senses: Option<&Senses>) -> Option<MissionStatus> {
        let (status, remark) = if self.watch.is_fault() {
            (DeliveryStatusName::Fault, self.watch.blocked().unwrap_or("human help is needed"))
        } else if let (None, Some(_)) = (senses, &self.kept.job) {
            (DeliveryStatusName::Blocked, "location lost")
        } else if let Some(why) = self.watch.blocked() {
            (DeliveryStatusName::Blocked, why)
        } else {
            (self.kept.status(), "")
        };
        let notice = self.notice.as_ref().filter(|(since, _)| now.seconds_since(*since) < NOTICE_S);
        let remark = if remark.is_empty() { notice.map_or("", |(_, text)| text) } else { remark };
        let goal = self.request.map(|request| [request.goal_x_m, request.goal_y_m]);
        let here = self.last_pose.map(|(_, _, pose)| [pose.x_m, pose.y_m]).unwrap_or_default();
        let [goal_x_m, goal_y_m] = goal.unwrap_or(here);
        let job = self.kept.job.as_ref();
        let message = MissionStatus {
            order_id: job.map_or(0, |job| job.order_id),
            delivered: self.kept.delivered,
            plans: self.kept.plans,
            goal_x_m,
            goal_y_m,
            distance_m: (goal_x_m - here[0]).hypot(goal_y_m - here[1]),
            room: job.map_or(RoomName::EMPTY, |job| FixedText::truncated(&job.room)),
            status: DeliveryStatus::from(status),
            waiting: u32::try_from(self.kept.orders.waiting()).unwrap_or(u32::MAX),
            remark: FixedText::truncated(remark),
        };
        let news = |last: &MissionStatus| {
            let essence = |status: &MissionStatus| {
                (
                    status.status,
                    status.order_id,
                    status.delivered,
                    status.plans,
                    status.waiting,
                    status.remark,
                )
            };
            essence(last) != essence(&message)
        };
        let due = self
            .said
            .as_ref()
            .is_none_or(|(since, last)| now.seconds_since(*since) >= STATUS_PERIOD_S || news(last));
        if !due {
            return None;
        }
        self.said = Some((now, message));
        Some(message)
    }
}

/// Speed forward by the wheels, if they are heard and finite.
fn speed_of(wheels: Option<Stamped<'_, AppliedWheels>>, now: Time) -> Option<f64> {
    let wheels = wheels.and_then(|wheels| wheels.fresh(now, FRESH))?;
    let speed_mps = 0.5 * (wheels.left_mps + wheels.right_mps);
    (speed_mps.abs() < 10.0).then_some(speed_mps)
}
