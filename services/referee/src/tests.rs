use super::*;
use messages::{DeliveryStatusName, FixedText, GuardReasonName, LocationStateName, Verdict};
use proptest::prelude::*;

/// A hallway with room 207 at x = 10 on its right, and a box in it at x = 30.
const HALLWAY: &str = r#"
name = "hallway"
[[floor]]
number = 2
walls = [[[-5.0, -0.85], [40.0, -0.85]], [[-5.0, 0.85], [40.0, 0.85]]]
[[door]]
room = "207"
floor = 2
at = [10.0, -0.85]
into_room = [0, -1]
"#;

const LOOK_MS: u64 = 50;

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

struct Run {
    referee: Referee,
    now_ms: u64,
    truth: WorldTruth,
    mission: MissionStatus,
    clearance: Clearance,
    last: Option<RunSummary>,
}

impl Run {
    fn new(params: Params) -> Self {
        let referee = Referee::in_world(params, World::parse(HALLWAY).unwrap()).unwrap();
        let truth = WorldTruth { y_m: -0.35, floor: 2, ..WorldTruth::default() };
        Self {
            referee,
            now_ms: 0,
            truth,
            mission: mission(DeliveryStatusName::Idle, 0),
            clearance: Clearance::default(),
            last: None,
        }
    }

    /// Drives along the hallway to `x_m` within so many seconds.
    fn drive_to(&mut self, x_m: f64, seconds: f64) -> &mut Self {
        let looks = (seconds * 20.0).round().max(1.0);
        let step_m = (x_m - self.truth.x_m) / looks;
        self.truth.left_mps = step_m * 20.0;
        self.truth.right_mps = step_m * 20.0;
        for _ in 0..looks as u64 {
            self.truth.x_m += step_m;
            self.look();
        }
        (self.truth.left_mps, self.truth.right_mps) = (0.0, 0.0);
        self
    }

    fn status(&mut self, status: DeliveryStatusName, delivered: u64, seconds: f64) -> &mut Self {
        self.mission = mission(status, delivered);
        for _ in 0..(seconds * 20.0).round() as u64 {
            self.look();
        }
        self
    }

    fn look(&mut self) {
        self.now_ms += LOOK_MS;
        let now = at(self.now_ms);
        let inputs = Inputs {
            truth: Some(Stamped::new(now, &self.truth)),
            mission: Some(Stamped::new(now, &self.mission)),
            clearance: Some(Stamped::new(now, &self.clearance)),
            ..Inputs::default()
        };
        self.last = self.referee.step(now, inputs).summary.or(self.last);
    }

    fn figure(&self, name: &str) -> f64 {
        let last = self.last.unwrap();
        let figure = last.figures().iter().find(|metric| metric.name.as_str() == name);
        figure.unwrap_or_else(|| panic!("no figure {name}")).value
    }

    #[track_caller]
    fn expect(&self, state: RunState, remark: &str) {
        let last = self.last.unwrap();
        assert_eq!(last.state, state, "{}", last.remark);
        assert!(last.remark.as_str().contains(remark), "{}", last.remark);
    }
}

fn mission(status: DeliveryStatusName, delivered: u64) -> MissionStatus {
    MissionStatus {
        order_id: 1,
        room: FixedText::new("207").unwrap(),
        status: status.into(),
        delivered,
        ..MissionStatus::default()
    }
}

/// A delivery whose robot halts at `halt_x_m`.
fn delivery(halt_x_m: f64) -> Run {
    let mut run = Run::new(Params::default());
    run.status(DeliveryStatusName::Travelling, 0, 0.1).drive_to(halt_x_m, 25.0);
    run.status(DeliveryStatusName::AtDoor, 0, 2.0).status(DeliveryStatusName::Delivered, 1, 0.5);
    run
}

#[test]
fn a_good_delivery_passes() {
    let run = delivery(10.06);
    run.expect(RunState::Passed, "delivered to 207");
    assert!((run.figure("halt distance from door centre") - 0.06).abs() < 1e-6);
    assert!((run.figure("path length") - 10.06).abs() < 0.02);
    assert!((run.figure("least clearance") - 0.245).abs() < 1e-6, "{}", run.figure("least clearance"));
    assert_eq!((run.figure("contacts"), run.figure("deliveries")), (0.0, 1.0));
    assert!((run.figure("time") - 27.2).abs() < 0.5);
}

#[test]
fn halting_beside_the_door_fails() {
    delivery(10.11).expect(RunState::Failed, "halted 0.11 m beside the door of 207");
    delivery(9.89).expect(RunState::Failed, "halted 0.11 m");
    delivery(9.91).expect(RunState::Passed, "");
}

#[test]
fn another_floor_is_not_the_door() {
    let mut run = Run::new(Params::default());
    run.truth.floor = 3;
    run.drive_to(10.0, 10.0).status(DeliveryStatusName::AtDoor, 0, 1.0).status(
        DeliveryStatusName::Delivered,
        1,
        0.5,
    );
    run.expect(RunState::Failed, "halted inf m");
}

#[test]
fn a_delivery_without_a_halt_fails() {
    let mut run = Run::new(Params::default());
    run.drive_to(10.0, 10.0).status(DeliveryStatusName::Delivered, 1, 0.5);
    run.expect(RunState::Failed, "did not stand at the door");
}

#[test]
fn a_contact_fails_at_once_and_for_good() {
    let mut run = Run::new(Params::default());
    run.drive_to(2.0, 5.0);
    run.truth.contacts = 1;
    run.drive_to(2.1, 0.1);
    run.expect(RunState::Failed, "touched a wall after 5.0 s, at x 2.05 m, y ");
    run.truth.contacts = 0;
    run.drive_to(10.0, 5.0).status(DeliveryStatusName::AtDoor, 0, 1.0).status(
        DeliveryStatusName::Delivered,
        1,
        0.5,
    );
    run.expect(RunState::Failed, "touched a wall after 5.0 s");
}

#[test]
fn contacts_from_before_the_run_do_not_count() {
    let mut run = Run::new(Params::default());
    run.truth.contacts = 5;
    run.drive_to(2.0, 5.0);
    run.expect(RunState::Running, "0 of 1 delivered");
}

#[test]
fn time_runs_out() {
    let mut run = Run::new(Params { time_limit_s: 10.0, ..Params::default() });
    run.drive_to(2.0, 9.0).expect_running();
    run.drive_to(2.1, 2.0);
    run.expect(RunState::Failed, "not done after 10 s");
    let mut patient = Run::new(Params { time_limit_s: 0.0, ..Params::default() });
    patient.drive_to(2.0, 900.0).expect_running();
}

impl Run {
    #[track_caller]
    fn expect_running(&self) {
        self.expect(RunState::Running, "");
    }
}

#[test]
fn a_lasting_fault_fails_and_a_short_one_does_not() {
    let mut run = Run::new(Params::default());
    run.status(DeliveryStatusName::Fault, 0, 9.0)
        .status(DeliveryStatusName::Travelling, 0, 1.0)
        .expect_running();
    run.status(DeliveryStatusName::Fault, 0, 9.9).expect_running();
    run.status(DeliveryStatusName::Fault, 0, 1.0);
    run.expect(RunState::Failed, "reports a fault for 10 s");
}

#[test]
fn several_deliveries_are_awaited_and_the_worst_halt_counts() {
    let mut run = Run::new(Params { deliveries: 2, ..Params::default() });
    run.drive_to(10.02, 10.0)
        .status(DeliveryStatusName::AtDoor, 0, 1.0)
        .status(DeliveryStatusName::Returning, 1, 1.0)
        .expect_running();
    run.drive_to(3.0, 10.0).drive_to(9.95, 10.0).status(DeliveryStatusName::AtDoor, 1, 1.0).status(
        DeliveryStatusName::Returning,
        2,
        0.5,
    );
    run.expect(RunState::Passed, "207, 207");
    assert!((run.figure("halt distance from door centre") - 0.05).abs() < 1e-6);
}

#[test]
fn stops_of_the_guard_are_counted_over_its_restarts() {
    let mut run = Run::new(Params::default());
    let mut changes = |count: u64| {
        let verdict = if count % 2 == 1 { Verdict::Go } else { Verdict::Stop };
        run.clearance = Clearance {
            signal: verdict.into(),
            reason: GuardReasonName::Clear.into(),
            changes: count,
            ..Clearance::default()
        };
        run.drive_to(0.0, 0.3);
        run.figure("stops by the guard")
    };
    assert_eq!(changes(0), 0.0);
    assert_eq!(changes(1), 0.0);
    assert_eq!(changes(2), 1.0);
    assert_eq!(changes(5), 2.0);
    assert_eq!(changes(1), 3.0);
    assert_eq!(changes(2), 3.0);
}

#[test]
fn summaries_come_five_times_a_second() {
    let mut run = Run::new(Params::default());
    let mut said = 0;
    for _ in 0..200 {
        run.last = None;
        run.look();
        said += u32::from(run.last.is_some());
    }
    assert_eq!(said, 50);
}

fn estimate(x_m: f64, state: LocationStateName) -> PoseEstimate {
    PoseEstimate { x_m, accepted: 40, rejected: 2, state: state.into(), ..PoseEstimate::default() }
}

/// A log in which the robot drives 1 m/s along x for 10 s; the truth comes at 10 Hz, poses in between with
/// these errors.
fn log(error_m: impl Fn(u64) -> f64, params: Params) -> Run {
    let params = Params { mode: Mode::Localisation, ..params };
    let mut run = Run::new(params);
    for tick in 0..=1200_u64 {
        let ms = tick * 10;
        let now = at(ms);
        let newest_truth = (ms / 100 * 100).min(10_000);
        let newest_pose = (ms.saturating_sub(30) / 100 * 100 + 30).min(9_930);
        let truth = TruePose {
            x_m: newest_truth as f64 * 1e-3,
            is_last: u32::from(newest_truth == 10_000),
            ..TruePose::default()
        };
        let pose =
            estimate(newest_pose as f64 * 1e-3 + error_m(newest_pose / 100), LocationStateName::Tracking);
        let inputs = Inputs {
            true_pose: Some(Stamped::new(at(newest_truth), &truth)),
            location: (ms >= 30)
                .then(|| Stamped { sequence: newest_pose, ..Stamped::new(at(newest_pose), &pose) }),
            ..Inputs::default()
        };
        run.last = run.referee.step(now, inputs).summary.or(run.last);
    }
    run
}

#[test]
fn a_log_is_judged_by_quantiles_at_its_end() {
    // Ten in a hundred poses are wrong by 0.5 m, the rest by 0.1 m; the truth between its messages is
    // interpolated.
    let run = log(|index| if index % 10 == 0 { 0.5 } else { 0.1 }, Params::default());
    run.expect(RunState::Passed, "median 0.1");
    assert_eq!(run.figure("poses compared"), 100.0);
    assert!((run.figure("error, median") - 0.1).abs() < 0.0015);
    assert!(
        (run.figure("error, 95 %") - 0.5).abs() < 0.0015 && (run.figure("error, largest") - 0.5).abs() < 1e-9
    );
    assert_eq!((run.figure("ranges accepted"), run.figure("ranges rejected")), (40.0, 2.0));
    log(|_| 0.26, Params::default()).expect(RunState::Failed, "median 0.26");
    log(|index| if index % 10 == 0 { 0.9 } else { 0.1 }, Params::default())
        .expect(RunState::Failed, "95 % 0.9");
    log(|_| f64::NAN, Params::default()).expect(RunState::Failed, "median NaN");
}

#[test]
fn headings_are_judged_and_poses_between_truths_can_be_left_out() {
    let run = log(|_| 0.1, Params::default());
    assert!(run.figure("heading error, median") < 0.0015);
    // The newest pose before each truth was published 70 ms before it, and the robot drives 1 m/s.
    let run = log(|_| 0.02, Params { between_truths: false, ..Params::default() });
    run.expect(RunState::Passed, "median 0.0");
    assert!((run.figure("error, median") - 0.05).abs() < 0.0015, "{}", run.figure("error, median"));
    log(|_| 0.0, Params { max_median_heading_deg: 0.01, ..Params::default() })
        .expect(RunState::Passed, "0.00 deg");
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = Referee::new(params).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    refuse(Params { deliveries: 0, ..Params::default() }, "`deliveries` is 0");
    refuse(
        Params { max_halt_error_m: f64::NAN, ..Params::default() },
        "`max_halt_error_m` is not a finite number",
    );
    refuse(Params { max_p95_m: 0.1, ..Params::default() }, "max_p95_m = 0.1 is below max_median_m = 0.25");
    refuse(Params { world: "nowhere.toml".into(), ..Params::default() }, "nowhere.toml");
    assert!(Referee::new(Params::default()).is_ok());
}

proptest! {
    /// Quantiles agree with sorting, to a millimetre.
    #[test]
    fn quantiles_agree_with_sorting(mut values in proptest::collection::vec(0.0f64..15.0, 1..200), share in 0.01f64..1.0) {
        let mut errors = errors::Errors::new();
        values.iter().for_each(|&value| errors.add(value));
        values.sort_by(f64::total_cmp);
        let rank = (share * values.len() as f64).ceil() as usize;
        prop_assert!((errors.quantile_m(share) - values[rank.max(1) - 1]).abs() <= 0.0011);
    }

    /// Whatever the messages hold, the referee gives a readable summary and no verdict "passed" for nothing.
    #[test]
    fn nonsense_does_not_pass(x in any::<f64>(), y in any::<f64>(), contacts in any::<u64>(), status in any::<u32>(), changes in any::<u64>()) {
        let mut run = Run::new(Params::default());
        run.truth = WorldTruth { x_m: x, y_m: y, contacts, ..run.truth };
        run.mission.status = messages::DeliveryStatus(status);
        run.clearance.changes = changes;
        run.look();
        run.look();
        prop_assert!(run.last.unwrap().state != RunState::Passed);
    }
}
