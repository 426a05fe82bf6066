//! What the robot may touch: the walls of the map, or what a scan has shown of them.

use geometry::{Point2, Polygon, Pose2, Segment, Vector2, Walls, World};
use messages::RangeScan;

/// Turns are looked at in steps of this.
const TURN_STEP_RAD: f64 = 0.07;
/// Ways are looked at in steps of this.
const WAY_STEP_M: f64 = 0.02;
/// Room that grows by more than this from step to step is that of a body that leaves a wall.
const LEAVING_M: f64 = 1e-4;
/// Readings on either side of a reading among which the middle one counts: a single late echo opens no gap.
const MEDIAN_HALF: usize = 2;

/// Walls, and the body that must not touch them.
#[derive(Debug, Clone)]
pub(crate) struct Arena {
    walls: Walls,
    outline: Option<Polygon>,
    footprint: Polygon,
}

impl Arena {
    /// The first floor of a world.
    pub(crate) fn of_world(world: &World, footprint: Polygon) -> Self {
        let floor = world.floors.first();
        let walls = floor.map(|floor| world.wall_segments(floor.number)).unwrap_or_default();
        let outline = floor.and_then(geometry::world::Floor::outline_polygon);
        Self { walls: Walls::new(walls), outline, footprint }
    }

    /// What a raw scan shows, in the frame of the robot that took it. `None` for a scan that shows nothing.
    pub(crate) fn of_scan(scan: &RangeScan, ranges: &[f32], footprint: Polygon) -> Option<Self> {
        scan.check().ok()?;
        let count = ranges.len();
        if !(8..=100_000).contains(&count) || !scan.range_max_m.is_finite() {
            return None;
        }
        let reading = |index: usize| scan.beam(ranges, index % count).map_or(scan.range_max_m, |beam| beam.1);
        let corner = |index: usize| {
            let mut around: Vec<f64> =
                (0..=2 * MEDIAN_HALF).map(|beside| reading(index + count + beside - MEDIAN_HALF)).collect();
            around.sort_by(f64::total_cmp);
            let direction_rad =
                scan.sensor_heading_rad + scan.angle_min_rad + index as f64 * scan.angle_step_rad;
            let (sine, cosine) = direction_rad.sin_cos();
            Point2::new(around[MEDIAN_HALF] * cosine, around[MEDIAN_HALF] * sine)
        };
        let corners: Vec<_> = (0..count).map(corner).collect();
        let walls = (0..count).map(|index| Segment::new(corners[index], corners[(index + 1) % count]));
        Some(Self { walls: Walls::new(walls), outline: None, footprint })
    }

    /// The closed line around the free space, where the world has one.
    pub(crate) fn outline(&self) -> Option<&Polygon> {
        self.outline.as_ref()
    }

    /// The walls.
    pub(crate) fn walls(&self) -> &Walls {
        &self.walls
    }

    /// Room around the body at a pose; infinite without walls.
    pub(crate) fn room_m(&self, pose: Pose2) -> f64 {
        self.room_up_to_m(pose, f64::INFINITY)
    }

    /// Room around the body at a pose, but no more than `enough_m`: walls that are farther away need not be
    /// looked at closely.
    pub(crate) fn room_up_to_m(&self, pose: Pose2, enough_m: f64) -> f64 {
        let (centre, reach_m) = (pose.position(), self.footprint.radius_m());
        let mut placed: Option<Polygon> = None;
        let mut least_m = enough_m;
        for wall in self.walls.segments() {
            if wall.distance_m(centre) - reach_m < least_m {
                let body = placed.get_or_insert_with(|| self.footprint.transformed(pose));
                least_m = least_m.min(body.distance_to_segment_m(wall));
            }
        }
        least_m
    }

    /// The least room around the body while it turns.
    pub(crate) fn turning_room_m(&self, pose: Pose2, turn_rad: f64) -> f64 {
        let steps = (turn_rad.abs() / TURN_STEP_RAD).ceil().clamp(1.0, 200.0) as u32;
        let at = |step: u32| f64::from(step) / f64::from(steps) * turn_rad;
        let poses = (0..=steps).map(|step| Pose2::new(pose.x_m, pose.y_m, pose.heading_rad + at(step)));
        self.least_room_m(poses)
    }

    /// The least room around the body while it drives straight.
    pub(crate) fn driving_room_m(&self, pose: Pose2, way_m: f64) -> f64 {
        let steps = (way_m.abs() / WAY_STEP_M).ceil().clamp(1.0, 500.0) as u32;
        let at = |step: u32| f64::from(step) / f64::from(steps) * way_m;
        self.least_room_m((0..=steps).map(|step| pose.compose(Pose2::new(at(step), 0.0, 0.0))))
    }

    /// The least room at any of these poses. What the body is leaving does not count: it is there, however
    /// near a wall seems to be.
    fn least_room_m(&self, poses: impl Iterator<Item = Pose2>) -> f64 {
        let (mut least_m, mut last_m, mut is_leaving) = (f64::INFINITY, None, true);
        for pose in poses {
            let room_m = self.room_m(pose);
            is_leaving &= last_m.is_none_or(|last_m| room_m > last_m + LEAVING_M);
            if !is_leaving {
                least_m = least_m.min(room_m);
            }
            last_m = Some(room_m);
        }
        least_m.min(last_m.unwrap_or(f64::INFINITY))
    }

    /// Distance of a straight way from the nearest wall.
    pub(crate) fn beside_m(&self, from: Point2<f64>, to: Point2<f64>) -> f64 {
        let way = Segment::new(from, to);
        let walls = self.walls().segments().iter();
        walls.map(|wall| wall.distance_to_segment_m(&way)).fold(f64::INFINITY, f64::min)
    }

    /// Whether a place is free, and how far it is from the nearest wall: zero outside.
    pub(crate) fn free_m(&self, place: Point2<f64>) -> f64 {
        if self.outline.as_ref().is_some_and(|outline| !outline.contains(place)) {
            return 0.0;
        }
        self.walls().distance_m(place)
    }

    /// A place near this one, at most `shift_m` away, that is `clearance_m` from the walls, or as far as it
    /// gets.
    pub(crate) fn shifted(&self, place: Point2<f64>, clearance_m: f64, shift_m: f64) -> Point2<f64> {
        let around = (1..=4).flat_map(|ring| {
            (0..16).map(move |step| {
                let (sine, cosine) = (f64::from(step) / 16.0 * std::f64::consts::TAU).sin_cos();
                Vector2::new(cosine, sine) * (f64::from(ring) / 4.0)
            })
        });
        let mut best = (place, self.free_m(place));
        for offset in around {
            let other = place + offset * shift_m;
            let free_m = self.free_m(other);
            if best.1 >= clearance_m {
                break;
            }
            if free_m > best.1 + 1e-6 {
                best = (other, free_m);
            }
        }
        best.0
    }

    /// How far the robot can drive back, up to `most_m`, with `margin_m` left.
    pub(crate) fn retreat_m(&self, pose: Pose2, most_m: f64, margin_m: f64) -> f64 {
        let steps = (most_m / WAY_STEP_M).ceil().clamp(1.0, 500.0) as u32;
        let mut free_m = 0.0;
        for step in 1..=steps {
            let way_m = most_m * f64::from(step) / f64::from(steps);
            if self.room_m(pose.compose(Pose2::new(-way_m, 0.0, 0.0))) < margin_m {
                break;
            }
            free_m = way_m;
        }
        free_m
    }
}
