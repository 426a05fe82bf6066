//! What was seen around the robot a moment ago, and which motions keep away from it.
//!
//! The sensors leave the body's corners uncovered, and a turn on the spot swings those corners out: a 0.61 x
//! 0.51 m body needs a circle of 0.40 m. So the controller remembers, in the frame of odometry, where
//! readings ended, and tries each motion for a moment ahead against them, as the dynamic window approach does
//! (Fox, Burgard and Thrun 1997), before the wheels are told.

use crate::controllers::Wheels;
use crate::params::Params;
use geometry::{Point2, Pose2, Segment, Vector2, angle};
use messages::{KeptSighting, SEEN_WITHIN_M, Sightings, TOF_SLOPE, Time, TofRanges};
use serde::{Deserialize, Serialize};

/// Known walls are looked at in points so far apart, and within this distance.
const WALL_POINT_M: f64 = 0.04;
const WALLS_WITHIN_M: f64 = 1.1;
/// Furniture stands along walls and may be this long, although only its ends are seen: a mail cart's shelf
/// lies below the sensors (COF-122). What is seen this near, and not at a known wall, is taken for such.
const FURNITURE_M: f64 = 0.90;
const FURNITURE_WITHIN_M: f64 = 0.45;
const FURNITURE_POINTS: u32 = 9;
const NONE_HERE_M: f64 = 0.03;
/// A robot that can do nothing for the first time doubts what it only assumes, for the second.
const STUCK_S: f64 = 3.0;
const DOUBT_S: f64 = 4.0;
const OFF_WALL_M: f64 = 0.12;
const LONG_WALL_M: f64 = 1.0;
/// How long a motion is tried, and in how many steps.
const TRIED_S: f64 = 0.9;
const TRIES: usize = 6;
/// What is too near already may come nearer by this, for noise.
const NOISE_M: f64 = 0.001;
/// A robot that moves less than this between two looks, in metres and radians, stands.
const STILL: f64 = 5e-4;
/// The robot does not move this far between two looks.
const JUMP_M: f64 = 0.5;
/// Slow enough for the narrowest places.
const SLOW_MPS: f64 = 0.10;

/// The points seen, in the frame of odometry.
#[derive(Debug, Clone, Default)]
pub(crate) struct Surround {
    points: Sightings,
    here: Option<Pose2>,
    /// The last place that was known.
    last_here: Option<Pose2>,
    frame: Option<Time>,
    /// The known walls nearby, as points too.
    walls: Vec<Point2<f64>>,
    /// The direction of the nearest long wall.
    axis: Option<Vector2<f64>>,
    /// How far what was seen may reach beyond its seen end.
    assumed: Sightings,
    /// When this was last judged, and where the robot was.
    judged: Option<(Time, Option<Pose2>)>,
    stuck_since: Option<Time>,
    doubted_since: Option<Time>,
}

/// What was seen around the robot when a predecessor last said so: places in the frame of odometry in
/// millimetres, how sure, and when.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    points: Vec<KeptSighting>,
    assumed: Vec<KeptSighting>,
}

impl Surround {
    /// What a successor needs: it must not turn into what lies in the gaps between the sensors.
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot { points: self.points.kept(), assumed: self.assumed.kept() }
    }

    /// Takes over what a predecessor saw.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot) {
        self.points = Sightings::restored(&snapshot.points);
        self.assumed = Sightings::restored(&snapshot.assumed);
    }

    /// Takes in the newest readings, with the robot at `here` in the frame of odometry; without a place
    /// nothing is known.
    pub(crate) fn observe(
        &mut self,
        now: Time,
        here: Option<Pose2>,
        ranges: Option<(Time, &TofRanges)>,
        params: &Params,
    ) {
        self.here = here;
        let Some(here) = here else { return };
        // In another frame, or after an unseen journey, the places mean nothing.
        if self.last_here.replace(here).is_some_and(|last| last.distance_m(here) > JUMP_M) {
            self.points.clear();
            self.assumed.clear();
        }
        self.points.forget(now, here, &params.hull(), 0.0);
        self.doubted_since = self.doubted_since.filter(|since| now.seconds_since(*since) < DOUBT_S);
        self.assumed.forget(now, here, &params.hull(), NONE_HERE_M);
        let Some((stamp, ranges)) = ranges.filter(|(stamp, _)| self.frame != Some(*stamp)) else { return };
        self.frame = Some(stamp);
        let looks = ranges.looks(here);
        for (eye, range_m) in looks.clone() {
            self.points.see_through(eye, range_m, TOF_SLOPE);
            // The side sensors look over a shelf; those in front saw it from farther away.
            if (eye.heading_rad - here.heading_rad).abs() < 0.1 {
                self.assumed.see_through(eye, range_m, TOF_SLOPE);
            }
        }
        for (eye, range_m) in looks.filter(|(_, range_m)| *range_m < SEEN_WITHIN_M) {
            self.points.add_reading(now, eye, range_m);
            self.assume(now, here, eye.transform(Point2::new(range_m, 0.0)), range_m);
        }
    }

    /// Takes in the walls that the world has around the robot, which stands at `pose` in the map.
    pub(crate) fn show_walls(&mut self, pose: Option<Pose2>, walls: &[Segment]) {
        self.walls.clear();
        self.axis = None;
        let (Some(pose), Some(here)) = (pose, self.here) else { return };
        for wall in walls.iter().filter(|wall| wall.distance_m(pose.position()) < WALLS_WITHIN_M) {
            let near =
                wall.points(WALL_POINT_M).filter(|place| (place - pose.position()).norm() < WALLS_WITHIN_M);
            self.walls.extend(near.map(|place| here.transform(pose.inverse_transform(place))));
        }
        let distance_m = |wall: &&Segment| wall.distance_m(pose.position());
        let long = walls.iter().filter(|wall| wall.length_m() >= LONG_WALL_M);
        let nearest = long.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        let turn_rad = here.heading_rad - pose.heading_rad;
        self.axis =
            nearest.and_then(Segment::direction).map(|along| nalgebra::Rotation2::new(turn_rad) * along);
    }

    /// Notices that the robot wants to move and may not, and doubts the assumptions then.
    ///
    /// What was seen does not grow old while the robot stands although it may drive (a guard holds it), or
    /// because it is `blind`, without inputs: it finds everything where it was.
    pub(crate) fn judge(&mut self, now: Time, wanted: Wheels, allowed: Wheels, blind: bool) {
        let last = self.judged.replace((now, self.here));
        let still = |(_, there): (Time, Option<Pose2>)| match (there, self.here) {
            (Some(there), Some(here)) => {
                there.distance_m(here) < STILL
                    && angle::difference(there.heading_rad, here.heading_rad).abs() < STILL
            }
            _ => true,
        };
        let is_held = blind || self.here.is_none() || allowed != [0.0; 2];
        if let Some(last) = last.filter(|last| still(*last) && is_held) {
            let held = now.since(last.0);
            self.points.hold(held);
            self.assumed.hold(held);
        }
        if wanted == [0.0; 2] || allowed != [0.0; 2] {
            self.stuck_since = None;
            return;
        }
        let since = *self.stuck_since.get_or_insert(now);
        if now.seconds_since(since) >= STUCK_S {
            self.assumed.clear();
            (self.stuck_since, self.doubted_since) = (None, Some(now));
        }
    }

    /// From the hull's front edge to the nearest of what was seen straight ahead; infinite without any.
    pub(crate) fn front_m(&self, params: &Params) -> f64 {
        let Some(here) = self.here.filter(|_| params.keep_away_m > 0.0) else { return f64::INFINITY };
        let local = self.points.iter().map(|point| here.inverse_transform(point.place));
        let ahead = local.filter(|place| place.x > params.hull_front_m && place.y.abs() < params.hull_side_m);
        ahead.map(|place| place.x - params.hull_front_m).fold(f64::INFINITY, f64::min)
    }

    /// What was seen may go on along the wall, in the direction in which the robot drives.
    fn assume(&mut self, now: Time, here: Pose2, place: Point2<f64>, range_m: f64) {
        let off_wall = self.walls.iter().all(|wall| (wall - place).norm() > OFF_WALL_M);
        let Some(axis) =
            self.axis.filter(|_| off_wall && range_m < FURNITURE_WITHIN_M && self.doubted_since.is_none())
        else {
            return;
        };
        let along = axis.dot(&Vector2::new(here.heading_rad.cos(), here.heading_rad.sin()));
        if along.abs() > 0.5 {
            for step in 1..=FURNITURE_POINTS {
                let way_m = FURNITURE_M * f64::from(step) / f64::from(FURNITURE_POINTS);
                self.assumed.add(now, place + axis * (way_m * along.signum()));
            }
        }
    }

    /// The motion nearest to the wanted one that keeps away from everything seen; standing when there is
    /// none. `may_advance` lets a turn on the spot that cannot be turned here be put off: the robot then
    /// drives on straight.
    pub(crate) fn allowed(&self, wanted: Wheels, may_advance: bool, params: &Params) -> Wheels {
        if params.keep_away_m <= 0.0 {
            return wanted;
        }
        // Without odometry nobody knows what is beside the robot.
        let Some(here) = self.here else { return [0.0; 2] };
        let forward_mps = 0.5 * (wanted[0] + wanted[1]);
        let fastest_mps = wanted[0].abs().max(wanted[1].abs());
        if fastest_mps <= 0.0 || self.is_clear(here, wanted, 2.0 * params.keep_away_m, params) {
            return wanted;
        }
        let slow = limited(wanted);
        if self.is_clear(here, slow, params.keep_away_m, params) {
            return slow;
        }
        let is_clear = |wheels: &Wheels| self.is_clear(here, *wheels, params.keep_away_m, params);
        let clear = if forward_mps.abs() > 0.25 * fastest_mps {
            curves(slow).into_iter().find(is_clear)
        } else {
            turns(slow, may_advance).into_iter().find(is_clear)
        };
        clear.unwrap_or([0.0; 2])
    }

    /// Whether, during the next moment, nothing seen comes nearer to the body than `margin_m`, or than it is
    /// already.
    fn is_clear(&self, here: Pose2, [left, right]: Wheels, margin_m: f64, params: &Params) -> bool {
        let step_s = TRIED_S / TRIES as f64;
        let (step_m, turn_rad) = (0.5 * (left + right) * step_s, (right - left) / params.track_m * step_s);
        let hull = params.hull();
        let points = self.points.iter().chain(self.assumed.iter());
        let mut places = points.map(|point| point.place).chain(self.walls.iter().copied());
        let mut pose = here;
        let way = [(); TRIES].map(|()| {
            pose = pose.after_arc(step_m, turn_rad);
            pose.frame()
        });
        let here = here.frame();
        places.all(|place| {
            let now_m = hull.distance_to_m(here.inverse_transform(place));
            let noise_m = if now_m > 0.5 * params.keep_away_m { NOISE_M } else { 0.0 };
            let least_m = margin_m.min(now_m - noise_m);
            way.iter().all(|frame| hull.distance_to_m(frame.inverse_transform(place)) >= least_m)
        })
    }
}

/// A fan of slow motions in the direction of the wanted one: first what gets on best, and then what turns
/// most alike.
fn curves(wanted: Wheels) -> Vec<Wheels> {
    let (mean_mps, rim_mps) = (0.5 * (wanted[0] + wanted[1]), 0.5 * (wanted[1] - wanted[0]));
    let fan = [1.0, 0.6, 0.3, 0.0].into_iter().flat_map(|share| {
        let mean_mps = share * SLOW_MPS.copysign(mean_mps);
        (-4..=4).map(move |turn| {
            let rim_mps = 0.25 * f64::from(turn) * SLOW_MPS;
            limited([mean_mps - rim_mps, mean_mps + rim_mps])
        })
    });
    let cost = |[left, right]: &Wheels| {
        3.0 * (0.5 * (left + right) - mean_mps).abs() + (0.5 * (right - left) - rim_mps).abs()
    };
    let mut fan: Vec<Wheels> = fan.filter(|[left, right]| left.abs() + right.abs() > 0.0).collect();
    fan.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    fan
}

/// Instead of a turn on the spot: curves with the same turn, forwards; straight on if that may be; the same
/// curves backwards.
fn turns(wanted: Wheels, may_advance: bool) -> Vec<Wheels> {
    let rim_mps = 0.5 * (wanted[1] - wanted[0]);
    let curve = |mean_mps: f64| limited([mean_mps - rim_mps, mean_mps + rim_mps]);
    let mut tries = vec![curve(0.5 * rim_mps.abs()), curve(rim_mps.abs())];
    if may_advance {
        tries.push([SLOW_MPS; 2]);
    }
    tries.extend([curve(-0.5 * rim_mps.abs()), curve(-rim_mps.abs())]);
    tries
}

fn limited(wheels: Wheels) -> Wheels {
    let fastest_mps = wheels[0].abs().max(wheels[1].abs());
    if fastest_mps > SLOW_MPS { wheels.map(|speed| speed * SLOW_MPS / fastest_mps) } else { wheels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::TOF_COUNT;
    use std::f64::consts::FRAC_PI_2;

    fn coffee() -> Params {
        let (hull_front_m, hull_rear_m, hull_side_m) = (0.305, 0.305, 0.255);
        Params {
            track_m: 0.4,
            hull_front_m,
            hull_rear_m,
            hull_side_m,
            keep_away_m: 0.08,
            ..Params::default()
        }
    }

    /// What is allowed at the origin of odometry, which is the map's too, between walls at these places
    /// across.
    #[track_caller]
    fn check(walls_m: &[f64], seen: &[(usize, f32)], wanted: Wheels, holds: impl Fn(Wheels) -> bool) {
        let mut surround = Surround::default();
        let line = |y_m: &f64| Segment::new(Point2::new(-3.0, *y_m), Point2::new(3.0, *y_m));
        let walls: Vec<_> = walls_m.iter().map(line).collect();
        let mut ranges = TofRanges { range_m: [2.0; TOF_COUNT], ..TofRanges::default() };
        seen.iter().for_each(|(sensor, range_m)| ranges.range_m[*sensor] = *range_m);
        for frame in 0..3 {
            let now = Time::from_secs_f64(0.05 * f64::from(frame));
            surround.observe(now, Some(Pose2::IDENTITY), Some((now, &ranges)), &coffee());
            surround.show_walls(Some(Pose2::IDENTITY), &walls);
        }
        let allowed = surround.allowed(wanted, true, &coffee());
        assert!(holds(allowed), "{wanted:?}: {allowed:?}");
    }

    const TURN: Wheels = [-0.1, 0.1];
    const DRIVE: Wheels = [0.3, 0.3];

    #[test]
    fn motions_keep_away_from_walls_and_from_what_was_seen() {
        check(&[], &[], TURN, |wheels| wheels == TURN);
        check(&[], &[], DRIVE, |wheels| wheels == DRIVE);
        // The corners need 0.40 m to turn.
        check(&[0.6, -0.6], &[], TURN, |wheels| wheels == TURN);
        check(&[0.37, -0.37], &[], TURN, |wheels| wheels[1] - wheels[0] < 0.05);
        // A hallway that is just wide enough is driven through, slowly.
        check(&[0.37, -0.37], &[], DRIVE, |[left, right]| left == right && left > 0.05 && left < 0.3);
        // Something straight ahead stops the robot, or is steered around.
        check(&[], &[(3, 0.1), (4, 0.1)], DRIVE, |[left, right]| 0.5 * (left + right) < 0.11);
        // The end of a mail cart on the right: the rest of it is there although it is not seen.
        check(&[1.0, -0.7], &[(1, 0.12)], [0.2, 0.02], |[left, right]| left - right < 0.1);
    }

    #[test]
    fn a_robot_that_is_held_forgets_nothing() {
        let held_for = |seconds: u32, wanted: Wheels, allowed: Wheels, blind: bool| {
            let mut surround = Surround::default();
            let mut ranges = TofRanges { range_m: [2.0; TOF_COUNT], ..TofRanges::default() };
            ranges.range_m[3] = 0.4;
            for tick in 0..=seconds * 20 {
                let now = Time::from_secs_f64(0.05 * f64::from(tick));
                let look = (tick < 3).then_some((now, &ranges));
                surround.observe(now, Some(Pose2::IDENTITY), look, &coffee());
                surround.judge(now, wanted, allowed, blind);
            }
            surround.points.len()
        };
        assert!(held_for(60, [0.0; 2], [0.0; 2], true) > 0, "it sees nothing");
        assert!(held_for(60, DRIVE, DRIVE, false) > 0, "something else holds the robot");
        assert_eq!(held_for(60, DRIVE, [0.0; 2], false), 0, "what holds it has left long ago");
        assert_eq!(held_for(60, [0.0; 2], [0.0; 2], false), 0, "it waits");
    }

    #[test]
    fn what_passes_through_frees_what_was_seen() {
        let mut surround = Surround::default();
        let mut look = |tenths: u32, range_m: f32| {
            let now = Time::from_secs_f64(0.1 * f64::from(tenths));
            let ranges = TofRanges { range_m: [range_m; TOF_COUNT], ..TofRanges::default() };
            surround.observe(now, Some(Pose2::new(0.0, 0.0, FRAC_PI_2)), Some((now, &ranges)), &coffee());
            surround.points.len()
        };
        assert!(look(0, 0.4) >= TOF_COUNT);
        assert!(look(1, 0.4) > 0);
        assert!(look(2, 2.0) > 0, "one look past it does not free it");
        let left = (3..=20).map(|tenths| look(tenths, 2.0)).last();
        assert_eq!(left, Some(0));
    }
}

#[cfg(test)]
mod kept {
    use super::*;

    #[test]
    fn a_successor_knows_what_its_predecessor_saw() {
        let (now, params) = (Time::from_secs_f64(1.0), Params::default());
        let mut ranges = TofRanges::default();
        ranges.range_m[3] = 0.5;
        let mut first = Surround::default();
        first.observe(now, Some(Pose2::IDENTITY), Some((now, &ranges)), &params);
        assert!(!first.points.is_empty());
        let text = serde_json::to_string(&first.snapshot()).unwrap();
        let mut successor = Surround::default();
        successor.restore(&serde_json::from_str(&text).unwrap());
        assert_eq!(successor.snapshot(), first.snapshot());
        // A millimetre is as fine as the sensors are.
        for (a, b) in first.points.iter().zip(successor.points.iter()) {
            assert!((a.place - b.place).norm() < 1e-3 && a.weight == b.weight);
        }
    }
}
