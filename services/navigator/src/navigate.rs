//! The stages of a delivery, one after the other: each step says what motion it wants.

use crate::building::{Lift, Spot};
use crate::docking::{Docking, DockingStep, DockingView};
use crate::mission::{Ride, Stage};
use crate::{NO_WAY, Navigator, Senses, Wish};
use geometry::{Pose2, angle};
use messages::{CarState, DriveModeName, ElevatorCall, PlanRequest, PlanStateName};

/// How long a delivery is shown as delivered.
const DELIVERED_S: f64 = 1.0;
/// Facing the elevator within this angle is enough to drive in.
const FACING_RAD: f64 = 0.15;
/// A robot that stands near its goal for this long has arrived.
const CLOSE_ENOUGH: (f64, f64) = (2.0, 2.0);
/// The place before the elevator is reached within this share of the tolerance of other places.
const BEFORE_ELEVATOR: f64 = 0.4;
/// Farther from the approach than this, the search for the door begins anew.
const ASTRAY_M: f64 = 0.8;

/// What became of a drive.
enum Drive {
    Arrived,
    Going(Wish),
}

impl Navigator {
    /// What the mission wants now. Stages that end at once hand over to the next within the step.
    pub(crate) fn pursue(&mut self, senses: &Senses) -> Wish {
        let now = senses.now;
        let since = *self.stage_since.get_or_insert(now);
        let waited_s = now.seconds_since(since);
        match self.kept.stage {
            Stage::Idle => {
                if let Some(job) = self.kept.orders.next() {
                    self.kept.job = Some(job);
                    self.enter(Stage::Ordered);
                }
                Wish::STAND
            }
            Stage::Ordered => {
                self.enter(Stage::Collecting);
                Wish::STAND
            }
            Stage::Collecting => self.drive_home(senses, Stage::Loading),
            Stage::Loading => {
                if waited_s >= self.params.load_s {
                    self.enter(Stage::Travelling);
                }
                Wish::STAND
            }
            Stage::Travelling => self.travel(senses),
            Stage::NearDoor => self.dock(senses),
            Stage::AtDoor => {
                if waited_s >= self.params.dwell_s {
                    self.kept.delivered += 1;
                    self.enter(Stage::Delivered);
                }
                Wish::STAND
            }
            Stage::Delivered => {
                if waited_s >= DELIVERED_S {
                    self.kept.job = None;
                    self.enter(Stage::Returning);
                }
                Wish::STAND
            }
            Stage::Returning => {
                // The way home is the way to the next coffee; on a ride it is finished first.
                if self.kept.ride == Ride::None
                    && let Some(job) = self.kept.orders.next()
                {
                    self.kept.job = Some(job);
                    self.enter(Stage::Ordered);
                    return Wish::STAND;
                }
                self.drive_home(senses, Stage::Idle)
            }
        }
    }

    fn enter(&mut self, stage: Stage) {
        self.kept.stage = stage;
        self.kept.ride = Ride::None;
        (self.stage_since, self.ride_since, self.docking, self.request) = (None, None, None, None);
    }

    fn drive_home(&mut self, senses: &Senses, then: Stage) -> Wish {
        let Some(home) = self.building.home else { return Wish::stand_because("the tea room is not known") };
        match self.drive(senses, home) {
            Drive::Going(wish) => wish,
            Drive::Arrived => {
                self.enter(then);
                Wish::STAND
            }
        }
    }

    /// Drives to where the search for the door begins.
    fn travel(&mut self, senses: &Senses) -> Wish {
        let Some((door, into)) = self.kept.door(&self.building) else { return self.abandon(senses) };
        let is_first = self.request.is_none() && self.kept.ride == Ride::None;
        if is_first {
            self.kept.door_heading_rad = self.passing_heading_rad(senses, door, into);
        }
        let goal = self.approach(door, into);
        match self.drive(senses, goal) {
            Drive::Going(wish) => wish,
            Drive::Arrived => {
                self.enter(Stage::NearDoor);
                Wish::STAND
            }
        }
    }

    /// The direction along the wall in which the door is passed: the one in which the robot comes, from the
    /// elevator on another floor.
    fn passing_heading_rad(&self, senses: &Senses, door: Spot, into: [f64; 2]) -> f64 {
        let from = match &self.building.lift {
            Some(lift) if senses.floor != door.floor => lift.wait,
            _ => [senses.pose.x_m, senses.pose.y_m],
        };
        let along = [-into[1], into[0]];
        let ahead = (door.x_m - from[0]) * along[0] + (door.y_m - from[1]) * along[1];
        let sign = if ahead >= 0.0 { 1.0 } else { -1.0 };
        (sign * along[1]).atan2(sign * along[0])
    }

    /// The place `approach_m` before the door, on the line on which it is passed.
    fn approach(&self, door: Spot, into: [f64; 2]) -> Spot {
        let (sine, cosine) = self.kept.door_heading_rad.sin_cos();
        let is_right = into[0] * sine - into[1] * cosine > 0.0;
        let aside_m = if is_right { self.params.right_door_m } else { self.params.left_door_m };
        let before_m = self.params.approach_m;
        Spot {
            floor: door.floor,
            x_m: door.x_m - into[0] * aside_m - cosine * before_m,
            y_m: door.y_m - into[1] * aside_m - sine * before_m,
        }
    }

    fn dock(&mut self, senses: &Senses) -> Wish {
        let Some((door, into)) = self.kept.door(&self.building) else { return self.abandon(senses) };
        let heading_rad = self.kept.door_heading_rad;
        let (sine, cosine) = heading_rad.sin_cos();
        let map_offset_m = (door.x_m - senses.pose.x_m) * cosine + (door.y_m - senses.pose.y_m) * sine;
        let from_wall_m = (door.x_m - senses.pose.x_m) * into[0] + (door.y_m - senses.pose.y_m) * into[1];
        let along = -(self.params.overrun_m + ASTRAY_M)..self.params.approach_m + ASTRAY_M;
        let is_near =
            senses.floor == door.floor && along.contains(&map_offset_m) && (0.0..1.7).contains(&from_wall_m);
        if !is_near {
            self.enter(Stage::Travelling);
            return Wish::stand_because("away from the door");
        }
        let docking = self.docking.get_or_insert_with(|| Docking::new(senses.now));
        let view = DockingView {
            now: senses.now,
            pose: senses.pose,
            heading_rad,
            map_offset_m,
            sighting: senses.sighting,
            odometer_m: if self.has_wheels { self.odometer_m } else { -map_offset_m },
            speed_mps: senses.speed_mps,
        };
        let wish =
            |mode, speed_mps| Wish { mode, heading_rad, speed_mps, hindrance: "cannot move at the door" };
        match docking.step(&view, &self.params) {
            DockingStep::Turn => wish(DriveModeName::TurnTo, self.params.creep_speed_mps),
            DockingStep::Creep(speed_mps) => wish(DriveModeName::Creep, speed_mps),
            DockingStep::BackOff(speed_mps) => wish(DriveModeName::BackOff, speed_mps),
            DockingStep::Hold => Wish::STAND,
            DockingStep::Done => {
                self.enter(Stage::AtDoor);
                Wish::STAND
            }
            DockingStep::Repeat => {
                self.enter(Stage::Travelling);
                self.watch.fail(senses.now, senses.pose, "cannot halt at the door", &self.params);
                wish(DriveModeName::Hold, 0.0)
            }
        }
    }

    /// The room is gone from the world: the order ends.
    fn abandon(&mut self, senses: &Senses) -> Wish {
        let room = self.kept.job.take().map(|job| job.room).unwrap_or_default();
        self.notice = Some((senses.now, format!("given up: there is no room `{room}`")));
        self.enter(Stage::Returning);
        Wish::STAND
    }

    /// Drives to a place, with the elevator where it is on another floor.
    fn drive(&mut self, senses: &Senses, goal: Spot) -> Drive {
        if self.kept.ride == Ride::None && senses.floor == goal.floor {
            return self.follow_path(senses, goal);
        }
        let Some(lift) = self.building.lift.clone() else {
            return Drive::Going(Wish::stand_because("no elevator to another floor"));
        };
        Drive::Going(self.ride(senses, goal, &lift))
    }

    /// The elevator's state machine: call, wait for an open car, drive in, call it to the other floor, wait
    /// there, drive out.
    fn ride(&mut self, senses: &Senses, goal: Spot, lift: &Lift) -> Wish {
        let now = senses.now;
        let waited_s = now.seconds_since(*self.ride_since.get_or_insert(now));
        let is_late = waited_s > self.params.elevator_timeout_s;
        let open_here = senses.car.is_some_and(|car| {
            car.floor == senses.floor && car.state.get().is_ok_and(|state| state == CarState::Open)
        });
        let spot = |[x_m, y_m]: [f64; 2]| Spot { floor: senses.floor, x_m, y_m };
        let turn = |heading_rad: f64| {
            let askew_rad = angle::difference(heading_rad, senses.pose.heading_rad).abs();
            (askew_rad > FACING_RAD).then_some(Wish {
                mode: DriveModeName::TurnTo,
                heading_rad,
                speed_mps: self.params.creep_speed_mps,
                hindrance: "cannot turn at the elevator",
            })
        };
        match self.kept.ride {
            Ride::None => {
                self.change_ride(Ride::Approaching);
                Wish::STAND
            }
            // Somebody carried the robot, or its floor was mistaken.
            Ride::Approaching | Ride::Waiting if senses.floor == goal.floor => {
                self.change_ride(Ride::None);
                Wish::STAND
            }
            Ride::Approaching => match self.follow_path(senses, spot(lift.wait)) {
                Drive::Going(wish) => wish,
                Drive::Arrived => {
                    self.change_ride(Ride::Waiting);
                    Wish::STAND
                }
            },
            Ride::Waiting => {
                let wish = turn(lift.into_rad).unwrap_or(Wish::STAND);
                if self.call.floor != senses.floor
                    || self.call.hold_doors != 1
                    || self.call.call_id == 0
                    || is_late
                {
                    self.call_car(senses.floor, true);
                    if is_late {
                        self.ride_since = None;
                        self.watch.fail(now, senses.pose, "the elevator does not come", &self.params);
                        return Wish::stand_because("the elevator does not come");
                    }
                }
                if wish == Wish::STAND && open_here {
                    self.change_ride(Ride::Entering);
                }
                wish
            }
            Ride::Entering => {
                if self.call.call_id == 0 {
                    self.call_car(senses.floor, true);
                }
                match self.follow_path(senses, spot(lift.car)) {
                    Drive::Going(wish) => wish,
                    Drive::Arrived => {
                        self.change_ride(Ride::Riding);
                        self.call_car(goal.floor, false);
                        Wish::STAND
                    }
                }
            }
            Ride::Riding => {
                if self.call.call_id == 0 || self.call.floor != goal.floor || is_late {
                    self.call_car(goal.floor, false);
                    if is_late {
                        self.ride_since = None;
                        self.watch.fail(now, senses.pose, "the elevator does not arrive", &self.params);
                        return Wish::stand_because("the elevator does not arrive");
                    }
                }
                if senses.car.is_some_and(|car| car.floor == goal.floor && car.call_id == self.call.call_id)
                    && senses.car.and_then(|car| car.state.get().ok()) == Some(CarState::Open)
                {
                    self.call.hold_doors = 1;
                    if senses.floor == goal.floor {
                        self.change_ride(Ride::Leaving);
                    }
                }
                Wish::STAND
            }
            Ride::Leaving => {
                if self.call.call_id == 0 || self.call.floor != senses.floor || is_late {
                    self.call_car(senses.floor, true);
                    self.ride_since = None;
                }
                match self.follow_path(senses, spot(lift.wait)) {
                    Drive::Going(wish) => wish,
                    Drive::Arrived => {
                        self.call.hold_doors = 0;
                        self.change_ride(Ride::None);
                        Wish::STAND
                    }
                }
            }
        }
    }

    fn change_ride(&mut self, ride: Ride) {
        self.kept.ride = ride;
        (self.ride_since, self.request) = (None, None);
    }

    fn call_car(&mut self, floor: i32, hold: bool) {
        self.kept.call_id += 1;
        self.call = ElevatorCall { call_id: self.kept.call_id, floor, hold_doors: hold.into() };
    }

    /// Follows the planner's path to a place on this floor.
    fn follow_path(&mut self, senses: &Senses, goal: Spot) -> Drive {
        let to_goal_m = senses.pose.distance_m(Pose2::new(goal.x_m, goal.y_m, 0.0));
        let end = senses.path_end.filter(|_| self.request.is_some());
        let to_end_m = end.map_or(f64::INFINITY, |end| senses.pose.distance_m(end));
        // The end of a path that had to stop short of its goal is as good.
        let away_m =
            if to_goal_m <= 2.0 * self.params.goal_tolerance_m { to_goal_m.min(to_end_m) } else { to_goal_m };
        // From beside the elevator's door the robot would enter it askew.
        let share = if self.kept.ride == Ride::Approaching { BEFORE_ELEVATOR } else { 1.0 };
        let tolerance_m = share * self.params.arrival_tolerance_m;
        let (times, seconds) = CLOSE_ENOUGH;
        let stands = self.watch.stands_s(senses.now) >= seconds && self.request.is_some();
        if senses.floor == goal.floor && (away_m <= tolerance_m || (stands && away_m <= times * tolerance_m))
        {
            return Drive::Arrived;
        }
        self.ask(senses, goal);
        let state = senses.answer.and_then(|answer| answer.state.get().ok());
        Drive::Going(match state {
            Some(PlanStateName::Found) => Wish {
                mode: DriveModeName::FollowPath,
                heading_rad: senses.pose.heading_rad,
                speed_mps: self.params.travel_speed_mps,
                hindrance: "the robot does not get on",
            },
            Some(PlanStateName::Unreachable) => Wish::stand_because(NO_WAY),
            Some(PlanStateName::InvalidGoal) => Wish::stand_because("something stands on the goal"),
            Some(PlanStateName::NoStart) => Wish::stand_because("the planner does not know the place"),
            Some(PlanStateName::Idle) | None => Wish::stand_because("the planner does not answer"),
        })
    }

    /// Asks for a path, unless it was asked for already.
    fn ask(&mut self, senses: &Senses, goal: Spot) {
        let same = |request: &PlanRequest| {
            (request.goal_x_m, request.goal_y_m, request.floor) == (goal.x_m, goal.y_m, goal.floor)
        };
        if self.request.as_ref().is_some_and(same) {
            return;
        }
        // The first number of a process lies above those of an earlier one, of whose last words no snapshot
        // may tell.
        let floor_id = if self.has_asked { 0 } else { senses.now.as_nanos() / 1_000_000 };
        self.has_asked = true;
        self.kept.request_id = (self.kept.request_id + 1).max(floor_id);
        self.kept.plans += 1;
        self.request = Some(PlanRequest {
            request_id: self.kept.request_id,
            goal_x_m: goal.x_m,
            goal_y_m: goal.y_m,
            tolerance_m: self.params.goal_tolerance_m,
            floor: goal.floor,
            reserved: 0,
        });
    }
}
