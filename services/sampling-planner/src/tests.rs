//! What can be said of the planner without a process.

mod oracles;
mod properties;

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
    check_refused(
        Params { robot_radius_m: f64::NAN, ..Params::default() },
        "`robot_radius_m` is not a finite number",
    );
    check_refused(Params { samples: 0, ..Params::default() }, "`samples` is 0");
    check_refused(Params { samples: 50, samples_max: 40, ..Params::default() }, "samples_max = 40");
    check_refused(Params { tries_max: 0, ..Params::default() }, "`tries_max` is 0");
    check_refused(Params { world: "no such file".to_owned(), ..Params::default() }, "no such file");
}
