//! What the robot's body can touch. Only what is near is looked at: the list is made anew every half metre.

use geometry::{Point2, Pose2, Segment, Shape, World, world::DoorGeometry};

/// The way for which the list of what is near holds.
const KEPT_FOR_M: f64 = 0.5;
/// Once in contact, the body is free again when it is this far from everything.
pub(crate) const RELEASE_M: f64 = 0.010;

/// A rectangle about the robot's centre of motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Footprint {
    pub(crate) half_length_m: f64,
    pub(crate) half_width_m: f64,
}

/// What stands on one floor.
#[derive(Debug, Clone)]
pub(crate) struct Obstacles {
    pub(crate) floor: i32,
    walls: Vec<Segment>,
    furniture: Vec<Shape>,
    leaves: Vec<Leaf>,
    near: Near,
}

/// The leaf of a door or of the elevator, as a line: its thickness lies behind the visible face.
#[derive(Debug, Clone)]
struct Leaf {
    which: LeafOf,
    geometry: DoorGeometry,
    line: Segment,
}

/// Whose leaf it is, by index into the world's list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeafOf {
    Door(usize),
    Elevator(usize),
}

#[derive(Debug, Clone, Default)]
struct Near {
    around: Option<Point2<f64>>,
    walls: Vec<Segment>,
    furniture: Vec<usize>,
    leaves: Vec<usize>,
}

impl Footprint {
    pub(crate) fn radius_m(&self) -> f64 {
        self.half_length_m.hypot(self.half_width_m)
    }

    pub(crate) fn grown(&self, margin_m: f64) -> Self {
        Self { half_length_m: self.half_length_m + margin_m, half_width_m: self.half_width_m + margin_m }
    }

    fn contains(&self, local: Point2<f64>) -> bool {
        local.x.abs() <= self.half_length_m && local.y.abs() <= self.half_width_m
    }

    /// Distance from the body to a point of the map; 0 inside.
    pub(crate) fn distance_m(&self, pose: Pose2, point: Point2<f64>) -> f64 {
        let local = pose.inverse_transform(point);
        let aside = |value: f64, half: f64| (value.abs() - half).max(0.0);
        aside(local.x, self.half_length_m).hypot(aside(local.y, self.half_width_m))
    }

    /// Whether a piece of line in the body's frame passes through the body (Liang and Barsky 1984).
    fn meets(&self, segment: &Segment) -> bool {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let step = segment.b - segment.a;
        for (from, along, half) in
            [(segment.a.x, step.x, self.half_length_m), (segment.a.y, step.y, self.half_width_m)]
        {
            if along.abs() < 1e-12 {
                if from.abs() > half {
                    return false;
                }
                continue;
            }
            let (p, q) = ((-half - from) / along, (half - from) / along);
            enter = enter.max(p.min(q));
            leave = leave.min(p.max(q));
            if enter > leave {
                return false;
            }
        }
        true
    }

    pub(crate) fn touches_line(&self, pose: Pose2, line: &Segment) -> bool {
        let local = Segment::new(pose.inverse_transform(line.a), pose.inverse_transform(line.b));
        self.meets(&local)
    }

    pub(crate) fn touches_shape(&self, pose: Pose2, shape: &Shape) -> bool {
        match shape {
            Shape::Disc { centre, radius_m } => self.distance_m(pose, *centre) < *radius_m,
            Shape::Polygon(polygon) => {
                polygon.edges().any(|edge| self.touches_line(pose, &edge))
                    || polygon.contains(pose.position())
                    || polygon
                        .corners()
                        .first()
                        .is_some_and(|&corner| self.contains(pose.inverse_transform(corner)))
            }
        }
    }
}

impl Obstacles {
    /// Everything of a floor that a body up to `height_m` can touch.
    pub(crate) fn new(world: &World, floor: i32, height_m: f64) -> Self {
        let mut leaves = Vec::new();
        for (index, door) in world.doors.iter().enumerate().filter(|(_, door)| door.floor == floor) {
            leaves.extend(world.door_geometry(door).map(|geometry| Leaf::new(LeafOf::Door(index), geometry)));
        }
        for (index, lift) in world.elevators.iter().enumerate() {
            let geometry = world.elevator_geometry(lift, floor);
            leaves.extend(geometry.map(|geometry| Leaf::new(LeafOf::Elevator(index), geometry)));
        }
        let standing = world.furniture.iter().filter(|item| item.floor == floor);
        let furniture = standing.flat_map(|item| {
            let body = item.body();
            let low = body.prisms().iter().filter(|prism| prism.reaches_between(0.0, height_m));
            low.map(|prism| prism.shape.transformed(item.pose)).collect::<Vec<_>>()
        });
        let (walls, furniture) = (world.wall_segments(floor), furniture.collect());
        Self { floor, walls, furniture, leaves, near: Near::default() }
    }

    /// Opens a leaf by a fraction from 0 to 1.
    pub(crate) fn open(&mut self, which: LeafOf, fraction: f64) {
        if let Some(leaf) = self.leaves.iter_mut().find(|leaf| leaf.which == which) {
            leaf.line = leaf.at(fraction);
        }
    }

    /// Whether the body touches anything that is no person.
    pub(crate) fn touched(&mut self, footprint: &Footprint, pose: Pose2) -> bool {
        let moved = self.near.around.is_none_or(|around| (around - pose.position()).norm() > KEPT_FOR_M);
        if moved {
            self.look_around(pose.position(), footprint.radius_m() + KEPT_FOR_M + 2.0 * RELEASE_M);
        }
        let near = &self.near;
        near.walls.iter().any(|wall| footprint.touches_line(pose, wall))
            || near.furniture.iter().any(|&index| footprint.touches_shape(pose, &self.furniture[index]))
            || near.leaves.iter().any(|&index| footprint.touches_line(pose, &self.leaves[index].line))
    }

    fn look_around(&mut self, around: Point2<f64>, reach_m: f64) {
        let near = &mut self.near;
        near.around = Some(around);
        near.walls.clear();
        near.walls.extend(self.walls.iter().filter(|wall| wall.distance_m(around) <= reach_m));
        near.furniture.clear();
        let shapes = self.furniture.iter().enumerate();
        near.furniture
            .extend(shapes.filter(|(_, shape)| shape.distance_m(around) <= reach_m).map(|(index, _)| index));
        near.leaves.clear();
        let leaves = self.leaves.iter().enumerate();
        // A leaf reaches no farther from its hinge than its own length.
        let reaches = |leaf: &Leaf| {
            leaf.geometry.gap.distance_m(around) <= reach_m + 1.5 * leaf.geometry.gap.length_m()
        };
        near.leaves.extend(leaves.filter(|(_, leaf)| reaches(leaf)).map(|(index, _)| index));
    }
}

impl Leaf {
    fn new(which: LeafOf, geometry: DoorGeometry) -> Self {
        let line = geometry.leaf;
        Self { which, geometry, line }
    }

    fn at(&self, fraction: f64) -> Segment {
        let pose = self.geometry.leaf_pose(fraction);
        let tip = pose.transform(Point2::new(self.geometry.leaf.length_m(), 0.0));
        Segment::new(pose.position(), tip)
    }
}
