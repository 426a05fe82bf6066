use super::*;
use geometry::Pose2;
use messages::{Face, Message, MotionKindName, NearPoint, View, WorldTruth};
use proptest::prelude::*;

mod limits;
mod motors;
mod room;

const STEP_MS: u64 = 20;
/// What the simulated motors gain and lose in a step.
const CHANGE_MPS: f64 = 0.8 * 0.020;

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

/// The word of a guard that watches 0.2 m ahead and 0.05 m aside, and sees nothing.
fn go() -> Clearance {
    Clearance {
        signal: Verdict::Go.into(),
        reason: GuardReasonName::Clear.into(),
        front_m: f32::INFINITY,
        front_radius_m: 0.2,
        right_radius_m: 0.05,
        left_radius_m: 0.05,
        max_age_ms: 150,
        ..Clearance::default()
    }
}

fn stop(faces: u32) -> Clearance {
    let reason = GuardReasonName::Violation.into();
    Clearance { signal: Verdict::Stop.into(), reason, violated_faces: faces, ..go() }
}

fn wish(left_mps: f64, right_mps: f64) -> WheelSpeeds {
    WheelSpeeds { left_mps, right_mps }
}

fn way(distance_m: f64) -> MotionCommand {
    let kind = MotionKindName::Move.into();
    MotionCommand { command_id: 1, distance_m, kind, ..MotionCommand::default() }
}

fn turn(turn_rad: f64) -> MotionCommand {
    MotionCommand { command_id: 1, turn_rad, kind: MotionKindName::Turn.into(), ..MotionCommand::default() }
}

/// A driver with motors that do what they are told, and a guard that says where things are.
#[derive(Clone)]
struct Robot {
    driver: BaseDriver,
    now_ms: u64,
    rims: WheelSpeeds,
    travel: WheelTravel,
    /// Where it is, in the frame of odometry.
    pose: Pose2,
    /// Everything that there is, in the same frame.
    things: Vec<Point2<f64>>,
    /// What it was ordered, where that counts.
    order: Option<MotionCommand>,
}

impl Robot {
    fn new(params: Params) -> Self {
        Self {
            driver: BaseDriver::new(params).unwrap(),
            now_ms: 10_000,
            rims: WheelSpeeds::ZERO,
            travel: WheelTravel::default(),
            pose: Pose2::IDENTITY,
            things: Vec::new(),
            order: None,
        }
    }

    /// One that has driven straight on at 0.3 m/s for two seconds, and is at the origin now.
    fn driving() -> Self {
        let mut robot = Self::new(Params::default());
        for _ in 0..100 {
            robot.step(go(), wish(0.3, 0.3));
        }
        assert!((robot.rims.left_mps - 0.3).abs() < 1e-9, "{:?}", robot.rims);
        robot
    }

    fn encoders(&self) -> Encoders {
        Encoders { taken: at(self.now_ms), travel: self.travel }
    }

    fn near(&self) -> Vec<NearPoint> {
        let local = self.things.iter().map(|thing| self.pose.inverse_transform(*thing));
        local.map(|place| NearPoint { x_m: place.x as f32, y_m: place.y as f32 }).collect()
    }

    /// A period later: what the driver makes of the word and the wish, and the wheels of what they are told.
    fn step(&mut self, word: Clearance, wished: WheelSpeeds) -> AppliedWheels {
        self.now_ms += STEP_MS;
        let now = at(self.now_ms);
        let Pose2 { x_m, y_m, heading_rad } = self.pose;
        let word = Clearance { at_x_m: x_m, at_y_m: y_m, at_heading_rad: heading_rad, ..word };
        let near = self.near();
        let inputs = Inputs {
            clearance: Some(Stamped::with_elements(now, &word, &near)),
            desired: Some(Stamped::new(now, &wished)),
            order: self.order.as_ref().map(|order| Stamped::new(now, order)),
            encoders: Some(self.encoders()),
        };
        let applied = self.driver.step(now, inputs).applied;
        self.turn_wheels(wish(applied.left_mps, applied.right_mps));
        applied
    }

    fn turn_wheels(&mut self, told: WheelSpeeds) {
        let towards = |rim: f64, told: f64| rim + (told - rim).clamp(-CHANGE_MPS, CHANGE_MPS);
        let before = self.rims;
        self.rims = wish(towards(before.left_mps, told.left_mps), towards(before.right_mps, told.right_mps));
        let seconds = STEP_MS as f64 * 1e-3;
        let left_m = 0.5 * (before.left_mps + self.rims.left_mps) * seconds;
        let right_m = 0.5 * (before.right_mps + self.rims.right_mps) * seconds;
        self.travel.left_m += left_m;
        self.travel.right_m += right_m;
        let track_m = self.driver.params.wheel_track_m;
        self.pose = self.pose.after_arc(0.5 * (left_m + right_m), (right_m - left_m) / track_m);
    }

    /// From the hull to the nearest thing.
    fn room_m(&self) -> f64 {
        let hull = self.driver.hull;
        self.things.iter().map(|thing| hull.distance_m(self.pose, *thing)).fold(f64::INFINITY, f64::min)
    }
}

/// What a driving driver does with a word and a wish of these ages.
fn outcome(word: Clearance, word_age_ms: i64, wish: WheelSpeeds, wish_age_ms: i64) -> AppliedWheels {
    let mut robot = Robot::driving();
    robot.now_ms += STEP_MS;
    let stamp = |age_ms: i64| at(u64::try_from(robot.now_ms as i64 - age_ms).unwrap());
    let Pose2 { x_m, y_m, heading_rad } = robot.pose;
    let word = Clearance { at_x_m: x_m, at_y_m: y_m, at_heading_rad: heading_rad, ..word };
    let inputs = Inputs {
        clearance: Some(Stamped::new(stamp(word_age_ms), &word)),
        desired: Some(Stamped::new(stamp(wish_age_ms), &wish)),
        order: None,
        encoders: Some(robot.encoders()),
    };
    robot.driver.step(at(robot.now_ms), inputs).applied
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
        Driving, Escaping, GuardStop, InvalidCommand, InvalidGuard, NothingGuarded, StaleCommand, StaleGuard,
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
    check(stop(front), 0, (-1.0, -0.9), 0, Escaping);
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
    let because = |reason: GuardReasonName| Clearance { reason: reason.into(), ..stop(front) };
    check(because(GuardReasonName::SensorFault), 0, (-0.1, -0.1), 0, GuardStop);
    check(because(GuardReasonName::Stale), 0, (-0.1, -0.1), 0, GuardStop);
    check(because(GuardReasonName::Remembered), 0, (-0.1, -0.1), 0, Escaping);
    check(Clearance::default(), 0, (0.3, 0.3), 0, GuardStop);
    check(Clearance { front_radius_m: 0.0, ..go() }, 0, (0.3, 0.3), 0, NothingGuarded);
    check(Clearance { front_radius_m: f32::NAN, ..go() }, 0, (0.3, 0.3), 0, NothingGuarded);
    check(Clearance { front_radius_m: -1.0, ..go() }, 0, (0.3, 0.3), 0, NothingGuarded);
}

#[test]
fn a_guard_that_does_not_know_where_it_saw_what_it_saw_is_not_believed() {
    let mut robot = Robot::driving();
    robot.now_ms += STEP_MS;
    let (now, wished) = (at(robot.now_ms), wish(0.3, 0.3));
    let word = Clearance { at_x_m: f64::NAN, ..go() };
    let inputs = Inputs {
        clearance: Some(Stamped::new(now, &word)),
        desired: Some(Stamped::new(now, &wished)),
        order: None,
        encoders: Some(robot.encoders()),
    };
    assert_eq!(robot.driver.step(now, inputs).applied.reason, DriveReasonName::NoRoom);
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
fn one_late_stretch_is_one_miss() {
    let (word, wished) = (go(), wish(0.3, 0.3));
    let mut robot = Robot::driving();
    let begin_ms = robot.now_ms;
    let travel = robot.travel;
    let mut step = |after_ms: u64, heard_ms: u64| {
        let heard = at(begin_ms + heard_ms);
        let inputs = Inputs {
            clearance: Some(Stamped::new(heard, &word)),
            desired: Some(Stamped::new(heard, &wished)),
            order: None,
            encoders: Some(Encoders { taken: at(begin_ms + after_ms), travel }),
        };
        robot.driver.step(at(begin_ms + after_ms), inputs).applied
    };
    assert_eq!(step(20, 20).deadline_misses, 0);
    assert_eq!(step(140, 20).deadline_misses, 1);
    assert_eq!(step(160, 20).deadline_misses, 1);
    assert_eq!(step(180, 180).deadline_misses, 1);
    assert_eq!(step(320, 180).deadline_misses, 2);
}

#[test]
fn a_silence_before_the_first_go_is_no_miss() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    for ms in 0..500 {
        assert_eq!(driver.step(at(ms), Inputs::default()).applied.deadline_misses, 0);
    }
}

#[test]
fn leaving_stops_the_wheels() {
    let applied = Robot::driving().driver.leave();
    assert_eq!((applied.left_mps, applied.right_mps), (0.0, 0.0));
    assert_eq!(applied.reason, DriveReasonName::ShuttingDown);
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
        let travel = WheelTravel { left_m: 7.0 + left_mps * t, right_m: -3.0 + right_mps * t };
        last = look(&mut driver, step * STEP_MS, travel).expect("due");
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

/// A step in which only the encoders have something to say.
fn look(driver: &mut BaseDriver, ms: u64, travel: WheelTravel) -> Option<Odometry> {
    let encoders = Some(Encoders { taken: at(ms), travel });
    driver.step(at(ms), Inputs { encoders, ..Inputs::default() }).odometry
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
        look(&mut driver, step * STEP_MS, WheelTravel { left_m, right_m: left_m }).expect("due")
    };
    assert_eq!(odometry(0, 0.0), Odometry::default());
    assert!((odometry(1, 0.01).x_m - 0.01).abs() < 1e-12);
    assert!((odometry(2, -900.0).x_m - 0.01).abs() < 1e-12);
    assert!((odometry(3, -899.99).x_m - 0.02).abs() < 1e-9);
}

#[test]
fn odometry_comes_at_fifty_hertz_whatever_the_steps() {
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    // The last of them may come a little early.
    let count = (0..990).filter(|&ms| look(&mut driver, ms, WheelTravel::default()).is_some());
    assert_eq!(count.count(), 50);
}

#[test]
fn a_successor_goes_on_with_the_odometry_of_its_predecessor() {
    let both = |left_m: f64| WheelTravel { left_m, right_m: left_m };
    let mut driver = BaseDriver::new(Params::default()).unwrap();
    assert_eq!(driver.snapshot(), None);
    look(&mut driver, 0, both(7.0));
    look(&mut driver, 1000, both(7.5));
    let snapshot = driver.snapshot().expect("it has read its encoders");
    // The robot rolled on by 30 mm before anybody looked again.
    let mut successor = BaseDriver::new(Params::default()).unwrap();
    successor.restore(&snapshot);
    let odometry = look(&mut successor, 1500, both(7.53)).expect("due");
    assert!((odometry.x_m - 0.53).abs() < 1e-12, "{odometry:?}");
    assert_eq!(odometry.forward_mps, 0.0);
    assert_eq!(successor.applied.reason, DriveReasonName::StaleGuard);
    // Encoders that lost power meanwhile tell nothing.
    let mut successor = BaseDriver::new(Params::default()).unwrap();
    successor.restore(&snapshot);
    assert!((look(&mut successor, 1500, both(0.0)).expect("due").x_m - 0.5).abs() < 1e-12);
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
    /// Any bytes on any of the topics: the wheels rest, or carry out a command within the limits and with a
    /// reason.
    #[test]
    fn whatever_comes_the_wheels_rest_or_obey_within_limits(
        words in proptest::collection::vec((bytes::<Clearance>(), bytes::<WheelSpeeds>(), bytes::<MotionCommand>(), any::<[u8; 16]>(), any::<[f32; 4]>(), 0u8..32, 0u64..200), 1..40),
        sides in proptest::collection::vec(proptest::sample::select(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.05, 1e30]), 2),
        room in prop_oneof![Just(Room::Seen), Just(Room::Ordered), Just(Room::Unchecked)],
    ) {
        let params = Params { room, ..Params::default() };
        let mut driver = BaseDriver::new(params.clone()).unwrap();
        let mut now_ms = 1000;
        let (mut left_m, mut right_m) = (0.0, 0.0);
        for (word, wished, order, travel, near, plausible, age_ms) in words {
            now_ms += STEP_MS;
            let mut word: Clearance = parsed(&word);
            let mut wished: WheelSpeeds = parsed(&wished);
            let order: MotionCommand = parsed(&order);
            if plausible & 1 != 0 { word = Clearance { signal: messages::GuardSignal(word.signal.0 & 1), reason: GuardReasonName::Violation.into(), violated_faces: word.violated_faces & 1, ..word } }
            if plausible & 2 != 0 { wished = WheelSpeeds { left_mps: wished.left_mps.sin(), right_mps: wished.right_mps.sin() } }
            if plausible & 4 != 0 { wished = WheelSpeeds { left_mps: -0.13 * wished.left_mps.sin().abs(), right_mps: -0.13 * wished.right_mps.sin().abs() } }
            if plausible & 8 != 0 { word = Clearance { at_x_m: 0.0, at_y_m: 0.0, at_heading_rad: 0.0, front_radius_m: 0.2, right_radius_m: sides[0], left_radius_m: sides[1], max_age_ms: 150, violated_faces: 0, ..word } }
            if plausible & 16 != 0 { [left_m, right_m] = [&travel[..8], &travel[8..]].map(|raw| f64::from_le_bytes(raw.try_into().unwrap())); }
            let stamp = at(now_ms - age_ms);
            let near = [NearPoint { x_m: near[0], y_m: near[1] }, NearPoint { x_m: near[2], y_m: near[3] }];
            let inputs = Inputs {
                clearance: Some(Stamped::with_elements(stamp, &word, &near)),
                desired: Some(Stamped::new(stamp, &wished)),
                order: Some(Stamped::new(stamp, &order)),
                encoders: Some(Encoders { taken: at(now_ms), travel: WheelTravel { left_m, right_m } }),
            };
            let outputs = driver.step(at(now_ms), inputs);
            let applied = outputs.applied;
            let reason = applied.reason.get().unwrap();
            for (applied_mps, wished_mps) in [(applied.left_mps, wished.left_mps), (applied.right_mps, wished.right_mps)] {
                prop_assert!(applied_mps.is_finite() && applied_mps.abs() <= params.max_wheel_speed_mps);
                if moves(reason) {
                    prop_assert!(age_ms <= 100);
                    prop_assert!(applied_mps.abs() <= wished_mps.abs() && applied_mps * wished_mps >= 0.0);
                    prop_assert!(room == Room::Unchecked || applied_mps.abs() <= params.top_speed_mps + 1e-12);
                } else {
                    prop_assert!(applied_mps == 0.0);
                }
                if reason == DriveReasonName::Driving { prop_assert!(word.signal == Verdict::Go); }
                if reason == DriveReasonName::Escaping { prop_assert!((-1.0..=0.0).contains(&applied_mps)); }
            }
            if let Some(odometry) = outputs.odometry { prop_assert!(odometry.pose().is_ok()); }
        }
    }
}
