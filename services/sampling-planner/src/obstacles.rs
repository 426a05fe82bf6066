//! Obstacles seen by the time-of-flight sensors: points that readings confirm, that readings which pass take
//! away again, and that fade.

use crate::floors::Floor;
use geometry::{Point2, Pose2, Segment};
use messages::{Reading, TOF_COUNT, Time, TofRanges};
use std::collections::BTreeMap;
use std::time::Duration;

/// Sightings nearer to each other than this are one.
pub(crate) const GRAIN_M: f64 = 0.05;
/// What a sighting adds to an obstacle's weight: thin things are seen only now and then (COF-123).
const SIGHTING: u8 = 24;
/// What weighs most, so that an obstacle that leaves is forgotten soon.
const WEIGHT_MAX: u8 = 5 * SIGHTING;
/// What a reading that passes takes from what lies within this share of its cone's width, where it would have
/// been seen ..
const SURE: (f64, u8) = (0.6, 8);
/// .. and from what lies at the cone's edge.
const UNSURE: (f64, u8) = (1.3, 2);
/// The robot's body (COF-003), less the error of its pose: where it stands there is no obstacle.
const BODY_M: [f64; 2] = [0.305 - 0.05, 0.255 - 0.05];
/// As many obstacles are remembered.
const MARKS_MAX: usize = 4000;

/// How observed obstacles are judged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    /// Farther readings count as no target (COF-030).
    pub(crate) range_max_m: f64,
    /// Half of the sensors' field of view.
    pub(crate) half_cone_rad: f64,
    /// Readings that end this near to a wall are the wall.
    pub(crate) wall_tolerance_m: f64,
    /// Sightings until an obstacle counts.
    pub(crate) confirm: u8,
    /// What was not seen again for this long is gone.
    pub(crate) memory: Duration,
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    seen: Time,
    weight: u8,
    counts: bool,
}

/// What one sensor says in one frame.
#[derive(Debug, Clone, Copy)]
struct Look {
    eye: Pose2,
    /// Distance of what it sees.
    hit_m: Option<f64>,
    /// As far as it sees nothing.
    free_m: f64,
}

/// The observed obstacles of the floor on which the robot is, by column and row of [`GRAIN_M`].
#[derive(Debug, Clone, Default)]
pub(crate) struct Obstacles {
    marks: BTreeMap<(i32, i32), Mark>,
    places: Vec<Point2<f64>>,
}

impl Obstacles {
    /// Where the obstacles are that count.
    pub(crate) fn places(&self) -> &[Point2<f64>] {
        &self.places
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.marks.clear();
        self.places.clear();
    }

    /// Forgets what was not seen for long.
    pub(crate) fn fade(&mut self, rules: &Rules, now: Time) {
        self.marks.retain(|_, mark| now.since(mark.seen) <= rules.memory);
        self.list();
    }

    /// One frame of the sensors, taken at a pose.
    pub(crate) fn observe(
        &mut self,
        floor: &Floor,
        rules: &Rules,
        now: Time,
        pose: Pose2,
        ranges: &TofRanges,
    ) {
        let looks: Vec<Look> =
            (0..TOF_COUNT).filter_map(|sensor| look(rules, pose, sensor, ranges)).collect();
        self.lighten(|place| {
            let inside = pose.inverse_transform(place);
            if inside.x.abs() < BODY_M[0] && inside.y.abs() < BODY_M[1] { WEIGHT_MAX } else { 0 }
        });
        for look in &looks {
            let passes = |place, share| look.passes(rules, place, share);
            self.lighten(|place| match (passes(place, SURE.0), passes(place, UNSURE.0)) {
                (true, _) => SURE.1,
                (false, true) => UNSURE.1,
                (false, false) => 0,
            });
        }
        for look in &looks {
            let across = look.unexplained(floor, rules);
            // It may stand anywhere across the cone, but for where a neighbour sees through; the rest is seen
            // from nearer by.
            let is_free = |place| looks.iter().any(|other| other.passes(rules, place, SURE.0));
            let all_free = across.iter().all(|&place| is_free(place));
            let mut last = None;
            for place in across.into_iter().filter(|&place| all_free || !is_free(place)) {
                let key = key(place);
                if last != Some(key) {
                    last = Some(key);
                    self.hit(rules, now, key);
                }
            }
        }
        self.list();
    }

    fn hit(&mut self, rules: &Rules, now: Time, key: (i32, i32)) {
        if self.marks.len() >= MARKS_MAX && !self.marks.contains_key(&key) {
            return;
        }
        let mark = self.marks.entry(key).or_insert(Mark { seen: now, weight: 0, counts: false });
        mark.seen = now;
        mark.weight = (mark.weight + SIGHTING).min(WEIGHT_MAX);
        mark.counts |= mark.weight >= SIGHTING * rules.confirm;
    }

    fn lighten(&mut self, by: impl Fn(Point2<f64>) -> u8) {
        self.marks.retain(|&key, mark| {
            mark.weight = mark.weight.saturating_sub(by(centre(key)));
            mark.weight > 0
        });
    }

    fn list(&mut self) {
        self.places.clear();
        let counting = self.marks.iter().filter(|(_, mark)| mark.counts);
        self.places.extend(counting.map(|(&key, _)| centre(key)));
    }
}

fn look(rules: &Rules, pose: Pose2, sensor: usize, ranges: &TofRanges) -> Option<Look> {
    let (hit_m, free_m) = match ranges.reading(sensor) {
        Reading::Distance(range_m) if f64::from(range_m) < rules.range_max_m => {
            (Some(f64::from(range_m)), f64::from(range_m))
        }
        Reading::Distance(_) | Reading::NoTarget => (None, rules.range_max_m),
        Reading::Ignore | Reading::Fault => return None,
    };
    Some(Look { eye: pose.compose(TofRanges::MOUNTS[sensor]), hit_m, free_m })
}

impl Look {
    /// Whether a place lies in the inner `share` of the cone, clearly nearer than what is seen.
    fn passes(&self, rules: &Rules, place: Point2<f64>, share: f64) -> bool {
        let seen = self.eye.inverse_transform(place);
        let reach_m = self.free_m - 2.0 * GRAIN_M;
        seen.x > 0.0 && seen.x < reach_m && seen.y.abs() <= share * rules.half_cone_rad.tan() * seen.x
    }

    /// The places across the cone where the obstacle may stand that is seen. None when a known wall, or the
    /// closed leaf of a known door, stands at one of them or on the way to it: then the reading is that wall,
    /// or a door that may open. The range counts along the axis.
    fn unexplained(&self, floor: &Floor, rules: &Rules) -> Vec<Point2<f64>> {
        let Some(range_m) = self.hit_m else { return Vec::new() };
        let half_m = range_m * rules.half_cone_rad.tan();
        let steps = (4.0 * half_m / GRAIN_M).ceil().max(1.0) as u32;
        let across = (0..=steps).map(|step| {
            let aside_m = half_m * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
            self.eye.transform(Point2::new(range_m, aside_m))
        });
        let across: Vec<_> = across.collect();
        let open = across.iter().all(|&place| {
            let way = Segment::new(self.eye.position(), place);
            floor.space.covers(place)
                && floor.space.wall_m(place) >= rules.wall_tolerance_m
                && !floor.leaves.iter().any(|leaf| leaf.distance_m(place) < rules.wall_tolerance_m)
                && !floor.space.crosses_wall(&way)
        });
        if open { across } else { Vec::new() }
    }
}

fn key(place: Point2<f64>) -> (i32, i32) {
    ((place.x / GRAIN_M).floor() as i32, (place.y / GRAIN_M).floor() as i32)
}

fn centre((column, row): (i32, i32)) -> Point2<f64> {
    Point2::new((f64::from(column) + 0.5) * GRAIN_M, (f64::from(row) + 0.5) * GRAIN_M)
}
