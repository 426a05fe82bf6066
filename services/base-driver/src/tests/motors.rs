//! Motors and encoders that do what they should not.

use super::*;

#[test]
fn silent_motors_are_a_fault() {
    let (word, wished) = (go(), wish(0.3, 0.3));
    let broken = Encoders { taken: at(10_000), travel: WheelTravel { left_m: f64::NAN, right_m: 0.0 } };
    for encoders in [None, Some(broken)] {
        let mut robot = Robot::driving();
        let now = at(robot.now_ms);
        let inputs = Inputs {
            clearance: Some(Stamped::new(now, &word)),
            desired: Some(Stamped::new(now, &wished)),
            order: None,
            encoders,
        };
        let outputs = robot.driver.step(now, inputs);
        assert_eq!(outputs.applied.reason, DriveReasonName::DeviceFault);
        assert_eq!((outputs.applied.left_mps, outputs.odometry), (0.0, None));
    }
}

#[test]
fn a_device_not_heard_for_its_deadline_does_not_answer() {
    let mut device = SimulatedBase::new(Duration::from_millis(100));
    assert_eq!(device.encoders(at(5)), Err(DeviceError::NeverHeard));
    let truth = WorldTruth { left_travel_m: 1.5, right_travel_m: 2.5, ..WorldTruth::default() };
    device.see(Some(Stamped::new(at(1000), &truth)));
    device.see(None);
    let travel = WheelTravel { left_m: 1.5, right_m: 2.5 };
    assert_eq!(device.encoders(at(1100)), Ok(Encoders { taken: at(1000), travel }));
    assert_eq!(device.encoders(at(1101)), Err(DeviceError::Silent { silent_ms: 101 }));
}

#[track_caller]
fn gains(present_mps: f64, wanted_mps: f64, expected_mps: f64) {
    let applied_mps = gain_at_most(present_mps, wanted_mps, 0.012);
    assert!((applied_mps - expected_mps).abs() < 1e-12, "{applied_mps}");
}

#[test]
fn only_gains_of_speed_are_limited() {
    gains(0.0, 0.3, 0.012);
    gains(0.1, 0.3, 0.112);
    gains(0.1, 0.105, 0.105);
    gains(0.3, 0.1, 0.1);
    gains(0.3, 0.0, 0.0);
    gains(0.3, -0.3, -0.012);
    gains(-0.3, -0.1, -0.1);
    gains(-0.1, -0.3, -0.112);
}

/// The first word after a pause in which the motors' watchdog has slowed the wheels, or stopped them: no
/// faster than the motors have been left with and a step of gain; and so with every word from then on.
#[track_caller]
fn check_pause(pause_ms: u64) {
    let mut robot = Robot::driving();
    let asleep_ms = pause_ms - STEP_MS;
    for passed_ms in (0..asleep_ms).step_by(STEP_MS as usize) {
        // The last word holds until the watchdog knows better.
        robot.turn_wheels(if passed_ms < 100 { wish(0.3, 0.3) } else { WheelSpeeds::ZERO });
    }
    robot.now_ms += asleep_ms;
    let mut motors_mps = robot.rims.left_mps;
    for step in 0..10 {
        let applied = robot.step(go(), wish(0.3, 0.3));
        // What the watchdog knows and what the driver assumes differs by one step.
        let most_mps = motors_mps + 0.6 * 0.020 + if step == 0 { CHANGE_MPS } else { 0.6 * 0.020 };
        assert!(applied.left_mps <= most_mps + 1e-9, "step {step}: {} of {most_mps}", applied.left_mps);
        motors_mps = applied.left_mps.max(robot.rims.left_mps);
    }
    assert!(robot.rims.left_mps > 0.05, "it gets going again");
}

#[test]
fn after_a_pause_it_begins_with_what_the_motors_do() {
    for pause_ms in [40, 60, 100, 200, 300, 400, 600, 900, 60_000] {
        check_pause(pause_ms);
    }
}

#[test]
fn a_successor_begins_with_what_the_motors_do() {
    let mut robot = Robot::driving();
    let snapshot = robot.driver.snapshot().unwrap();
    robot.driver = BaseDriver::new(Params::default()).unwrap();
    robot.driver.restore(&snapshot);
    let first = robot.step(go(), wish(0.3, 0.3));
    assert!(first.left_mps <= 0.012 + 1e-12, "nobody knows yet: {first:?}");
    let second = robot.step(go(), wish(0.3, 0.3));
    assert!((0.25..=0.3).contains(&second.left_mps), "the wheels still turn: {second:?}");
    let third = robot.step(go(), wish(-0.3, -0.3));
    assert!((-0.0121..=0.0).contains(&third.left_mps), "no jump to the other side: {third:?}");
}

#[test]
fn motors_that_do_not_follow_are_not_told_more_and_more() {
    let mut robot = Robot::new(Params::default());
    let mut most_mps = 0.0_f64;
    for _ in 0..20 {
        most_mps = most_mps.max(robot.step(go(), wish(0.3, 0.3)).left_mps);
        // A stalled wheel: nothing turns.
        (robot.rims, robot.travel) = (WheelSpeeds::ZERO, WheelTravel::default());
    }
    assert!(most_mps <= 0.11, "{most_mps}");
}

/// What the driver says of encoders that show so much of the left wheel's way and so much of the right one's.
#[track_caller]
fn check_following(shown: [f64; 2], seconds: f64, expected: DriveReasonName) {
    let mut robot = Robot::driving();
    let mut shown_travel = robot.travel;
    let mut reason = DriveReasonName::Driving;
    for _ in 0..(seconds * 50.0) as u32 {
        let before = robot.travel;
        let real = std::mem::replace(&mut robot.travel, shown_travel);
        reason = robot.step(go(), wish(0.3, 0.3)).reason.get().unwrap();
        let (left_m, right_m) =
            (robot.travel.left_m - shown_travel.left_m, robot.travel.right_m - shown_travel.right_m);
        robot.travel = WheelTravel { left_m: real.left_m + left_m, right_m: real.right_m + right_m };
        shown_travel.left_m += shown[0] * (robot.travel.left_m - before.left_m);
        shown_travel.right_m += shown[1] * (robot.travel.right_m - before.right_m);
    }
    assert_eq!(reason, expected);
}

#[test]
fn encoders_that_do_not_show_what_the_wheels_are_told_stop_them() {
    use DriveReasonName::{DeviceFault, Driving};
    check_following([1.0, 1.0], 3.0, Driving);
    check_following([0.0, 0.0], 0.4, Driving);
    check_following([0.0, 0.0], 1.5, DeviceFault);
    check_following([1.0, 0.0], 1.5, DeviceFault);
    check_following([0.0, 1.0], 1.5, DeviceFault);
    check_following([-1.0, 1.0], 1.5, DeviceFault);
}

#[test]
fn wheels_that_did_not_follow_try_again_after_a_rest() {
    let mut robot = Robot::new(Params::default());
    let mut stalled = |wished: WheelSpeeds| {
        let reason = robot.step(go(), wished).reason.get().unwrap();
        (robot.rims, robot.travel) = (WheelSpeeds::ZERO, WheelTravel::default());
        reason
    };
    let reasons: Vec<_> = (0..60).map(|_| stalled(wish(0.3, 0.3))).collect();
    assert_eq!(reasons.last(), Some(&DriveReasonName::DeviceFault));
    assert_eq!(stalled(wish(0.3, 0.3)), DriveReasonName::DeviceFault);
    assert_eq!(stalled(WheelSpeeds::ZERO), DriveReasonName::Driving);
    assert_eq!(stalled(wish(0.3, 0.3)), DriveReasonName::Driving);
}

#[test]
fn encoders_that_jump_stop_the_wheels_for_a_moment_and_make_the_trail_worthless() {
    let mut robot = Robot::driving();
    robot.travel.left_m += 3.0;
    let reasons: Vec<_> = (0..20).map(|_| robot.step(go(), wish(0.3, 0.3)).reason.get().unwrap()).collect();
    assert!(reasons[..10].iter().all(|reason| *reason == DriveReasonName::DeviceFault), "{reasons:?}");
    assert_eq!(reasons[12..], [DriveReasonName::Driving; 8]);
    let mut robot = Robot::driving();
    for _ in 0..30 {
        robot.step(go(), WheelSpeeds::ZERO);
    }
    robot.travel.right_m -= 900.0;
    for _ in 0..15 {
        robot.step(go(), WheelSpeeds::ZERO);
    }
    let here = robot.pose;
    for _ in 0..100 {
        robot.step(go(), wish(-0.1, -0.1));
    }
    assert!(robot.pose.distance_m(here) < 0.012, "{here:?}, {:?}", robot.pose);
}
