//! The doors of the floor plan.

use geometry::{Point2, Pose2, Vector2, angle, world::World};
use messages::{RoomName, Side};
use std::f64::consts::{FRAC_PI_2, PI};

/// A door (or an elevator's, which has no room: it is known so that it is not taken for another).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Door {
    pub(crate) room: RoomName,
    pub(crate) floor: i32,
    pub(crate) centre: Point2<f64>,
    /// One direction of its wall.
    along: Vector2<f64>,
    pub(crate) width_m: f64,
    pub(crate) recess_m: f64,
}

impl Door {
    /// The direction of its wall that is nearer to `heading_rad`.
    fn wall_heading_rad(&self, heading_rad: f64) -> f64 {
        let along_rad = self.along.y.atan2(self.along.x);
        let off_rad = angle::difference(heading_rad, along_rad);
        if off_rad.abs() <= FRAC_PI_2 { along_rad } else { angle::wrap(along_rad + PI) }
    }

    /// How far ahead of a place it is along `hallway_rad`, and on which side.
    pub(crate) fn seen_from(&self, place: Point2<f64>, hallway_rad: f64) -> (f64, Side) {
        let relative = Pose2::new(place.x, place.y, hallway_rad).inverse_transform(self.centre);
        (relative.x, if relative.y > 0.0 { Side::Left } else { Side::Right })
    }
}

/// Every door of a world.
pub(crate) fn doors(world: &World) -> Vec<Door> {
    let door = |door: &geometry::world::Door| {
        let gap = world.door_geometry(door)?.gap;
        let (room, along) = (RoomName::truncated(&door.room), gap.direction()?);
        let (floor, width_m, recess_m) = (door.floor, door.width_m, door.recess_m);
        Some(Door { room, floor, centre: gap.midpoint(), along, width_m, recess_m })
    };
    let mut doors: Vec<_> = world.doors.iter().filter_map(door).collect();
    for elevator in &world.elevators {
        doors.extend(elevator.floors.iter().filter_map(|&floor| {
            let gap = world.elevator_geometry(elevator, floor)?.gap;
            let (width_m, recess_m) = (elevator.width_m, elevator.recess_m);
            Some(Door {
                room: RoomName::EMPTY,
                floor,
                centre: gap.midpoint(),
                along: gap.direction()?,
                width_m,
                recess_m,
            })
        }));
    }
    doors
}

/// The direction of the hallway at a place: that of the wall of the nearest door, the way the robot faces.
pub(crate) fn hallway_rad(doors: &[Door], floor: i32, pose: Pose2) -> Option<f64> {
    let distance_m = |door: &&Door| (door.centre - pose.position()).norm();
    let of_floor = doors.iter().filter(|door| door.floor == floor);
    let nearest = of_floor.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))?;
    Some(nearest.wall_heading_rad(pose.heading_rad))
}
