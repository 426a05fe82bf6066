//! The elevator's car: it comes when called, opens, waits, closes and travels (COF-133, X-28).

use crate::obstacles::Footprint;
use geometry::world::{DoorGeometry, Elevator, World};
use geometry::{Point2, Polygon, Pose2, Shape};
use messages::{CarState, CarStateField, ElevatorCall, ElevatorState};
use serde::{Deserialize, Serialize};

/// A car begins at its lowest floor, closed.
#[derive(Debug, Clone)]
pub(crate) struct Car {
    plan: Elevator,
    /// The car's inside, and the threshold in which a door's light barrier looks.
    inside: Option<Shape>,
    doorway: Option<Shape>,
    state: CarState,
    floor: i32,
    call: ElevatorCall,
    wanted: Option<i32>,
    opening: f64,
    timer_s: f64,
    rides: bool,
}

/// A car that is under way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct KeptCar {
    state: u32,
    floor: i32,
    /// Number, floor, and whether the doors are held.
    call: (u64, i32, u32),
    wanted: Option<i32>,
    opening: f64,
    timer_s: f64,
    rides: bool,
}

/// What the robot is to the car.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rider {
    pub(crate) floor: i32,
    pub(crate) pose: Pose2,
    pub(crate) footprint: Footprint,
}

impl Car {
    /// `None` for an elevator without floors.
    pub(crate) fn new(world: &World, plan: &Elevator) -> Option<Self> {
        let &floor = plan.floors.first()?;
        let geometry = world.elevator_geometry(plan, floor);
        Some(Self {
            plan: plan.clone(),
            inside: geometry.as_ref().and_then(inside),
            doorway: geometry.as_ref().and_then(doorway),
            state: CarState::Closed,
            floor,
            call: ElevatorCall::default(),
            wanted: None,
            opening: 0.0,
            timer_s: 0.0,
            rides: false,
        })
    }

    /// What a successor needs.
    pub(crate) fn kept(&self) -> KeptCar {
        KeptCar {
            state: CarStateField::from(self.state).0,
            floor: self.floor,
            call: (self.call.call_id, self.call.floor, self.call.hold_doors),
            wanted: self.wanted,
            opening: self.opening,
            timer_s: self.timer_s,
            rides: self.rides,
        }
    }

    /// Goes on where a predecessor was.
    pub(crate) fn go_on(&mut self, kept: &KeptCar) {
        let Ok(state) = CarStateField(kept.state).get() else { return };
        if !kept.opening.is_finite() || !kept.timer_s.is_finite() || !self.plan.floors.contains(&kept.floor) {
            return;
        }
        let (call_id, floor, hold_doors) = kept.call;
        self.call = ElevatorCall { call_id, floor, hold_doors };
        (self.state, self.floor, self.wanted) = (state, kept.floor, kept.wanted);
        (self.opening, self.timer_s, self.rides) = (kept.opening, kept.timer_s, kept.rides);
    }

    /// How far the door stands open at a floor, from 0 to 1.
    pub(crate) fn opening_at(&self, floor: i32) -> f64 {
        if self.floor == floor && self.state != CarState::Moving { self.opening } else { 0.0 }
    }

    /// The floors served.
    pub(crate) fn floors(&self) -> &[i32] {
        &self.plan.floors
    }

    /// What the car's interface says.
    pub(crate) fn say(&self) -> ElevatorState {
        ElevatorState { call_id: self.call.call_id, floor: self.floor, state: self.state.into() }
    }

    /// One step. Returns the floor to which the robot was carried, when it was.
    pub(crate) fn step(&mut self, seconds: f64, call: Option<&ElevatorCall>, robot: &Rider) -> Option<i32> {
        if let Some(call) = call {
            let is_new = call.call_id != 0 && call.call_id != self.call.call_id;
            if is_new && self.plan.floors.contains(&call.floor) {
                self.wanted = Some(call.floor);
            }
            if is_new || call.call_id == self.call.call_id {
                self.call = *call;
            }
        }
        let touches = |shape: &Option<Shape>| {
            shape.as_ref().is_some_and(|shape| robot.footprint.touches_shape(robot.pose, shape))
        };
        let here = robot.floor == self.floor;
        let held = self.call.hold_doors == 1 || (here && touches(&self.doorway));
        let wanted_here = self.wanted == Some(self.floor);
        let wanted_elsewhere = self.wanted.is_some() && !wanted_here;
        match self.state {
            CarState::Closed => {
                if wanted_here {
                    self.state = CarState::Opening;
                } else if let Some(wanted) = self.wanted {
                    self.state = CarState::Moving;
                    self.timer_s = self.plan.travel_s * self.floors_between(wanted);
                    self.rides = here && contains(&self.inside, robot.pose.position());
                }
            }
            CarState::Opening => {
                self.opening = (self.opening + seconds / self.plan.door_s).min(1.0);
                if self.opening >= 1.0 {
                    self.state = CarState::Open;
                    self.timer_s = self.plan.open_s;
                    self.wanted = self.wanted.filter(|_| !wanted_here);
                }
            }
            CarState::Open => {
                self.wanted = self.wanted.filter(|_| !wanted_here);
                self.timer_s = if held || wanted_here { self.plan.open_s } else { self.timer_s - seconds };
                if !held && (self.timer_s <= 0.0 || wanted_elsewhere) {
                    self.state = CarState::Closing;
                }
            }
            CarState::Closing => {
                if held || wanted_here {
                    self.state = CarState::Opening;
                } else {
                    self.opening = (self.opening - seconds / self.plan.door_s).max(0.0);
                    if self.opening <= 0.0 {
                        self.state = CarState::Closed;
                    }
                }
            }
            CarState::Moving => {
                self.timer_s -= seconds;
                if self.timer_s <= 0.0 {
                    self.floor = self.wanted.unwrap_or(self.floor);
                    self.state = CarState::Opening;
                    return self.rides.then_some(self.floor);
                }
            }
        }
        None
    }

    /// How many storeys lie between here and there; at least one.
    fn floors_between(&self, wanted: i32) -> f64 {
        let index = |floor: i32| self.plan.floors.iter().position(|&served| served == floor).unwrap_or(0);
        index(wanted).abs_diff(index(self.floor)).max(1) as f64
    }
}

fn contains(shape: &Option<Shape>, point: Point2<f64>) -> bool {
    shape.as_ref().is_some_and(|shape| shape.contains(point))
}

/// The car's floor: the corners of its walls.
fn inside(geometry: &DoorGeometry) -> Option<Shape> {
    let corners = geometry.room.iter().map(|wall| wall.a).chain(geometry.room.last().map(|wall| wall.b));
    // The door's own ends lie between two corners on a straight line; a polygon may have such.
    Polygon::new(corners).ok().map(Shape::Polygon)
}

/// From the wall to a hand's breadth behind the leaf.
fn doorway(geometry: &DoorGeometry) -> Option<Shape> {
    let beyond = geometry.into * 0.1;
    let corners = [geometry.gap.a, geometry.gap.b, geometry.leaf.b + beyond, geometry.leaf.a + beyond];
    Polygon::new(corners).ok().map(Shape::Polygon)
}
