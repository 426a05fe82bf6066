use crate::{Inputs, MoveController, Params};
use messages::{
    Clearance, Face, GuardReason, GuardReasonName, GuardSignal, MotionCommand, MotionKind, MotionKindName,
    MotionReport, MotionState, MotionStateName, Odometry, Parameters, Stamped, Time, Verdict, WheelSpeeds,
};
use proptest::prelude::*;

/// A robot whose wheels do what they are told, 30 ms later, with a wall ahead of it.
struct Robot {
    controller: MoveController,
    odometry: Odometry,
    /// What was told in the last steps, the oldest first.
    told: Vec<WheelSpeeds>,
    wall_m: f64,
    now_ms: u64,
    wheels_turn: bool,
}

impl Robot {
    fn new(wall_m: f64) -> Self {
        let controller = MoveController::new(Params::default()).expect("default");
        let told = vec![WheelSpeeds::ZERO; 3];
        Self { controller, odometry: Odometry::default(), told, wall_m, now_ms: 0, wheels_turn: true }
    }

    fn step(&mut self, command: &MotionCommand) -> MotionReport {
        self.now_ms += 10;
        let now = Time::from_nanos(self.now_ms * 1_000_000);
        let WheelSpeeds { left_mps, right_mps } =
            if self.wheels_turn { self.told[0] } else { WheelSpeeds::ZERO };
        let (forward_mps, turn_rad_per_s) = (0.5 * (left_mps + right_mps), (right_mps - left_mps) / 0.12);
        let odometry = &mut self.odometry;
        (odometry.forward_mps, odometry.turn_rad_per_s) = (forward_mps, turn_rad_per_s);
        odometry.left_travel_m += 0.01 * left_mps;
        odometry.right_travel_m += 0.01 * right_mps;
        odometry.heading_rad = geometry::angle::wrap(odometry.heading_rad + 0.01 * turn_rad_per_s);
        self.wall_m -= 0.01 * forward_mps;
        let clearance = if self.wall_m >= 0.09 {
            let (signal, reason) = (Verdict::Go.into(), GuardReasonName::Clear.into());
            Clearance { signal, reason, front_m: self.wall_m as f32, ..Clearance::default() }
        } else {
            let reason = GuardReasonName::Violation.into();
            let violated_faces = Face::Front as u32;
            Clearance { reason, violated_faces, front_m: self.wall_m as f32, ..Clearance::default() }
        };
        let inputs = Inputs {
            command: Some(Stamped::new(now, command)),
            odometry: Some(Stamped::new(now, &self.odometry)),
            clearance: Some(Stamped::new(now, &clearance)),
        };
        let outputs = self.controller.step(now, inputs);
        self.told.remove(0);
        self.told.push(outputs.desired);
        outputs.report
    }

    fn carry_out(&mut self, command: &MotionCommand) -> MotionReport {
        for _ in 0..5000 {
            let report = self.step(command);
            if !matches!(report.state.get(), Ok(MotionStateName::Running | MotionStateName::Idle)) {
                return report;
            }
        }
        unreachable!("the motion does not end");
    }
}

fn way(distance_m: f64) -> MotionCommand {
    let kind = MotionKindName::Move.into();
    MotionCommand { command_id: 1, distance_m, retreat_m: 0.2, kind, ..MotionCommand::default() }
}

fn turn(turn_rad: f64) -> MotionCommand {
    MotionCommand { command_id: 1, turn_rad, kind: MotionKindName::Turn.into(), ..MotionCommand::default() }
}

#[track_caller]
fn check_done(command: &MotionCommand, travelled_m: f64, turned_rad: f64) {
    let report = Robot::new(5.0).carry_out(command);
    assert_eq!(report.state, MotionStateName::Done);
    assert!((report.travelled_m - travelled_m).abs() < 0.002, "{} m of {travelled_m} m", report.travelled_m);
    assert!((report.turned_rad - turned_rad).abs() < 0.012, "{} rad of {turned_rad} rad", report.turned_rad);
}

#[test]
fn ways_and_turns_end_where_they_should() {
    for way_m in [0.005, 0.05, 0.7, -0.05, -0.3] {
        check_done(&way(way_m), way_m, 0.0);
    }
    for turn_rad in [0.02, 0.5, -1.5, 3.1, -4.0] {
        check_done(&turn(turn_rad), 0.0, turn_rad);
    }
    check_done(&MotionCommand { command_id: 1, ..MotionCommand::default() }, 0.0, 0.0);
}

#[test]
fn a_wall_ahead_ends_the_way_and_the_robot_drives_back() {
    let mut robot = Robot::new(0.4);
    let report = robot.carry_out(&way(0.6));
    assert_eq!(report.state, MotionStateName::NearWall);
    assert!((report.retreated_m - 0.10).abs() < 0.01, "{report:?}");
    assert!((0.17..0.20).contains(&robot.wall_m), "{} m", robot.wall_m);
    // It slowed down before the wall: the body, 8 cm long ahead, never touched it.
    assert!(report.travelled_m < 0.4 - 0.085, "{report:?}");
}

#[test]
fn no_farther_back_than_is_free() {
    let mut robot = Robot::new(0.085);
    let report = robot.carry_out(&MotionCommand { retreat_m: 0.04, ..way(0.5) });
    assert_eq!(report.state, MotionStateName::NearWall);
    assert!((report.retreated_m - 0.04).abs() < 0.01, "{report:?}");
}

#[test]
fn a_way_back_does_not_mind_what_is_ahead() {
    let report = Robot::new(0.08).carry_out(&way(-0.05));
    assert_eq!(report.state, MotionStateName::Done);
}

#[test]
fn wheels_that_do_not_turn_are_noticed() {
    let mut robot = Robot::new(5.0);
    robot.wheels_turn = false;
    assert_eq!(robot.carry_out(&way(0.5)).state, MotionStateName::Blocked);
}

#[test]
fn orders_without_sense_are_refused() {
    for command in [way(f64::NAN), way(1e9), turn(f64::INFINITY), turn(9.0)] {
        assert_eq!(Robot::new(5.0).carry_out(&command).state, MotionStateName::Refused);
    }
    let unknown = MotionCommand { command_id: 1, kind: MotionKind(9), ..MotionCommand::default() };
    assert_eq!(Robot::new(5.0).carry_out(&unknown).state, MotionStateName::Refused);
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    let params = Params { creep_mps: 0.05, speed_mps: 0.02, ..Params::default() };
    assert!(params.check().is_err_and(|error| error.to_string().contains("creep_mps = 0.05")));
    let params = Params { braking_m_per_s2: f64::NAN, ..Params::default() };
    assert!(
        params
            .check()
            .is_err_and(|error| error.to_string().contains("`braking_m_per_s2` is not a finite number"))
    );
}

proptest! {
    #[test]
    fn whatever_it_hears_its_wish_is_within_its_limits(
        steps in proptest::collection::vec((proptest::array::uniform8(any::<f64>()), any::<[u32; 3]>(), 0_u64..4), 1..30),
    ) {
        let mut controller = MoveController::new(Params::default()).expect("default");
        for (step, (n, states, command_id)) in (0..).zip(steps) {
            let now = Time::from_nanos(step * 20_000_000);
            let command = MotionCommand {
                command_id, distance_m: n[0], turn_rad: n[1], retreat_m: n[2], kind: MotionKind(states[0] % 4), reserved: 0,
            };
            let odometry = Odometry {
                x_m: n[3], heading_rad: n[4], left_travel_m: n[5], right_travel_m: n[6], forward_mps: n[7], ..Odometry::default()
            };
            let clearance = Clearance {
                signal: GuardSignal(states[1] % 3), reason: GuardReason(states[2] % 8), front_m: n[0] as f32, ..Clearance::default()
            };
            let inputs = Inputs {
                command: Some(Stamped::new(now, &command)), odometry: Some(Stamped::new(now, &odometry)),
                clearance: Some(Stamped::new(now, &clearance)),
            };
            let outputs = controller.step(now, inputs);
            prop_assert!(outputs.desired.is_within(0.21));
            prop_assert!(outputs.report.state != MotionState(99));
        }
    }
}
