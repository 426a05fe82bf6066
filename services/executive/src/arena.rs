//! What the robot may touch: the walls of the map, or what a scan has shown of them.

use geometry::{Point2, Polygon, Pose2, Scene, Segment, Vector2, Walls, World};
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
    scene: Scene,
    outline: Option<Polygon>,
    footprint: Polygon,
}

impl Arena {
    /// The first floor of a world.
    pub(crate) fn of_world(world: &World, footprint: Polygon) -> Self {
        let floor = world.floors.first();
        let walls = floor.map(|floor| world.wall_segments(floor.number)).unwrap_or_default();
        let outline = floor.and_then(geometry::world::Floor::outline_polygon);
        Self { scene: Scene::new(walls), outline, footprint }
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
        Some(Self { scene: Scene::new(walls), outline: None, footprint })
    }

    /// The closed line around the free space, where the world has one.
    pub(crate) fn outline(&self) -> Option<&Polygon> {
        self.outline.as_ref()
    }

    /// The walls.
    pub(crate) fn walls(&self) -> &Walls {
        self.scene.walls()
    }

    /// Room around the body at a pose; infinite without walls.
    pub(crate) fn room_m(&self, pose: Pose2) -> f64 {
        self.scene.clearance_m(&self.footprint, pose, [0.0, 1.0], None)
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

    /// The least room at any of these poses. What the body is leaving does not count: it is there, however near a wall seems to be.
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

    /// A place near this one, at most `shift_m` away, that is `clearance_m` from the walls, or as far as it gets.
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
        let steps = (most_m / WAY_STEP_M).ceil().max(1.0) as u32;
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

/// What has to be done before the robot can drive straight to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Manoeuvre {
    /// First so far ahead, or back, to where there is room for the turn.
    pub(crate) first_m: f64,
    /// Then so far around.
    pub(crate) turn_rad: f64,
    /// The least room on the way.
    pub(crate) room_m: f64,
}

/// How far the robot may go to find room for a turn.
const FIRST_M: [f64; 13] =
    [0.0, 0.02, -0.02, 0.04, -0.04, 0.06, -0.06, 0.08, -0.08, 0.10, -0.10, 0.13, -0.13];
/// A metre of detour is worth this much turning.
const RAD_PER_M: f64 = 30.0;
/// Smaller turns are none.
const NO_TURN_RAD: f64 = 0.004;

/// What the robot knows of its surroundings, and where it is in them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) arena: &'a Arena,
    pub(crate) pose: Pose2,
}

/// The least room that any view shows around the body while it turns.
pub(crate) fn turning_room_m(views: &[View<'_>], ahead_m: f64, turn_rad: f64) -> f64 {
    let room_m = |view: &View<'_>| {
        view.arena.turning_room_m(view.pose.compose(Pose2::new(ahead_m, 0.0, 0.0)), turn_rad)
    };
    views.iter().map(room_m).fold(f64::INFINITY, f64::min)
}

/// The same while it drives straight.
pub(crate) fn driving_room_m(views: &[View<'_>], way_m: f64) -> f64 {
    views.iter().map(|view| view.arena.driving_room_m(view.pose, way_m)).fold(f64::INFINITY, f64::min)
}

/// How far a body that cannot turn anywhere may turn, and then drive, to get away from a wall beside it.
const ESCAPE_RAD: [f64; 6] = [0.15, -0.15, 0.30, -0.30, 0.45, -0.45];
const ESCAPE_M: [f64; 6] = [0.05, -0.05, 0.10, -0.10, 0.15, -0.15];
/// Less room is none.
const NO_ROOM_M: f64 = 0.003;

/// A small turn and a short way that lead the body out of a narrow place, to where there is more room.
pub(crate) fn escape(views: &[View<'_>]) -> Option<(f64, f64)> {
    let ways = ESCAPE_RAD.into_iter().flat_map(|turn_rad| ESCAPE_M.map(|way_m| (turn_rad, way_m)));
    let room_m = |(turn_rad, way_m): (f64, f64)| {
        let turned: Vec<View<'_>> = views
            .iter()
            .map(|view| View { pose: view.pose.compose(Pose2::new(0.0, 0.0, turn_rad)), ..*view })
            .collect();
        let on_the_way_m = turning_room_m(views, 0.0, turn_rad).min(driving_room_m(&turned, way_m));
        let there_m =
            turned.iter().map(|view| view.arena.room_m(view.pose.compose(Pose2::new(way_m, 0.0, 0.0))));
        (on_the_way_m >= NO_ROOM_M).then(|| there_m.fold(f64::INFINITY, f64::min))
    };
    let free = ways.filter_map(|way| Some((way, room_m(way)?)));
    free.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(way, _)| way)
}

/// The cheapest way to look at a place, given as seen from the robot, with room for the body in all views; the roomiest where there is not
/// enough. Either way around is tried.
pub(crate) fn manoeuvre(views: &[View<'_>], margin_m: f64, place: Point2<f64>) -> Manoeuvre {
    let options = FIRST_M.into_iter().flat_map(|first_m| {
        let short_rad = place.y.atan2(place.x - first_m);
        let long_rad = short_rad - std::f64::consts::TAU.copysign(short_rad);
        [(first_m, short_rad), (first_m, long_rad)]
    });
    let mut best: Option<(f64, Manoeuvre)> = None;
    for (first_m, turn_rad) in options {
        let cost = first_m.abs() * RAD_PER_M + turn_rad.abs();
        let enough = |(_, found): &(f64, Manoeuvre)| found.room_m >= margin_m;
        if best.as_ref().is_some_and(|best| enough(best) && best.0 <= cost) {
            continue;
        }
        let turn_rad = if turn_rad.abs() < NO_TURN_RAD { 0.0 } else { turn_rad };
        let way_room_m = if first_m == 0.0 { f64::INFINITY } else { driving_room_m(views, first_m) };
        let turn_room_m =
            if turn_rad == 0.0 { f64::INFINITY } else { turning_room_m(views, first_m, turn_rad) };
        let found = (cost, Manoeuvre { first_m, turn_rad, room_m: way_room_m.min(turn_room_m) });
        let better = match &best {
            None => true,
            Some(best) if enough(best) => enough(&found),
            Some(best) => found.1.room_m > best.1.room_m,
        };
        if better {
            best = Some(found);
        }
    }
    best.map_or(Manoeuvre { first_m: 0.0, turn_rad: 0.0, room_m: 0.0 }, |(_, found)| found)
}

/// Where an approach may begin: so far from its end, in so many directions.
const APPROACH_M: [f64; 4] = [0.06, 0.10, 0.14, 0.20];
const APPROACHES: u32 = 24;
/// An approach begins where the robot can turn as it likes.
const APPROACH_ROOM_M: f64 = 0.125;
/// A turn more has to be worth its error.
const VIA_COST_M: f64 = 0.05;

impl Arena {
    /// The least room on the straight way to a place, the turn to it included.
    fn way_room_m(&self, pose: Pose2, place: Point2<f64>, margin_m: f64) -> (f64, Pose2) {
        let views = [View { arena: self, pose }];
        let turn = manoeuvre(&views, margin_m, pose.inverse_transform(place));
        let from = pose.compose(Pose2::new(turn.first_m, 0.0, turn.turn_rad));
        let way_m = (place - from.position()).norm();
        let there = from.compose(Pose2::new(way_m, 0.0, 0.0));
        (turn.room_m.min(self.driving_room_m(from, way_m)), there)
    }

    /// By way of which place the body best gets to a last one: `None` for the straight way. A box that drives up to a wall askew touches it
    /// with a corner where one that drives along it, or straight at it, does not.
    pub(crate) fn approach(&self, pose: Pose2, place: Point2<f64>, margin_m: f64) -> Option<Point2<f64>> {
        let (direct_room_m, _) = self.way_room_m(pose, place, margin_m);
        if direct_room_m >= margin_m {
            return None;
        }
        let mut best = (direct_room_m.min(margin_m), (place - pose.position()).norm(), None);
        for (reach_m, step) in
            APPROACH_M.into_iter().flat_map(|reach_m| (0..APPROACHES).map(move |step| (reach_m, step)))
        {
            let heading_rad = f64::from(step) / f64::from(APPROACHES) * std::f64::consts::TAU;
            let begin = Pose2::new(place.x, place.y, heading_rad).compose(Pose2::new(-reach_m, 0.0, 0.0));
            if self.free_m(begin.position()) < APPROACH_ROOM_M {
                continue;
            }
            let last_room_m = self.driving_room_m(begin, reach_m);
            if last_room_m <= best.0 && best.0 < margin_m {
                continue;
            }
            let (first_room_m, there) = self.way_room_m(pose, begin.position(), margin_m);
            let (second_room_m, _) = self.way_room_m(there, place, margin_m);
            let room_m = last_room_m.min(first_room_m).min(second_room_m).min(margin_m);
            let cost_m = (begin.position() - pose.position()).norm() + reach_m + VIA_COST_M;
            if room_m > best.0 || (room_m == best.0 && cost_m < best.1) {
                best = (room_m, cost_m, Some(begin.position()));
            }
        }
        best.2
    }
}
