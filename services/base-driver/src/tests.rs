use super::*;
use geometry::Pose2;
use messages::{Face, Message, View, WorldTruth};
use proptest::prelude::*;

const STEP_MS: u64 = 20;
const NOW_MS: u64 = 10_000;

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn go() -> Clearance {
    Clearance { signal: Verdict::Go.into(), reason: GuardReasonName::Clear.into(), ..Clearance::default() }
}

fn stop(faces: u32) -> Clearance {
    let reason = GuardReasonName::Violation.into();
    Clearance { signal: Verdict::Stop.into(), reason, violated_faces: faces, ..Clearance::default() }
}

fn wish(left_mps: f64, right_mps: f64) -> WheelSpeeds {
    WheelSpeeds { left_mps, right_mps }
}

/// A driver that has been driving at 0.3 m/s for a second, one period before `NOW_MS`.
fn driving() -> BaseDriver {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    let (word, wish) = (go(), wish(0.3, 0.3));
    for step in (1..=50).rev() {
        let now = at(NOW_MS - step * STEP_MS);
        let (clearance, desired) = (Some(Stamped::new(now, &word)), Some(Stamped::new(now, &wish)));
        driver.step(now, Inputs { clearance, desired, travel: Some(WheelTravel::default()) });
    }
    assert!((driver.applied.left_mps - 0.3).abs() < 1e-9);
    driver
}

/// What a driving driver does with a word and a wish of these ages.
fn outcome(word: Clearance, word_age_ms: i64, wish: WheelSpeeds, wish_age_ms: i64) -> AppliedWheels {
    let stamp = |age_ms: i64| at(u64::try_from(NOW_MS as i64 - age_ms).unwrap());
    let clearance = Some(Stamped::new(stamp(word_age_ms), &word));
    let desired = Some(Stamped::new(stamp(wish_age_ms), &wish));
    driving().step(at(NOW_MS), Inputs { clearance, desired, travel: Some(WheelTravel::default()) }).applied
}

#[track_caller]
fn check(word: Clearance, word_age_ms: i64, wished: (f64, f64), wish_age_ms: i64, expected: DriveReasonName) {
    let applied = outcome(word, word_age_ms, wish(wished.0, wished.1), wish_age_ms);
    assert_eq!(applied.reason, expected);
    let turning = (applied.left_mps, applied.right_mps) != (0.0, 0.0);
    assert_eq!(turning, moves(expected), "{applied:?}");
}

#[test]
fn truth_table() {
    use DriveReasonName::{
        Driving, Escaping, GuardStop, InvalidCommand, InvalidGuard, StaleCommand, StaleGuard,
    };
    let front = Face::Front as u32;
    check(go(), 0, (0.3, 0.3), 0, Driving);
    check(go(), 100, (0.3, 0.3), 100, Driving);
    check(go(), 101, (0.3, 0.3), 0, StaleGuard);
    check(go(), 0, (0.3, 0.3), 101, StaleCommand);
    check(go(), 101, (0.3, 0.3), 101, StaleGuard);
    check(go(), -5, (0.3, 0.3), -5, Driving);
    check(go(), -5000, (0.3, 0.3), 0, StaleGuard);
    check(go(), 0, (0.3, 0.3), -5000, StaleCommand);
    check(go(), 0, (f64::NAN, 0.3), 0, InvalidCommand);
    check(go(), 0, (0.3, f64::NAN), 0, InvalidCommand);
    check(go(), 0, (f64::INFINITY, 0.3), 0, InvalidCommand);
    check(go(), 0, (0.3, f64::NEG_INFINITY), 0, InvalidCommand);
    check(go(), 0, (1.01, 0.3), 0, InvalidCommand);
    check(go(), 0, (0.3, -1.01), 0, InvalidCommand);
    check(go(), 0, (1.0, -1.0), 0, Driving);
    check(go(), 0, (-0.5, -0.5), 0, Driving);
    check(stop(front), 0, (0.3, 0.3), 0, GuardStop);
    check(stop(front), 0, (0.0, 0.1), 0, GuardStop);
    check(stop(front), 0, (f64::NAN, f64::NAN), 0, GuardStop);
    check(stop(front), 0, (-0.1, -0.1), 0, Escaping);
    check(stop(front), 0, (-0.12, -0.05), 0, Escaping);
    check(stop(front), 0, (-0.121, -0.05), 0, GuardStop);
    check(stop(front), 0, (-0.1, 0.01), 0, GuardStop);
    check(stop(front), 0, (-0.1, f64::NAN), 0, GuardStop);
    check(stop(front), 0, (-0.1, -0.1), 101, GuardStop);
    check(stop(front), 101, (-0.1, -0.1), 0, StaleGuard);
    check(stop(0), 0, (-0.1, -0.1), 0, GuardStop);
    check(stop(Face::Left as u32), 0, (-0.1, -0.1), 0, GuardStop);
    check(stop(front | Face::Right as u32), 0, (-0.1, -0.1), 0, GuardStop);
    check(Clearance { signal: messages::GuardSignal(2), ..go() }, 0, (0.3, 0.3), 0, InvalidGuard);
    check(Clearance { reason: messages::GuardReason(77), ..go() }, 0, (0.3, 0.3), 0, InvalidGuard);
    check(Clearance { violated_faces: front, ..go() }, 0, (0.3, 0.3), 0, InvalidGuard);
    check(Clearance { front_m: f32::NAN, ..go() }, 0, (0.3, 0.3), 0, Driving);
    let blind = Clearance { reason: GuardReasonName::SensorFault.into(), ..stop(front) };
    check(blind, 0, (-0.1, -0.1), 0, GuardStop);
    check(Clearance { reason: GuardReasonName::Stale.into(), ..stop(front) }, 0, (-0.1, -0.1), 0, GuardStop);
    check(
        Clearance { reason: GuardReasonName::Remembered.into(), ..stop(front) },
        0,
        (-0.1, -0.1),
        0,
        Escaping,
    );
    check(Clearance::default(), 0, (0.3, 0.3), 0, GuardStop);
}

#[test]
fn begins_at_rest_and_stays_there_without_inputs() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    assert_eq!(driver.applied, AppliedWheels::default());
    let applied = driver.step(at(1), Inputs::default()).applied;
    assert_eq!(
        applied,
        AppliedWheels { reason: DriveReasonName::StaleGuard.into(), ..AppliedWheels::default() }
    );
}

#[test]
fn silent_motors_are_a_fault() {
    let (word, wished) = (go(), wish(0.3, 0.3));
    let inputs = |travel| Inputs {
        clearance: Some(Stamped::new(at(NOW_MS), &word)),
        desired: Some(Stamped::new(at(NOW_MS), &wished)),
        travel,
    };
    let broken = WheelTravel { left_m: f64::NAN, right_m: 0.0 };
    for travel in [None, Some(broken)] {
        let outputs = driving().step(at(NOW_MS), inputs(travel));
        assert_eq!(outputs.applied.reason, DriveReasonName::DeviceFault);
        assert_eq!((outputs.applied.left_mps, outputs.odometry), (0.0, None));
    }
}

#[test]
fn a_device_not_heard_for_its_deadline_does_not_answer() {
    let mut device = SimulatedBase::new(Duration::from_millis(100));
    assert_eq!(device.travel(at(5)), Err(DeviceError::NeverHeard));
    let truth = WorldTruth { left_travel_m: 1.5, right_travel_m: 2.5, ..WorldTruth::default() };
    device.see(Some(Stamped::new(at(1000), &truth)));
    device.see(None);
    assert_eq!(device.travel(at(1100)), Ok(WheelTravel { left_m: 1.5, right_m: 2.5 }));
    assert_eq!(device.travel(at(1101)), Err(DeviceError::Silent { silent_ms: 101 }));
}

#[test]
fn one_late_stretch_is_one_miss() {
    let (word, wished) = (go(), wish(0.3, 0.3));
    let mut driver = driving();
    let mut step = |now_ms: u64, heard_ms: u64| {
        let (clearance, desired) = (Stamped::new(at(heard_ms), &word), Stamped::new(at(heard_ms), &wished));
        let travel = Some(WheelTravel::default());
        driver.step(at(now_ms), Inputs { clearance: Some(clearance), desired: Some(desired), travel }).applied
    };
    assert_eq!(step(10_000, 10_000).deadline_misses, 0);
    assert_eq!(step(10_120, 10_000).deadline_misses, 1);
    assert_eq!(step(10_140, 10_000).deadline_misses, 1);
    assert_eq!(step(10_160, 10_160).deadline_misses, 1);
    assert_eq!(step(10_300, 10_160).deadline_misses, 2);
}

#[test]
fn a_silence_before_the_first_go_is_no_miss() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    for ms in 0..500 {
        assert_eq!(driver.step(at(ms), Inputs::default()).applied.deadline_misses, 0);
    }
}

#[test]
fn an_escape_ends_after_its_distance_and_a_go_allows_another() {
    let (blocked, free, back) = (stop(Face::Front as u32), go(), wish(-0.1, -0.1));
    let mut driver = driving();
    let mut now_ms = NOW_MS;
    let mut reason = |word: &Clearance, went_m: f64| {
        now_ms += STEP_MS;
        let clearance = Some(Stamped::new(at(now_ms), word));
        let desired = Some(Stamped::new(at(now_ms), &back));
        let travel = Some(WheelTravel { left_m: -went_m, right_m: -went_m });
        driver.step(at(now_ms), Inputs { clearance, desired, travel }).applied.reason.get().unwrap()
    };
    assert_eq!(reason(&blocked, 5.00), DriveReasonName::Escaping);
    assert_eq!(reason(&blocked, 5.34), DriveReasonName::Escaping);
    assert_eq!(reason(&blocked, 5.351), DriveReasonName::GuardStop);
    assert_eq!(reason(&blocked, 5.36), DriveReasonName::GuardStop);
    assert_eq!(reason(&free, 5.36), DriveReasonName::Driving);
    assert_eq!(reason(&blocked, 5.36), DriveReasonName::Escaping);
    assert_eq!(reason(&blocked, 5.70), DriveReasonName::Escaping);
    assert_eq!(reason(&blocked, 5.711), DriveReasonName::GuardStop);
}

#[test]
fn an_escape_can_be_forbidden() {
    let mut driver = BaseDriver::new(Params { allow_escape: false, ..Params::default() }).unwrap();
    let (blocked, back) = (stop(Face::Front as u32), wish(-0.1, -0.1));
    let clearance = Some(Stamped::new(at(5), &blocked));
    let desired = Some(Stamped::new(at(5), &back));
    let inputs = Inputs { clearance, desired, travel: Some(WheelTravel::default()) };
    assert_eq!(driver.step(at(5), inputs).applied.reason, DriveReasonName::GuardStop);
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

#[test]
fn a_pause_is_no_reason_to_jump() {
    let (word, wished) = (go(), wish(0.9, 0.9));
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    for ms in [0, 60_000] {
        let clearance = Some(Stamped::new(at(ms), &word));
        let desired = Some(Stamped::new(at(ms), &wished));
        let inputs = Inputs { clearance, desired, travel: Some(WheelTravel::default()) };
        let applied = driver.step(at(ms), inputs).applied;
        assert!(applied.left_mps <= 0.6 * 0.020 + 1e-12, "{applied:?}");
    }
}

/// Drives wheels along `speeds` for a time and compares the odometry with the arc in closed form.
#[track_caller]
fn check_arc(left_mps: f64, right_mps: f64, seconds: f64) {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    let steps = (seconds / 0.020).round() as u64;
    let mut last = Odometry::default();
    for step in 0..=steps {
        let t = step as f64 * 0.020;
        // The encoders of a robot that has been on for a while do not begin at zero; its odometry does.
        let travel = Some(WheelTravel { left_m: 7.0 + left_mps * t, right_m: -3.0 + right_mps * t });
        last = driver.step(at(step * STEP_MS), Inputs { travel, ..Inputs::default() }).odometry.expect("due");
    }
    let expected = Pose2::IDENTITY
        .after_arc(0.5 * (left_mps + right_mps) * seconds, (right_mps - left_mps) / 0.40 * seconds);
    let pose = last.pose().unwrap();
    assert!(pose.distance_m(expected) < 1e-9, "{pose:?} instead of {expected:?}");
    assert!(geometry::angle::difference(pose.heading_rad, expected.heading_rad).abs() < 1e-9);
    assert!((last.left_travel_m - left_mps * seconds).abs() < 1e-9);
    assert!((last.forward_mps - 0.5 * (left_mps + right_mps)).abs() < 1e-9);
    assert!((last.turn_rad_per_s - (right_mps - left_mps) / 0.40).abs() < 1e-9);
}

#[test]
fn odometry_follows_arcs_exactly() {
    check_arc(0.3, 0.3, 5.0);
    check_arc(0.2, 0.3, 7.0);
    check_arc(-0.1, 0.1, 3.0);
    check_arc(-0.3, -0.2, 4.0);
    check_arc(0.0, 0.0, 1.0);
}

#[test]
fn encoders_that_begin_anew_do_not_move_the_odometry() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    let mut odometry = |step: u64, left_m: f64| {
        let travel = Some(WheelTravel { left_m, right_m: left_m });
        driver.step(at(step * STEP_MS), Inputs { travel, ..Inputs::default() }).odometry.expect("due")
    };
    assert_eq!(odometry(0, 0.0), Odometry::default());
    assert!((odometry(1, 0.01).x_m - 0.01).abs() < 1e-12);
    assert!((odometry(2, -900.0).x_m - 0.01).abs() < 1e-12);
    assert!((odometry(3, -899.99).x_m - 0.02).abs() < 1e-9);
}

#[test]
fn odometry_comes_at_fifty_hertz_whatever_the_steps() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    let travel = Some(WheelTravel::default());
    // The last of them may come a little early.
    let count =
        (0..990).filter(|&ms| driver.step(at(ms), Inputs { travel, ..Inputs::default() }).odometry.is_some());
    assert_eq!(count.count(), 50);
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = BaseDriver::new(params).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    refuse(Params { period_ms: 0, ..Params::default() }, "period_ms = 0");
    refuse(Params { guard_deadline_ms: 5, ..Params::default() }, "guard_deadline_ms = 5");
    refuse(Params { command_deadline_ms: 19, ..Params::default() }, "command_deadline_ms = 19");
    refuse(Params { max_wheel_speed_mps: f64::NAN, ..Params::default() }, "max_wheel_speed_mps = NaN");
    refuse(Params { wheel_track_m: 0.0, ..Params::default() }, "wheel_track_m = 0");
    refuse(
        Params { escape_speed_mps: 0.2, max_wheel_speed_mps: 0.1, ..Params::default() },
        "lower the first",
    );
}

#[test]
fn leaving_stops_the_wheels() {
    let mut driver = driving();
    let applied = driver.leave();
    assert_eq!((applied.left_mps, applied.right_mps), (0.0, 0.0));
    assert_eq!(applied.reason, DriveReasonName::ShuttingDown);
}

fn bytes<T: Message>() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(any::<u8>(), size_of::<T>())
}

/// A message from arbitrary bytes, some of its words made plausible so that a command passes now and then.
fn parsed<T: Message + Default>(bytes: &[u8]) -> T {
    let mut message = T::default();
    message.as_mut_bytes().copy_from_slice(bytes);
    *View::<T>::parse(message.as_bytes()).unwrap().message
}

proptest! {
    /// Any bytes on any of the three topics: the wheels rest, or carry out a command within the limits and with a reason.
    #[test]
    fn whatever_comes_the_wheels_rest_or_obey_within_limits(
        words in proptest::collection::vec((bytes::<Clearance>(), bytes::<WheelSpeeds>(), any::<[u8; 16]>(), 0u8..8, 0u64..200), 1..40),
    ) {
        let params = Params::default();
        let mut driver = BaseDriver::new(params.clone()).unwrap();
        let mut now_ms = 1000;
        let mut before = AppliedWheels::default();
        for (word, wished, travel, plausible, age_ms) in words {
            now_ms += STEP_MS;
            let mut word: Clearance = parsed(&word);
            let mut wished: WheelSpeeds = parsed(&wished);
            let [left_m, right_m] = [&travel[..8], &travel[8..]].map(|raw| f64::from_le_bytes(raw.try_into().unwrap()));
            if plausible & 1 != 0 { word = Clearance { signal: messages::GuardSignal(word.signal.0 & 1), reason: GuardReasonName::Violation.into(), violated_faces: word.violated_faces & 1, ..word } }
            if plausible & 2 != 0 { wished = WheelSpeeds { left_mps: wished.left_mps.sin(), right_mps: wished.right_mps.sin() } }
            if plausible & 4 != 0 { wished = WheelSpeeds { left_mps: -0.13 * wished.left_mps.sin().abs(), right_mps: -0.13 * wished.right_mps.sin().abs() } }
            let stamp = at(now_ms - age_ms);
            let inputs = Inputs {
                clearance: Some(Stamped::new(stamp, &word)),
                desired: Some(Stamped::new(stamp, &wished)),
                travel: Some(WheelTravel { left_m, right_m }),
            };
            let outputs = driver.step(at(now_ms), inputs);
            let applied = outputs.applied;
            let reason = applied.reason.get().unwrap();
            for (applied_mps, wished_mps, before_mps) in
                [(applied.left_mps, wished.left_mps, before.left_mps), (applied.right_mps, wished.right_mps, before.right_mps)]
            {
                prop_assert!(applied_mps.is_finite() && applied_mps.abs() <= params.max_wheel_speed_mps);
                if moves(reason) {
                    prop_assert!(age_ms <= 100);
                    prop_assert!(applied_mps.abs() <= wished_mps.abs() && applied_mps * wished_mps >= 0.0);
                    prop_assert!(applied_mps.abs() <= before_mps.abs() + 0.6 * 0.020 + 1e-12);
                } else {
                    prop_assert!(applied_mps == 0.0);
                }
                if reason == DriveReasonName::Driving { prop_assert!(word.signal == Verdict::Go); }
                if reason == DriveReasonName::Escaping { prop_assert!((-0.12..=0.0).contains(&applied_mps)); }
            }
            if let Some(odometry) = outputs.odometry { prop_assert!(odometry.pose().is_ok()); }
            before = applied;
        }
    }
}

#[test]
fn a_successor_goes_on_with_the_odometry_of_its_predecessor() {
    let step = |driver: &mut BaseDriver, ms: u64, left_m: f64| {
        let travel = Some(WheelTravel { left_m, right_m: left_m });
        driver.step(at(ms), Inputs { travel, ..Inputs::default() }).odometry
    };
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    assert_eq!(driver.snapshot(), None);
    step(&mut driver, 0, 7.0);
    step(&mut driver, 1000, 7.5);
    let snapshot = driver.snapshot().expect("it has read its encoders");
    // The robot rolled on by 30 mm before anybody looked again.
    let mut successor = BaseDriver::new(Params::default()).unwrap();
    successor.restore(&snapshot);
    let odometry = step(&mut successor, 1500, 7.53).expect("due");
    assert!((odometry.x_m - 0.53).abs() < 1e-12, "{odometry:?}");
    assert_eq!(odometry.forward_mps, 0.0);
    assert_eq!(successor.applied.reason, DriveReasonName::StaleGuard);
    // Encoders that lost power meanwhile tell nothing.
    let mut successor = BaseDriver::new(Params::default()).unwrap();
    successor.restore(&snapshot);
    assert!((step(&mut successor, 1500, 0.0).expect("due").x_m - 0.5).abs() < 1e-12);
}
