//! Where the hull may go, whatever a controller asks.

use super::*;

/// A line of points from one place to another.
fn wall(from: (f64, f64), to: (f64, f64)) -> Vec<Point2<f64>> {
    let line = geometry::Segment::new(Point2::new(from.0, from.1), Point2::new(to.0, to.1));
    line.points(0.04).collect()
}

/// Asks for the same for five seconds among things, from rest; returns the robot and the least room there
/// was.
fn ask(things: Vec<Point2<f64>>, mut robot: Robot, wished: (f64, f64)) -> (Robot, f64) {
    robot.things = things;
    let mut least_m = f64::INFINITY;
    for _ in 0..250 {
        robot.step(go(), wish(wished.0, wished.1));
        least_m = least_m.min(robot.room_m());
    }
    (robot, least_m)
}

/// A robot at rest at the origin that asks for something nearby: it stays off, and at rest in the end unless
/// it is to get away.
#[track_caller]
fn check_kept_off(things: Vec<Point2<f64>>, wished: (f64, f64)) {
    let (robot, least_m) = ask(things, Robot::new(Params::default()), wished);
    assert!(least_m > 0.055, "{least_m} m");
    assert!(robot.rims.is_within(0.03), "{:?}", robot.rims);
}

#[test]
fn ahead_it_stops_before_whatever_is_known() {
    check_kept_off(wall((0.9, -1.0), (0.9, 1.0)), (1.0, 1.0));
    check_kept_off(vec![Point2::new(0.9, 0.0)], (1.0, 1.0));
    check_kept_off(vec![Point2::new(0.9, 0.25)], (1.0, 1.0));
    // Into a corner, and into a wall that comes nearer and nearer beside it.
    check_kept_off([wall((0.6, -0.6), (1.2, 0.0)), wall((1.2, 0.0), (0.6, 0.6))].concat(), (1.0, 1.0));
    check_kept_off(wall((-0.5, 0.5), (2.0, 0.1)), (1.0, 1.0));
    check_kept_off(wall((-0.5, -0.4), (2.0, -0.2)), (1.0, 1.0));
}

#[test]
fn arcs_of_every_curvature_end_before_the_wall() {
    for tenths in -9..=9 {
        let inner = 0.1 * f64::from(tenths);
        let around = [
            wall((1.2, -1.2), (1.2, 1.2)),
            wall((-1.2, 1.2), (1.2, 1.2)),
            wall((-1.2, -1.2), (1.2, -1.2)),
            wall((-1.2, -1.2), (-1.2, 1.2)),
        ];
        for wished in [(1.0, inner), (inner, 1.0)] {
            let (_, least_m) = ask(around.concat(), Robot::new(Params::default()), wished);
            assert!(least_m > 0.055, "{wished:?}: {least_m} m");
        }
    }
}

#[test]
fn it_turns_only_where_the_corners_have_room() {
    // A circle of 0.398 m is free.
    let (robot, _) = ask(wall((-1.0, 0.6), (1.0, 0.6)), Robot::new(Params::default()), (-0.1, 0.1));
    assert!(robot.rims.right_mps > 0.09, "{:?}", robot.rims);
    check_kept_off(wall((-1.0, 0.36), (1.0, 0.36)), (-1.0, 1.0));
    check_kept_off(wall((-1.0, 0.36), (1.0, 0.36)), (1.0, -1.0));
    check_kept_off(wall((-1.0, -0.36), (1.0, -0.36)), (-1.0, 1.0));
    check_kept_off(vec![Point2::new(0.0, 0.36)], (-1.0, 1.0));
    // What is too near already may be left, and not be approached.
    let beside = wall((-1.0, 0.30), (1.0, 0.30));
    let (robot, least_m) = ask(beside.clone(), Robot::new(Params::default()), (1.0, 1.0));
    assert!(robot.pose.x_m > 0.3 && least_m > 0.0449, "{:?}, {least_m}", robot.pose);
    let (_, least_m) = ask(beside, Robot::new(Params::default()), (0.3, 0.36));
    assert!(least_m > 0.0449, "{least_m}");
}

#[test]
fn at_full_speed_a_change_of_mind_finds_no_way_into_a_wall() {
    for (left, right) in
        [(-1.0, 1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, -1.0), (1.0, 0.7), (0.7, 1.0)]
    {
        let mut robot = Robot::driving();
        let here = robot.pose;
        let hallway = [wall((-2.0, 0.45), (2.5, 0.45)), wall((-2.0, -0.45), (2.5, -0.45))];
        robot.things = hallway.concat().into_iter().map(|thing| here.transform(thing)).collect();
        for step in 0..400 {
            // And another one, now and then.
            let wished = if step % 50 < 25 { wish(left, right) } else { wish(right, left) };
            robot.step(go(), wished);
            assert!(robot.room_m() > 0.055, "({left}, {right}): {} m at {:?}", robot.room_m(), robot.pose);
        }
    }
}

#[test]
fn back_it_goes_only_over_ground_that_it_has_just_covered() {
    // From rest nowhere.
    let mut robot = Robot::new(Params::default());
    for _ in 0..100 {
        robot.step(go(), wish(-1.0, -1.0));
    }
    assert!(robot.pose.x_m > -0.012, "{:?}", robot.pose);
    // As far as it came, if that is not more than a metre; and slowly.
    let mut robot = Robot::driving();
    let from_m = robot.pose.x_m;
    for _ in 0..1500 {
        robot.step(go(), wish(-1.0, -1.0));
        assert!(robot.rims.left_mps > -0.101 || robot.pose.x_m > from_m - 0.1);
    }
    assert!((robot.pose.x_m - (from_m - 1.0).max(0.0)).abs() < 0.05, "{:?} from {from_m}", robot.pose);
    // Not beside it.
    let mut robot = Robot::driving();
    for _ in 0..500 {
        robot.step(go(), wish(-0.1, -0.02));
    }
    let corners = [-0.255, 0.255].map(|y_m| robot.pose.transform(Point2::new(-0.305, y_m)));
    assert!(corners.iter().all(|corner| corner.y.abs() < 0.255 + 0.08), "{:?}", robot.pose);
}

#[test]
fn who_was_pushed_back_may_go_on() {
    let mut robot = Robot::driving();
    for _ in 0..100 {
        robot.step(go(), WheelSpeeds::ZERO);
    }
    // Farther than it remembers.
    let begin_m = robot.pose.x_m - 1.5;
    while robot.pose.x_m > begin_m {
        robot.pose.x_m -= 0.02;
        robot.travel.left_m -= 0.02;
        robot.travel.right_m -= 0.02;
        robot.step(go(), WheelSpeeds::ZERO);
    }
    for _ in 0..50 {
        robot.step(go(), wish(-0.3, -0.3));
    }
    assert!(robot.pose.x_m > begin_m - 0.05, "nobody knows what is behind: {:?}", robot.pose);
    for _ in 0..50 {
        robot.step(go(), wish(0.3, 0.3));
    }
    assert!(robot.pose.x_m > begin_m + 0.1, "{:?}", robot.pose);
}

#[test]
fn a_curve_is_a_way_back_as_it_was_a_way_there() {
    let mut robot = Robot::new(Params::default());
    // Slowly, so that both wheels come to rest at once, nearly.
    for _ in 0..500 {
        robot.step(go(), wish(0.03, 0.05));
    }
    for _ in 0..20 {
        robot.step(go(), WheelSpeeds::ZERO);
    }
    let far = robot.pose;
    for _ in 0..500 {
        robot.step(go(), wish(-0.03, -0.05));
    }
    assert!(robot.pose.distance_m(far) > 0.3, "{far:?}, {:?}", robot.pose);
}

#[test]
fn jerking_back_and_forth_leads_nowhere_behind() {
    for period in [5, 10, 20, 35] {
        let mut robot = Robot::new(Params::default());
        for step in 0..2000 {
            let ahead = (step / period) % 2 == 1;
            robot.step(go(), if ahead { wish(0.05, 0.05) } else { wish(-1.0, -1.0) });
            assert!(robot.pose.x_m > -0.015, "period {period}, step {step}: {:?}", robot.pose);
        }
    }
}

#[test]
fn a_stop_for_something_in_front_lets_it_go_back_the_way_it_came() {
    let mut robot = Robot::driving();
    robot.things = wall((robot.pose.x_m + 0.5, -1.0), (robot.pose.x_m + 0.5, 1.0));
    let blocked = stop(Face::Front as u32);
    for _ in 0..50 {
        robot.step(blocked, wish(0.3, 0.3));
    }
    let before_m = robot.pose.x_m;
    for _ in 0..200 {
        robot.step(blocked, wish(-0.1, -0.1));
    }
    assert!((0.2..1.05).contains(&(before_m - robot.pose.x_m)), "{before_m}, {:?}", robot.pose);
    // A successor knows the way too.
    let mut robot = Robot::driving();
    let snapshot = robot.driver.snapshot().unwrap();
    robot.driver = BaseDriver::new(Params::default()).unwrap();
    robot.driver.restore(&snapshot);
    for _ in 0..60 {
        robot.step(blocked, WheelSpeeds::ZERO);
    }
    assert_eq!(robot.step(blocked, wish(-0.1, -0.1)).reason, DriveReasonName::Escaping);
    // It can be forbidden.
    let mut robot = Robot::driving();
    robot.driver.params.allow_escape = false;
    assert_eq!(robot.step(blocked, wish(-0.1, -0.1)).reason, DriveReasonName::GuardStop);
}

// ---- Orders.

fn ordered(order: Option<MotionCommand>, front_m: f32) -> (Robot, Clearance) {
    let params = Params {
        room: Room::Ordered,
        wheel_track_m: 0.12,
        hull_front_m: 0.08,
        hull_rear_m: 0.08,
        hull_side_m: 0.07,
        ..Params::default()
    };
    let word = Clearance {
        front_m,
        front_radius_m: 0.01,
        right_radius_m: 0.0,
        left_radius_m: 0.0,
        max_age_ms: 100,
        ..go()
    };
    (Robot { order, ..Robot::new(params) }, word)
}

/// How far a wish leads when this was ordered: ahead, and around.
#[track_caller]
fn check_ordered(order: Option<MotionCommand>, front_m: f32, wished: (f64, f64), expected: [f64; 2]) {
    let (mut robot, word) = ordered(order, front_m);
    let mut turned_rad = 0.0;
    for _ in 0..600 {
        let before_rad = robot.pose.heading_rad;
        robot.step(word, wish(wished.0, wished.1));
        turned_rad += geometry::angle::difference(robot.pose.heading_rad, before_rad);
    }
    let [way_m, turn_rad] = expected;
    assert!((robot.pose.x_m - way_m).abs() < 0.015, "{:?}", robot.pose);
    assert!((turned_rad - turn_rad).abs() < 0.05, "{turned_rad}");
}

#[test]
fn where_orders_count_nothing_else_is_done() {
    let far = f32::INFINITY;
    check_ordered(None, far, (1.0, 1.0), [0.0, 0.0]);
    check_ordered(None, far, (-1.0, 1.0), [0.0, 0.0]);
    check_ordered(Some(MotionCommand::default()), far, (1.0, 1.0), [0.0, 0.0]);
    check_ordered(Some(way(0.5)), far, (1.0, 1.0), [0.5, 0.0]);
    check_ordered(Some(way(0.5)), far, (-1.0, -1.0), [0.0, 0.0]);
    check_ordered(Some(way(0.5)), far, (-1.0, 1.0), [0.0, 0.0]);
    check_ordered(Some(way(-0.1)), far, (-1.0, -1.0), [-0.1, 0.0]);
    check_ordered(Some(MotionCommand { retreat_m: 0.05, ..way(0.5) }), far, (-1.0, -1.0), [-0.05, 0.0]);
    check_ordered(Some(turn(1.5)), far, (-1.0, 1.0), [0.0, 1.5]);
    check_ordered(Some(turn(-5.0)), far, (1.0, -1.0), [0.0, -5.0]);
    check_ordered(Some(turn(1.5)), far, (1.0, -1.0), [0.0, 0.0]);
    check_ordered(Some(turn(1.5)), far, (1.0, 1.0), [0.0, 0.0]);
    check_ordered(Some(turn(f64::NAN)), far, (-1.0, 1.0), [0.0, 0.0]);
    check_ordered(Some(way(f64::INFINITY)), far, (1.0, 1.0), [0.0, 0.0]);
    check_ordered(
        Some(MotionCommand { kind: messages::MotionKind(9), ..way(1.0) }),
        far,
        (1.0, 1.0),
        [0.0, 0.0],
    );
}

#[test]
fn beside_what_was_ordered_there_is_a_centimetre_and_two_degrees() {
    for wished in [(0.2, 0.3), (0.3, 0.1), (0.3, -0.3)] {
        let (mut robot, word) = ordered(Some(way(0.5)), f32::INFINITY);
        for _ in 0..600 {
            robot.step(word, wish(wished.0, wished.1));
            assert!(robot.pose.y_m.abs() < 0.011 && robot.pose.heading_rad.abs() < 0.037, "{:?}", robot.pose);
        }
    }
}

#[test]
fn what_the_sensor_sees_ahead_limits_the_speed_all_the_same() {
    let speed_mps = |front_m: f32| {
        let (mut robot, word) = ordered(Some(way(5.0)), front_m);
        for _ in 0..100 {
            let _ = robot.step(word, wish(0.3, 0.3));
        }
        robot.rims.left_mps
    };
    assert!((speed_mps(2.0) - 0.3).abs() < 1e-9);
    // 0.220 s until the wheels are told, then 0.8 m/s².
    assert!((speed_mps(0.05) - 0.157).abs() < 0.002, "{}", speed_mps(0.05));
    assert!((speed_mps(0.0) - 0.041).abs() < 0.002, "{}", speed_mps(0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Random walls, and commands at random for random times: the hull never comes nearer than it should.
    #[test]
    fn whatever_a_controller_asks_the_hull_touches_nothing(
        walls in prop::collection::vec(((-1.5..1.5_f64, -1.5..1.5_f64), (-1.5..1.5_f64, -1.5..1.5_f64)), 1..6),
        commands in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, 1_usize..60), 1..40),
    ) {
        let mut robot = Robot::new(Params::default());
        let things: Vec<_> = walls.into_iter().flat_map(|(from, to)| wall(from, to)).collect();
        let hull = robot.driver.hull;
        robot.things = things.into_iter().filter(|thing| hull.distance_to_m(*thing) > 0.085).collect();
        for (left, right, steps) in commands {
            for _ in 0..steps {
                robot.step(go(), wish(left, right));
                prop_assert!(robot.room_m() > 0.055, "{} m at {:?}", robot.room_m(), robot.pose);
            }
        }
    }
}
