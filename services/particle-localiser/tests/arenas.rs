//! The ultrasonic robot in the three arenas: found from one to three scans without a pose.

mod support;

use geometry::{Point2, Polygon, Pose2, Walls, angle};
use messages::{Odometry, RangeScan, Stamped, Time};
use particle_localiser::{Inputs, Map, Model, MotionNoise, Params, ParticleLocaliser, Sensor};

fn params() -> Params {
    Params {
        sensor: Sensor::Sonar,
        model: Model::Gaussian,
        cone_half_width_rad: 15.0_f64.to_radians(),
        cone_step_rad: 1.0_f64.to_radians(),
        world_resolution_m: 0.01,
        beams: 360,
        range_max_m: 2.54,
        sigma_m: 0.03,
        clip_sigmas: 4.0,
        independent_beams: 60.0,
        min_particles: 500,
        max_particles: 2000,
        global_particles: 10_000,
        max_passes: 12,
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
        found_sigma_rad: 3.0_f64.to_radians(),
        ..Params::default()
    }
}

/// Numbers for the simulated robot.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

struct Arena {
    outline: Polygon,
    walls: Walls,
    map: Map,
}

fn arenas() -> Option<Vec<Arena>> {
    let text = std::fs::read_to_string(support::shared("botsim/arenas.json")?).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let arena = |name: &str| {
        let corners: Vec<[f64; 2]> = serde_json::from_value(value["maps"][name].clone()).unwrap();
        let outline = Polygon::new(corners.iter().map(|c| Point2::new(c[0] / 100.0, c[1] / 100.0))).unwrap();
        let map = Map::of_outline(&outline, 0.01).unwrap();
        Arena { walls: Walls::new(outline.edges()), outline, map }
    };
    Some(["1_default", "2_long", "3_repeated"].map(arena).into())
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
        let reading = |index: i32| {
            let rays = -15..=15;
            let ranges = rays.map(|ray| {
                let heading = pose.heading_rad + f64::from(index + ray).to_radians();
                self.walls.cast(pose.position(), heading, 10.0).map_or(10.0, |hit| hit.range_m)
            });
            (ranges.fold(10.0, f64::min) + 0.01 * dice.normal()).min(2.55) as f32
        };
        (header, (0..360).map(reading).collect())
    }

    /// Towards the most open direction, at most 10 cm and not nearer than 10 cm to what the scan saw.
    fn move_from(&self, ranges: &[f32], dice: &mut Dice) -> Pose2 {
        let (index, range_m) =
            ranges.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map(|(i, r)| (i, f64::from(*r))).unwrap();
        let turn = angle::wrap((index as f64).to_radians());
        let _ = dice;
        Pose2::IDENTITY.compose(Pose2::new(0.0, 0.0, turn)).compose(Pose2::new((range_m - 0.1).clamp(0.0, 0.1), 0.0, 0.0))
    }
}

struct Outcome {
    right: bool,
    scans: usize,
    clusters_first: usize,
}

fn localise(arena: &Arena, params: &Params, seed: u64, verbose: bool) -> Outcome {
    let mut dice = Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1);
    let mut truth = arena.random_pose(&mut dice);
    let mut localiser = ParticleLocaliser::new(params.clone(), arena.map.clone(), seed).unwrap();
    let mut odometry = Pose2::IDENTITY;
    let mut clusters_first = 0;
    for scan in 1..=3 {
        let (header, ranges) = arena.scan(truth, &mut dice);
        let now = Time::from_nanos(scan as u64 * 1_000_000_000);
        let message = Odometry { x_m: odometry.x_m, y_m: odometry.y_m, heading_rad: odometry.heading_rad, ..Odometry::default() };
        let pose = localiser
            .step(now, Inputs {
                odometry: Some(Stamped::new(now, &message)),
                scan: Some(Stamped::with_elements(now, &header, &ranges)),
            })
            .pose;
        let update = localiser.last_update().unwrap();
        let places = update.clusters.iter().filter(|c| c.share > 0.05).count();
        if scan == 1 {
            clusters_first = places;
        }
        let error_m = Pose2::new(pose.x_m, pose.y_m, 0.0).distance_m(truth);
        let error_rad = angle::difference(pose.heading_rad, truth.heading_rad).abs();
        if verbose {
            println!("  seed {seed} scan {scan}: {:?} error {error_m:.3} m {:.1} deg, places {places}, share {:.2}, sigma {:.3} m {:.1} deg, passes {}, fit {:.2}, n {}", pose.state, error_rad.to_degrees(), update.clusters[0].share, update.clusters[0].sigma_m(), update.clusters[0].sigma_rad().to_degrees(), update.passes, update.fit, localiser.filter().particles().len());
        }
        let is_found = pose.state == messages::LocationStateName::Tracking;
        if is_found || scan == 3 {
            let right = is_found && error_m < 0.05 && error_rad < 10.0_f64.to_radians();
            return Outcome { right, scans: scan, clusters_first };
        }
        let step = arena.move_from(&ranges, &mut dice);
        odometry = odometry.compose(step);
        truth = truth.compose(Pose2::new(step.x_m + 0.001 * dice.normal(), step.y_m, step.heading_rad + 0.005 * dice.normal()));
    }
    unreachable!("the third scan returns");
}

#[test]
#[ignore = "figures for people"]
fn figures() {
    let Some(arenas) = arenas() else { return };
    let runs: u64 = std::env::var("RUNS").ok().and_then(|s| s.parse().ok()).unwrap_or(30);
    let patch = std::env::var("PARAMS").unwrap_or("{}".into());
    let mut value = serde_json::to_value(params()).unwrap();
    let patch: serde_json::Value = serde_json::from_str(&patch).unwrap();
    for (key, v) in patch.as_object().unwrap() {
        value[key] = v.clone();
    }
    let params: Params = serde_json::from_value(value).unwrap();
    for (number, arena) in (1..).zip(&arenas) {
        let outcomes: Vec<_> = (0..runs).map(|seed| (seed, localise(arena, &params, seed, false))).collect();
        for (seed, outcome) in &outcomes {
            if !outcome.right { localise(arena, &params, *seed, true); }
        }
        let right = outcomes.iter().filter(|o| o.1.right).count();
        let ambiguous = outcomes.iter().filter(|o| o.1.clusters_first > 1).count();
        let scans: usize = outcomes.iter().map(|o| o.1.scans).sum();
        println!("map {number}: {right} of {runs} right, {ambiguous} ambiguous after one scan, {:.2} scans", scans as f64 / runs as f64);
    }
}
