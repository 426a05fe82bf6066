//! The ultrasonic robot in an arena: it starts anywhere without a pose, looks around, and moves towards open
//! space until it knows where it is.
#![allow(
    dead_code,
    missing_docs,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test uses a part of it"
)]

use super::Dice;
use geometry::{Point2, Polygon, Pose2, Walls, World, angle};
use messages::{LocationStateName, Odometry, RangeScan, Stamped, Time};
use particle_localiser::{
    Echoes, Inputs, Map, Model, MotionNoise, Params, ParticleLocaliser, Recovery, Sensor,
};

/// As in `launch/graphs/nxt.toml`.
pub fn params() -> Params {
    Params {
        sensor: Sensor::Sonar,
        model: Model::Echo,
        cone_half_width_rad: 15.0_f64.to_radians(),
        world_resolution_m: 0.01,
        beams: 62,
        range_max_m: 2.54,
        sigma_m: 0.013,
        random_share: 0.02,
        independent_beams: 40.0,
        min_particles: 1000,
        max_particles: 3000,
        global_particles: 60_000,
        search_beams: 16,
        // This sensor hears every echo in time.
        echoes: Echoes { late_m: 0.0, lost_share: 0.0, ..Echoes::default() },
        recovery: Recovery { early_scans: 0, ..Recovery::default() },
        max_passes: 12,
        pass_effective_share: 0.4,
        bin_m: 0.05,
        bin_rad: 0.2,
        motion: MotionNoise {
            place_m: 0.002,
            place_per_m: 0.02,
            place_m_per_rad: 0.0,
            heading_rad: 0.005,
            heading_per_rad: 0.01,
            heading_rad_per_m: 0.02,
        },
        jitter_m: 0.002,
        jitter_rad: 0.004,
        update_distance_m: 0.0,
        update_turn_rad: 0.0,
        found_sigma_m: 0.02,
        found_sigma_rad: 0.15,
        // Places that are alike are told apart by evidence, not by the luck of a scan.
        found_share: 0.99,
        ..Params::default()
    }
}

/// An arena, and its map.
pub struct Arena {
    outline: Polygon,
    walls: Walls,
    map: Map,
}

/// The arena of this number.
pub fn arena(number: u32) -> Arena {
    let file = format!("{}/../../launch/worlds/arena-{number}.toml", env!("CARGO_MANIFEST_DIR"));
    let world = World::load(file).unwrap();
    let outline = world.floors[0].outline_polygon().unwrap();
    let map = Map::of_outline(&outline, 0.01).unwrap();
    Arena { walls: Walls::new(outline.edges()), outline, map }
}

impl Arena {
    fn random_pose(&self, dice: &mut Dice) -> Pose2 {
        let (low, high) = self.outline.bounds();
        loop {
            let point = Point2::new(
                low.x + dice.uniform() * (high.x - low.x),
                low.y + dice.uniform() * (high.y - low.y),
            );
            if self.outline.contains(point) && self.outline.distance_to_boundary_m(point) >= 0.1 {
                return Pose2::new(point.x, point.y, dice.uniform() * std::f64::consts::TAU);
            }
        }
    }

    /// A reading a degree: the nearest within the cone, a centimetre of noise, 255 for nothing.
    fn scan(&self, pose: Pose2, dice: &mut Dice) -> (RangeScan, Vec<f32>) {
        let header =
            RangeScan { angle_step_rad: 1.0_f64.to_radians(), range_max_m: 2.55, ..RangeScan::default() };
        let mut reading = |index: i32| {
            let rays = -15..=15;
            let ranges = rays.map(|ray| {
                let heading = pose.heading_rad + f64::from(index + ray).to_radians();
                self.walls.cast(pose.position(), heading, 10.0).map_or(10.0, |hit| hit.range_m)
            });
            (ranges.fold(10.0, f64::min) + 0.01 * normal(dice)).min(2.55) as f32
        };
        // The four windows that the scan conditioner keeps (NXT-041).
        let is_kept = |index: &i32| (index + 15) % 90 <= 30;
        (header, (0..360).map(|index| if is_kept(&index) { reading(index) } else { 0.0 }).collect())
    }
}

/// How often a search of three scans at most was right, was surely wrong, and saw several places at first.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    pub right: usize,
    pub wrong: usize,
    pub ambiguous: usize,
    pub scans: usize,
}

fn localise(arena: &Arena, params: &Params, seed: u64, most_scans: usize, tally: &mut Tally) {
    let mut dice = Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1);
    let mut truth = arena.random_pose(&mut dice);
    let mut localiser = ParticleLocaliser::new(params.clone(), arena.map.clone(), seed).unwrap();
    let mut odometry = Pose2::IDENTITY;
    for scan in 1..=most_scans {
        let (header, ranges) = arena.scan(truth, &mut dice);
        let now = Time::from_nanos(scan as u64 * 1_000_000_000);
        let Pose2 { x_m, y_m, heading_rad } = odometry;
        let message = Odometry { x_m, y_m, heading_rad, ..Odometry::default() };
        let inputs = Inputs {
            odometry: Some(Stamped::new(now, &message)),
            scan: Some(Stamped::with_elements(now, &header, &ranges)),
        };
        let pose = localiser.step(now, inputs).pose;
        let update = localiser.last_update().unwrap();
        let places = update.clusters.iter().filter(|cluster| cluster.share > 0.05).count();
        tally.ambiguous += usize::from(scan == 1 && places > 1);
        tally.scans += 1;
        if pose.state == LocationStateName::Tracking {
            let error_m = Pose2::new(pose.x_m, pose.y_m, 0.0).distance_m(truth);
            let error_rad = angle::difference(pose.heading_rad, truth.heading_rad).abs();
            let right = error_m < 0.05 && error_rad < 0.1;
            tally.right += usize::from(right);
            tally.wrong += usize::from(!right);
            return;
        }
        let step = towards_open_space(&ranges);
        odometry = odometry.compose(step);
        let slip = Pose2::new(0.001 * normal(&mut dice), 0.0, 0.005 * normal(&mut dice));
        truth = truth.compose(step).compose(slip);
    }
}

/// A normal number.
fn normal(dice: &mut Dice) -> f64 {
    (0..12).map(|_| dice.uniform()).sum::<f64>() - 6.0
}

/// 10 cm at most, in the most open direction.
fn towards_open_space(ranges: &[f32]) -> Pose2 {
    let farthest = ranges.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    let (index, range_m) = farthest.map(|(index, range)| (index, f64::from(*range))).unwrap();
    let turn_rad = (index as f64).to_radians();
    Pose2::new(0.0, 0.0, turn_rad).compose(Pose2::new((range_m - 0.1).clamp(0.0, 0.1), 0.0, 0.0))
}

/// Robots that start anywhere, and look so often at most.
pub fn tally(arena: &Arena, runs: u64, most_scans: usize) -> Tally {
    let mut tally = Tally::default();
    (0..runs).for_each(|seed| localise(arena, &params(), seed, most_scans, &mut tally));
    tally
}
