//! A tiny robot in a tiny building: ideal motion with limited acceleration, sightings of doors, a planner of
//! straight lines, a car.

use crate::{Building, Inputs, Lift, Navigator, Outputs, Params, Room, Snapshot, Spot};
use geometry::{Pose2, angle};
use messages::*;

pub(super) const HOME: Spot = Spot { floor: 2, x_m: 3.6, y_m: -0.3 };
const STEP_S: f64 = 0.1;

/// Rooms as in the CS building: odd ones on the right of who drives along x, even ones on the left.
pub(super) fn building() -> Building {
    let right = [
        ("213", 4.4),
        ("211", 9.2),
        ("209", 12.8),
        ("207", 16.6),
        ("205", 20.4),
        ("203", 22.2),
        ("201", 28.6),
    ];
    let left = [("212", 9.4), ("210", 12.4), ("208", 17.0), ("206", 20.8), ("204", 25.0), ("202", 28.2)];
    let room = |floor: i32, name: &str, x_m: f64, side: f64| Room {
        name: name.to_owned(),
        door: Spot { floor, x_m, y_m: 0.85 * side },
        into: [0.0, side],
    };
    let mut rooms: Vec<Room> = right.iter().map(|&(name, x_m)| room(2, name, x_m, -1.0)).collect();
    rooms.extend(left.iter().map(|&(name, x_m)| room(2, name, x_m, 1.0)));
    rooms.extend([room(3, "302", 28.2, 1.0), room(3, "309", 12.8, -1.0)]);
    let into_rad = -std::f64::consts::FRAC_PI_2;
    let lift = Lift { floors: vec![2, 3], wait: [1.6, 0.15], car: [1.6, -1.75], into_rad };
    Building { rooms, home: Some(HOME), lift: Some(lift) }
}

/// The world around one navigator.
pub(super) struct World {
    pub(super) navigator: Navigator,
    pub(super) now: Time,
    pub(super) floor: i32,
    pub(super) pose: Pose2,
    /// Estimated minus true place.
    pub(super) bias_m: [f64; 2],
    pub(super) sees_doors: bool,
    pub(super) is_located: bool,
    pub(super) guard_stops: bool,
    pub(super) plan_state: PlanStateName,
    pub(super) has_lift: bool,
    pub(super) said: Vec<DeliveryStatusName>,
    pub(super) last_status: MissionStatus,
    pub(super) command: DriveCommand,
    /// True distance from the door's centre line at each halt at a door.
    pub(super) halts_m: Vec<f64>,
    speed_mps: f64,
    request: PlanRequest,
    call: ElevatorCall,
    car: ElevatorState,
    car_timer_s: f64,
    orders: Vec<Order>,
    sequence: u64,
}

impl World {
    pub(super) fn new(params: Params) -> Self {
        Self {
            navigator: Navigator::with_building(params, building()).unwrap(),
            now: Time::from_nanos(5_000_000_000),
            floor: 2,
            pose: Pose2::new(HOME.x_m, HOME.y_m, 0.0),
            bias_m: [0.0; 2],
            sees_doors: true,
            is_located: true,
            guard_stops: false,
            plan_state: PlanStateName::Found,
            has_lift: true,
            said: Vec::new(),
            last_status: MissionStatus::default(),
            command: DriveCommand::default(),
            halts_m: Vec::new(),
            speed_mps: 0.0,
            request: PlanRequest::default(),
            call: ElevatorCall::default(),
            car: ElevatorState { call_id: 0, floor: 2, state: CarState::Closed.into() },
            car_timer_s: 0.0,
            orders: Vec::new(),
            sequence: 0,
        }
    }

    pub(super) fn order(&mut self, order_id: u64, room: &str) {
        self.orders.push(Order { order_id, room: FixedText::new(room).unwrap() });
    }

    /// Kills the navigator and starts another one from what was kept, as text.
    pub(super) fn kill(&mut self, params: Params) {
        let kept = serde_json::to_string(&self.navigator.snapshot()).unwrap();
        let kept: Snapshot = serde_json::from_str(&kept).unwrap();
        self.navigator = Navigator::with_building(params, building()).unwrap();
        self.navigator.restore(&kept);
    }

    pub(super) fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S) as usize {
            self.step();
        }
    }

    /// Runs until a status is said; panics when it is not within `seconds`.
    #[track_caller]
    pub(super) fn run_until(&mut self, status: DeliveryStatusName, seconds: f64) {
        for _ in 0..(seconds / STEP_S) as usize {
            self.step();
            if self.last_status.status == status {
                return;
            }
        }
        panic!(
            "no {status:?} within {seconds} s: {:?} at {:?}, {:?}",
            self.said, self.pose, self.last_status
        );
    }

    pub(super) fn step(&mut self) {
        self.now = self.now.after(std::time::Duration::from_millis(100));
        self.move_car();
        let now = self.now;
        let state = if self.is_located { LocationStateName::Tracking } else { LocationStateName::Lost };
        let estimate = PoseEstimate {
            x_m: self.pose.x_m + self.bias_m[0],
            y_m: self.pose.y_m + self.bias_m[1],
            heading_rad: self.pose.heading_rad,
            floor: self.floor,
            state: state.into(),
            ..PoseEstimate::default()
        };
        let path = Path {
            request_id: self.request.request_id,
            revision: 1,
            floor: self.request.floor,
            state: PlanState::from(self.plan_state),
            ..Path::default()
        };
        let waypoints = [
            Waypoint { x_m: estimate.x_m, y_m: estimate.y_m },
            Waypoint { x_m: self.request.goal_x_m, y_m: self.request.goal_y_m },
        ];
        let signal = if self.guard_stops { Verdict::Stop } else { Verdict::Go };
        let clearance = Clearance { signal: signal.into(), ..Clearance::default() };
        let wheels =
            AppliedWheels { left_mps: self.speed_mps, right_mps: self.speed_mps, ..AppliedWheels::default() };
        let sighting = self.sighting();
        let orders = std::mem::take(&mut self.orders);
        let stamped: Vec<Stamped<'_, Order>> = orders
            .iter()
            .map(|order| {
                self.sequence += 1;
                Stamped { sequence: self.sequence, ..Stamped::new(now, order) }
            })
            .collect();
        let outputs = self.navigator.step(
            now,
            Inputs {
                orders: &stamped,
                pose: Some(Stamped::new(now, &estimate)),
                path: Some(Stamped::with_elements(now, &path, &waypoints)),
                sighting: sighting.as_ref().map(|sighting| Stamped::new(now, sighting)),
                clearance: Some(Stamped::new(now, &clearance)),
                elevator: self.has_lift.then(|| Stamped::new(now, &self.car)),
                wheels: Some(Stamped::new(now, &wheels)),
            },
        );
        self.take(outputs);
        self.drive();
    }

    fn take(&mut self, outputs: Outputs) {
        self.request = outputs.request.unwrap_or(self.request);
        self.call = outputs.call.unwrap_or(self.call);
        self.command = outputs.command;
        if let Some(status) = outputs.status {
            let name = status.status.get().unwrap();
            if self.said.last() != Some(&name) {
                self.said.push(name);
                if name == DeliveryStatusName::AtDoor {
                    let room = building().room(status.room.as_str()).unwrap().clone();
                    assert_eq!(room.door.floor, self.floor);
                    self.halts_m.push((room.door.x_m - self.pose.x_m).abs());
                }
            }
            self.last_status = status;
        }
    }

    /// The door ordered, from the near edge on until it is behind.
    fn sighting(&self) -> Option<DoorSighting> {
        let rooms = building();
        let room = rooms.room(self.last_status.room.as_str()).filter(|room| room.door.floor == self.floor)?;
        let forward = if self.pose.heading_rad.cos() > 0.0 { 1.0 } else { -1.0 };
        let offset_m = (room.door.x_m - self.pose.x_m) * forward;
        (self.sees_doors && (-1.2..0.55).contains(&offset_m)).then(|| DoorSighting {
            offset_m,
            confidence: 0.8,
            sightings: 1,
            room: self.last_status.room,
            floor: self.floor,
            ..DoorSighting::default()
        })
    }

    fn drive(&mut self) {
        let most_mps = self.command.max_speed_mps;
        let turn_to = |pose: Pose2, heading_rad: f64, most_rad: f64| {
            angle::difference(heading_rad, pose.heading_rad).clamp(-most_rad, most_rad)
        };
        let (wanted_mps, turn_rad) = match self.command.mode.get().unwrap() {
            DriveModeName::Hold => (0.0, 0.0),
            DriveModeName::FollowPath if self.plan_state == PlanStateName::Found => {
                let (dx, dy) = (
                    self.request.goal_x_m - self.pose.x_m - self.bias_m[0],
                    self.request.goal_y_m - self.pose.y_m - self.bias_m[1],
                );
                let turn_rad = turn_to(self.pose, dy.atan2(dx), 0.2);
                let mps = if turn_rad.abs() < 0.15 { most_mps.min(dx.hypot(dy)) } else { 0.0 };
                if dx.hypot(dy) < 0.1 { (0.0, 0.0) } else { (mps, turn_rad) }
            }
            DriveModeName::FollowPath => (0.0, 0.0),
            DriveModeName::TurnTo => (0.0, turn_to(self.pose, self.command.heading_rad, 0.1)),
            DriveModeName::Creep => (most_mps, turn_to(self.pose, self.command.heading_rad, 0.05)),
            DriveModeName::BackOff => (-most_mps, 0.0),
        };
        if self.guard_stops {
            self.speed_mps = 0.0;
            return;
        }
        self.speed_mps += (wanted_mps - self.speed_mps).clamp(-0.05, 0.05);
        self.pose = self.pose.after_arc(self.speed_mps * STEP_S, turn_rad);
    }

    /// Two seconds for the door, five for a storey; it stands open while held, else for six seconds.
    fn move_car(&mut self) {
        let inside = (self.pose.x_m - 1.6).abs() < 0.5 && self.pose.y_m < -1.2;
        let is_new = self.call.call_id != 0 && self.call.call_id != self.car.call_id;
        self.car.call_id = self.call.call_id;
        self.car_timer_s -= STEP_S;
        let wants_other = self.call.call_id != 0 && self.call.floor != self.car.floor;
        let (state, timer_s) = match self.car.state.get().unwrap() {
            CarState::Closed if wants_other => (CarState::Moving, 5.0),
            CarState::Closed if is_new => (CarState::Opening, 2.0),
            CarState::Moving if self.car_timer_s <= 0.0 => {
                if inside && self.floor == self.car.floor {
                    self.floor = self.call.floor;
                }
                self.car.floor = self.call.floor;
                (CarState::Opening, 2.0)
            }
            CarState::Opening if self.car_timer_s <= 0.0 => (CarState::Open, 6.0),
            CarState::Open if self.call.hold_doors == 0 && (wants_other || self.car_timer_s <= 0.0) => {
                (CarState::Closing, 2.0)
            }
            CarState::Closing if is_new && !wants_other => (CarState::Opening, 2.0),
            CarState::Closing if self.car_timer_s <= 0.0 => (CarState::Closed, 0.0),
            same => (same, self.car_timer_s),
        };
        (self.car.state, self.car_timer_s) = (state.into(), timer_s);
    }
}
