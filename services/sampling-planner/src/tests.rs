//! What can be said of the planner without a process.

use super::*;
use geometry::Polygon;
use messages::{LocationState, LocationStateName, RangeStatus, RangeStatusName, TOF_COUNT};
use proptest::prelude::*;
use std::time::Duration;

fn arena(name: &str) -> World {
    World::load(format!("{}/arenas/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn space(name: &str, offset_m: f64) -> Space {
    floors::floors(&arena(name), offset_m).remove(0).space
}

fn question(start: [f64; 2], goal: [f64; 2]) -> Question {
    Question {
        start: start.into(),
        goal: goal.into(),
        tolerance_m: 0.0,
        escape_m: 0.0,
        samples: [30, 30],
        tries_max: 1,
        literal: false,
    }
}

// ---- The search against the enumeration of the paper.

/// Algorithm 1 as printed: every ordered choice of i samples, for i from `first` on.
fn enumerate(
    [start, goal]: [Point2<f64>; 2],
    samples: &[Point2<f64>],
    first: usize,
    is_open: &dyn Fn(Point2<f64>, Point2<f64>) -> bool,
) -> Option<(usize, f64)> {
    fn extend(
        left: usize,
        way: &mut Vec<Point2<f64>>,
        used: &mut Vec<bool>,
        (goal, samples): (Point2<f64>, &[Point2<f64>]),
        is_open: &dyn Fn(Point2<f64>, Point2<f64>) -> bool,
        shortest_m: &mut f64,
    ) {
        let last = way[way.len() - 1];
        if left == 0 {
            let length_m: f64 =
                way.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum::<f64>() + (goal - last).norm();
            // The links are looked at one by one, all of them.
            let free = way.windows(2).all(|ends| is_open(ends[0], ends[1])) && is_open(last, goal);
            if free && length_m < *shortest_m {
                *shortest_m = length_m;
            }
            return;
        }
        for index in 0..samples.len() {
            if !used[index] {
                used[index] = true;
                way.push(samples[index]);
                extend(left - 1, way, used, (goal, samples), is_open, shortest_m);
                way.pop();
                used[index] = false;
            }
        }
    }
    (first..=samples.len()).find_map(|count| {
        let mut shortest_m = f64::INFINITY;
        let mut used = vec![false; samples.len()];
        extend(count, &mut vec![start], &mut used, (goal, samples), is_open, &mut shortest_m);
        shortest_m.is_finite().then_some((count, shortest_m))
    })
}

#[track_caller]
fn check_as_enumerated(
    ends: [Point2<f64>; 2],
    samples: &[Point2<f64>],
    literal: bool,
    is_open: &dyn Fn(Point2<f64>, Point2<f64>) -> bool,
) {
    let mut search = Search::default();
    let found =
        search.find(ends, samples, literal, is_open).map(|length_m| (search.chosen().len(), length_m));
    let expected = enumerate(ends, samples, usize::from(literal), is_open);
    assert_eq!(found.map(|(count, _)| count), expected.map(|(count, _)| count));
    let (found_m, expected_m) = (found.map_or(0.0, |way| way.1), expected.map_or(0.0, |way| way.1));
    assert!((found_m - expected_m).abs() < 1e-9, "{found_m} m where enumeration finds {expected_m} m");
    if found.is_some() {
        let chosen = search.chosen().iter().map(|&index| samples[index]);
        let way: Vec<_> = std::iter::once(ends[0]).chain(chosen).chain([ends[1]]).collect();
        assert!(way.windows(2).all(|link| is_open(link[0], link[1])), "a closed link in {way:?}");
        let length_m: f64 = way.windows(2).map(|link| (link[1] - link[0]).norm()).sum();
        assert!((length_m - found_m).abs() < 1e-9, "{length_m} m along the way, {found_m} m said");
    }
}

fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Point2<f64>>> {
    prop::collection::vec((0.0..1.06, 0.0..1.05).prop_map(|(x, y)| Point2::new(x, y)), count)
}

/// Opens each link by a draw of its own, so that ways of many waypoints come about.
fn lottery(seed: u64, percent: u64) -> impl Fn(Point2<f64>, Point2<f64>) -> bool {
    move |from, to| {
        let mut state = seed;
        for bits in [from.x, from.y, to.x, to.y].map(f64::to_bits) {
            state = (state ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            state ^= state >> 29;
        }
        (state >> 20) % 100 < percent
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    #[test]
    fn finds_what_enumeration_finds(samples in points(0..8), ends in points(2..3), seed: u64, percent in 5_u64..60, literal: bool) {
        check_as_enumerated([ends[0], ends[1]], &samples, literal, &lottery(seed, percent));
    }

    #[test]
    fn finds_what_enumeration_finds_in_an_arena(samples in points(4..8), ends in points(2..3), offset_m in 0.0..0.12, literal: bool) {
        let space = space("default", offset_m);
        let view = View::new(&space, &[], 0.0);
        check_as_enumerated([ends[0], ends[1]], &samples, literal, &|from, to| view.is_open(from, to));
    }

    #[test]
    fn every_path_keeps_the_offset(
        arena in prop::sample::select(vec!["default", "long", "repeated"]),
        start in (-0.3..3.0, 0.0..1.05), goal in (-0.3..3.0, 0.0..1.05),
        obstacles in points(0..4), offset_m in 0.0..0.12, more_m in 0.0..0.1, seed: u64,
    ) {
        let (start, goal): ([f64; 2], [f64; 2]) = (start.into(), goal.into());
        let space = space(arena, offset_m);
        let obstacle_m = offset_m + more_m;
        let view = View::new(&space, &obstacles, obstacle_m);
        let mut router = Router::default();
        let question = Question { samples: [20, 80], tries_max: 4, ..question(start, goal) };
        let state = router.plan(&view, &question, &mut Pcg64::seed_from_u64(seed));
        prop_assert_eq!(state == PlanStateName::Found, router.waypoints().len() > 1);
        prop_assert!(state != PlanStateName::Found || router.waypoints().len() == router.chosen() + 2);
        for sample in router.samples() {
            prop_assert!(view.is_free(*sample));
        }
        for ends in router.waypoints().windows(2) {
            let way = Segment::new(place(&ends[0]), place(&ends[1]));
            prop_assert!(space.walls().all(|wall| wall.distance_to_segment_m(&way) >= offset_m));
            prop_assert!(obstacles.iter().all(|obstacle| way.distance_m(*obstacle) >= obstacle_m));
        }
    }

    #[test]
    fn what_cannot_connect_is_not_open(start in points(1..2), goal in points(1..2), offset_m in 0.01..0.2) {
        let space = space("default", offset_m);
        let view = View::new(&space, &[], 0.0);
        let (start, goal) = (start[0], goal[0]);
        if view.is_free(start) && view.is_free(goal) && view.is_open(start, goal) {
            prop_assert!(space.may_connect(start, goal));
        }
    }

    #[test]
    fn nonsense_never_panics(
        numbers in prop::collection::vec(prop::num::f64::ANY, 6), id in 0_u64..3, floor in -1_i32..3,
        ranges in prop::array::uniform8(prop::num::f32::ANY), states in prop::array::uniform8(0_u32..16), location in 0_u32..6,
    ) {
        let mut planner = SamplingPlanner::in_world(Params { tries_max: 2, ..Params::default() }, &arena("default"), 1).unwrap();
        let request = PlanRequest { request_id: id, goal_x_m: numbers[0], goal_y_m: numbers[1], tolerance_m: numbers[2], floor, reserved: 0 };
        let pose = PoseEstimate { x_m: numbers[3], y_m: numbers[4], heading_rad: numbers[5], floor, state: LocationState(location), ..PoseEstimate::default() };
        let ranges = TofRanges { range_m: ranges, status: states.map(RangeStatus) };
        for tenths in 1..20 {
            let now = Time::from_secs_f64(0.1 * f64::from(tenths));
            let inputs = Inputs { request: Some(Stamped::new(now, &request)), pose: Some(Stamped::new(now, &pose)), ranges: Some(Stamped::new(now, &ranges)) };
            if let Some((path, waypoints)) = planner.step(now, inputs).path {
                prop_assert_eq!(path.state == PlanStateName::Found, !waypoints.is_empty());
            }
        }
    }
}

// ---- The oracles of the requirements, part 5.

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

/// Draws 150 times 30 samples at an offset of 8 cm: how often so many waypoints are chosen (none first), how often there is no path,
/// and the median length of the paths in centimetres.
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

// ---- The literal switch.

#[test]
fn the_printed_algorithm_never_drives_straight() {
    let space = space("default", 0.08);
    let view = View::new(&space, &[], 0.0);
    let mut router = Router::default();
    let straight = question([0.20, 0.20], [0.40, 0.30]);
    for seed in 0..20 {
        router.plan(&view, &straight, &mut Pcg64::seed_from_u64(seed));
        assert_eq!(router.chosen(), 0);
        let literal = Question { literal: true, ..straight };
        router.plan(&view, &literal, &mut Pcg64::seed_from_u64(seed));
        assert_eq!(router.chosen(), 1);
    }
}

// ---- Answers.

fn estimate(x_m: f64, y_m: f64) -> PoseEstimate {
    let state = LocationState::from(LocationStateName::Tracking);
    PoseEstimate { x_m, y_m, floor: 1, state, ..PoseEstimate::default() }
}

fn request(request_id: u64, goal: [f64; 2]) -> PlanRequest {
    let [goal_x_m, goal_y_m] = goal;
    PlanRequest { request_id, goal_x_m, goal_y_m, tolerance_m: 0.02, floor: 1, reserved: 0 }
}

fn planner(params: Params) -> SamplingPlanner {
    SamplingPlanner::in_world(params, &arena("default"), 7).unwrap()
}

/// One step at a time in seconds, with fresh messages.
fn step(
    planner: &mut SamplingPlanner,
    now_s: f64,
    request: &PlanRequest,
    pose: &PoseEstimate,
) -> Option<(Path, Vec<Waypoint>)> {
    let now = Time::from_secs_f64(now_s);
    let inputs = Inputs {
        request: Some(Stamped::new(now, request)),
        pose: Some(Stamped::new(now, pose)),
        ranges: None,
    };
    planner.step(now, inputs).path.map(|(path, waypoints)| (path, waypoints.to_vec()))
}

#[track_caller]
fn check_answer(start: [f64; 2], goal: [f64; 2], expected: PlanStateName) {
    let mut planner = planner(Params { escape_m: 0.1, ..Params::default() });
    let (path, waypoints) =
        step(&mut planner, 1.0, &request(3, goal), &estimate(start[0], start[1])).expect("an answer");
    assert!(path.state == expected, "{:?}", path.state);
    assert_eq!((path.request_id, path.revision, path.floor), (3, 1, 1));
    assert_eq!(waypoints.is_empty(), expected != PlanStateName::Found);
}

#[test]
fn every_request_is_answered() {
    check_answer([0.5, 0.1], [0.9, 0.9], PlanStateName::Found);
    check_answer([0.2, 0.2], [0.2, 0.2], PlanStateName::Found);
    check_answer([0.2, 0.2], [0.09, 0.9], PlanStateName::Found);
    check_answer([0.2, 0.2], [0.07, 0.9], PlanStateName::Found); // within its tolerance
    check_answer([0.04, 0.2], [0.2, 0.2], PlanStateName::Found); // after an escape
    check_answer([0.2, 0.2], [0.02, 0.9], PlanStateName::InvalidGoal);
    check_answer([0.2, 0.2], [0.9, 0.3], PlanStateName::InvalidGoal);
    check_answer([0.2, 0.2], [9.0, 9.0], PlanStateName::InvalidGoal);
    check_answer([0.2, 0.2], [f64::NAN, 0.2], PlanStateName::InvalidGoal);
    check_answer([5.0, 0.2], [0.2, 0.2], PlanStateName::NoStart);
    check_answer([f64::NAN, 0.2], [0.2, 0.2], PlanStateName::NoStart);
}

#[test]
fn a_goal_in_another_part_is_unreachable_at_once() {
    let walls = [
        [[0.0, 0.0], [2.0, 0.0]],
        [[2.0, 0.0], [2.0, 1.0]],
        [[2.0, 1.0], [0.0, 1.0]],
        [[0.0, 1.0], [0.0, 0.0]],
    ];
    let wall_between = [[1.0, 0.0], [1.0, 1.0]];
    let walls = walls.into_iter().chain([wall_between]).map(|[a, b]| Segment::between(a, b));
    let space = Space::new(walls, None, 0.08);
    let view = View::new(&space, &[], 0.0);
    let mut router = Router::default();
    let question = Question { tries_max: 20, ..question([0.5, 0.5], [1.5, 0.5]) };
    let state = router.plan(&view, &question, &mut Pcg64::seed_from_u64(1));
    assert_eq!((state, router.tries()), (PlanStateName::Unreachable, 0));
}

#[test]
fn a_floor_shut_by_obstacles_is_unreachable_after_one_draw() {
    let space = space("default", 0.08);
    let shut: Vec<Point2<f64>> = (0..10).map(|at| Point2::new(0.05 * f64::from(at), 0.52)).collect();
    let view = View::new(&space, &shut, 0.08);
    let mut router = Router::default();
    let question = Question { tries_max: 20, ..question([0.3, 0.2], [0.8, 0.8]) };
    let state = router.plan(&view, &question, &mut Pcg64::seed_from_u64(1));
    assert_eq!((state, router.tries()), (PlanStateName::Unreachable, 1));
    // A gap is found, if not always at once.
    let gap: Vec<_> = shut.into_iter().filter(|place| (place.x - 0.225).abs() > 0.1).collect();
    let view = View::new(&space, &gap, 0.08);
    let question = Question { samples: [5, 640], ..question };
    let tries = (0..20).map(|seed| {
        let state = router.plan(&view, &question, &mut Pcg64::seed_from_u64(seed));
        assert_eq!(state, PlanStateName::Found, "seed {seed}");
        router.tries()
    });
    assert!(tries.max() > Some(1));
}

#[test]
fn a_long_search_goes_on_in_the_next_step() {
    // Five samples hardly ever pass the third arena, and each step draws no more than five.
    let params = Params { samples: 5, samples_max: 5, ..Params::default() };
    let mut planner = SamplingPlanner::in_world(params, &arena("repeated"), 3).unwrap();
    let (goal, pose) = (request(1, [2.3, 0.7]), estimate(0.5, 0.7));
    let answers: Vec<_> =
        (0..30).map(|tenths| step(&mut planner, 1.0 + 0.1 * f64::from(tenths), &goal, &pose)).collect();
    let answered = answers.iter().position(Option::is_some).expect("an answer");
    assert!((1..20).contains(&answered), "after {answered} steps");
    assert!(answers[answered].as_ref().is_some_and(|(path, _)| (path.request_id, path.revision) == (1, 1)));
    let mut portions = Router::default();
    let world = arena("repeated");
    let space = SamplingPlanner::in_world(Params::default(), &world, 1).unwrap();
    let view = View::new(space.space(1).unwrap(), &[], 0.0);
    let question = Question { samples: [4, 4], tries_max: 3, ..question([0.5, 0.7], [2.3, 0.7]) };
    let mut rng = Pcg64::seed_from_u64(1);
    for (first, expected) in [(0, None), (1, None), (2, Some(PlanStateName::Unreachable))] {
        assert_eq!(portions.plan_some(&view, &question, first, 4, &mut rng), expected);
        assert_eq!(portions.tries(), first + 1);
    }
}

#[test]
fn an_answer_is_given_once() {
    let (mut planner, pose) = (planner(Params::default()), estimate(0.5, 0.1));
    let goal = request(1, [0.9, 0.9]);
    assert!(step(&mut planner, 1.0, &goal, &pose).is_some());
    assert!(step(&mut planner, 1.1, &goal, &pose).is_none());
    assert!(step(&mut planner, 9.0, &goal, &pose).is_none());
    let (path, _) = step(&mut planner, 9.1, &request(2, [0.9, 0.9]), &pose).expect("a new request");
    assert_eq!((path.request_id, path.revision), (2, 1));
    assert!(step(&mut planner, 9.2, &request(0, [0.9, 0.9]), &pose).is_none(), "zero is no request");
}

#[test]
fn a_robot_that_strays_gets_a_new_path() {
    let mut planner = planner(Params { stray_m: 0.2, ..Params::default() });
    let goal = request(1, [0.9, 0.9]);
    step(&mut planner, 1.0, &goal, &estimate(0.5, 0.1)).expect("a path");
    let (path, waypoints) = step(&mut planner, 3.0, &goal, &estimate(0.1, 0.9)).expect("a new path");
    assert_eq!((path.request_id, path.revision), (1, 2));
    assert_eq!((waypoints[0].x_m, waypoints[0].y_m), (0.1, 0.9));
}

#[test]
fn the_same_seed_gives_the_same_path() {
    let way = |seed| {
        let mut planner = SamplingPlanner::in_world(Params::default(), &arena("repeated"), seed).unwrap();
        step(&mut planner, 1.0, &request(1, [2.3, 0.7]), &estimate(0.5, 0.7)).expect("a path").1
    };
    assert_eq!(way(1), way(1));
    assert_ne!(way(1), way(2));
}

// ---- Obstacles. A hall of 8 m by 4 m for the coffee robot, whose sensors these are.

fn hall() -> (World, Params) {
    let outline = "outline = [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [0.0, 4.0]]";
    let text = format!("name = \"hall\"\n[[floor]]\nnumber = 1\n{outline}\n");
    (World::parse(&text).unwrap(), Params { robot_radius_m: 0.3, ..Params::default() })
}

fn seen_ahead(range_m: f32) -> TofRanges {
    let mut ranges = TofRanges {
        range_m: [0.0; TOF_COUNT],
        status: [RangeStatus::from(RangeStatusName::OutOfBounds); TOF_COUNT],
    };
    for sensor in 2..6 {
        ranges.range_m[sensor] = range_m;
        ranges.status[sensor] = RangeStatus::from(RangeStatusName::Valid);
    }
    ranges
}

#[test]
fn an_obstacle_on_the_path_is_passed_at_a_distance_and_forgotten() {
    let (world, params) = hall();
    let mut planner = SamplingPlanner::in_world(params.clone(), &world, 1).unwrap();
    let (goal, pose) = (request(1, [7.0, 2.0]), estimate(2.0, 2.0));
    let first = step(&mut planner, 0.9, &goal, &pose).expect("a straight path");
    let mut answers = vec![first];
    for tenths in 10..40 {
        let now = Time::from_secs_f64(0.1 * f64::from(tenths));
        let ranges = seen_ahead(0.6);
        let inputs = Inputs {
            request: Some(Stamped::new(now, &goal)),
            pose: Some(Stamped::new(now, &pose)),
            ranges: Some(Stamped::new(now, &ranges)),
        };
        if let Some((path, waypoints)) = planner.step(now, inputs).path {
            answers.push((path, waypoints.to_vec()));
        }
    }
    assert_eq!(answers.len(), 2, "one straight path, and one around the obstacle: {answers:?}");
    assert_eq!(answers[0].1.len(), 2);
    let around = &answers[1];
    assert_eq!((around.0.revision, around.0.state.get()), (2, Ok(PlanStateName::Found)));
    let obstacles = planner.obstacles().to_vec();
    assert!(!obstacles.is_empty() && obstacles.iter().all(|place| (place.x - 2.9).abs() < 0.1));
    for ends in around.1.windows(2) {
        let way = Segment::new(place(&ends[0]), place(&ends[1]));
        for obstacle in &obstacles {
            assert!(way.distance_m(*obstacle) >= 0.3 + params.obstacle_margin_m - GRAIN_M);
        }
    }
    // Nothing is seen for long.
    let now = Time::from_secs_f64(60.0);
    planner.step(now, Inputs::default());
    assert!(planner.obstacles().is_empty());
}

#[test]
fn walls_and_what_lies_in_range_of_nothing_are_no_obstacles() {
    let (world, params) = hall();
    let mut planner = SamplingPlanner::in_world(params, &world, 1).unwrap();
    let pose = estimate(7.0, 2.0);
    for tenths in 10..20 {
        let now = Time::from_secs_f64(0.1 * f64::from(tenths));
        // The wall is 0.695 m ahead of the sensors.
        let ranges = seen_ahead(0.69);
        planner.step(
            now,
            Inputs {
                request: None,
                pose: Some(Stamped::new(now, &pose)),
                ranges: Some(Stamped::new(now, &ranges)),
            },
        );
    }
    assert!(planner.obstacles().is_empty(), "{:?}", planner.obstacles());
}

#[test]
fn an_obstacle_that_leaves_is_seen_through() {
    let (world, params) = hall();
    let mut planner = SamplingPlanner::in_world(params, &world, 1).unwrap();
    let pose = estimate(2.0, 2.0);
    let mut look = |range_m: f32, from: i32| {
        for tenths in from..from + 20 {
            let now = Time::ZERO.after(Duration::from_millis(100 * tenths as u64));
            let ranges = seen_ahead(range_m);
            let inputs = Inputs {
                request: None,
                pose: Some(Stamped::new(now, &pose)),
                ranges: Some(Stamped::new(now, &ranges)),
            };
            planner.step(now, inputs);
        }
        planner.obstacles().iter().filter(|place| (place.y - 2.0).abs() < 0.2).count()
    };
    assert!(look(0.6, 10) > 0);
    // Now something stands farther away: what was ahead of it has left.
    assert_eq!(look(0.95, 30) - look(0.95, 50), 0);
    assert!(
        !planner.obstacles().iter().any(|place| (place.x - 2.9).abs() < 0.1 && (place.y - 2.0).abs() < 0.2)
    );
}

// ---- Set-up.

#[track_caller]
fn check_refused(params: Params, part: &str) {
    let error = SamplingPlanner::new(params, 1).expect_err("refused").to_string();
    assert!(error.contains(part), "{error}");
}

#[test]
fn bad_parameters_are_refused() {
    check_refused(Params { robot_radius_m: f64::NAN, ..Params::default() }, "robot_radius_m = NaN");
    check_refused(Params { samples: 0, ..Params::default() }, "samples = 0");
    check_refused(Params { samples: 50, samples_max: 40, ..Params::default() }, "samples_max = 40");
    check_refused(Params { tries_max: 0, ..Params::default() }, "tries_max = 0");
    check_refused(Params { world: "no such file".to_owned(), ..Params::default() }, "no such file");
}
