//! The search against the enumeration of the paper, and what holds of every path.

use super::*;

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
    fn finds_what_enumeration_finds(samples in points(0..9), ends in points(2..3), seed: u64, percent in 5_u64..60, literal: bool) {
        check_as_enumerated([ends[0], ends[1]], &samples, literal, &lottery(seed, percent));
    }

    #[test]
    fn finds_what_enumeration_finds_in_an_arena(samples in points(4..9), ends in points(2..3), offset_m in 0.0..0.12, literal: bool) {
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
