use crate::*;
use messages::{DriveMode, LocationState, LocationStateName};
use proptest::prelude::*;
use zerocopy::FromBytes;

fn at(seconds: f64) -> Time {
    Time::from_secs_f64(seconds)
}

fn service() -> CurrentStateService {
    CurrentStateService::new(Params::default()).unwrap()
}

fn pose(x_m: f64) -> PoseEstimate {
    let state = LocationStateName::Tracking.into();
    PoseEstimate { x_m, y_m: -0.4, heading_rad: 0.1, floor: 2, state, ..PoseEstimate::default() }
}

fn correction(angle_rad: f64, valid: u32) -> HeadingCorrection {
    HeadingCorrection { angle_rad, valid, ..HeadingCorrection::default() }
}

/// The state after one step at 10 s with these inputs.
fn after(inputs: Inputs<'_>) -> CurrentState {
    service().step(at(10.0), inputs).state.unwrap()
}

#[test]
fn nothing_known_is_halt_stop_and_idle() {
    let state = after(Inputs::default());
    assert_eq!(state.instruction, MoveInstructionName::Halt);
    assert_eq!(state.signal, Verdict::Stop);
    assert_eq!(state.status, DeliveryStatusName::Idle);
    assert_eq!((state.location_valid, state.angle_valid), (0, 0));
    assert_eq!(
        (state.location_age_s, state.angle_age_s, state.mission_age_s),
        (f64::INFINITY, f64::INFINITY, f64::INFINITY)
    );
}

/// COF-047, item by item.
#[test]
fn everything_said_is_shown() {
    let location = pose(3.0);
    let correction = correction(0.2, 1);
    let mission = MissionStatus {
        room: RoomName::truncated("207"),
        status: DeliveryStatusName::Travelling.into(),
        ..MissionStatus::default()
    };
    let command = DriveCommand { mode: DriveModeName::FollowPath.into(), ..DriveCommand::default() };
    let clearance = Clearance { signal: Verdict::Go.into(), ..Clearance::default() };
    let state = after(Inputs {
        location: Some(Stamped::new(at(9.9), &location)),
        correction: Some(Stamped::new(at(9.5), &correction)),
        mission: Some(Stamped::new(at(8.0), &mission)),
        command: Some(Stamped::new(at(1.0), &command)),
        clearance: Some(Stamped::new(at(9.95), &clearance)),
    });
    assert_eq!((state.x_m, state.y_m, state.heading_rad, state.floor), (3.0, -0.4, 0.1, 2));
    assert_eq!((state.angle_from_line_rad, state.location_valid, state.angle_valid), (0.2, 1, 1));
    assert_eq!(state.room.as_str(), "207");
    assert_eq!(state.status, DeliveryStatusName::Travelling);
    assert_eq!(state.instruction, MoveInstructionName::Follow);
    assert_eq!(state.signal, Verdict::Go);
    assert!((state.location_age_s - 0.1).abs() < 1e-6 && (state.mission_age_s - 2.0).abs() < 1e-6);
}

#[track_caller]
fn check_instruction(mode: u32, expected: MoveInstructionName) {
    let command = DriveCommand { mode: DriveMode(mode), ..DriveCommand::default() };
    let state = after(Inputs { command: Some(Stamped::new(at(9.0), &command)), ..Inputs::default() });
    assert_eq!(state.instruction, expected);
}

#[test]
fn each_mode_has_its_word() {
    check_instruction(0, MoveInstructionName::Halt);
    check_instruction(1, MoveInstructionName::Follow);
    check_instruction(2, MoveInstructionName::Turn);
    check_instruction(3, MoveInstructionName::Creep);
    check_instruction(4, MoveInstructionName::BackOff);
    check_instruction(5, MoveInstructionName::Halt);
}

#[track_caller]
fn check_signal(signal: u32, age_ms: u64, expected: Verdict) {
    let clearance = Clearance { signal: GuardSignal(signal), ..Clearance::default() };
    let stamp = Time::from_nanos(at(10.0).as_nanos() - age_ms * 1_000_000);
    let state = after(Inputs { clearance: Some(Stamped::new(stamp, &clearance)), ..Inputs::default() });
    assert_eq!(state.signal, expected);
}

#[test]
fn only_a_fresh_go_is_go() {
    check_signal(1, 0, Verdict::Go);
    check_signal(1, 300, Verdict::Go);
    check_signal(1, 301, Verdict::Stop);
    check_signal(0, 0, Verdict::Stop);
    check_signal(7, 0, Verdict::Stop);
}

#[test]
fn a_lost_pose_keeps_the_last_place_and_says_so() {
    let mut service = service();
    let good = pose(3.0);
    service.step(at(1.0), Inputs { location: Some(Stamped::new(at(1.0), &good)), ..Inputs::default() });
    for lost in [
        PoseEstimate { state: LocationStateName::Lost.into(), ..pose(4.0) },
        PoseEstimate { state: LocationState(99), ..pose(4.0) },
        pose(f64::NAN),
    ] {
        let inputs = Inputs { location: Some(Stamped::new(at(1.2), &lost)), ..Inputs::default() };
        let state = service.step(at(1.3), inputs).state.unwrap_or(service.published.unwrap().value);
        assert_eq!((state.x_m, state.floor, state.location_valid), (3.0, 2, 0));
    }
}

#[test]
fn an_old_pose_and_an_old_angle_are_not_valid() {
    let (location, correction) = (pose(1.0), correction(0.1, 1));
    let inputs = |seconds: f64| Inputs {
        location: Some(Stamped::new(at(seconds), &location)),
        correction: Some(Stamped::new(at(seconds), &correction)),
        ..Inputs::default()
    };
    let valid = |state: CurrentState| (state.location_valid, state.angle_valid);
    assert_eq!(valid(after(inputs(9.01))), (1, 1));
    assert_eq!(valid(after(inputs(8.5))), (0, 1));
    assert_eq!(valid(after(inputs(7.9))), (0, 0));
}

#[test]
fn an_angle_that_was_not_measured_leaves_the_last() {
    let mut service = service();
    let step = |service: &mut CurrentStateService, seconds, correction: HeadingCorrection| {
        let inputs = Inputs { correction: Some(Stamped::new(at(seconds), &correction)), ..Inputs::default() };
        service.step(at(seconds), inputs);
        service.published.unwrap().value
    };
    assert_eq!(step(&mut service, 1.0, correction(0.3, 1)).angle_from_line_rad, 0.3);
    assert_eq!(step(&mut service, 1.5, correction(0.9, 0)).angle_from_line_rad, 0.3);
    assert_eq!(step(&mut service, 1.6, correction(f64::NAN, 1)).angle_from_line_rad, 0.3);
}

#[test]
fn it_speaks_at_each_change_and_ten_times_a_second() {
    let mut service = service();
    let location = pose(1.0);
    let mut spoke_at_ms = Vec::new();
    for ms in (0..=400).step_by(10) {
        let now = Time::from_nanos(1_000_000_000 + ms * 1_000_000);
        // The pose comes after 150 ms.
        let location = (ms >= 150).then(|| Stamped::new(Time::from_nanos(1_150_000_000), &location));
        if service.step(now, Inputs { location, ..Inputs::default() }).state.is_some() {
            spoke_at_ms.push(ms);
        }
    }
    assert_eq!(spoke_at_ms, [0, 100, 150, 250, 350]);
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    let error = CurrentStateService::new(Params { period_ms: 0, ..Params::default() }).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`period_ms` is 0 ms, which is out of range: it must be from 5 to 10000 ms; the default is 100"
    );
}

fn message<T: FromBytes>(bytes: &[u8]) -> T {
    T::read_from_prefix(bytes).unwrap().0
}

proptest! {
    #[test]
    fn any_bytes_give_a_readable_state(bytes in prop::collection::vec(any::<u8>(), 400), seconds in 0.0..1e6) {
        let (location, correction): (PoseEstimate, HeadingCorrection) = (message(&bytes), message(&bytes));
        let (mission, command): (MissionStatus, DriveCommand) = (message(&bytes), message(&bytes));
        let clearance: Clearance = message(&bytes);
        let now = at(seconds);
        let state = service().step(now, Inputs {
            location: Some(Stamped::new(now, &location)),
            correction: Some(Stamped::new(now, &correction)),
            mission: Some(Stamped::new(now, &mission)),
            command: Some(Stamped::new(now, &command)),
            clearance: Some(Stamped::new(now, &clearance)),
        }).state.unwrap();
        prop_assert!(state.x_m.is_finite() && state.y_m.is_finite() && state.heading_rad.is_finite());
        prop_assert!(state.angle_from_line_rad.is_finite());
        prop_assert!(state.instruction.get().is_ok() && state.status.get().is_ok() && state.signal.get().is_ok());
    }
}
