//! The grids of a building's floors, from its world file or from a map file.

use crate::grid::Grid;
use crate::params::{Params, ParamsError};
use geometry::world::{DoorGeometry, Floor};
use geometry::{GridFrame, OccupancyGrid, Point2, World};

/// Free cells around the outermost walls, in metres.
const MARGIN_M: f64 = 0.5;
/// Cells of all floors at most: 290 m by 290 m at 5 cm. Each takes some 30 bytes while a path is searched, a
/// gigabyte in all.
const CELLS_MAX: u64 = 34_000_000;

/// A grid for each floor. Doors of rooms are walls, whether open or not, as the robot does not enter rooms,
/// unless the world names a place inside; elevators are open, as the mission waits for their doors.
pub(crate) fn grids(world: &World, params: &Params) -> Result<Vec<(i32, Grid)>, ParamsError> {
    check_world(world, params)?;
    let grid = |segments: &[Piece]| Grid::from_segments(segments, params.resolution_m, MARGIN_M);
    Ok(world.floors.iter().map(|floor| (floor.number, grid(&pieces(world, floor.number)))).collect())
}

/// Whether grids can be made of the floors of a world.
pub(crate) fn check_world(world: &World, params: &Params) -> Result<(), ParamsError> {
    let cells = |floor: &Floor| {
        let pieces = pieces(world, floor.number);
        let extent_m = |axis: usize| {
            let values = pieces.iter().flatten().map(|point| point[axis]);
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
            (high - low).max(0.0) + 2.0 * MARGIN_M
        };
        (extent_m(0) * extent_m(1) / (params.resolution_m * params.resolution_m)) as u64
    };
    let cells = world.floors.iter().map(cells).fold(0, u64::saturating_add);
    check_size(&params.world, cells, params.resolution_m, params)
}

/// Whether a grid can be made of the map that the parameters name, by its head.
pub(crate) fn check_map(params: &Params) -> Result<(), ParamsError> {
    check_frame(&OccupancyGrid::look(&params.map)?, params)
}

fn check_frame(frame: &GridFrame, params: &Params) -> Result<(), ParamsError> {
    let origin = frame.origin();
    if origin.heading_rad.abs() > 1e-9 {
        return Err(ParamsError::TurnedMap { map: params.map.clone(), yaw_rad: origin.heading_rad });
    }
    check_size(&params.map, frame.len() as u64, frame.resolution_m(), params)
}

fn check_size(what: &str, cells: u64, resolution_m: f64, params: &Params) -> Result<(), ParamsError> {
    let what = what.to_owned();
    let costs = params.costs();
    if cells > CELLS_MAX {
        return Err(ParamsError::TooLarge { what, cells, resolution_m, most: CELLS_MAX });
    }
    if !costs.are_fit_for(resolution_m) {
        return Err(ParamsError::TooFine { what, resolution_m, reach_m: costs.obstacle_reach_m() });
    }
    Ok(())
}

/// The grid of a map file: a cell is free when its freeness (0 occupied, 0.5 unknown, 1 free) is above the
/// threshold.
pub(crate) fn grid_of_map(params: &Params) -> Result<Grid, ParamsError> {
    check_map(params)?;
    let map = OccupancyGrid::load(&params.map)?;
    let frame = map.frame();
    let origin = frame.origin();
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let mut grid = Grid::new(width, height, frame.resolution_m(), [origin.x_m, origin.y_m]);
    for (row, cells) in map.as_slice().chunks_exact(width).enumerate() {
        grid.occupy_where(row, cells, |occupancy| {
            1.0 - occupancy.probability().unwrap_or(0.5) <= params.occupancy_threshold
        });
    }
    Ok(grid)
}

/// A straight piece of wall, [x, y] to [x, y].
type Piece = [[f64; 2]; 2];

/// What walls off a floor.
fn pieces(world: &World, floor: i32) -> Vec<Piece> {
    let mut pieces: Vec<Piece> =
        world.wall_segments(floor).iter().map(|wall| [[wall.a.x, wall.a.y], [wall.b.x, wall.b.y]]).collect();
    for door in world.doors.iter().filter(|door| door.floor == floor) {
        let Some(lines) = world.door_geometry(door) else { continue };
        let entered = world
            .places
            .iter()
            .any(|place| place.floor == floor && is_inside(&lines, door.room_depth_m, place.pose.position()));
        if !entered {
            pieces.push([[lines.gap.a.x, lines.gap.a.y], [lines.gap.b.x, lines.gap.b.y]]);
        }
    }
    pieces
}

/// Whether a point lies behind the door, within the room's depth and about its width.
fn is_inside(door: &DoorGeometry, depth_m: f64, point: Point2<f64>) -> bool {
    let offset = point - door.gap.midpoint();
    let behind_m = offset.dot(&door.into);
    let aside_m = (offset - door.into * behind_m).norm();
    behind_m > 0.0 && behind_m < depth_m + 0.2 && aside_m < 0.5 * (depth_m + door.gap.length_m())
}
