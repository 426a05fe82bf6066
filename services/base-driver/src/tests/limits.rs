//! How fast the robot may be, and which parameters could not be safe.

use super::*;
use crate::speed::{ahead_mps, curving_mps, fastest_mps, slowed, stopping_way_m};

/// The speeds that a guard's word allows ahead.
#[track_caller]
fn check_fastest(radius_m: f32, max_age_ms: u32, expected_mps: f64) {
    let word = Clearance { front_radius_m: radius_m, max_age_ms, ..go() };
    let mps = ahead_mps(&Params::default(), &word, radius_m).unwrap_or(0.0);
    assert!((mps - expected_mps).abs() < 0.001, "{mps}");
}

#[test]
fn the_guards_radius_and_the_age_of_its_readings_limit_the_speed() {
    // 0.8 m/s², and 0.120 s until a silent guard is noticed.
    check_fastest(0.2, 150, 0.3895);
    check_fastest(0.2, 300, 0.3218);
    check_fastest(0.05, 150, 0.1396);
    check_fastest(0.35, 150, 0.5632);
    check_fastest(0.0, 150, 0.0);
    check_fastest(0.2, u32::MAX, 0.0);
}

#[test]
fn a_robot_of_that_speed_just_stops_in_time() {
    for (way_m, reaction_s, deceleration) in [(0.2, 0.27, 0.8), (0.01, 0.2, 0.3), (3.0, 0.0, 5.0)] {
        let mps = fastest_mps(way_m, reaction_s, deceleration);
        assert!((stopping_way_m(mps, reaction_s, deceleration) - way_m).abs() < 1e-12);
    }
    assert_eq!(fastest_mps(-1.0, 0.2, 0.8), 0.0);
}

/// What comes of a wish: the wheels, after a second of it.
#[track_caller]
fn check_held(wished: (f64, f64), left_mps: f64, right_mps: f64) {
    let mut robot = Robot::driving();
    let mut applied = AppliedWheels::default();
    for _ in 0..75 {
        applied = robot.step(go(), wish(wished.0, wished.1));
    }
    assert!((applied.left_mps - left_mps).abs() < 1e-3, "{applied:?}");
    assert!((applied.right_mps - right_mps).abs() < 1e-3, "{applied:?}");
}

#[test]
fn whatever_is_asked_the_curve_is_the_same_and_no_corner_too_fast() {
    check_held((0.3, 0.3), 0.3, 0.3);
    check_held((1.0, 1.0), 0.36, 0.36);
    // A straight way is as fast as the sensors in front allow; a wide curve too, and a narrow one is slower.
    check_held((0.33, 0.36), 0.33, 0.36);
    check_held((0.5, 1.0), 0.0861, 0.1722);
    // On the spot the corners, 0.398 m away, must not be faster than 0.39 m/s either.
    check_held((-1.0, 1.0), -0.1959, 0.1959);
    check_held((-0.2, 0.2), -0.1959, 0.1959);
    // Back it goes slowly.
    check_held((-1.0, -1.0), -0.1, -0.1);
    check_held((-0.05, -0.05), -0.05, -0.05);
}

proptest! {
    /// What the sensors beside the robot and in front of it do not see is met slowly: the corner that goes
    /// aside in a curve stands before it has come 3 cm aside, as it goes no faster than the robot in all but
    /// the narrowest curves.
    #[test]
    fn a_corner_comes_aside_by_no_more_than_it_may(left in 0.05..3.0_f64, right in 0.05..3.0_f64, reaction_s in 0.01..0.5_f64) {
        let (hull, track_m) = (Params::default().hull(), 0.4);
        let curving_mps = curving_mps(wish(left, right), &hull, track_m, reaction_s, 0.8).min(10.0);
        let speeds = slowed(wish(left, right), &hull, track_m, [9.0, curving_mps, 9.0, 9.0]);
        let (forward, turn) = (0.5 * (speeds.left_mps + speeds.right_mps), (speeds.right_mps - speeds.left_mps) / track_m);
        let (aside, along) = (turn.abs() * hull.front_m, forward - turn.abs() * hull.side_m);
        let way_m = stopping_way_m(forward, reaction_s, 0.8);
        prop_assert!(way_m * aside / aside.hypot(along).max(1e-9) <= 0.03 + 1e-9);
    }

    #[test]
    fn slowed_motions_keep_their_curve_and_every_limit(left in -3.0..3.0_f64, right in -3.0..3.0_f64) {
        let (hull, track_m) = (Params::default().hull(), 0.4);
        let speeds = slowed(wish(left, right), &hull, track_m, [0.39, 0.39, 0.1, 0.36]);
        let (forward, turn) = (0.5 * (speeds.left_mps + speeds.right_mps), (speeds.right_mps - speeds.left_mps) / track_m);
        prop_assert!(hull.fastest_corner_mps(forward, turn) <= 0.39 + 1e-9);
        prop_assert!((-0.1 - 1e-9..=0.39 + 1e-9).contains(&forward));
        prop_assert!(speeds.left_mps.abs() <= 0.36 + 1e-9 && speeds.right_mps.abs() <= 0.36 + 1e-9);
        prop_assert!((speeds.left_mps * right - speeds.right_mps * left).abs() < 1e-9);
    }
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = BaseDriver::new(params).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    let default = Params::default;
    refuse(Params { period_ms: 0, ..default() }, "`period_ms` is 0");
    refuse(Params { guard_deadline_ms: 5, ..default() }, "`guard_deadline_ms` is 5");
    refuse(Params { command_deadline_ms: 19, ..default() }, "command_deadline_ms = 19");
    refuse(
        Params { max_wheel_speed_mps: f64::NAN, ..default() },
        "`max_wheel_speed_mps` is not a finite number",
    );
    refuse(Params { wheel_track_m: 0.0, ..default() }, "`wheel_track_m` is 0");
    refuse(Params { hull_side_m: f64::NAN, ..default() }, "`hull_side_m` is not a finite number");
    refuse(Params { reverse_speed_mps: 0.5, ..default() }, "`reverse_speed_mps` is 0.5");
    refuse(Params { max_speed_up_m_per_s2: 1.0, ..default() }, "is above deceleration_m_per_s2 = 0.8");
    refuse(
        Params { motor_watchdog_ms: 20, ..default() },
        "motor_watchdog_ms = 20 is not above period_ms = 20",
    );
}

#[test]
fn refuses_a_speed_from_which_the_robot_cannot_stop_with_what_would_do() {
    let text = "at top_speed_mps = 0.5 the robot needs 0.291 m to stop (0.27 s until the wheels are told, then 0.8 m/s²), but the \
                guard watches front_radius_m = 0.2 m; lower top_speed_mps to 0.39, raise front_radius_m to 0.291";
    let fast = Params { top_speed_mps: 0.5, ..Params::default() };
    refuse(fast.clone(), text);
    refuse(Params { deceleration_m_per_s2: 0.6, ..Params::default() }, "needs 0.205 m to stop");
    refuse(Params { guard_deadline_ms: 500, ..Params::default() }, "0.67 s until");
    refuse(Params { max_age_ms: 1000, ..Params::default() }, "1.12 s until");
    refuse(Params { front_radius_m: 0.05, ..Params::default() }, "lower top_speed_mps to 0.14");
    Params { front_radius_m: 0.3, ..fast.clone() }.check().unwrap();
    // Where the radius is not what the speed is worked out from, it does not matter.
    Params { room: Room::Ordered, ..fast.clone() }.check().unwrap();
    Params { room: Room::Unchecked, ..fast }.check().unwrap();
}
