//! The side sensors against the walls of the world.

use crate::hypothesis::{Comparison, Hypothesis};
use geometry::{Point2, Pose2, Segment, Vector2, World};
use messages::{Reading, TOF_COUNT, TofRanges};
use nalgebra::RowVector3;

/// Sensors that look sideways (COF-025).
pub(crate) const SIDE_SENSORS: [usize; 4] = [0, 1, 6, 7];
/// Readings of walls farther away are too noisy to be worth it (COF-022).
const FARTHEST_M: f64 = 1.0;
/// A wall met at a flatter angle gives no distance: the cosine of 30 degrees.
const SQUAREST: f64 = 0.866;
/// How near to a door's opening the wall is not trusted: half the sensor's cone at a metre (note 2.1).
const DOOR_MARGIN_M: f64 = 0.25;
/// Share of readings of a wall that something else causes: people, furniture, notice boards.
const OBSTRUCTED: f64 = 0.3;

/// The walls of all floors, and the openings in them.
#[derive(Debug, Clone, Default)]
pub struct HallwayWalls {
    walls: Vec<(i32, Segment)>,
    openings: Vec<(i32, Segment)>,
}

/// The sides whose readings can be used, and by how much their variance grows.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Agreeing {
    right: bool,
    left: bool,
    pub(crate) caution: f64,
}

impl Agreeing {
    pub(crate) fn contains(&self, sensor: usize) -> bool {
        if sensor < 2 { self.right } else { self.left }
    }
}

impl HallwayWalls {
    /// The walls of a world, before doors are cut, and its doors.
    pub fn of(world: &World) -> Self {
        let mut all = Self::default();
        for floor in &world.floors {
            all.walls.extend(floor.segments().map(|wall| (floor.number, wall)));
            all.openings.extend(world.openings_of(floor.number).map(|door| (floor.number, door.gap)));
        }
        all
    }

    /// Walls without doors, for tests and for places without a world file.
    pub fn from_segments(floor: i32, segments: impl IntoIterator<Item = Segment>) -> Self {
        Self { walls: segments.into_iter().map(|wall| (floor, wall)).collect(), openings: Vec::new() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.walls.is_empty()
    }

    /// Which side sensors see walls and nothing else, as far as they can tell among themselves: the two of a
    /// side must see one straight wall, and right and left together must measure the hallway's width,
    /// whatever the robot's place in it. A door that no drawing shows, or a person, breaks one of the two.
    pub(crate) fn agreeing(
        &self,
        best: &Hypothesis,
        floor: i32,
        ranges: &TofRanges,
        sigma_m: f64,
    ) -> Agreeing {
        let error = |sensor| self.compare(best, floor, sensor, ranges, sigma_m).map(|one| one.innovation);
        let turn_m = TofRanges::SIDE_BASE_M * best.covariance[(2, 2)].max(0.0).sqrt();
        let straight_m = 2.0 * (2.0 * sigma_m * sigma_m + turn_m * turn_m).sqrt();
        let side = |first, second| {
            let (a, b) = (error(first)?, error(second)?);
            ((a - b).abs() < straight_m).then_some(0.5 * (a + b))
        };
        match (side(0, 1), side(6, 7)) {
            (Some(right), Some(left)) if (right + left).abs() < 2.0 * sigma_m => {
                Agreeing { right: true, left: true, caution: 1.0 }
            }
            (Some(_), Some(_)) | (None, None) => Agreeing::default(),
            // One side alone has nothing to be measured against: half as good, and not when something may
            // stand before the wall.
            (Some(alone_m), None) | (None, Some(alone_m)) if alone_m < -2.0 * sigma_m => Agreeing::default(),
            (right, left) => Agreeing { right: right.is_some(), left: left.is_some(), caution: 4.0 },
        }
    }

    /// The reading of one side sensor against the wall that a hypothesis expects there; `None` when there is
    /// no wall to speak of.
    pub(crate) fn compare(
        &self,
        hypothesis: &Hypothesis,
        floor: i32,
        sensor: usize,
        ranges: &TofRanges,
        sigma_m: f64,
    ) -> Option<Comparison> {
        let Reading::Distance(measured_m) = ranges.reading(sensor) else { return None };
        let mount = TofRanges::MOUNTS[sensor % TOF_COUNT];
        let eye = hypothesis.pose.compose(mount);
        let (sine, cosine) = eye.heading_rad.sin_cos();
        let axis = Vector2::new(cosine, sine);
        let (expected_m, wall) = self.first_wall(floor, eye, axis)?;
        if expected_m > FARTHEST_M || f64::from(measured_m) > FARTHEST_M {
            return None;
        }
        let met = eye.position() + axis * expected_m;
        let near_door = |(on, gap): &(i32, Segment)| *on == floor && gap.distance_m(met) < DOOR_MARGIN_M;
        if self.openings.iter().any(near_door) {
            return None;
        }
        let along = wall.direction()?;
        let normal = Vector2::new(-along.y, along.x);
        let square = normal.dot(&axis);
        if square.abs() < SQUAREST {
            return None;
        }
        // distance = normal . (wall - eye) / normal . axis, derived by the pose; the eye turns around the
        // robot's centre.
        let lever = Vector2::new(eye.x_m - hypothesis.pose.x_m, eye.y_m - hypothesis.pose.y_m);
        let swing = |v: Vector2<f64>| normal.dot(&Vector2::new(-v.y, v.x));
        let jacobian = RowVector3::new(
            -normal.x / square,
            -normal.y / square,
            (-swing(lever) - expected_m * swing(axis)) / square,
        );
        Some(Comparison {
            innovation: f64::from(measured_m) - expected_m,
            jacobian,
            variance: sigma_m * sigma_m,
            prior: 1.0 - OBSTRUCTED,
            wrong_density: Self::WRONG_DENSITY,
        })
    }

    /// Density of a reading that is not of the wall.
    pub(crate) const WRONG_DENSITY: f64 = 1.0 / FARTHEST_M;

    fn first_wall(&self, floor: i32, eye: Pose2, axis: Vector2<f64>) -> Option<(f64, Segment)> {
        let on_floor = self.walls.iter().filter(|(on, _)| *on == floor);
        let hits = on_floor.filter_map(|(_, wall)| {
            let at: Point2<f64> = eye.position();
            wall.cast_m(at, axis).map(|distance_m| (distance_m, *wall))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{RangeStatus, RangeStatusName};

    /// Which sides are believed in a hallway with walls at ±0.85 m, by a robot in its middle that reads these
    /// side distances.
    #[track_caller]
    fn check(right_m: f32, left_m: f32, expected: [bool; 2]) {
        let line = |y_m: f64| Segment::new(Point2::new(-9.0, y_m), Point2::new(9.0, y_m));
        let walls = HallwayWalls::from_segments(2, [line(-0.85), line(0.85)]);
        let best = Hypothesis::new(Pose2::IDENTITY, 0.05, 0.01, 0.0, 0.0);
        let mut ranges = TofRanges::default();
        for (sensor, range_m) in [(0, right_m), (1, right_m), (6, left_m), (7, left_m)] {
            ranges.range_m[sensor] = range_m;
            ranges.status[sensor] = RangeStatus::from(RangeStatusName::Valid);
        }
        let agreeing = walls.agreeing(&best, 2, &ranges, 0.03);
        assert_eq!([agreeing.right, agreeing.left], expected, "{right_m} {left_m}");
    }

    #[test]
    fn a_box_before_the_wall_is_not_the_wall() {
        let wall_m = 0.85 - 0.255;
        check(wall_m, wall_m, [true, true]);
        // Shifted in the hallway: both sides say so.
        check(wall_m - 0.1, wall_m + 0.1, [true, true]);
        // One side alone: a little nearer, farther, and a box.
        check(wall_m - 0.04, 2.0, [true, false]);
        check(wall_m + 0.1, 2.0, [true, false]);
        check(wall_m - 0.3, 2.0, [false, false]);
        check(2.0, wall_m - 0.3, [false, false]);
    }
}
