//! The configuration space: a floor's walls, shrunk away from by an offset (NXT-070).

use crate::lattice::Lattice;
use geometry::{Point2, Polygon, Segment};
use std::cell::Cell;

/// Where the robot's middle may be on one floor, as far as the walls decide.
#[derive(Debug, Clone)]
pub struct Space {
    walls: Vec<Wall>,
    outline: Option<Polygon>,
    offset_m: f64,
    lattice: Lattice,
}

#[derive(Debug, Clone, Copy)]
struct Wall {
    line: Segment,
    /// The corners of the box around it.
    low: Point2<f64>,
    high: Point2<f64>,
}

impl Space {
    /// The space between walls, all of it at least `offset_m` away from each. With an outline, only what is
    /// inside of it; without, what hangs together with the place in question is inside. Walls that are not
    /// finite are left out.
    pub fn new(walls: impl IntoIterator<Item = Segment>, outline: Option<Polygon>, offset_m: f64) -> Self {
        let walls: Vec<Wall> = walls
            .into_iter()
            .filter(Segment::is_finite)
            .map(|line| Wall { line, low: line.a.inf(&line.b), high: line.a.sup(&line.b) })
            .collect();
        let bounds = walls.iter().map(|wall| (wall.low, wall.high));
        let bounds = bounds.reduce(|one, other| (one.0.inf(&other.0), one.1.sup(&other.1)));
        let mut space = Self { walls, outline, offset_m, lattice: Lattice::default() };
        if let Some((low, high)) = bounds {
            space.lattice =
                Lattice::new(low, high, offset_m, |centre, within_m| space.may_hold(centre, within_m));
        }
        space
    }

    /// The offset.
    pub fn offset_m(&self) -> f64 {
        self.offset_m
    }

    /// The walls.
    pub fn walls(&self) -> impl Iterator<Item = &Segment> {
        self.walls.iter().map(|wall| &wall.line)
    }

    /// Whether a place lies within the box around all walls.
    pub fn covers(&self, place: Point2<f64>) -> bool {
        self.lattice.cell_at(place).is_some()
    }

    /// Distance to the nearest wall; infinite without walls.
    pub fn wall_m(&self, place: Point2<f64>) -> f64 {
        self.walls.iter().map(|wall| wall.line.distance_m(place)).fold(f64::INFINITY, f64::min)
    }

    /// Whether a straight way touches a wall.
    pub fn crosses_wall(&self, way: &Segment) -> bool {
        let (low, high) = (way.a.inf(&way.b), way.a.sup(&way.b));
        self.walls.iter().any(|wall| wall.overlaps(low, high) && wall.line.intersects(way))
    }

    /// Whether a way between two places of the space can exist. `false` is certain, `true` is not.
    pub fn may_connect(&self, one: Point2<f64>, other: Point2<f64>) -> bool {
        let part = |place| self.lattice.part_at(place);
        part(one).is_some() && part(one) == part(other)
    }

    pub(crate) fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub(crate) fn has_outline(&self) -> bool {
        self.outline.is_some()
    }

    /// Whether a circle around a place may hold a place of the space.
    fn may_hold(&self, centre: Point2<f64>, within_m: f64) -> bool {
        let inside = self.outline.as_ref().is_none_or(|outline| {
            outline.contains(centre) || outline.distance_to_boundary_m(centre) <= within_m
        });
        inside && self.is_clear(centre, self.offset_m - within_m)
    }

    /// Whether no wall is nearer than a distance.
    fn is_clear(&self, place: Point2<f64>, distance_m: f64) -> bool {
        let reach = geometry::Vector2::repeat(distance_m.max(0.0));
        let (low, high) = (place - reach, place + reach);
        self.walls.iter().all(|wall| !wall.overlaps(low, high) || wall.line.distance_m(place) >= distance_m)
    }
}

impl Wall {
    /// Whether the boxes touch.
    fn overlaps(&self, low: Point2<f64>, high: Point2<f64>) -> bool {
        self.low.x <= high.x && self.high.x >= low.x && self.low.y <= high.y && self.high.y >= low.y
    }
}

/// The space as it is now: without what is too near to observed obstacles.
#[derive(Debug, Clone)]
pub struct View<'a> {
    space: &'a Space,
    obstacles: &'a [Point2<f64>],
    obstacle_m: f64,
    /// What closed the last link often closes the next: an index into the walls, then the obstacles.
    closed_by: Cell<usize>,
}

impl<'a> View<'a> {
    /// The space without what is nearer than `obstacle_m` to one of the `obstacles`.
    pub fn new(space: &'a Space, obstacles: &'a [Point2<f64>], obstacle_m: f64) -> Self {
        Self { space, obstacles, obstacle_m, closed_by: Cell::new(0) }
    }

    /// The space below.
    pub fn space(&self) -> &'a Space {
        self.space
    }

    /// The obstacles observed.
    pub fn obstacles(&self) -> &'a [Point2<f64>] {
        self.obstacles
    }

    /// The distance at which they are passed.
    pub fn obstacle_m(&self) -> f64 {
        self.obstacle_m
    }

    /// Whether the robot's middle may be there.
    pub fn is_free(&self, place: Point2<f64>) -> bool {
        let space = self.space;
        space.outline.as_ref().is_none_or(|outline| outline.contains(place))
            && space.is_clear(place, space.offset_m)
            && self.obstacles.iter().all(|obstacle| (obstacle - place).norm() >= self.obstacle_m)
    }

    /// Whether a way between two places can exist in spite of the obstacles. `false` is certain, `true` is
    /// not.
    pub fn may_connect(&self, one: Point2<f64>, other: Point2<f64>) -> bool {
        self.space.may_connect(one, other)
            && (self.obstacles.is_empty()
                || self.space.lattice.may_connect(one, other, self.obstacles, self.obstacle_m))
    }

    /// Whether the robot may drive straight from one free place to another: the distance to every wall is at
    /// least the offset.
    pub fn is_open(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        let way = Segment::new(from, to);
        let reach = geometry::Vector2::repeat(self.space.offset_m);
        let (low, high) = (from.inf(&to) - reach, from.sup(&to) + reach);
        let walls = &self.space.walls;
        let closes = |index: usize| match walls.get(index) {
            Some(wall) => {
                wall.overlaps(low, high) && wall.line.distance_to_segment_m(&way) < self.space.offset_m
            }
            None => self
                .obstacles
                .get(index - walls.len())
                .is_some_and(|obstacle| way.distance_m(*obstacle) < self.obstacle_m),
        };
        if closes(self.closed_by.get()) {
            return false;
        }
        match (0..walls.len() + self.obstacles.len()).find(|&index| closes(index)) {
            Some(index) => {
                self.closed_by.set(index);
                false
            }
            None => true,
        }
    }
}
