//! The configuration spaces of a building's floors, or of an arena, from a world file.

use crate::space::Space;
use geometry::world::DoorGeometry;
use geometry::{Point2, Segment, World};

/// What the planner knows of a floor.
#[derive(Debug, Clone)]
pub(crate) struct Floor {
    pub(crate) number: i32,
    pub(crate) space: Space,
    /// The closed leaves of its doors: seen, they are no obstacle.
    pub(crate) leaves: Vec<Segment>,
}

/// Every floor. Doors of rooms are walls, whether open or not, as the robot does not enter rooms, unless the
/// world names a place inside; elevators are open, as the mission waits for their doors.
pub(crate) fn floors(world: &World, offset_m: f64) -> Vec<Floor> {
    let floor = |number: i32, outline| {
        let mut walls = world.wall_segments(number);
        for door in world.doors.iter().filter(|door| door.floor == number) {
            let Some(lines) = world.door_geometry(door) else { continue };
            let inside = |place: Point2<f64>| is_inside(&lines, door.room_depth_m, place);
            let entered =
                world.places.iter().any(|place| place.floor == number && inside(place.pose.position()));
            if !entered {
                walls.push(lines.gap);
            }
        }
        let leaves = world.openings_of(number).map(|door| door.leaf).collect();
        Floor { number, space: Space::new(walls, outline, offset_m), leaves }
    };
    world.floors.iter().map(|plan| floor(plan.number, plan.outline_polygon())).collect()
}

/// Whether a point lies behind the door, within the room's depth and about its width.
fn is_inside(door: &DoorGeometry, depth_m: f64, point: Point2<f64>) -> bool {
    let offset = point - door.gap.midpoint();
    let behind_m = offset.dot(&door.into);
    let aside_m = (offset - door.into * behind_m).norm();
    behind_m > 0.0 && behind_m < depth_m + 0.2 && aside_m < 0.5 * (depth_m + door.gap.length_m())
}
