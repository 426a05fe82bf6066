//! What is near the hull, for the service that moves it: what the sensors see, what they saw a moment ago
//! when the robot came there, walls beyond the end of what was seen of them, and the walls of the map while
//! the robot knows where it is.

use crate::{
    Params,
    laser::{Beam, Scan},
    memory::Motion,
};
use geometry::{Frame, Hull, Point2, Pose2, Segment, Vector2, World, WorldError, angle};
use messages::{KeptSighting, NearPoint, PoseEstimate, SEEN_WITHIN_M, Sightings, TOF_SLOPE, Time, TofRanges};
use std::f64::consts::FRAC_PI_2;

/// Points farther from the hull than this do not matter to the next motion.
const TOLD_WITHIN_M: f64 = 0.6;
/// The most points that are told: the nearest ones.
const TOLD_MAX: usize = 256;
const TOLD_APART_M: f32 = 0.02;
/// A robot that has not come farther than this for [`STANDS_AFTER_S`] stands.
const STANDS_WITHIN_M: f64 = 0.03;
const STANDS_WITHIN_RAD: f64 = 0.05;
const STANDS_AFTER_S: f64 = 1.0;
/// What lies so near to the hull can be touched by a turn before a sensor sees it. When it is old it counts
/// as so much farther to the front and to the side: a reading says to a few centimetres only where in its
/// cone a thing is, and the robot may pass what it may not turn into.
const KEPT_WITHIN_M: f64 = 0.15;
const OLD_FARTHER_M: f64 = 0.025;
/// In another frame, or after an unseen journey, places mean nothing.
const JUMP_M: f64 = 0.5;

/// A reading may have ended at the rim of the sensor's view, half of which has this slope, if it is so near;
/// and one that passes, so far aside, was not hindered there.
const RIM_SLOPES: [f64; 4] = [-0.22, -0.15, 0.15, 0.22];
const RIM_WITHIN_M: f64 = 0.6;
const RIM_SEEN_SLOPE: f64 = 0.19;

/// Ends of readings from which walls are made out: so many, so far apart. Of two that are nearer the mean is
/// taken, with so much weight for the newer one.
const ENDS_MAX: usize = 160;
const ENDS_APART_M: f64 = 0.015;
const ENDS_NEWS: f64 = 0.2;
/// A reading ends at a wall if so many ends nearby lie on one line with it, within so much of it, over such a
/// length.
const WALL_WITHIN_M: f64 = 0.35;
const WALL_ENDS: usize = 4;
const WALL_THICK_M: f64 = 0.015;
const WALL_LENGTH_M: f64 = 0.12;
const WALL_SHARE: f64 = 0.6;
/// A wall beside the robot goes on for so long beyond the end of a reading; one in front of it only beyond
/// the outermost sensors, which sit so near to the hull's sides. In points so far apart.
const WALL_GOES_ON_M: f64 = 0.45;
const CORNER_GOES_ON_M: f64 = 0.25;
const OUTERMOST_M: f64 = 0.10;
const WALL_STEP_M: f64 = 0.04;
/// A wall that is met askew reads too far by up to this, as the sensors' cones see more of what lies farther
/// away.
const ASSUMED_NEARER_M: f64 = 0.015;
/// What was assumed a moment ago still holds: of many readings, each with its error, the one that leaves the
/// least room.
const ASSUMED_S: f64 = 1.0;
/// What is assumed does not reach nearer to the hull than this: the robot stands there.
const ASSUMED_OFF_M: f64 = 0.02;
/// What is seen beside the robot, or in front by an outermost sensor, nearer than this, and is no wall may
/// reach as far as the corner of the hull next to the sensor, where no sensor looks, and there be nearer
/// still by this share, but not nearer than so much.
const BESIDE_M: f64 = 0.25;
const AHEAD_M: f64 = 0.35;
const CORNER_SHARE: f64 = 0.5;
const CORNER_LEAST_M: f64 = 0.03;
/// Walls of the map count while the pose is known so well (one standard deviation).
const SURE_M: f64 = 0.10;
const SURE_RAD: f64 = 0.10;
/// Half of a laser beam's width for each metre, as it is trusted.
const BEAM_SLOPE: f64 = 0.01;
/// A scan is taken in by no more beams than this, evenly spread.
const BEAMS_MAX: usize = 361;

/// Where the middle of a reading has ended.
#[derive(Debug, Clone, Copy)]
struct End {
    seen: Time,
    place: Point2<f64>,
    /// The side out of which it was seen: a wall that is met askew reads too far, so that those of two sides
    /// make no line.
    side: i8,
    /// From where it was seen.
    eye: Point2<f64>,
    /// The edge of the hull out of which it was seen: along it a wall goes on, so far back and ahead, where
    /// no other sensor looks.
    axis: Vector2<f64>,
    goes_on_m: [f64; 2],
}

/// What is near.
#[derive(Debug, Clone, Default)]
pub(crate) struct Near {
    sightings: Sightings,
    /// Where the middles of readings have ended.
    ends: Vec<End>,
    /// Where else a front sensor's reading may have ended, at the rim of its view: when that is narrower it
    /// will know.
    rims: Sightings,
    /// Walls beyond the ends of what was seen of them.
    assumed: Vec<(Time, Point2<f64>)>,
    place: Option<Pose2>,
    /// Where the robot has been, and since when.
    stay: Option<(Pose2, Time)>,
    /// The walls of each floor of the map, and those points of them that are near now.
    floors: Vec<(i32, Vec<Segment>)>,
    walls: Vec<Point2<f64>>,
    points: Vec<NearPoint>,
}

impl Near {
    /// With the walls of the world file that the parameters name, if they name one.
    pub(crate) fn new(params: &Params) -> Result<Self, WorldError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        let floors = world.floors.iter().map(|floor| (floor.number, world.wall_segments(floor.number)));
        Ok(Self { floors: floors.collect(), ..Self::default() })
    }

    pub(crate) fn kept(&self) -> Vec<KeptSighting> {
        self.sightings.kept()
    }

    pub(crate) fn restore(&mut self, kept: &[KeptSighting]) {
        self.sightings = Sightings::restored(kept);
    }

    /// Takes in a frame of the time-of-flight sensors.
    pub(crate) fn take_tof(&mut self, now: Time, ranges: &TofRanges, motion: Option<Motion>, hull: &Hull) {
        let Some(here) = self.arrive(now, motion, hull) else { return };
        let looks = ranges.looks(here);
        for (eye, range_m) in looks.clone() {
            self.sightings.see_through(eye, range_m, TOF_SLOPE);
            self.rims.see_through(eye, range_m, RIM_SEEN_SLOPE);
        }
        let near = looks.clone().filter(|(_, range_m)| *range_m < SEEN_WITHIN_M);
        let feet = near.clone().map(|(eye, range_m)| {
            let side = (angle::difference(eye.heading_rad, here.heading_rad) / FRAC_PI_2).round() as i8;
            let along_rad = if side == 0 { here.heading_rad + FRAC_PI_2 } else { here.heading_rad };
            let outer_m = hull.side_m - OUTERMOST_M;
            let goes_on_m = match here.inverse_transform(eye.position()).y {
                _ if side != 0 => [WALL_GOES_ON_M; 2],
                y_m if y_m > outer_m => [0.0, CORNER_GOES_ON_M],
                y_m if y_m < -outer_m => [CORNER_GOES_ON_M, 0.0],
                _ => [0.0; 2],
            };
            End {
                seen: now,
                place: eye.transform(Point2::new(range_m, 0.0)),
                side,
                eye: eye.position(),
                axis: Vector2::new(along_rad.cos(), along_rad.sin()),
                goes_on_m,
            }
        });
        let feet: Vec<End> = feet.collect();
        for (eye, range_m) in near {
            self.sightings.add_reading(now, eye, range_m);
            let is_in_front = (eye.heading_rad - here.heading_rad).abs() < 0.1;
            for slope in RIM_SLOPES.into_iter().filter(|_| is_in_front && range_m < RIM_WITHIN_M) {
                self.rims.add(now, eye.transform(Point2::new(range_m, slope * range_m)));
            }
        }
        self.assume(here, &feet, hull);
        let frame = here.frame();
        let eyes: Vec<(Frame, f64)> = looks.map(|(eye, range_m)| (eye.frame(), range_m)).collect();
        let seen_past = |place: &Point2<f64>| {
            eyes.iter().any(|(eye, range_m)| {
                let seen = eye.inverse_transform(*place);
                seen.x > 0.0 && seen.x < range_m - ENDS_APART_M && seen.y.abs() <= TOF_SLOPE * seen.x
            })
        };
        self.assumed.retain(|(seen, place)| {
            now.seconds_since(*seen) <= ASSUMED_S
                && hull.distance_to_m(frame.inverse_transform(*place)) > ASSUMED_OFF_M
                && !seen_past(place)
        });
    }

    /// Takes in a laser's scan, which shows walls as far as they go.
    pub(crate) fn take_scan(&mut self, now: Time, scan: &Scan<'_>, motion: Option<Motion>, hull: &Hull) {
        let Some(here) = self.arrive(now, motion, hull) else { return };
        let every = scan.beams().count().div_ceil(BEAMS_MAX).max(1);
        let mut ends = Vec::new();
        for (direction_rad, beam) in scan.beams().step_by(every) {
            let range_m = match beam {
                Beam::Hit(range_m) => range_m,
                Beam::Nothing => f64::INFINITY,
                Beam::TooNear | Beam::Unreadable => continue,
            };
            let eye = scan.end(direction_rad, 0.0);
            let eye = here.compose(Pose2::new(eye.x, eye.y, direction_rad));
            self.sightings.see_through(eye, range_m, BEAM_SLOPE);
            let end = scan.end(direction_rad, range_m.min(1e3));
            if hull.distance_to_m(end) < SEEN_WITHIN_M {
                ends.push(here.transform(end));
            }
        }
        ends.into_iter().for_each(|end| self.sightings.add(now, end));
    }

    /// Takes in where the robot is in the map, if that is known well enough.
    pub(crate) fn show_walls(&mut self, pose: Option<&PoseEstimate>, motion: Option<Motion>, hull: &Hull) {
        self.walls.clear();
        let (Some(message), Some(motion)) = (pose.filter(|pose| is_sure(pose)), motion) else { return };
        let Ok(pose) = message.pose() else { return };
        let within_m = hull.radius_m() + TOLD_WITHIN_M;
        let walls = self.floors.iter().find(|(number, _)| *number == message.floor);
        for wall in walls.iter().flat_map(|(_, walls)| walls) {
            if wall.distance_m(pose.position()) < within_m {
                let near = wall.points(WALL_STEP_M).map(|place| pose.inverse_transform(place));
                let near = near.filter(|place| hull.distance_to_m(*place) < TOLD_WITHIN_M);
                self.walls.extend(near.map(|place| motion.pose.transform(place)));
            }
        }
    }

    /// What is near, in the frame of a robot that has just moved on; what it was when there is no news of
    /// that.
    pub(crate) fn tell(&mut self, motion: Option<Motion>, hull: &Hull) -> (Option<Pose2>, &[NearPoint]) {
        self.points.clear();
        let Some(here) = motion.map(|motion| motion.pose) else { return (None, &self.points) };
        let frame = here.frame();
        let farther = |place: Point2<f64>| {
            Point2::new(place.x + OLD_FARTHER_M.copysign(place.x), place.y + OLD_FARTHER_M.copysign(place.y))
        };
        let seen = self.sightings.iter().chain(self.rims.iter()).map(|sighting| {
            let place = frame.inverse_transform(sighting.place);
            if sighting.is_old { farther(place) } else { place }
        });
        let others = self.assumed.iter().map(|(_, place)| *place).chain(self.walls.iter().copied());
        let local = seen.chain(others.map(|place| frame.inverse_transform(place)));
        let mut near: Vec<(f64, Point2<f64>)> = local
            .map(|place| (hull.distance_to_m(place), place))
            .filter(|(distance_m, _)| (1e-9..TOLD_WITHIN_M).contains(distance_m))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, place) in near {
            let point = NearPoint { x_m: place.x as f32, y_m: place.y as f32 };
            // The nearest first: what lies beside it tells no more.
            let is_news = |told: &NearPoint| {
                let (x_m, y_m) = (told.x_m - point.x_m, told.y_m - point.y_m);
                x_m * x_m + y_m * y_m >= TOLD_APART_M * TOLD_APART_M
            };
            if self.points.len() == TOLD_MAX {
                break;
            }
            if self.points.iter().all(is_news) {
                self.points.push(point);
            }
        }
        (Some(here), &self.points)
    }

    /// The robot is here now: forgets what is too old or too far away.
    fn arrive(&mut self, now: Time, motion: Option<Motion>, hull: &Hull) -> Option<Pose2> {
        let here = motion?.pose;
        if self.place.replace(here).is_some_and(|last| last.distance_m(here) > JUMP_M) {
            self.sightings.clear();
            self.rims.clear();
            self.ends.clear();
            self.assumed.clear();
        }
        self.keep_while_it_stands(now, here, hull);
        self.sightings.forget(now, here, hull, 0.0);
        self.rims.forget(now, here, hull, 0.0);
        let frame = here.frame();
        self.ends.retain(|end| hull.distance_to_m(frame.inverse_transform(end.place)) < SEEN_WITHIN_M);
        Some(here)
    }

    /// What was seen close to the hull is remembered for longer while the robot stands: a leg of a chair at a
    /// corner of the hull, where no sensor looks, is still there when it drives on. Not for ever: in a narrow
    /// door the edge of a cone makes out what is not there, and only time takes that away.
    fn keep_while_it_stands(&mut self, now: Time, here: Pose2, hull: &Hull) {
        let is_near = |there: Pose2| {
            there.distance_m(here) <= STANDS_WITHIN_M
                && angle::difference(there.heading_rad, here.heading_rad).abs() <= STANDS_WITHIN_RAD
        };
        let (there, since) = self.stay.filter(|stay| is_near(stay.0)).unwrap_or((here, now));
        self.stay = Some((there, since));
        if now.seconds_since(since) > STANDS_AFTER_S {
            let frame = here.frame();
            let is_kept = |place| hull.distance_to_m(frame.inverse_transform(place)) <= KEPT_WITHIN_M;
            self.sightings.keep_old(now, is_kept);
        }
    }

    /// Walls go on beyond the ends of what was seen of them: a corner of the hull comes there before a sensor
    /// does.
    fn assume(&mut self, here: Pose2, feet: &[End], hull: &Hull) {
        for foot in feet {
            let is_known =
                |end: &End| end.side == foot.side && (end.place - foot.place).norm() < ENDS_APART_M;
            let oldest = || (0..self.ends.len()).min_by_key(|&index| self.ends[index].seen);
            // When there is no room, the oldest makes some.
            let known = self.ends.iter().position(is_known);
            match known.or_else(|| if self.ends.len() < ENDS_MAX { None } else { oldest() }) {
                Some(index) => {
                    // A robot at rest sees the same place again and again: the mean counts.
                    let place = self.ends[index].place;
                    self.ends[index] = End { place: place + (foot.place - place) * ENDS_NEWS, ..*foot };
                }
                None => self.ends.push(*foot),
            }
        }
        for foot in feet {
            let near: Vec<Point2<f64>> = self.ends_near(foot).collect();
            let Some((middle, along)) = line_through(foot.place, &near) else {
                self.assume_at_corners(here, foot, hull);
                continue;
            };
            // Towards the robot.
            let across = Vector2::new(-along.y, along.x);
            let nearer = across * (ASSUMED_NEARER_M * across.dot(&(foot.eye - middle)).signum());
            let begin = middle + nearer + along * along.dot(&(foot.place - middle));
            let steps = |length_m: f64| (length_m / WALL_STEP_M) as i32;
            let [back_m, ahead_m] = foot.goes_on_m;
            // Along the hull's side: ahead is where the hull's x axis or, across its front, its y axis
            // points.
            let sign = along.dot(&foot.axis).signum();
            for step in (-steps(back_m)..=steps(ahead_m)).filter(|step| *step != 0) {
                self.assumed.push((foot.seen, begin + along * (sign * WALL_STEP_M * f64::from(step))));
            }
        }
    }
}

impl Near {
    /// Between the sensors at a side and those in front nobody looks: a thing that comes into view of one of
    /// them may already be at the corner between them. So that corner comes no nearer to where it may be,
    /// until the thing is known for a wall, or seen past.
    fn assume_at_corners(&mut self, here: Pose2, foot: &End, hull: &Hull) {
        let range_m = (foot.place - foot.eye).norm();
        let off_m = (CORNER_SHARE * range_m).max(CORNER_LEAST_M);
        let eye = here.inverse_transform(foot.eye);
        let corner = match foot.side {
            0 if range_m <= AHEAD_M && eye.y.abs() > hull.side_m - OUTERMOST_M => {
                Point2::new(hull.front_m + off_m, (hull.side_m + CORNER_LEAST_M).copysign(eye.y))
            }
            side if side != 0 && range_m <= BESIDE_M => {
                let x_m = if eye.x > 0.0 { hull.front_m } else { -hull.rear_m };
                Point2::new(x_m, f64::from(side) * (hull.side_m + off_m))
            }
            _ => return,
        };
        self.assumed.push((foot.seen, here.transform(corner)));
    }

    /// Where else readings out of the same side have ended near this one.
    fn ends_near(&self, foot: &End) -> impl Iterator<Item = Point2<f64>> + '_ {
        let (side, place) = (foot.side, foot.place);
        let is_near = move |end: &&End| end.side == side && (end.place - place).norm() <= WALL_WITHIN_M;
        self.ends.iter().filter(is_near).map(|end| end.place)
    }
}

/// Whether a pose is known so well that the walls of the map are where it says.
fn is_sure(pose: &PoseEstimate) -> bool {
    let variance_m2 = pose.covariance[0].max(pose.covariance[4]);
    (0.0..=SURE_M * SURE_M).contains(&variance_m2)
        && (0.0..=SURE_RAD * SURE_RAD).contains(&pose.covariance[8])
}

/// The middle and the direction of the line through a place on which most of the points lie, if enough of
/// them do.
fn line_through(place: Point2<f64>, points: &[Point2<f64>]) -> Option<(Point2<f64>, Vector2<f64>)> {
    let on = |middle: Point2<f64>, along: Vector2<f64>| {
        let across = Vector2::new(-along.y, along.x);
        points.iter().filter(move |point| across.dot(&(**point - middle)).abs() <= WALL_THICK_M)
    };
    let directions = points.iter().map(|point| point - place).filter(|way| way.norm() >= 0.5 * WALL_LENGTH_M);
    let along = directions.map(|way| way.normalize()).max_by_key(|along| on(place, *along).count())?;
    let share = on(place, along).count() as f64 / points.len() as f64;
    if share >= WALL_SHARE { principal_axis(on(place, along)) } else { None }
}

/// The middle of points and the direction in which they spread, if there are enough, over enough of a length.
fn principal_axis<'a>(
    points: impl Iterator<Item = &'a Point2<f64>> + Clone,
) -> Option<(Point2<f64>, Vector2<f64>)> {
    let count = points.clone().count();
    if count < WALL_ENDS {
        return None;
    }
    let sum = points.clone().fold(Vector2::zeros(), |sum, point| sum + point.coords);
    let middle = Point2::from(sum / count as f64);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for offset in points.clone().map(|point| point - middle) {
        xx += offset.x * offset.x;
        xy += offset.x * offset.y;
        yy += offset.y * offset.y;
    }
    let direction_rad = 0.5 * (2.0 * xy).atan2(xx - yy);
    let along = Vector2::new(direction_rad.cos(), direction_rad.sin());
    let spread = points.map(|point| along.dot(&(point - middle)));
    let (least_m, most_m) =
        spread.fold((0.0_f64, 0.0_f64), |(least, most), at| (least.min(at), most.max(at)));
    (most_m - least_m >= WALL_LENGTH_M).then_some((middle, along))
}
