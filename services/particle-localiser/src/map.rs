//! What particles are compared with: walls as lines or as cells, in a frame of the map's own.

use crate::params::{Model, Params, ParamsError};
use crate::random::{Purpose, Stream};
use geometry::{Cell, Grid, GridFrame, Occupancy, OccupancyGrid, Point2, Polygon, Pose2, Segment, World};
use std::f32::consts::PI;

/// A map. Its own frame begins at the grid's outer corner and follows its rows and columns, so that single
/// precision is enough wherever on earth the map lies.
#[derive(Debug, Clone)]
pub struct Map {
    /// The frame of the map's file in which the own frame lies.
    origin: Pose2,
    /// Distance from each cell's middle to the nearest wall.
    pub(crate) distances_m: Grid<f32>,
    /// The walls as lines in the own frame, where they are known so; empty for a grid.
    pub(crate) walls: Vec<Segment>,
    /// The cells in which a robot may be.
    free: Vec<u32>,
}

/// Room around the walls of a world in the grid that is made of it, in cells.
const MARGIN: u32 = 2;

impl Map {
    /// The walls and the free cells of a grid.
    pub fn of_grid(grid: &OccupancyGrid, occupied_percent: u8) -> Self {
        let distances_m = own_frame(grid, grid.distances_m(occupied_percent));
        let free = (0..).zip(grid.as_slice()).filter(|(_, cell)| {
            cell.percent().is_some_and(|percent| percent < 50 && percent < occupied_percent)
        });
        let free = free.map(|(index, _)| index).collect();
        Self { origin: grid.frame().origin(), distances_m, walls: Vec::new(), free }
    }

    /// A map without anything; nothing can be found on it.
    pub fn empty() -> Self {
        match Self::of_walls(&[], &[], 1.0) {
            Ok(map) => map,
            Err(_) => unreachable!("a grid of one cell of one metre always exists"),
        }
    }

    /// An arena: the robot is inside of the outline.
    pub fn of_outline(outline: &Polygon, resolution_m: f64) -> Result<Self, ParamsError> {
        let walls: Vec<_> = outline.edges().collect();
        Self::of_walls(&walls, &walls, resolution_m)
    }

    /// One floor of a world. The robot is inside of the outline, or, where there is none, anywhere among the
    /// walls.
    pub fn of_world(world: &World, floor: i32, resolution_m: f64) -> Result<Self, ParamsError> {
        let walls = world.wall_segments(floor);
        let outline = world.floor(floor).and_then(|floor| floor.outline.as_ref());
        let outline: Vec<_> = outline
            .and_then(|corners| Polygon::from_coordinates(corners).ok())
            .map(|polygon| polygon.edges().collect())
            .unwrap_or_default();
        Self::of_walls(&walls, &outline, resolution_m)
    }

    fn of_walls(walls: &[Segment], outline: &[Segment], resolution_m: f64) -> Result<Self, ParamsError> {
        let (origin, frame) = frame_around(walls, resolution_m)?;
        let walls: Vec<Segment> = walls.iter().map(|wall| wall.transformed(origin.inverse())).collect();
        let outline: Vec<Segment> = outline.iter().map(|wall| wall.transformed(origin.inverse())).collect();
        let mut drawn = Grid::filled(frame, Occupancy::FREE);
        for wall in &walls {
            for cell in frame.cells_along(wall.a, wall.b) {
                if let Some(cell) = drawn.get_mut(cell) {
                    *cell = Occupancy::OCCUPIED;
                }
            }
        }
        let is_free = |cell: Cell| {
            let middle = frame.centre(cell);
            let inside = outline.is_empty() || is_inside(&outline, middle);
            inside && drawn.get(cell) == Some(&Occupancy::FREE)
        };
        let cells = frame.cells().enumerate();
        let free = if walls.is_empty() {
            Vec::new()
        } else {
            cells.filter(|(_, cell)| is_free(*cell)).map(|(index, _)| index as u32).collect()
        };
        Ok(Self { origin, distances_m: drawn.distances_m(100), walls, free })
    }

    /// Whether the map holds nothing that a robot could be in.
    pub fn is_empty(&self) -> bool {
        self.free.is_empty()
    }

    /// Where a robot may be, in square metres.
    pub fn free_area_m2(&self) -> f64 {
        let resolution_m = self.distances_m.frame().resolution_m();
        self.free.len() as f64 * resolution_m * resolution_m
    }

    /// A pose of the file's frame in the own frame.
    pub fn to_own(&self, pose: Pose2) -> Pose2 {
        self.origin.to(pose)
    }

    /// A pose of the own frame in the file's frame.
    pub fn from_own(&self, pose: Pose2) -> Pose2 {
        self.origin.compose(pose)
    }

    /// Direction of the own frame's x axis in the file's frame.
    pub fn rotation_rad(&self) -> f64 {
        self.origin.heading_rad
    }

    /// `count` poses spread evenly over the free cells and all directions, the `index`-th of them.
    pub(crate) fn scattered(&self, stream: Stream, index: usize, count: usize) -> [f32; 3] {
        let frame = self.distances_m.frame();
        let resolution_m = frame.resolution_m() as f32;
        // One of `count` equal parts of the list for each, and in it a random cell.
        let part = (index as f64 + f64::from(stream.uniform(index, 0))) / count.max(1) as f64;
        let at = ((part * self.free.len() as f64) as usize).min(self.free.len().saturating_sub(1));
        let cell = self.free.get(at).and_then(|cell| frame.cell(*cell as usize)).unwrap_or(Cell::new(0, 0));
        // Steps of the golden ratio fill the circle evenly, however many there are.
        let turn = (index as f64 * 0.618_033_988_749_895 + f64::from(stream.uniform(0, 7))).fract() as f32;
        [
            (cell.column as f32 + stream.uniform(index, 1)) * resolution_m,
            (cell.row as f32 + stream.uniform(index, 2)) * resolution_m,
            (2.0 * turn - 1.0) * PI,
        ]
    }

    pub(crate) fn scatter_stream(seed: u64, epoch: u64, is_start: bool) -> Stream {
        Stream::new(seed, epoch, if is_start { Purpose::Start } else { Purpose::Scatter })
    }

    /// Whether the world or the map that the parameters name can be used; of a map only the head is read.
    pub fn check(params: &Params) -> Result<(), MapLoadError> {
        let file = if params.world.is_empty() { params.map.as_str() } else { params.world.as_str() };
        if file.is_empty() {
            return Ok(());
        }
        if file.ends_with(".toml") {
            let walls = World::load(file)?.wall_segments(params.floor);
            frame_around(&walls, params.world_resolution_m)?;
            return Ok(());
        }
        OccupancyGrid::look(file)?;
        if params.model == Model::Echo { Err(ParamsError::NoLines.into()) } else { Ok(()) }
    }

    /// Reads the world or the map that the parameters name: a map is a world when it ends in `.toml`, else of
    /// the kind of ROS.
    pub fn load(params: &Params) -> Result<Self, MapLoadError> {
        let file = if params.world.is_empty() { params.map.as_str() } else { params.world.as_str() };
        if file.is_empty() {
            return Ok(Self::empty());
        }
        if file.ends_with(".toml") {
            let world = World::load(file)?;
            return Ok(Self::of_world(&world, params.floor, params.world_resolution_m)?);
        }
        Ok(Self::of_grid(&OccupancyGrid::load(file)?, params.occupied_percent))
    }
}

/// The grid that is made around the walls of a world, and where it lies there.
fn frame_around(walls: &[Segment], resolution_m: f64) -> Result<(Pose2, GridFrame), ParamsError> {
    let ends = || walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let low = ends().fold([f64::MAX; 2], |low, end| [low[0].min(end.x), low[1].min(end.y)]);
    let high = ends().fold([f64::MIN; 2], |high, end| [high[0].max(end.x), high[1].max(end.y)]);
    let (low, high) = if walls.is_empty() { ([0.0; 2], [0.0; 2]) } else { (low, high) };
    let margin_m = f64::from(MARGIN) * resolution_m;
    let origin = Pose2::new(low[0] - margin_m, low[1] - margin_m, 0.0);
    let cells = |axis: usize| ((high[axis] - low[axis]) / resolution_m).ceil() as u32 + 2 * MARGIN + 1;
    let frame = GridFrame::new(cells(0), cells(1), resolution_m, Pose2::IDENTITY);
    Ok((origin, frame.map_err(|cause| ParamsError::Grid { resolution_m, cause })?))
}

/// Why a map cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MapLoadError {
    /// A broken world file.
    #[error(transparent)]
    World(#[from] geometry::WorldError),
    /// A broken map file.
    #[error(transparent)]
    Grid(#[from] geometry::MapError),
    /// Parameters that do not fit it.
    #[error(transparent)]
    Params(#[from] ParamsError),
}

/// The same cells in a frame that begins at the grid itself.
fn own_frame(grid: &OccupancyGrid, cells: Grid<f32>) -> Grid<f32> {
    let frame = grid.frame();
    let own = GridFrame::new(frame.width(), frame.height(), frame.resolution_m(), Pose2::IDENTITY);
    let cells = cells.into_cells();
    match own.and_then(|own| Grid::new(own, cells)) {
        Ok(grid) => grid,
        Err(_) => unreachable!("the same size and resolution as of a grid that exists"),
    }
}

/// Whether a point lies inside closed lines: a ray to the right crosses them an odd number of times.
fn is_inside(lines: &[Segment], point: Point2<f64>) -> bool {
    let crosses = |line: &&Segment| {
        let (a, b) = (line.a, line.b);
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    lines.iter().filter(crosses).count() % 2 == 1
}
