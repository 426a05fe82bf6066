//! The exact lines of doors: a gap in the wall, two jambs straight into it, a leaf set back, a room behind.

use super::items::{Door, Elevator, Floor, Hinge};
use crate::{Body, Polygon, Pose2, Prism, Segment, Shape};
use nalgebra::{Point2, Vector2};
use std::f64::consts::FRAC_PI_2;

/// How thick a door leaf is, in metres.
pub const LEAF_THICKNESS_M: f64 = 0.040;

/// How far a door's centre may lie from its wall, in metres: what rounding in a floor plan explains.
pub(super) const ON_WALL_M: f64 = 0.01;

/// How much wider than its opening a car is on each side, in metres.
const CAR_MARGIN_M: f64 = 0.2;

/// What doors and elevators have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    pub(super) at: Point2<f64>,
    into: Vector2<f64>,
    pub(super) width_m: f64,
    recess_m: f64,
    depth_m: f64,
    /// How much wider than the opening the room is on each side.
    margin_m: f64,
    hinge: Hinge,
    slides: bool,
}

impl Door {
    pub(super) fn opening(&self) -> Opening {
        Opening {
            at: self.at.into(),
            into: self.into_room.into(),
            width_m: self.width_m,
            recess_m: self.recess_m,
            depth_m: self.room_depth_m,
            margin_m: 0.5 * self.room_depth_m,
            hinge: self.hinge,
            slides: false,
        }
    }
}

impl Elevator {
    pub(super) fn opening(&self) -> Opening {
        Opening {
            at: self.at.into(),
            into: self.into_car.into(),
            width_m: self.width_m,
            recess_m: self.recess_m,
            depth_m: self.car_depth_m,
            margin_m: CAR_MARGIN_M,
            hinge: Hinge::Left,
            slides: true,
        }
    }
}

/// The lines of one door, as seen from above, in the world's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct DoorGeometry {
    /// Where the wall is missing, from the left to the right side of one who faces the door from the hallway.
    pub gap: Segment,
    /// From the wall straight to the leaf: the left one, then the right one. There is no frame (COF-101).
    pub jambs: [Segment; 2],
    /// The visible face of the closed leaf, from left to right.
    pub leaf: Segment,
    /// The walls of the room (or car) behind, open towards the leaf.
    pub room: Vec<Segment>,
    /// Unit vector into the room, square to the wall.
    pub into: Vector2<f64>,
    hinge: Hinge,
    slides: bool,
}

impl DoorGeometry {
    /// Finds the wall that holds the opening and builds the lines. Those parts of the gap's position that are
    /// not exact in the file (its distance from the wall, the direction into the room) are taken from the
    /// wall.
    pub(super) fn cut(floor: &Floor, opening: &Opening) -> Option<Self> {
        let wall = floor.segments().find(|wall| holds(wall, opening))?;
        let along = wall.direction()?;
        let normal = Vector2::new(-along.y, along.x);
        let into = if normal.dot(&opening.into) > 0.0 { normal } else { -normal };
        // Facing `into`, the right hand points this way.
        let right = Vector2::new(into.y, -into.x);
        let centre = wall.a + along * along.dot(&(opening.at - wall.a));
        let half = right * (0.5 * opening.width_m);
        let gap = Segment::new(centre - half, centre + half);
        let recess = into * opening.recess_m;
        let leaf = Segment::new(gap.a + recess, gap.b + recess);
        let (depth, margin) = (into * opening.depth_m, right * opening.margin_m);
        let corners = [
            leaf.a,
            leaf.a - margin,
            leaf.a - margin + depth,
            leaf.b + margin + depth,
            leaf.b + margin,
            leaf.b,
        ];
        Some(Self {
            gap,
            jambs: [Segment::new(gap.a, leaf.a), Segment::new(gap.b, leaf.b)],
            leaf,
            room: corners.windows(2).map(|ends| Segment::new(ends[0], ends[1])).collect(),
            into,
            hinge: opening.hinge,
            slides: opening.slides,
        })
    }

    /// The solid leaf in its own frame, to be placed by [`DoorGeometry::leaf_pose`]: at its hinge, pointing
    /// along x.
    pub fn leaf_body(&self, height_m: f64) -> Body {
        let (width_m, thick_m) = (self.leaf.length_m(), LEAF_THICKNESS_M);
        // The visible face lies on the x axis, the thickness behind it: to the left of a leaf hung on the
        // left, for one who faces it from the hallway.
        let behind = match self.hinge {
            Hinge::Left => thick_m,
            Hinge::Right => -thick_m,
        };
        let plate = Polygon::axis_aligned([0.0, 0.0], [width_m, behind]);
        // A door of no width is refused by the world's check; here it is simply not there.
        let prisms =
            plate.map(|plate| Prism { shape: Shape::Polygon(plate), z_min_m: 0.0, z_max_m: height_m });
        Body::new(prisms.ok())
    }

    /// Where the leaf is when it is open by `fraction`: 0 closed, 1 at a right angle into the room (or slid
    /// away sideways).
    pub fn leaf_pose(&self, fraction: f64) -> Pose2 {
        let fraction = if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) };
        let (hinge, tip, turn) = match self.hinge {
            Hinge::Left => (self.leaf.a, self.leaf.b, 1.0),
            Hinge::Right => (self.leaf.b, self.leaf.a, -1.0),
        };
        let along = tip - hinge;
        let closed_rad = along.y.atan2(along.x);
        if self.slides {
            let slid = hinge - along * fraction;
            return Pose2::new(slid.x, slid.y, closed_rad);
        }
        Pose2::new(hinge.x, hinge.y, closed_rad + turn * FRAC_PI_2 * fraction)
    }

    /// The spot in the hallway `standoff_m` before the wall, at the door's middle, facing it.
    pub fn front(&self, standoff_m: f64) -> Pose2 {
        let place = self.gap.midpoint() - self.into * standoff_m;
        Pose2::new(place.x, place.y, self.into.y.atan2(self.into.x))
    }
}

fn holds(wall: &Segment, opening: &Opening) -> bool {
    let Some(along) = wall.direction() else { return false };
    let middle_m = along.dot(&(opening.at - wall.a));
    let half_m = 0.5 * opening.width_m;
    let aside_m = (opening.at - wall.a - along * middle_m).norm();
    aside_m <= ON_WALL_M && middle_m >= half_m - 1e-9 && middle_m + half_m <= wall.length_m() + 1e-9
}

/// Adds to `pieces` what the gaps leave of a wall.
pub(super) fn subtract_gaps<'a>(
    wall: &Segment,
    gaps: impl Iterator<Item = &'a Segment>,
    pieces: &mut Vec<Segment>,
) {
    let Some(along) = wall.direction() else { return };
    let length_m = wall.length_m();
    let mut holes: Vec<(f64, f64)> = gaps
        .filter(|gap| {
            let off = |point: Point2<f64>| {
                let offset = point - wall.a;
                (offset - along * along.dot(&offset)).norm()
            };
            off(gap.a) <= ON_WALL_M && off(gap.b) <= ON_WALL_M
        })
        .map(|gap| {
            let (a, b) = (along.dot(&(gap.a - wall.a)), along.dot(&(gap.b - wall.a)));
            (a.min(b), a.max(b))
        })
        .filter(|&(from, to)| to > 0.0 && from < length_m)
        .collect();
    holes.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut from_m = 0.0;
    for (hole_from_m, hole_to_m) in holes {
        if hole_from_m > from_m + 1e-9 {
            pieces.push(Segment::new(wall.a + along * from_m, wall.a + along * hole_from_m));
        }
        from_m = hole_to_m.max(from_m);
    }
    if length_m > from_m + 1e-9 {
        pieces.push(Segment::new(wall.a + along * from_m, wall.b));
    }
}
