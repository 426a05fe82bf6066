//! What was seen around the robot a moment ago, and which motions keep away from it.
//!
//! The sensors leave the body's corners uncovered, and a turn on the spot swings those corners out: a 0.61 x 0.51 m body needs a circle
//! of 0.40 m. So the controller remembers, in the frame of odometry, where readings ended, and tries each motion for a moment ahead
//! against them, as the dynamic window approach does (Fox, Burgard and Thrun 1997), before the wheels are told.

use crate::controllers::Wheels;
use crate::params::Params;
use geometry::{Point2, Pose2};
use messages::{Reading, TOF_COUNT, Time, TofRanges};

/// Readings up to here are remembered.
const SEEN_WITHIN_M: f64 = 0.8;
/// Half of a sensor's field of view (COF-021), and the share of it in which a reading that passes is trusted to see everything.
const HALF_CONE: f64 = 0.13;
const SURE_SHARE: f64 = 0.6;
/// A point this much nearer than a reading would have been seen.
const PASSED_M: f64 = 0.08;
/// Points nearer to each other than this are one.
const ONE_POINT_M: f64 = 0.03;
/// Sightings count up to here, in readings that pass: thin things are not always seen (COF-123).
const SIGHTING: u8 = 3;
const WEIGHT_MAX: u8 = 12;
/// What was not seen for so long, or lies so far away, is forgotten.
const KEPT_S: f64 = 20.0;
const KEPT_WITHIN_M: f64 = 1.5;
/// So many points are remembered at most.
const POINTS_MAX: usize = 800;
/// A motion is tried for so long, in so many steps.
const TRIED_S: f64 = 0.9;
const TRIES: u32 = 6;
/// What is too near already may come nearer by this, for noise.
const NOISE_M: f64 = 0.001;
/// Slow enough for the narrowest places.
const SLOW_MPS: f64 = 0.10;

#[derive(Debug, Clone, Copy)]
struct Point {
    place: Point2<f64>,
    seen: Time,
    weight: u8,
}

/// The points seen, in the frame of odometry.
#[derive(Debug, Clone, Default)]
pub(crate) struct Surround {
    points: Vec<Point>,
    here: Option<Pose2>,
    frame: Option<Time>,
}

impl Surround {
    /// Takes in the newest readings, with the robot at `here` in the frame of odometry; without a place nothing is known.
    pub(crate) fn observe(
        &mut self,
        now: Time,
        here: Option<Pose2>,
        ranges: Option<(Time, &TofRanges)>,
        params: &Params,
    ) {
        self.here = here;
        let Some(here) = here else {
            self.points.clear();
            return;
        };
        self.points.retain(|point| {
            let near = (point.place - here.position()).norm() <= KEPT_WITHIN_M;
            let below = distance_m(here, point.place, params) <= 0.0;
            near && !below && now.seconds_since(point.seen) <= KEPT_S
        });
        let Some((stamp, ranges)) = ranges.filter(|(stamp, _)| self.frame != Some(*stamp)) else { return };
        self.frame = Some(stamp);
        let looks = (0..TOF_COUNT).filter_map(|sensor| {
            let range_m = match ranges.reading(sensor) {
                Reading::Distance(range_m) => f64::from(range_m),
                Reading::NoTarget => f64::INFINITY,
                Reading::Ignore | Reading::Fault => return None,
            };
            Some((here.compose(TofRanges::MOUNTS[sensor]), range_m))
        });
        for (eye, range_m) in looks.clone() {
            let passed_m = range_m.min(SEEN_WITHIN_M) - PASSED_M;
            self.points.retain_mut(|point| {
                let seen = eye.inverse_transform(point.place);
                if seen.x > 0.0 && seen.x < passed_m && seen.y.abs() <= SURE_SHARE * HALF_CONE * seen.x {
                    point.weight = point.weight.saturating_sub(1);
                }
                point.weight > 0
            });
        }
        for (eye, range_m) in looks.filter(|(_, range_m)| *range_m < SEEN_WITHIN_M) {
            for share in [-SURE_SHARE, 0.0, SURE_SHARE] {
                self.add(now, eye.transform(Point2::new(range_m, share * HALF_CONE * range_m)));
            }
        }
    }

    fn add(&mut self, now: Time, place: Point2<f64>) {
        let known = self.points.iter_mut().find(|point| (point.place - place).norm() < ONE_POINT_M);
        if let Some(point) = known {
            point.seen = now;
            point.weight = (point.weight + SIGHTING).min(WEIGHT_MAX);
        } else if self.points.len() < POINTS_MAX {
            self.points.push(Point { place, seen: now, weight: SIGHTING });
        }
    }

    /// The motion nearest to the wanted one that keeps away from everything seen; standing when there is none.
    pub(crate) fn allowed(&self, wanted: Wheels, params: &Params) -> Wheels {
        let (Some(here), true) = (self.here, params.keep_away_m > 0.0) else { return wanted };
        let forward_mps = 0.5 * (wanted[0] + wanted[1]);
        let fastest_mps = wanted[0].abs().max(wanted[1].abs());
        if fastest_mps <= 0.0 || self.is_clear(here, wanted, 2.0 * params.keep_away_m, params) {
            return wanted;
        }
        let slow = limited(wanted);
        if self.is_clear(here, slow, params.keep_away_m, params) {
            return slow;
        }
        // Of what is left the motion that gets on best, and then the one that turns most alike.
        let ([left, right], direction) = (slow, forward_mps.signum());
        let (slow_mps, rim_mps) = (0.5 * (left + right), 0.5 * (right - left));
        // A turn on the spot may become a curve, in either direction.
        let speeds: &[f64] = if forward_mps.abs() > 0.25 * fastest_mps {
            &[1.0, 0.6, 0.3, 0.0]
        } else {
            &[0.0, 0.3, 0.6, -0.3, -0.6]
        };
        let tries = speeds.iter().flat_map(|share| {
            let mean_mps = share * SLOW_MPS * direction;
            (-4..=4).map(move |turn| {
                let rim_mps = 0.25 * f64::from(turn) * SLOW_MPS;
                [mean_mps - rim_mps, mean_mps + rim_mps]
            })
        });
        let cost = |[left, right]: &Wheels| {
            let (mean, rim) = (0.5 * (left + right), 0.5 * (right - left));
            3.0 * (mean - slow_mps).abs() + (rim - rim_mps).abs()
        };
        let mut tries: Vec<Wheels> = tries.filter(|[left, right]| left.abs() + right.abs() > 0.0).collect();
        tries.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        let clear = tries.into_iter().find(|wheels| self.is_clear(here, *wheels, params.keep_away_m, params));
        clear.map_or([0.0; 2], limited)
    }

    /// Whether, during the next moment, nothing seen comes nearer to the body than `margin_m`, or than it is already.
    fn is_clear(&self, here: Pose2, [left, right]: Wheels, margin_m: f64, params: &Params) -> bool {
        let step_s = TRIED_S / f64::from(TRIES);
        let (step_m, turn_rad) = (0.5 * (left + right) * step_s, (right - left) / params.track_m * step_s);
        self.points.iter().all(|point| {
            let now_m = distance_m(here, point.place, params);
            let least_m = margin_m.min(now_m - NOISE_M);
            let mut pose = here;
            (0..TRIES).all(|_| {
                pose = pose.after_arc(step_m, turn_rad);
                distance_m(pose, point.place, params) >= least_m
            })
        })
    }
}

fn limited(wheels: Wheels) -> Wheels {
    let fastest_mps = wheels[0].abs().max(wheels[1].abs());
    if fastest_mps > SLOW_MPS { wheels.map(|speed| speed * SLOW_MPS / fastest_mps) } else { wheels }
}

/// From the body to a place; 0 inside.
fn distance_m(body: Pose2, place: Point2<f64>, params: &Params) -> f64 {
    let local = body.inverse_transform(place);
    let ahead_m = (local.x - params.hull_front_m).max(-params.hull_rear_m - local.x).max(0.0);
    let aside_m = (local.y.abs() - params.hull_side_m).max(0.0);
    ahead_m.hypot(aside_m)
}
