//! World files: floor plans, arenas, furniture and walkers, as TOML.
//!
//! One file serves everybody: the simulator casts rays into it, the planners read its walls and areas, the
//! localiser its tag anchors, the launcher's view draws it. A complete, commented example lies in
//! `tests/example-world.toml` of this crate.
//!
//! Frame: one right-handed plane for all floors (x and y of an elevator shaft agree on each), z up from the
//! floor in question. Metres, radians, seconds.

mod check;
mod door;
mod items;
mod motion;
mod scene;

pub use door::{DoorGeometry, LEAF_THICKNESS_M};
pub use items::{
    Anchor, Area, AreaKind, Door, Elevator, Floor, Furniture, Hinge, Place, Rectangle, Start, Trigger,
    Walker, WalkerCourse,
};
pub use scene::{WorldBodies, WorldScene};

use crate::{Pose2, Segment};
use files::{FileError, FileProblem};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The largest building of ours has 11 KiB, and one with as much of everything as is allowed has 1.5 MiB.
const FILE_MAX: u64 = 2 << 20;

/// A building, or a single arena: everything that does not depend on time. What moves (door leaves, walkers)
/// is described by how it moves; [`Door::opening_fraction`] and [`Walker::pose`] say where it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct World {
    /// What people call it.
    pub name: String,
    /// Storeys; an arena is a world with one. At least one.
    #[serde(rename = "floor", default)]
    pub floors: Vec<Floor>,
    /// Doors in walls, with the rooms behind them.
    #[serde(rename = "door", default)]
    pub doors: Vec<Door>,
    /// Lifts between floors.
    #[serde(rename = "elevator", default)]
    pub elevators: Vec<Elevator>,
    /// Marked areas of floors.
    #[serde(rename = "area", default)]
    pub areas: Vec<Area>,
    /// Named poses: destinations other than doors.
    #[serde(rename = "place", default)]
    pub places: Vec<Place>,
    /// Radio tag anchors.
    #[serde(rename = "anchor", default)]
    pub anchors: Vec<Anchor>,
    /// Things that stand about.
    #[serde(rename = "furniture", default)]
    pub furniture: Vec<Furniture>,
    /// People that walk about.
    #[serde(rename = "walker", default)]
    pub walkers: Vec<Walker>,
    /// Where robots begin.
    #[serde(rename = "start", default)]
    pub starts: Vec<Start>,
}

/// Why a world file is refused.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The file cannot be read.
    #[error("cannot read the world file {}: {cause}", files::shown(path))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: FileProblem,
    },
    /// The text is no TOML, or a field is missing, unknown or of the wrong type.
    #[error("{}line {line}, column {column}: {message}", in_file(path.as_deref()))]
    Syntax {
        /// The file, if it came from one.
        path: Option<PathBuf>,
        /// Line, counted from 1.
        line: usize,
        /// Column in characters, counted from 1.
        column: usize,
        /// What is wrong, in one line.
        message: String,
    },
    /// The text is well-formed, but what it describes cannot be.
    #[error("{}line {line}: {item}: {problem}", in_file(path.as_deref()))]
    Nonsense {
        /// The file, if it came from one.
        path: Option<PathBuf>,
        /// Line where the item begins, counted from 1; 0 when the world was not read from a text.
        line: usize,
        /// What it is about, such as ``door "213"``.
        item: String,
        /// What is wrong with it.
        problem: WorldProblem,
    },
}

fn in_file(path: Option<&Path>) -> String {
    path.map(|path| format!("{}, ", path.display())).unwrap_or_default()
}

/// What can be wrong with a well-formed world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldProblem {
    /// A world without a floor.
    #[error("a world needs at least one [[floor]]")]
    NoFloor,
    /// More of something than a world may hold.
    #[error(
        "{count} {what} are more than the {most} that a world may hold; leave out what this robot does not meet"
    )]
    TooMany {
        /// What, in words.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A start or place that no robot within the outline is at.
    #[error("({x_m}, {y_m}) lies outside of the outline of floor {floor}")]
    OutsideOutline {
        /// The floor's number.
        floor: i32,
        /// The place.
        x_m: f64,
        /// The place.
        y_m: f64,
    },
    /// Two things of a kind bear one name or number.
    #[error("{what} is already taken by an earlier entry")]
    Duplicate {
        /// The name or number.
        what: String,
    },
    /// A name is empty.
    #[error("it has an empty name")]
    NoName,
    /// A floor is named that does not exist.
    #[error("there is no floor {floor}")]
    UnknownFloor {
        /// The floor's number.
        floor: i32,
    },
    /// A number is NaN, infinite, or outside of what is possible.
    #[error("{field} = {value} is not {wanted}")]
    BadNumber {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        wanted: &'static str,
    },
    /// A wall or path with too few points, or an elevator with too few floors.
    #[error("{field} needs at least {wanted} points (or floors), not {points}")]
    TooFewPoints {
        /// The field.
        field: &'static str,
        /// Points given.
        points: usize,
        /// Points needed.
        wanted: usize,
    },
    /// Two points in a row coincide.
    #[error("{field} has a piece of no length at point {point}")]
    NoLength {
        /// The field.
        field: &'static str,
        /// Index of the second of the two equal points.
        point: usize,
    },
    /// An outline or area is no simple polygon.
    #[error("{field}: {cause}")]
    BadPolygon {
        /// The field.
        field: &'static str,
        /// Why not.
        cause: crate::PolygonError,
    },
    /// A door that no wall holds.
    #[error(
        "no straight wall of floor {floor} holds an opening {width_m} m wide at ({x_m}, {y_m}); the nearest wall is {distance_m:.3} m away"
    )]
    NotOnWall {
        /// The floor's number.
        floor: i32,
        /// The opening's centre.
        x_m: f64,
        /// The opening's centre.
        y_m: f64,
        /// The opening's width.
        width_m: f64,
        /// How far the nearest wall is.
        distance_m: f64,
    },
    /// Two openings in one wall overlap.
    #[error("its opening overlaps that of {other}")]
    OpeningsOverlap {
        /// The other door or elevator.
        other: String,
    },
    /// Fields that exclude each other, or of which one must be given.
    #[error("{problem}")]
    Contradiction {
        /// Which, in one sentence.
        problem: &'static str,
    },
}

impl World {
    /// Reads and checks the text of a world file.
    pub fn parse(text: &str) -> Result<Self, WorldError> {
        let world: Self = files::toml::parse(text).map_err(|error| {
            let (line, column) = line_and_column(text, error.span().map_or(0, |span| span.start));
            // A name that is not known stands in it, however long, before those that are.
            let message = files::clipped(&error.message().replace('\n', " "), 1000);
            WorldError::Syntax { path: None, line, column, message }
        })?;
        world.find_problem().map_or(Ok(()), |found| {
            let line = found.line_in(text);
            Err(WorldError::Nonsense { path: None, line, item: found.item, problem: found.problem })
        })?;
        Ok(world)
    }

    /// Reads and checks a world file.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, WorldError> {
        let file = path.as_ref();
        let text = files::read_text(file, FILE_MAX)
            .map_err(|FileError { path, problem }| WorldError::Unreadable { path, cause: problem })?;
        Self::parse(&text).map_err(|error| error.in_path(file))
    }

    /// Refuses nonsense: unknown floors, equal names, doors outside walls, numbers that are not finite or not
    /// positive. [`World::parse`] and [`World::load`] have done so already; a world built in code has to be
    /// checked.
    pub fn check(&self) -> Result<(), WorldError> {
        self.find_problem().map_or(Ok(()), |found| {
            Err(WorldError::Nonsense { path: None, line: 0, item: found.item, problem: found.problem })
        })
    }

    /// The floor of that number.
    pub fn floor(&self, number: i32) -> Option<&Floor> {
        self.floors.iter().find(|floor| floor.number == number)
    }

    /// The door of that room. A room may have several; this is the first.
    pub fn door(&self, room: &str) -> Option<&Door> {
        self.doors.iter().find(|door| door.room == room)
    }

    /// Where that robot begins, or where any robot does for which the file names none.
    pub fn start(&self, robot: &str) -> Option<&Start> {
        let named = self.starts.iter().find(|start| start.robot.as_deref() == Some(robot));
        named.or_else(|| self.starts.iter().find(|start| start.robot.is_none()))
    }

    /// Where to drive for a destination: floor and pose of the place of that name or, for a room, of the spot
    /// `standoff_m` in front of its door, facing it.
    pub fn destination(&self, name: &str, standoff_m: f64) -> Option<(i32, Pose2)> {
        if let Some(place) = self.places.iter().find(|place| place.name == name) {
            return Some((place.floor, place.pose));
        }
        let door = self.door(name)?;
        Some((door.floor, self.door_geometry(door)?.front(standoff_m)))
    }

    /// The marked areas of a floor, with those of one kind only if asked.
    pub fn areas_of(&self, floor: i32, kind: Option<AreaKind>) -> impl Iterator<Item = &Area> {
        self.areas.iter().filter(move |area| area.floor == floor && kind.is_none_or(|kind| area.kind == kind))
    }

    /// The exact lines of a door: gap, jambs, recessed leaf and room. `None` when no wall holds the door,
    /// which [`World::check`] refuses.
    pub fn door_geometry(&self, door: &Door) -> Option<DoorGeometry> {
        DoorGeometry::cut(self.floor(door.floor)?, &door.opening())
    }

    /// The exact lines of the elevator's door on one floor; its room is the car. `None` where it does not
    /// stop.
    pub fn elevator_geometry(&self, elevator: &Elevator, floor: i32) -> Option<DoorGeometry> {
        let stops = elevator.floors.contains(&floor);
        if stops { DoorGeometry::cut(self.floor(floor)?, &elevator.opening()) } else { None }
    }

    /// Everything on a floor that stands still and reaches from floor to ceiling: walls with gaps where doors
    /// are, jambs, and the rooms behind the doors. Door leaves are not among it.
    pub fn wall_segments(&self, floor: i32) -> Vec<Segment> {
        let Some(plan) = self.floor(floor) else { return Vec::new() };
        let openings: Vec<_> = self.openings_of(floor).collect();
        let mut segments = Vec::new();
        for wall in plan.segments() {
            door::subtract_gaps(&wall, openings.iter().map(|opening| &opening.gap), &mut segments);
        }
        for opening in &openings {
            segments.extend(opening.jambs);
            segments.extend(&opening.room);
        }
        segments
    }

    /// The geometry of every door, then every elevator door, of a floor.
    pub fn openings_of(&self, floor: i32) -> impl Iterator<Item = DoorGeometry> {
        let doors = self.doors.iter().filter(move |door| door.floor == floor);
        let doors = doors.filter_map(|door| self.door_geometry(door));
        doors.chain(self.elevators.iter().filter_map(move |lift| self.elevator_geometry(lift, floor)))
    }
}

impl WorldError {
    fn in_path(self, file: &Path) -> Self {
        match self {
            Self::Syntax { line, column, message, .. } => {
                Self::Syntax { path: Some(file.to_owned()), line, column, message }
            }
            Self::Nonsense { line, item, problem, .. } => {
                Self::Nonsense { path: Some(file.to_owned()), line, item, problem }
            }
            unreadable @ Self::Unreadable { .. } => unreadable,
        }
    }
}

/// Line and column of a byte, both counted from 1.
fn line_and_column(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}
