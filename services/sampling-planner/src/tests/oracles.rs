//! The oracles of the requirements, part 5.

use super::*;

fn polygon_area_m2(name: &str) -> f64 {
    Polygon::from_coordinates(arena(name).floors[0].outline.as_ref().unwrap()).unwrap().area_m2()
}

#[test]
fn the_arenas_have_their_areas() {
    for (name, cm2) in [("default", 8206.0), ("long", 8550.0), ("repeated", 18_600.0)] {
        assert!((polygon_area_m2(name) * 1e4 - cm2).abs() < 1e-6, "{name}");
    }
}

/// Length of the shortest path without an offset, over the arena's corners.
fn shortest_m(name: &str, start: [f64; 2], goal: [f64; 2]) -> f64 {
    let space = space(name, 0.0);
    // A hair inside of each corner, so that links along walls do not touch them.
    let outline = Polygon::from_coordinates(arena(name).floors[0].outline.as_ref().unwrap()).unwrap();
    let inside = |corner: Point2<f64>| {
        (0..360)
            .map(|degree| f64::from(degree).to_radians().sin_cos())
            .map(move |(sine, cosine)| corner + geometry::Vector2::new(cosine, sine) * 1e-6)
    };
    let near: Vec<Point2<f64>> = outline
        .corners()
        .iter()
        .flat_map(|&corner| inside(corner).step_by(15))
        .filter(|&place| outline.contains(place))
        .collect();
    let ends = [Point2::from(start), Point2::from(goal)];
    let open = |from: Point2<f64>, to: Point2<f64>| !space.crosses_wall(&Segment::new(from, to));
    // Dijkstra's algorithm over all of them.
    let nodes: Vec<Point2<f64>> = ends.into_iter().chain(near).collect();
    let next = |&node: &usize| {
        let found: Vec<_> = (0..nodes.len())
            .filter(|&other| other != node && open(nodes[node], nodes[other]))
            .map(|other| (other, ((nodes[other] - nodes[node]).norm() * 1e9) as u64))
            .collect();
        found
    };
    let (_, length) = pathfinding::prelude::dijkstra(&0, next, |&node| node == 1).unwrap();
    length as f64 * 1e-9
}

#[track_caller]
fn check_shortest(name: &str, start: [f64; 2], goal: [f64; 2], expected_cm: f64) {
    let found_cm = 100.0 * shortest_m(name, start, goal);
    assert!((found_cm - expected_cm).abs() < 0.06, "{found_cm} cm, not {expected_cm}");
}

#[test]
fn the_arenas_have_their_shortest_paths() {
    check_shortest("default", [0.20, 0.20], [0.80, 0.80], 87.1);
    check_shortest("long", [0.30, 0.20], [1.00, 0.20], 112.4);
    check_shortest("repeated", [0.50, 0.70], [2.30, 0.70], 217.7);
    check_shortest("default", [0.50, 0.10], [0.90, 0.90], 104.0);
}

/// Draws 150 times 30 samples at an offset of 8 cm: how often so many waypoints are chosen (none first), how
/// often there is no path, and the median length of the paths in centimetres.
fn draws(name: &str, start: [f64; 2], goal: [f64; 2]) -> ([usize; 6], usize, f64) {
    let space = space(name, 0.08);
    let view = View::new(&space, &[], 0.0);
    let mut rng = Pcg64::seed_from_u64(1);
    let (mut counts, mut failed, mut lengths) = ([0; 6], 0, Vec::new());
    let mut router = Router::default();
    for _ in 0..150 {
        match router.plan(&view, &question(start, goal), &mut rng) {
            PlanStateName::Found => {
                counts[router.chosen().min(5)] += 1;
                lengths.push(100.0 * length_m(router.waypoints()));
            }
            _ => failed += 1,
        }
    }
    lengths.sort_by(f64::total_cmp);
    (counts, failed, lengths[lengths.len() / 2])
}

/// A share of 150 draws, give or take three standard deviations of the difference to another 150 draws.
#[track_caller]
fn check_share(name: &str, found: usize, expected_percent: f64) {
    let share = found as f64 / 150.0;
    let expected = expected_percent / 100.0;
    let allowed = 3.0 * (2.0 * expected * (1.0 - expected) / 150.0).sqrt() + 0.02;
    assert!((share - expected).abs() < allowed, "{name}: {share} where {expected} is expected");
}

#[test]
fn thirty_samples_suffice_as_often_as_they_should() {
    let (fig5, failed, _) = draws("default", [0.50, 0.10], [0.90, 0.90]);
    assert!(fig5[1] >= 146 && fig5[0] == 0 && failed <= 2, "{fig5:?} {failed}");
    let (first, failed, _) = draws("default", [0.20, 0.20], [0.80, 0.80]);
    assert!(first[1] >= 146 && first[0] == 0 && failed <= 2, "{first:?} {failed}");

    let (second, failed, _) = draws("long", [0.30, 0.20], [1.00, 0.20]);
    check_share("map 2, two waypoints", second[2], 60.0);
    check_share("map 2, three waypoints", second[3], 33.0);
    check_share("map 2, four waypoints", second[4], 4.0);
    check_share("map 2, no path", failed, 3.0);

    let (third, failed, median_cm) = draws("repeated", [0.50, 0.70], [2.30, 0.70]);
    check_share("map 3, two waypoints", third[2], 70.0);
    check_share("map 3, three waypoints", third[3], 20.0);
    check_share("map 3, no path", failed, 10.0);
    assert!((median_cm - 274.0).abs() < 6.0, "{median_cm} cm");
}

#[test]
fn more_draws_find_what_the_first_misses() {
    for (name, start, goal) in
        [("long", [0.30, 0.20], [1.00, 0.20]), ("repeated", [0.50, 0.70], [2.30, 0.70])]
    {
        let space = space(name, 0.08);
        let view = View::new(&space, &[], 0.0);
        let mut router = Router::default();
        let question = Question { samples: [30, 960], tries_max: 20, ..question(start, goal) };
        for seed in 0..100 {
            let state = router.plan(&view, &question, &mut Pcg64::seed_from_u64(seed));
            assert_eq!(state, PlanStateName::Found, "{name}, seed {seed}");
            assert_eq!(router.samples().len(), 30 << (router.tries() - 1), "the draws double");
        }
    }
}
