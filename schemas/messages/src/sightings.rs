//! Where range readings ended a moment ago, as points of the odometry frame: what lies in the gaps between
//! the sensors was seen when the robot came there.

use crate::{TOF_COUNT, Time, TofRanges, range::Reading};
use geometry::{Hull, Point2, Pose2};

/// Readings up to here are remembered.
pub const SEEN_WITHIN_M: f64 = 0.8;
/// Half of a time-of-flight sensor's field of view as a slope (COF-021), and the share of it in which a
/// reading that passes is trusted to see everything.
const HALF_CONE: f64 = 0.13;
const SURE_SHARE: f64 = 0.6;
/// The points at a reading's ends, which lie on the edge of that share, are within it.
const SLACK_M: f64 = 0.01;
/// A point this much nearer than a reading would have been seen.
const PASSED_M: f64 = 0.08;
/// Points nearer to each other than this are one.
const ONE_POINT_M: f64 = 0.03;
/// Sightings count up to here, in readings that pass: thin things are not always seen (COF-123).
const SIGHTING: u8 = 3;
const WEIGHT_MAX: u8 = 12;
/// What was not seen for this long, or lies this far away, is forgotten.
const KEPT_S: f64 = 20.0;
const KEPT_WITHIN_M: f64 = 1.5;
/// So many points are remembered at most; the oldest makes room for another.
pub const SIGHTINGS_MAX: usize = 800;

/// Something that was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Where, in the frame of odometry.
    pub place: Point2<f64>,
    /// When it was last seen.
    pub seen: Time,
    /// How many readings have to pass through it until it is gone.
    pub weight: u8,
    /// Whether it would have been forgotten, had it not been kept by [`Sightings::keep_old`].
    pub is_old: bool,
}

/// A sighting as it is kept for a successor: its place in millimetres, its weight, and when it was seen.
pub type KeptSighting = (i32, i32, u8, u64);

/// What was seen around the robot a moment ago.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sightings {
    points: Vec<Sighting>,
}

impl Sightings {
    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Sighting> + Clone {
        self.points.iter()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Forgets what is old, far away, or not farther from the robot's hull than `beyond_m`: where the robot
    /// stands, nothing else does.
    pub fn forget(&mut self, now: Time, here: Pose2, hull: &Hull, beyond_m: f64) {
        let frame = here.frame();
        self.points.retain(|point| {
            (point.place - here.position()).norm() <= KEPT_WITHIN_M
                && hull.distance_to_m(frame.inverse_transform(point.place)) > beyond_m
                && now.seconds_since(point.seen) <= KEPT_S
        });
    }

    /// Takes in that a reading of `range_m` along the x axis of `eye` passes through what lies before its
    /// end. `slope` is how wide the view is that is trusted to see everything: half of its width for each
    /// metre.
    pub fn see_through(&mut self, eye: Pose2, range_m: f64, slope: f64) {
        let passed_m = range_m.min(SEEN_WITHIN_M) - PASSED_M;
        let frame = eye.frame();
        self.points.retain_mut(|point| {
            let seen = frame.inverse_transform(point.place);
            if seen.x > 0.0 && seen.x < passed_m && seen.y.abs() <= slope * seen.x + SLACK_M {
                point.weight = point.weight.saturating_sub(1);
            }
            point.weight > 0
        });
    }

    /// Takes in a point.
    pub fn add(&mut self, now: Time, place: Point2<f64>) {
        let known = self.points.iter_mut().find(|point| (point.place - place).norm() < ONE_POINT_M);
        if let Some(point) = known {
            (point.seen, point.is_old) = (now, false);
            point.weight = (point.weight + SIGHTING).min(WEIGHT_MAX);
        } else if place.x.is_finite() && place.y.is_finite() {
            if self.points.len() >= SIGHTINGS_MAX {
                let oldest = (0..self.points.len()).min_by_key(|&index| self.points[index].seen);
                oldest.map(|index| self.points.swap_remove(index));
            }
            self.points.push(Sighting { place, seen: now, weight: SIGHTING, is_old: false });
        }
    }

    /// Takes in a reading of a time-of-flight sensor at `eye` that ends nearby: its middle and two points
    /// beside it stand for its cone.
    pub fn add_reading(&mut self, now: Time, eye: Pose2, range_m: f64) {
        for share in [-SURE_SHARE, 0.0, SURE_SHARE] {
            self.add(now, eye.transform(Point2::new(range_m, share * HALF_CONE * range_m)));
        }
    }

    /// Lets everything be as old as it was this long ago.
    pub fn hold(&mut self, time: std::time::Duration) {
        for point in &mut self.points {
            point.seen = point.seen.after(time);
        }
    }

    /// Keeps what lies at such places for as long again, once, when it would be forgotten for its age, and
    /// marks it as old.
    pub fn keep_old(&mut self, now: Time, is_kept: impl Fn(Point2<f64>) -> bool) {
        for point in self.points.iter_mut().filter(|point| now.seconds_since(point.seen) > KEPT_S) {
            if !point.is_old && is_kept(point.place) {
                (point.seen, point.is_old) = (now, true);
            }
        }
    }

    /// What a successor needs.
    pub fn kept(&self) -> Vec<KeptSighting> {
        let mm = |metres: f64| (metres * 1e3).round() as i32;
        let kept =
            |point: &Sighting| (mm(point.place.x), mm(point.place.y), point.weight, point.seen.as_nanos());
        self.points.iter().map(kept).collect()
    }

    /// What a predecessor kept.
    pub fn restored(kept: &[KeptSighting]) -> Self {
        let point = |&(x_mm, y_mm, weight, seen): &KeptSighting| Sighting {
            place: Point2::new(f64::from(x_mm) / 1e3, f64::from(y_mm) / 1e3),
            weight,
            seen: Time::from_nanos(seen),
            is_old: false,
        };
        Self { points: kept.iter().take(SIGHTINGS_MAX).map(point).collect() }
    }
}

/// The trusted view of a time-of-flight sensor, as [`Sightings::see_through`] wants it.
pub const TOF_SLOPE: f64 = SURE_SHARE * HALF_CONE;

impl TofRanges {
    /// What each sensor of a robot at `here` looks at: its eye, and how far it sees; infinite where it sees
    /// nothing. Sensors without news are left out.
    pub fn looks(&self, here: Pose2) -> impl Iterator<Item = (Pose2, f64)> + Clone + '_ {
        (0..TOF_COUNT).filter_map(move |sensor| {
            let range_m = match self.reading(sensor) {
                Reading::Distance(range_m) => f64::from(range_m),
                Reading::NoTarget => f64::INFINITY,
                Reading::Ignore | Reading::Fault => return None,
            };
            Some((here.compose(Self::MOUNTS[sensor]), range_m))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HULL: Hull = Hull { front_m: 0.3, rear_m: 0.3, side_m: 0.25 };

    fn at(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn seen(range_m: f64) -> Sightings {
        let mut sightings = Sightings::default();
        sightings.add_reading(at(0), Pose2::new(0.3, 0.0, 0.0), range_m);
        sightings
    }

    #[track_caller]
    fn check_left(after: impl FnOnce(&mut Sightings), expected: usize) {
        let mut sightings = seen(0.5);
        after(&mut sightings);
        assert_eq!(sightings.len(), expected, "{sightings:?}");
    }

    #[test]
    fn what_was_seen_stays_until_it_is_old_far_away_or_seen_through() {
        let ahead = Pose2::new(0.3, 0.0, 0.0);
        check_left(|_| (), 3);
        check_left(|all| all.forget(at(20_000), Pose2::IDENTITY, &HULL, 0.0), 3);
        check_left(|all| all.forget(at(20_001), Pose2::IDENTITY, &HULL, 0.0), 0);
        check_left(|all| all.forget(at(1), Pose2::new(-1.0, 0.0, 0.0), &HULL, 0.0), 0);
        check_left(|all| all.forget(at(1), Pose2::new(0.6, 0.0, 0.0), &HULL, 0.0), 0);
        check_left(|all| all.forget(at(1), Pose2::IDENTITY, &HULL, 0.495), 3);
        check_left(|all| all.forget(at(1), Pose2::IDENTITY, &HULL, 0.505), 0);
        check_left(|all| (0..2).for_each(|_| all.see_through(ahead, 0.8, TOF_SLOPE)), 3);
        check_left(|all| (0..3).for_each(|_| all.see_through(ahead, 0.8, TOF_SLOPE)), 0);
        check_left(|all| (0..3).for_each(|_| all.see_through(ahead, f64::INFINITY, TOF_SLOPE)), 0);
        check_left(|all| (0..9).for_each(|_| all.see_through(ahead, 0.57, TOF_SLOPE)), 3);
        check_left(|all| (0..9).for_each(|_| all.see_through(ahead, 0.8, 0.0)), 2);
        check_left(|all| all.add(at(1), Point2::new(0.8, 0.01)), 3);
        check_left(|all| all.add(at(1), Point2::new(f64::NAN, 0.0)), 3);
    }

    #[test]
    fn the_oldest_makes_room() {
        let mut sightings = Sightings::default();
        for index in 0..=SIGHTINGS_MAX {
            sightings.add(at(index as u64), Point2::new(index as f64, 0.0));
        }
        assert_eq!(sightings.len(), SIGHTINGS_MAX);
        assert!(sightings.iter().all(|point| point.place.x > 0.5), "the first is gone, and no other");
    }

    #[test]
    fn a_successor_sees_what_was_kept() {
        let restored = Sightings::restored(&seen(0.5).kept());
        assert_eq!(restored.kept(), seen(0.5).kept());
        assert_eq!(Sightings::restored(&vec![(1, 2, 3, 4); 1000]).len(), SIGHTINGS_MAX);
    }

    proptest! {
        #[test]
        fn anything_is_survived(places in prop::collection::vec((any::<f64>(), any::<f64>()), 0..50), x in any::<f64>(), range in any::<f64>()) {
            let mut sightings = Sightings::default();
            for (x, y) in places {
                sightings.add(at(0), Point2::new(x, y));
            }
            let eye = Pose2 { x_m: x, y_m: 0.0, heading_rad: 0.0 };
            sightings.see_through(eye, range, TOF_SLOPE);
            sightings.forget(at(1), eye, &HULL, 0.0);
            prop_assert!(sightings.iter().all(|point| point.place.x.is_finite()));
        }
    }
}
