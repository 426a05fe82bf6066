//! Where the angle may be measured: the marked areas of the floor plan, and stretches of wall without doors
//! (COF-083, X-2A).

use crate::Params;
use geometry::{
    Point2, Polygon, Pose2, Segment, Vector2, angle,
    world::{AreaKind, World},
};
use messages::{FixedText, Side, TofRanges};

/// A stretch of wall shorter than this between two doors' margins is not worth an area.
const SHORTEST_M: f64 = 0.2;

/// A robot that measures a wall stands no farther from it than this: half a hallway and half a robot.
const REACH_M: f64 = 1.2;

/// A ray must miss a door by this.
const DOOR_MISS_M: f64 = 0.05;

/// Walls farther than this are not those that the sensors measure.
const FARTHEST_M: f64 = 3.0;

#[derive(Debug, Clone)]
struct Area {
    name: FixedText<24>,
    outline: Polygon,
    /// The wall to be measured there, by index; any for a marked area.
    wall: Option<usize>,
}

#[derive(Debug, Clone)]
struct Floor {
    number: i32,
    /// Straight pieces of wall, which run through where doors are.
    walls: Vec<Segment>,
    /// Where doors are.
    gaps: Vec<Segment>,
    /// First the marked ones.
    areas: Vec<Area>,
}

/// A place where one side may be measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    pub(crate) area: FixedText<24>,
    /// Direction of the wall in the map, the one of its two that is nearer to the robot's heading.
    pub(crate) wall_heading_rad: f64,
}

/// The areas of all floors.
#[derive(Debug, Clone, Default)]
pub(crate) struct Areas {
    floors: Vec<Floor>,
}

impl Areas {
    pub(crate) fn new(world: &World, params: &Params) -> Self {
        let floor = |floor: &geometry::world::Floor| {
            let number = floor.number;
            let walls: Vec<_> = floor.segments().collect();
            let gaps: Vec<_> = world.openings_of(number).map(|opening| opening.gap).collect();
            let marked = world.areas_of(number, Some(AreaKind::Measure)).filter_map(|area| {
                Some(Area { name: FixedText::truncated(&area.name), outline: area.shape().ok()?, wall: None })
            });
            let mut areas: Vec<_> = marked.collect();
            if params.generate_areas {
                for (index, wall) in walls.iter().enumerate() {
                    areas.extend(free_stretches(wall, &gaps, params.door_margin_m).enumerate().filter_map(
                        |(count, stretch)| {
                            let name = FixedText::truncated(&format!("floor {number} wall {index}.{count}"));
                            Some(Area { name, outline: beside(&stretch)?, wall: Some(index) })
                        },
                    ));
                }
            }
            Floor { number, walls, gaps, areas }
        };
        Self { floors: world.floors.iter().map(floor).collect() }
    }

    /// Whether, and in which area, a side of a robot at `pose` faces flat wall.
    pub(crate) fn spot(&self, floor: i32, pose: Pose2, side: Side) -> Option<Spot> {
        let floor = self.floors.iter().find(|candidate| candidate.number == floor)?;
        let mut areas = floor.areas.iter().filter(|area| area.outline.contains(pose.position())).peekable();
        areas.peek()?;
        let (wall, facing) = floor.facing(pose, side)?;
        let area = areas.find(|area| area.wall.is_none_or(|index| index == wall && facing))?;
        let direction = floor.walls[wall].direction()?;
        let along_rad = direction.y.atan2(direction.x);
        let off_rad = angle::difference(pose.heading_rad, along_rad);
        let wall_heading_rad = if off_rad.abs() <= std::f64::consts::FRAC_PI_2 {
            along_rad
        } else {
            angle::wrap(along_rad + std::f64::consts::PI)
        };
        Some(Spot { area: area.name, wall_heading_rad })
    }
}

impl Floor {
    /// The wall beside the robot, and whether both sensors of the side look at it. `None` without a wall, and
    /// when a sensor looks at a door.
    fn facing(&self, pose: Pose2, side: Side) -> Option<(usize, bool)> {
        let (back, front) = if side == Side::Right { (0, 1) } else { (7, 6) };
        let look = |sensor: usize| {
            let sensor = pose.compose(TofRanges::MOUNTS[sensor]);
            let hit = self.cast(sensor);
            let at_door =
                hit.is_some_and(|(_, point)| self.gaps.iter().any(|gap| gap.distance_m(point) < DOOR_MISS_M));
            (!at_door).then_some(hit)
        };
        let (back, front) = (look(back)?, look(front)?);
        let axis_rad = TofRanges::MOUNTS[if side == Side::Right { 0 } else { 7 }].heading_rad;
        let beside = self.cast(pose.compose(Pose2::new(0.0, 0.0, axis_rad)));
        let (wall, _) = beside.or(back).or(front)?;
        let both = [back, front]
            .iter()
            .all(|hit| hit.is_some_and(|(other, point)| self.is_same_wall(wall, other, point)));
        Some((wall, both))
    }

    /// The nearest wall ahead of `from`, and where it is met.
    fn cast(&self, from: Pose2) -> Option<(usize, Point2<f64>)> {
        let (sine, cosine) = from.heading_rad.sin_cos();
        let direction = Vector2::new(cosine, sine);
        let hit = |(index, wall): (usize, &Segment)| Some((index, wall.cast_m(from.position(), direction)?));
        let hits = self.walls.iter().enumerate().filter_map(hit);
        let (index, range_m) = hits.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (range_m <= FARTHEST_M).then(|| (index, from.position() + direction * range_m))
    }

    /// Whether `point` on wall `other` lies on the line of `wall`, as where one polyline ends and the next
    /// goes on.
    fn is_same_wall(&self, wall: usize, other: usize, point: Point2<f64>) -> bool {
        if wall == other {
            return true;
        }
        let (wall, other) = (&self.walls[wall], &self.walls[other]);
        let Some((along, along_other)) = wall.direction().zip(other.direction()) else { return false };
        let off = point - wall.a;
        (along.x * along_other.y - along.y * along_other.x).abs() < 0.01
            && (along.x * off.y - along.y * off.x).abs() < 0.01
    }
}

/// What is left of a wall when the doors on it, each with a margin, are taken out, and the margin at its
/// ends.
fn free_stretches<'a>(
    wall: &'a Segment,
    gaps: &[Segment],
    margin_m: f64,
) -> impl Iterator<Item = Segment> + use<'a> {
    let length_m = wall.length_m();
    let along = wall.direction().unwrap_or_default();
    let place_m = |point: Point2<f64>| (point - wall.a).dot(&along);
    let on_wall = gaps.iter().filter(|gap| wall.distance_m(gap.midpoint()) < 0.02);
    let mut taken: Vec<_> = on_wall
        .map(|gap| {
            let (a_m, b_m) = (place_m(gap.a), place_m(gap.b));
            (a_m.min(b_m) - margin_m, a_m.max(b_m) + margin_m)
        })
        .chain([(f64::NEG_INFINITY, margin_m), (length_m - margin_m, f64::INFINITY)])
        .collect();
    taken.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = Vec::new();
    let mut from_m = f64::NEG_INFINITY;
    for (begin_m, end_m) in taken {
        if begin_m - from_m >= SHORTEST_M && from_m.is_finite() {
            free.push((from_m, begin_m));
        }
        from_m = from_m.max(end_m);
    }
    let at = move |m: f64| wall.a + along * m;
    free.into_iter().map(move |(a_m, b_m)| Segment::new(at(a_m), at(b_m)))
}

/// The floor on both sides of a stretch of wall, within reach.
fn beside(stretch: &Segment) -> Option<Polygon> {
    let along = stretch.direction()?;
    let out = Vector2::new(-along.y, along.x) * REACH_M;
    Polygon::new([stretch.a - out, stretch.b - out, stretch.b + out, stretch.a + out]).ok()
}
