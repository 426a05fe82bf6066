//! What a world file may hold, item by item.

use crate::{Body, BodyKind, Polygon, PolygonError, Pose2, Segment};
use serde::{Deserialize, Serialize};

/// `[[floor]]`: one storey, or the one floor of an arena.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Floor {
    /// By which everything else refers to it; unique.
    pub number: i32,
    /// What people call it.
    #[serde(default)]
    pub name: String,
    /// For an arena: the closed line around its free space, corners [x, y] in metres in either order of
    /// turning, a simple polygon. Its edges are walls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outline: Option<Vec<[f64; 2]>>,
    /// Walls as polylines: lists of points [x, y] in metres, from floor to ceiling, without thickness. Walls
    /// run through where doors are: the doors cut their own gaps.
    #[serde(default)]
    pub walls: Vec<Vec<[f64; 2]>>,
}

impl Floor {
    /// Every straight piece of wall, before doors are cut; first the outline's, then those of the walls.
    pub fn segments(&self) -> impl Iterator<Item = Segment> + '_ {
        let outline = self.outline.iter().flat_map(|corners| {
            let next = corners.iter().cycle().skip(1);
            corners.iter().zip(next)
        });
        let walls = self.walls.iter().flat_map(|wall| wall.iter().zip(wall.iter().skip(1)));
        let pieces = outline.chain(walls).map(|(&a, &b)| Segment::between(a, b));
        // An outline that repeats its first corner would have an edge of no length.
        pieces.filter(|piece| piece.a != piece.b)
    }

    /// The arena's free space; `None` when the floor has no outline (or a broken one, which the check
    /// refuses).
    pub fn outline_polygon(&self) -> Option<Polygon> {
        Polygon::from_coordinates(self.outline.as_ref()?).ok()
    }
}

/// `[[door]]`: an opening in a wall, a leaf set back into it, and a room behind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Door {
    /// The room behind, such as "213": also the destination's name.
    pub room: String,
    /// The floor's number.
    pub floor: i32,
    /// Centre of the opening, on the line of a wall, [x, y] in metres.
    pub at: [f64; 2],
    /// Which side of the wall the room lies on: any vector from hallway to room, such as [0, 1]. Its length
    /// and its angle to the wall do not matter.
    pub into_room: [f64; 2],
    /// Width of the opening in metres.
    #[serde(default = "Door::default_width_m")]
    pub width_m: f64,
    /// How much deeper than the wall the closed leaf lies, in metres (COF-105).
    #[serde(default = "Door::default_recess_m")]
    pub recess_m: f64,
    /// Depth of the room behind the closed leaf, in metres; its width is depth + opening.
    #[serde(default = "Door::default_room_depth_m")]
    pub room_depth_m: f64,
    /// The side the leaf is hung on, as one sees it from the hallway.
    #[serde(default)]
    pub hinge: Hinge,
    /// Whether it stands open at the beginning.
    #[serde(default)]
    pub open: bool,
    /// When somebody opens it (or closes it, if it stands open at the beginning); never without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moves: Option<Trigger>,
    /// After this many seconds it goes back to what it was at the beginning; without, it stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub returns_after_s: Option<f64>,
    /// How long the leaf needs from closed to open, in seconds.
    #[serde(default = "Door::default_swing_s")]
    pub swing_s: f64,
}

impl Door {
    fn default_width_m() -> f64 {
        0.91
    }
    fn default_recess_m() -> f64 {
        0.100
    }
    fn default_room_depth_m() -> f64 {
        3.0
    }
    fn default_swing_s() -> f64 {
        1.5
    }
}

/// The side a leaf is hung on, as one sees it from outside the room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hinge {
    /// On the left.
    #[default]
    Left,
    /// On the right.
    Right,
}

/// When something begins to move: once all that is given here has come true; at the very beginning if nothing
/// is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trigger {
    /// So many seconds have passed since the beginning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    /// A robot's centre is closer than this, in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_m: Option<f64>,
}

/// `[[elevator]]`: a shaft with a door on each floor it serves, all at the same x and y.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Elevator {
    /// Unique.
    pub name: String,
    /// Numbers of the floors it serves, from the bottom to the top.
    pub floors: Vec<i32>,
    /// Centre of the door opening, on the line of a wall on each of the floors, [x, y] in metres.
    pub at: [f64; 2],
    /// Any vector from the hallway into the car.
    pub into_car: [f64; 2],
    /// Width of the opening in metres.
    #[serde(default = "Elevator::default_width_m")]
    pub width_m: f64,
    /// How much deeper than the wall its closed door lies, in metres.
    #[serde(default = "Elevator::default_recess_m")]
    pub recess_m: f64,
    /// Depth of the car in metres; its width is opening + 0.4 m.
    #[serde(default = "Elevator::default_car_depth_m")]
    pub car_depth_m: f64,
    /// From floor to next floor, in seconds.
    #[serde(default = "Elevator::default_travel_s")]
    pub travel_s: f64,
    /// How long its door needs to open or to close, in seconds.
    #[serde(default = "Elevator::default_door_s")]
    pub door_s: f64,
    /// How long its door stays open, in seconds.
    #[serde(default = "Elevator::default_open_s")]
    pub open_s: f64,
}

impl Elevator {
    fn default_width_m() -> f64 {
        1.07
    }
    fn default_recess_m() -> f64 {
        0.10
    }
    fn default_car_depth_m() -> f64 {
        1.6
    }
    fn default_travel_s() -> f64 {
        8.0
    }
    fn default_door_s() -> f64 {
        2.0
    }
    fn default_open_s() -> f64 {
        10.0
    }
}

/// What an area is marked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AreaKind {
    /// The veer angle may be measured here: flat walls, no doors (COF-083).
    Measure,
    /// Where coffee is taken aboard.
    TeaRoom,
    /// In front of, or in, the elevator.
    Elevator,
    /// Where a side hallway opens.
    OpenHallway,
    /// The main hallway.
    Hallway,
    /// Robots may not enter.
    KeepOut,
    /// Robots drive slowly.
    Slow,
    /// Counts as reached when a robot's centre is inside.
    Goal,
}

/// Two opposite corners of a rectangle along the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Lower left corner [x, y] in metres.
    pub min: [f64; 2],
    /// Upper right corner [x, y] in metres.
    pub max: [f64; 2],
}

/// `[[area]]`: a marked part of a floor, either a rectangle along the axes or a polygon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Area {
    /// Unique.
    pub name: String,
    /// The floor's number.
    pub floor: i32,
    /// What it is marked for.
    pub kind: AreaKind,
    /// Its outline as a rectangle; an area has either this or `polygon`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rectangle: Option<Rectangle>,
    /// Its outline as a simple polygon, corners [x, y] in metres; an area has either this or `rectangle`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polygon: Option<Vec<[f64; 2]>>,
}

impl Area {
    /// Its outline.
    pub fn shape(&self) -> Result<Polygon, PolygonError> {
        match (&self.rectangle, &self.polygon) {
            (Some(rectangle), _) => Polygon::axis_aligned(rectangle.min, rectangle.max),
            (None, Some(corners)) => Polygon::from_coordinates(corners),
            (None, None) => Err(PolygonError::TooFewCorners { corners: 0 }),
        }
    }
}

/// `[[place]]`: a named pose to drive to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Unique, also among the rooms.
    pub name: String,
    /// The floor's number.
    pub floor: i32,
    /// Where a robot stands when it is there.
    pub pose: Pose2,
}

/// `[[anchor]]`: a radio tag fixed to the building.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Anchor {
    /// Its address; unique. TOML reads hexadecimal: `id = 0x0B1C`.
    pub id: u32,
    /// The floor's number.
    pub floor: i32,
    /// Position in metres.
    pub x_m: f64,
    /// Position in metres.
    pub y_m: f64,
    /// Height above its floor in metres.
    pub z_m: f64,
}

/// `[[furniture]]`: something that stands on the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Furniture {
    /// What it is.
    pub kind: BodyKind,
    /// The floor's number.
    pub floor: i32,
    /// Where its centre stands, and which way its front faces.
    pub pose: Pose2,
    /// Other than usual extent: [length along x, width along y, height] in metres; for boxes only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 3]>,
    /// What people call it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
}

impl Furniture {
    /// Its solid parts, in its own frame.
    pub fn body(&self) -> Body {
        self.size_m.map_or_else(|| Body::of(self.kind), |size| Body::with_size(self.kind, size))
    }
}

/// What a walker does at the end of the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WalkerCourse {
    /// Stays there.
    #[default]
    Once,
    /// Walks from the last point straight to the first and begins again.
    Loop,
    /// Turns back.
    BackAndForth,
}

/// `[[walker]]`: a person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Walker {
    /// Unique.
    pub name: String,
    /// The floor's number.
    pub floor: i32,
    /// Points [x, y] in metres; with a single point, the person stands there.
    pub path: Vec<[f64; 2]>,
    /// Radius of the person in metres.
    #[serde(default = "Walker::default_radius_m")]
    pub radius_m: f64,
    /// Walking speed in m/s.
    #[serde(default = "Walker::default_speed_m_s")]
    pub speed_m_s: f64,
    /// When the person sets out; `near_m` counts from where the person then stands.
    #[serde(default)]
    pub starts: Trigger,
    /// What happens at the end of the path.
    #[serde(default)]
    pub course: WalkerCourse,
}

impl Walker {
    fn default_radius_m() -> f64 {
        0.2
    }
    fn default_speed_m_s() -> f64 {
        1.2
    }
}

/// `[[start]]`: where a robot begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Which robot; any for which no other start is named, when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// The floor's number.
    pub floor: i32,
    /// Where.
    pub pose: Pose2,
}
