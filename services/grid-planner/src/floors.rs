//! The grids of a building's floors, from its world file or from a map file.

use crate::grid::Grid;
use crate::params::{Params, ParamsError};
use geometry::world::DoorGeometry;
use geometry::{OccupancyGrid, Point2, World};

/// Free cells around the outermost walls, in metres.
const MARGIN_M: f64 = 0.5;
/// Cells of one floor at most: 160 m by 250 m at 5 cm.
const CELLS_MAX: f64 = 16e6;

/// A grid for each floor. Doors of rooms are walls, whether open or not, as the robot does not enter rooms, unless the world names a
/// place inside; elevators are open, as the mission waits for their doors.
pub(crate) fn grids(world: &World, params: &Params) -> Result<Vec<(i32, Grid)>, ParamsError> {
    world.floors.iter().map(|floor| Ok((floor.number, grid(world, floor.number, params)?))).collect()
}

/// The grid of a map file: a cell is free when its freeness (0 occupied, 0.5 unknown, 1 free) is above the threshold.
pub(crate) fn grid_of_map(params: &Params) -> Result<Grid, ParamsError> {
    let map = OccupancyGrid::load(&params.map)?;
    let frame = map.frame();
    let origin = frame.origin();
    if origin.heading_rad.abs() > 1e-9 {
        return Err(ParamsError::TurnedMap { map: params.map.clone(), yaw_rad: origin.heading_rad });
    }
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let mut grid = Grid::new(width, height, frame.resolution_m(), [origin.x_m, origin.y_m]);
    for (at, occupancy) in map.as_slice().iter().enumerate() {
        let freeness = 1.0 - occupancy.probability().unwrap_or(0.5);
        if freeness <= params.occupancy_threshold {
            grid.occupy((at % width) as i64, (at / width) as i64);
        }
    }
    Ok(grid)
}

fn grid(world: &World, floor: i32, params: &Params) -> Result<Grid, ParamsError> {
    let mut segments: Vec<_> =
        world.wall_segments(floor).iter().map(|wall| [[wall.a.x, wall.a.y], [wall.b.x, wall.b.y]]).collect();
    for door in world.doors.iter().filter(|door| door.floor == floor) {
        let Some(lines) = world.door_geometry(door) else { continue };
        let entered = world
            .places
            .iter()
            .any(|place| place.floor == floor && is_inside(&lines, door.room_depth_m, place.pose.position()));
        if !entered {
            segments.push([[lines.gap.a.x, lines.gap.a.y], [lines.gap.b.x, lines.gap.b.y]]);
        }
    }
    let extent_m = |axis: usize| {
        let values = segments.iter().flatten().map(|point| point[axis]);
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        (high - low).max(0.0) + 2.0 * MARGIN_M
    };
    let cells = extent_m(0) * extent_m(1) / (params.resolution_m * params.resolution_m);
    if cells > CELLS_MAX {
        let (resolution_m, most) = (params.resolution_m, CELLS_MAX);
        return Err(ParamsError::TooLarge { floor, cells, resolution_m, most });
    }
    Ok(Grid::from_segments(&segments, params.resolution_m, MARGIN_M))
}

/// Whether a point lies behind the door, within the room's depth and about its width.
fn is_inside(door: &DoorGeometry, depth_m: f64, point: Point2<f64>) -> bool {
    let offset = point - door.gap.midpoint();
    let behind_m = offset.dot(&door.into);
    let aside_m = (offset - door.into * behind_m).norm();
    behind_m > 0.0 && behind_m < depth_m + 0.2 && aside_m < 0.5 * (depth_m + door.gap.length_m())
}
