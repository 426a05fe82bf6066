//! The part of the map that stands still: walls, doors, rooms.

use geometry::World;

/// A line on the map: x and y of both ends, in metres.
pub(crate) type Line = [f64; 4];

/// The floors of a world, as lines.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plan {
    /// The floors.
    pub(crate) floors: Vec<FloorPlan>,
}

/// One floor.
#[derive(Debug, Clone)]
pub(crate) struct FloorPlan {
    /// Its number.
    pub(crate) number: i32,
    /// What people call it.
    pub(crate) name: String,
    /// Walls with gaps where doors are.
    pub(crate) walls: Vec<Line>,
    /// Walls of the rooms behind the doors.
    pub(crate) rooms: Vec<Line>,
    /// The doors.
    pub(crate) doors: Vec<DoorMark>,
    /// Smallest x, largest x, smallest y, largest y.
    pub(crate) bounds: [f64; 4],
}

/// A door.
#[derive(Debug, Clone)]
pub(crate) struct DoorMark {
    /// Its place in the world file, which is its bit in `WorldTruth::open_doors`; none for an elevator.
    pub(crate) index: Option<usize>,
    /// What is behind it.
    pub(crate) label: String,
    /// Middle of the opening.
    pub(crate) at: [f64; 2],
    /// Unit vector to what is behind it.
    pub(crate) into: [f64; 2],
    /// The leaf when the door is closed.
    pub(crate) closed: Line,
    /// The leaf when it is open.
    pub(crate) open: Line,
}

impl Plan {
    /// The lines of a world.
    pub(crate) fn of(world: &World) -> Self {
        Self {
            floors: world.floors.iter().map(|floor| floor_plan(world, floor.number, &floor.name)).collect(),
        }
    }

    /// The floor of that number; of an unknown number the first floor.
    pub(crate) fn floor(&self, number: i32) -> Option<&FloorPlan> {
        self.floors.iter().find(|floor| floor.number == number).or(self.floors.first())
    }
}

fn floor_plan(world: &World, number: i32, name: &str) -> FloorPlan {
    let line = |segment: &geometry::Segment| [segment.a.x, segment.a.y, segment.b.x, segment.b.y];
    let rooms: Vec<Line> = world
        .openings_of(number)
        .flat_map(|opening| opening.room.iter().map(line).collect::<Vec<_>>())
        .collect();
    let walls: Vec<Line> =
        world.wall_segments(number).iter().map(line).filter(|wall| !rooms.contains(wall)).collect();
    let on_floor = world.doors.iter().enumerate().filter(|(_, door)| door.floor == number);
    let doors = on_floor.filter_map(|(index, door)| {
        let geometry = world.door_geometry(door)?;
        Some(mark(Some(index), &door.room, &geometry))
    });
    let lifts = world.elevators.iter().filter_map(|lift| {
        let geometry = world.elevator_geometry(lift, number)?;
        Some(mark(None, &lift.name, &geometry))
    });
    let bounds = bounds_of(walls.iter().chain(&rooms));
    FloorPlan {
        number,
        name: if name.is_empty() { format!("floor {number}") } else { name.to_owned() },
        doors: doors.chain(lifts).collect(),
        bounds,
        walls,
        rooms,
    }
}

fn mark(index: Option<usize>, label: &str, geometry: &geometry::world::DoorGeometry) -> DoorMark {
    let leaf = |fraction: f64| {
        let pose = geometry.leaf_pose(fraction);
        let tip = pose.transform(geometry::Point2::new(geometry.leaf.length_m(), 0.0));
        [pose.x_m, pose.y_m, tip.x, tip.y]
    };
    let middle = geometry.gap.midpoint();
    DoorMark {
        index,
        label: label.to_owned(),
        at: [middle.x, middle.y],
        into: [geometry.into.x, geometry.into.y],
        closed: leaf(0.0),
        open: leaf(1.0),
    }
}

/// Smallest x, largest x, smallest y, largest y; a square metre about the origin for no lines.
pub(crate) fn bounds_of<'a>(lines: impl Iterator<Item = &'a Line>) -> [f64; 4] {
    let empty = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    let bounds = lines.fold(empty, |[x0, x1, y0, y1], &[ax, ay, bx, by]| {
        [x0.min(ax).min(bx), x1.max(ax).max(bx), y0.min(ay).min(by), y1.max(ay).max(by)]
    });
    if bounds.iter().all(|bound| bound.is_finite()) { bounds } else { [-0.5, 0.5, -0.5, 0.5] }
}
