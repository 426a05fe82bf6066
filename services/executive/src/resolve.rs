//! Where to drive when several places look alike: active localisation (after Fox et al. 1998) on a small
//! random roadmap.
//!
//! Wherever the robot is, it is at one of a few poses. A way is described as seen from the robot, and must be
//! free at nearly all of them; it is the better, the more the scans at its end would differ from pose to
//! pose, and the shorter it is (note 1.6 step 6).

use crate::arena::Arena;
use geometry::{Point2, Pose2};
use messages::ParticleCloud;
use rand::{Rng, RngExt};

/// A pose at which the robot may be, and how likely that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hypothesis {
    pub(crate) pose: Pose2,
    pub(crate) weight: f64,
}

/// So many of the particles are looked at, beside the clusters.
const PARTICLES: usize = 12;
/// Clusters with a smaller share are left out.
const LEAST_SHARE: f64 = 0.01;
/// Places of the roadmap.
const PLACES: usize = 90;
/// No place is farther away.
const REACH_M: f64 = 1.3;
/// Places keep this distance from walls at the likeliest pose, so that the robot can turn there.
const ROOM_M: f64 = 0.13;
/// Ways keep this distance at the likeliest pose, and at the others.
const BESIDE_M: [f64; 2] = [0.11, 0.105];
/// The beginning of the first way, which may lie in a narrow place.
const LEAVE_M: f64 = 0.06;
/// A way must be free at poses of this weight.
const FREE_WEIGHT: f64 = 0.9;
/// Standard deviation of what can be told apart.
const SIGMA_M: f64 = 0.03;
/// No reading reaches farther.
const RANGE_M: f64 = 2.5;
/// What a metre of the way, and a turn, cost, where a scan that tells everything is worth 1.
const COST_PER_M: f64 = 0.2;
const COST_PER_TURN: f64 = 0.03;

/// Where the robot may be.
#[derive(Debug, Clone, Default)]
pub(crate) struct Places {
    /// The places that a cloud of particles holds, the likeliest first.
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// The standard deviation to which each of the places is certain, if these few are all.
    pub(crate) sigma_m: Option<f64>,
}

/// The clusters are all that there is when they hold this share of the weight, and none is wider than
/// [`WIDE_M`] or [`WIDE_RAD`].
const ALL_SHARE: f64 = 0.98;
const WIDE_M: f64 = 0.03;
const WIDE_RAD: f64 = 0.15;

impl Places {
    /// What a message says.
    pub(crate) fn of_cloud(cloud: &ParticleCloud, particles: &[messages::Particle]) -> Self {
        let is_place = |place: &&messages::PoseCluster| {
            let numbers = [place.x_m, place.y_m, place.heading_rad, place.sigma_m, place.sigma_rad];
            place.share >= LEAST_SHARE && numbers.iter().all(|number| number.is_finite())
        };
        let clusters: Vec<_> = cloud.places().iter().filter(is_place).collect();
        let mut hypotheses: Vec<Hypothesis> = clusters
            .iter()
            .map(|place| Hypothesis {
                pose: Pose2::new(place.x_m, place.y_m, place.heading_rad),
                weight: place.share.min(1.0),
            })
            .collect();
        let share: f64 = clusters.iter().map(|place| place.share).sum();
        let is_narrow = |place: &&messages::PoseCluster| place.sigma_m < WIDE_M && place.sigma_rad < WIDE_RAD;
        if share >= ALL_SHARE && clusters.iter().all(is_narrow) {
            let sigma_m = clusters.iter().map(|place| place.sigma_m).fold(0.0, f64::max);
            return Self { hypotheses, sigma_m: Some(sigma_m) };
        }
        hypotheses.extend(selection(cloud, particles));
        Self { hypotheses, sigma_m: None }
    }
}

/// A few of the particles, by weight.
fn selection(cloud: &ParticleCloud, particles: &[messages::Particle]) -> Vec<Hypothesis> {
    let mut found = Vec::new();
    let weight = |particle: &messages::Particle| f64::from(particle.weight).clamp(0.0, 1e6);
    let total: f64 = particles.iter().map(weight).filter(|weight| weight.is_finite()).sum();
    if total > 0.0 {
        let (mut sum, mut next) = (0.0, 0.5);
        for particle in particles {
            sum += Some(weight(particle)).filter(|weight| weight.is_finite()).unwrap_or(0.0);
            while next < PARTICLES as f64 && sum * PARTICLES as f64 > next * total {
                next += 1.0;
                let pose = Pose2::new(
                    cloud.origin_x_m + f64::from(particle.x_m),
                    cloud.origin_y_m + f64::from(particle.y_m),
                    f64::from(particle.heading_rad),
                );
                if pose.is_finite() {
                    found.push(Hypothesis { pose, weight: 1.0 / PARTICLES as f64 });
                }
            }
        }
    }
    found
}

/// A place of the roadmap, as seen from the robot, and the best way there.
#[derive(Debug, Clone, Copy)]
struct Place {
    seen: Point2<f64>,
    cost: f64,
    before: usize,
    is_done: bool,
}

/// The places to drive to, one after the other, as seen from the robot; empty when no way leads anywhere.
pub(crate) fn way(arena: &Arena, places: &Places, rng: &mut impl Rng) -> Vec<Point2<f64>> {
    let hypotheses = &places.hypotheses;
    let free_weight = if places.sigma_m.is_some() { 0.999 } else { FREE_WEIGHT };
    let (Some(first), Some(outline)) = (hypotheses.first(), arena.outline()) else { return Vec::new() };
    let total: f64 = hypotheses.iter().map(|hypothesis| hypothesis.weight).sum();
    let mut roadmap = vec![Place { seen: Point2::origin(), cost: 0.0, before: 0, is_done: false }];
    let mut tries = 0;
    while roadmap.len() <= PLACES && tries < 20 * PLACES {
        tries += 1;
        let Some(place) = outline.random_place(ROOM_M, || rng.random()) else { break };
        let seen = first.pose.inverse_transform(place);
        if seen.coords.norm() > REACH_M {
            continue;
        }
        let free = hypotheses.iter().filter(|other| arena.free_m(other.pose.transform(seen)) >= BESIDE_M[1]);
        if free.map(|other| other.weight).sum::<f64>() >= free_weight * total {
            roadmap.push(Place { seen, cost: f64::INFINITY, before: 0, is_done: false });
        }
    }
    let is_free = |from: Point2<f64>, to: Point2<f64>| {
        // How the body leaves a narrow place is found when it drives.
        let away = to - from;
        let from = if from == Point2::origin() && away.norm() > LEAVE_M {
            from + away * (LEAVE_M / away.norm())
        } else {
            from
        };
        let beside_m = |pose: Pose2| arena.beside_m(pose.transform(from), pose.transform(to));
        if beside_m(first.pose) < BESIDE_M[0] {
            return false;
        }
        let free = hypotheses.iter().filter(|other| beside_m(other.pose) >= BESIDE_M[1]);
        free.map(|other| other.weight).sum::<f64>() >= free_weight * total
    };
    // Dijkstra's algorithm on the complete graph; ways are checked when they would be better.
    while let Some(here) = (0..roadmap.len())
        .filter(|&index| !roadmap[index].is_done && roadmap[index].cost.is_finite())
        .min_by(|&a, &b| roadmap[a].cost.total_cmp(&roadmap[b].cost))
    {
        roadmap[here].is_done = true;
        for there in 0..roadmap.len() {
            let step_m = (roadmap[there].seen - roadmap[here].seen).norm();
            let cost = roadmap[here].cost + COST_PER_M * step_m + COST_PER_TURN;
            if !roadmap[there].is_done
                && cost < roadmap[there].cost
                && is_free(roadmap[here].seen, roadmap[there].seen)
            {
                (roadmap[there].cost, roadmap[there].before) = (cost, here);
            }
        }
    }
    let value = |index: &usize| {
        let place = &roadmap[*index];
        1.0 - (-difference(arena, hypotheses, total, place.seen)).exp() - place.cost
    };
    let reached = (1..roadmap.len()).filter(|index| roadmap[*index].cost.is_finite());
    let valued = reached.map(|index| (index, value(&index)));
    let Some((best, _)) = valued.max_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
    let mut way = Vec::new();
    let mut at = best;
    while at != 0 {
        way.push(roadmap[at].seen);
        at = roadmap[at].before;
    }
    way.reverse();
    way
}

/// How much the readings of the four windows at a place differ from pose to pose: the sum, over the windows,
/// of the readings' variance in relation to that of their noise, each at most 1.
fn difference(arena: &Arena, hypotheses: &[Hypothesis], total: f64, seen: Point2<f64>) -> f64 {
    let Some(first) = hypotheses.first() else { return 0.0 };
    let place = first.pose.transform(seen);
    // The robot will turn to the nearest wall.
    let nearest =
        arena.walls().segments().iter().min_by(|a, b| a.distance_m(place).total_cmp(&b.distance_m(place)));
    let Some(nearest) = nearest else { return 0.0 };
    let to_wall = nearest.closest_point(place) - place;
    let aligned_rad = to_wall.y.atan2(to_wall.x) - first.pose.heading_rad;
    let windows = (0..12).map(|reading| {
        let (window, part) = (reading / 3, reading % 3);
        aligned_rad + f64::from(window) * std::f64::consts::FRAC_PI_2 + (f64::from(part) - 1.0) * 0.17
    });
    let spread = |direction_rad: f64| {
        let (mut sum, mut squares) = (0.0, 0.0);
        for Hypothesis { pose, weight } in hypotheses {
            let range_m = expected_m(arena, pose.transform(seen), pose.heading_rad + direction_rad);
            sum += weight * range_m;
            squares += weight * range_m * range_m;
        }
        let mean = sum / total;
        let variance = (squares / total - mean * mean).max(0.0);
        variance / (variance + SIGMA_M * SIGMA_M)
    };
    windows.map(spread).sum::<f64>() / 3.0
}

/// The nearest of a few rays within the sensor's cone.
fn expected_m(arena: &Arena, from: Point2<f64>, direction_rad: f64) -> f64 {
    let cast = |aside_rad: f64| {
        let hit = arena.walls().cast(from, direction_rad + aside_rad, RANGE_M);
        hit.map_or(RANGE_M, |hit| hit.range_m)
    };
    [-0.25, -0.12, 0.0, 0.12, 0.25].into_iter().map(cast).fold(RANGE_M, f64::min)
}
