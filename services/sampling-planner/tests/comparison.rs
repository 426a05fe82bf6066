//! The paper's comparison (NXT-078, Fig. 6): random waypoints against A* on a grid of stars, from (20, 20) to
//! (80, 80) cm in the first arena.

#[path = "../examples/figures/lattice.rs"]
mod lattice;

use geometry::{Point2, World};
use messages::PlanStateName;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use sampling_planner::{Params, Question, Router, SamplingPlanner, View, length_m};

const START: Point2<f64> = Point2::new(0.20, 0.20);
const GOAL: Point2<f64> = Point2::new(0.80, 0.80);

/// Lengths and numbers of turns of 200 plans, the medians and the worst number of turns.
fn sampled(view: &View<'_>, samples: u32) -> (f64, usize, usize) {
    let question = Question {
        start: START,
        goal: GOAL,
        tolerance_m: 0.0,
        escape_m: 0.0,
        samples: [samples, samples],
        tries_max: 20,
        literal: false,
    };
    let (mut rng, mut router) = (Pcg64::seed_from_u64(1), Router::default());
    let (mut lengths, mut turns) = (Vec::new(), Vec::new());
    for _ in 0..200 {
        assert_eq!(router.plan(view, &question, &mut rng), PlanStateName::Found);
        lengths.push(length_m(router.waypoints()));
        turns.push(router.chosen());
    }
    lengths.sort_by(f64::total_cmp);
    turns.sort_unstable();
    (lengths[100], turns[100], turns[199])
}

#[test]
fn shorter_and_with_fewer_turns_than_on_a_grid() {
    let world = World::load(concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/default.toml")).unwrap();
    let planner = SamplingPlanner::in_world(Params::default(), &world, 1).unwrap();
    let view = View::new(planner.space(1).unwrap(), &[], 0.0);

    let (sampled_m, turns, most_turns) = sampled(&view, 30);
    assert_eq!(turns, 1);
    assert!(most_turns <= 2, "{most_turns} turns");
    for spacing_m in [0.05, 0.10, 0.15] {
        let stars = lattice::path(&view, START, GOAL, spacing_m).expect("a path from star to star");
        assert!(stars.len() > 4 && stars[0] == START && (stars[stars.len() - 1] - GOAL).norm() < 1e-9);
        for ends in stars.windows(2) {
            assert!(view.is_open(ends[0], ends[1]));
        }
        let (stars_m, stars_turns) = (lattice::length_m(&stars), lattice::turns(&stars));
        assert!(stars_turns > turns, "{stars_turns} turns at {spacing_m} m, {turns} over samples");
        assert!(
            sampled_m < stars_m,
            "{sampled_m} m over samples, {stars_m} m over stars {spacing_m} m apart"
        );
    }
}
