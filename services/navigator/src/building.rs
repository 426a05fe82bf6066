//! What the mission needs to know of the building: doors, home, elevator.

use geometry::world::AreaKind;
use geometry::{Pose2, World};
use serde::{Deserialize, Serialize};

/// A place to drive to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// The floor.
    pub floor: i32,
    /// In the map.
    pub x_m: f64,
    /// In the map.
    pub y_m: f64,
}

/// The door of a room.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// Its name.
    pub name: String,
    /// The middle of the door, on the wall's line.
    pub door: Spot,
    /// Unit vector into the room.
    pub into: [f64; 2],
}

/// The elevator.
#[derive(Debug, Clone, PartialEq)]
pub struct Lift {
    /// Floors that it serves.
    pub floors: Vec<i32>,
    /// Where the robot waits before its door, in the map, the same on all floors.
    pub wait: [f64; 2],
    /// The middle of the car.
    pub car: [f64; 2],
    /// Direction into the car, in (-π, π].
    pub into_rad: f64,
}

/// The building as the mission sees it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Building {
    /// Every room with a door.
    pub rooms: Vec<Room>,
    /// Where coffee is taken aboard, and where the robot waits.
    pub home: Option<Spot>,
    /// The elevator, if there is one.
    pub lift: Option<Lift>,
}

impl Building {
    /// Picks the doors, the home and the first elevator out of a world. The home is the place of that name,
    /// else the middle of the first area marked as tea room, else where the robot starts. The robot waits
    /// `wait_m` before the elevator's door.
    pub fn from_world(world: &World, home: &str, wait_m: f64) -> Self {
        let rooms = world.doors.iter().filter_map(|door| {
            let lines = world.door_geometry(door)?;
            let middle = lines.gap.midpoint();
            Some(Room {
                name: door.room.clone(),
                door: Spot { floor: door.floor, x_m: middle.x, y_m: middle.y },
                into: [lines.into.x, lines.into.y],
            })
        });
        let spot = |floor: i32, pose: Pose2| Spot { floor, x_m: pose.x_m, y_m: pose.y_m };
        let named =
            world.places.iter().find(|place| place.name == home).map(|place| spot(place.floor, place.pose));
        let tea_room = || {
            let area = world.areas.iter().find(|area| area.kind == AreaKind::TeaRoom)?;
            let middle = middle_of(area)?;
            Some(Spot { floor: area.floor, x_m: middle[0], y_m: middle[1] })
        };
        let start = || world.starts.first().map(|start| spot(start.floor, start.pose));
        let lift = world.elevators.first().and_then(|lift| {
            let lines = world.elevator_geometry(lift, *lift.floors.first()?)?;
            let (wait, car) = (lines.front(wait_m), lines.front(-lift.recess_m - 0.5 * lift.car_depth_m));
            Some(Lift {
                floors: lift.floors.clone(),
                wait: [wait.x_m, wait.y_m],
                car: [car.x_m, car.y_m],
                into_rad: wait.heading_rad,
            })
        });
        Self { rooms: rooms.collect(), home: named.or_else(tea_room).or_else(start), lift }
    }

    /// The room of that name.
    pub fn room(&self, name: &str) -> Option<&Room> {
        self.rooms.iter().find(|room| room.name == name)
    }
}

/// The middle of an area's extent.
fn middle_of(area: &geometry::world::Area) -> Option<[f64; 2]> {
    if let Some(rectangle) = &area.rectangle {
        return Some([0, 1].map(|axis| 0.5 * (rectangle.min[axis] + rectangle.max[axis])));
    }
    let corners = area.polygon.as_ref().filter(|corners| !corners.is_empty())?;
    let sum = corners.iter().fold([0.0, 0.0], |sum, corner| [sum[0] + corner[0], sum[1] + corner[1]]);
    Some(sum.map(|sum| sum / corners.len() as f64))
}
