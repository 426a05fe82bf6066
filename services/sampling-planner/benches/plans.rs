//! Milliseconds a plan, and how much longer than the shortest its paths are:
//! `cargo bench -p sampling-planner`.
//!
//! The shortest path is that over rings of 32 places around all corners and obstacles (a visibility graph),
//! whatever its number of waypoints, and at most 0.5 % too long. Medians of 200 plans each, one thread.
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use geometry::{Point2, World};
use messages::PlanStateName;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use sampling_planner::{Params, Question, Router, SamplingPlanner, View, length_m};
use std::time::Instant;

/// Name, world file, floor, offset, start, goal, obstacles.
type Case = (&'static str, &'static str, i32, f64, [f64; 2], [f64; 2], &'static [[f64; 2]]);

const OFFICE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/worlds/cs-building.toml");
const DEFAULT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/default.toml");
const LONG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/long.toml");
const REPEATED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/repeated.toml");

const CASES: [Case; 8] = [
    ("arena 1, Fig. 5", DEFAULT, 1, 0.08, [0.5, 0.1], [0.9, 0.9], &[]),
    ("arena 1", DEFAULT, 1, 0.08, [0.2, 0.2], [0.8, 0.8], &[]),
    ("arena 2", LONG, 1, 0.08, [0.3, 0.2], [1.0, 0.2], &[]),
    ("arena 3", REPEATED, 1, 0.08, [0.5, 0.7], [2.3, 0.7], &[]),
    ("hallway, free", OFFICE, 2, 0.3, [3.0, -0.3], [28.0, 0.3], &[]),
    ("hallway, round a corner", OFFICE, 2, 0.3, [3.0, 2.5], [23.0, 3.5], &[]),
    (
        "hallway, two obstacles",
        OFFICE,
        2,
        0.3,
        [3.0, -0.3],
        [16.6, -0.3],
        &[[6.6, 0.4], [6.9, 0.4], [7.2, 0.4], [8.6, -0.5], [8.8, -0.5], [9.0, -0.5]],
    ),
    ("hallway, shut by an obstacle", OFFICE, 2, 0.3, [3.0, -0.3], [28.0, 0.3], &[[10.0, -0.3], [10.0, 0.3]]),
];

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Length of the shortest path, NaN when there is none.
fn shortest_m(view: &View<'_>, question: &Question) -> f64 {
    let space = view.space();
    let corners = space.walls().flat_map(|wall| [wall.a, wall.b]).map(|corner| (corner, space.offset_m()));
    let ring = |centre: Point2<f64>, radius_m: f64| {
        (0..32).map(move |at| {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(at) / 32.0).sin_cos();
            // Outside of the circle by enough for links between neighbours.
            centre
                + geometry::Vector2::new(cosine, sine)
                    * (radius_m / (std::f64::consts::PI / 32.0).cos() + 1e-9)
        })
    };
    let obstacles = view.obstacles().iter().map(|&place| (place, view.obstacle_m()));
    let rings = corners.chain(obstacles).flat_map(|(centre, radius_m)| ring(centre, radius_m));
    let free: Vec<Point2<f64>> = [question.start, question.goal]
        .into_iter()
        .chain(rings.filter(|&place| view.is_free(place)))
        .collect();
    let next = |&node: &usize| {
        let open: Vec<_> = (0..free.len())
            .filter(|&other| other != node && view.is_open(free[node], free[other]))
            .map(|other| (other, ((free[other] - free[node]).norm() * 1e9) as u64))
            .collect();
        open
    };
    let left = |&node: &usize| ((free[1] - free[node]).norm() * 1e9) as u64;
    let found = pathfinding::prelude::astar(&0, next, left, |&node| node == 1);
    found.map_or(f64::NAN, |(_, length)| length as f64 * 1e-9)
}

fn main() {
    println!(
        "{:<30} {:>7} {:>9} {:>9} {:>6} {:>9} {:>9} {:>7}",
        "case", "samples", "ms/plan", "worst ms", "draws", "waypoints", "length m", "ratio"
    );
    for (name, file, floor, offset_m, start, goal, obstacles) in CASES {
        let world = match World::load(file) {
            Ok(world) => world,
            Err(error) => {
                println!("{name}: left out: {error}");
                continue;
            }
        };
        let params = Params { robot_radius_m: offset_m, ..Params::default() };
        let Ok(planner) = SamplingPlanner::in_world(params.clone(), &world, 1) else { continue };
        let Some(space) = planner.space(floor) else { continue };
        let obstacles: Vec<Point2<f64>> = obstacles.iter().map(|&place| place.into()).collect();
        let view = View::new(space, &obstacles, offset_m + params.obstacle_margin_m);
        let mut question = Question {
            start: start.into(),
            goal: goal.into(),
            tolerance_m: 0.0,
            escape_m: 0.0,
            samples: [30, params.samples_max],
            tries_max: params.tries_max,
            literal: false,
        };
        let best_m = shortest_m(&view, &question);
        for samples in [30, 100, 300] {
            question.samples[0] = samples;
            let (mut rng, mut router) = (Pcg64::seed_from_u64(1), Router::default());
            let (mut times, mut lengths, mut draws, mut chosen) = (vec![], vec![], 0.0, 0.0);
            let rounds = if best_m.is_nan() { 3 } else { 200 };
            for _ in 0..rounds {
                let begin = Instant::now();
                let state = router.plan(&view, &question, &mut rng);
                times.push(begin.elapsed().as_secs_f64() * 1e3);
                draws += f64::from(router.tries()) / f64::from(rounds);
                if state == PlanStateName::Found {
                    lengths.push(length_m(router.waypoints()));
                    chosen += router.chosen() as f64 / f64::from(rounds);
                }
            }
            let worst = times.iter().copied().fold(0.0, f64::max);
            let length_m = median(lengths);
            println!(
                "{name:<30} {samples:>7} {:>9.3} {worst:>9.3} {draws:>6.2} {chosen:>9.2} {length_m:>9.3} {:>7.3}",
                median(times),
                length_m / best_m
            );
        }
    }
}
