//! Cases of the controller.

use super::window::Hull;
use super::*;
use messages::{
    DriveMode, LocationState, LocationStateName, PlanState, RangeStatus, RangeStatusName, Waypoint,
};
use nalgebra::Point2;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;

const STEP: Duration = Duration::from_millis(50);
const HULL: Hull = Hull { front_m: 0.3, rear_m: 0.3, side_m: 0.25 };

#[track_caller]
fn check_time(forward_mps: f64, turn_rad_per_s: f64, x: f64, y: f64, expected_s: f64) {
    let found_s = HULL.time_to(Velocity { forward_mps, turn_rad_per_s }, Point2::new(x, y));
    assert!(found_s == expected_s || (found_s - expected_s).abs() < 1e-9, "{found_s} is not {expected_s}");
}

#[test]
fn straight_courses_meet_what_lies_ahead() {
    check_time(0.5, 0.0, 1.3, 0.0, 2.0);
    check_time(0.5, 0.0, 1.3, 0.24, 2.0);
    check_time(0.5, 0.0, 1.3, 0.26, f64::INFINITY);
    check_time(0.5, 0.0, -1.3, 0.0, f64::INFINITY);
    check_time(-0.5, 0.0, -1.3, 0.0, 2.0);
    check_time(0.0, 0.0, 1.3, 0.0, f64::INFINITY);
}

#[test]
fn turns_meet_what_the_corners_sweep() {
    // On the spot: a point at the side within the corners' reach of 0.39 m, and one beyond it.
    check_time(0.0, 1.0, 0.0, 0.4, f64::INFINITY);
    let corner_rad = (0.35_f64.powi(2) - 0.25_f64.powi(2)).sqrt().atan2(0.25);
    check_time(0.0, 1.0, 0.0, 0.35, corner_rad);
    check_time(0.0, -1.0, 0.0, 0.35, corner_rad);
    // Around (0, 1): the point straight ahead on the centre's circle meets the front edge after 90 degrees
    // less its own angle.
    let front_rad = FRAC_PI_2 - 0.3_f64.asin();
    check_time(1.0, 1.0, 1.0, 1.0, front_rad);
    check_time(1.0, -1.0, 1.0, -1.0, front_rad);
}

proptest! {
    #[test]
    fn contact_is_where_small_steps_find_it(
        forward_mps in 0.05_f64..0.5, turn in -1.5_f64..1.5, x in -2.0_f64..2.0, y in -2.0_f64..2.0,
    ) {
        let inside = |place: Point2<f64>| place.x.abs() < 0.3 && place.y.abs() < 0.25;
        prop_assume!(!inside(Point2::new(x, y)) && turn.abs() > 0.01);
        let found_s = HULL.time_to(Velocity { forward_mps, turn_rad_per_s: turn }, Point2::new(x, y));
        let meets = (0..2000).map(|step| f64::from(step) * 2e-3).find(|seconds| {
            inside(Pose2::IDENTITY.after_arc(forward_mps * seconds, turn * seconds).inverse_transform(Point2::new(x, y)))
        });
        match meets {
            // Small steps may overlook a corner that is only grazed, but not find contact earlier.
            Some(seconds) => prop_assert!(found_s <= seconds + 1e-9 && found_s > seconds - 0.2, "{found_s} {seconds}"),
            None => prop_assert!(found_s > 0.0),
        }
    }

    #[test]
    fn any_input_gives_speeds_within_limits(
        numbers in prop::array::uniform8(any::<f64>()), ranges in prop::array::uniform8(any::<f32>()),
        statuses in prop::array::uniform8(any::<u32>()), mode in any::<u32>(), state in any::<u32>(),
    ) {
        let mut world = World::new(Params::default());
        let command = DriveCommand { request_id: 1, heading_rad: numbers[0], max_speed_mps: numbers[1], mode: DriveMode(mode % 7), reserved: 0 };
        let tof = TofRanges { range_m: ranges, status: statuses.map(|status| RangeStatus(status % 16)) };
        let odometry = Odometry { forward_mps: numbers[2], turn_rad_per_s: numbers[3], ..Odometry::default() };
        let pose = PoseEstimate { x_m: numbers[4], y_m: numbers[5], heading_rad: numbers[6], state: LocationState(state % 5), ..PoseEstimate::default() };
        let places = [Waypoint { x_m: 0.0, y_m: 0.0 }, Waypoint { x_m: numbers[7], y_m: 1.0 }];
        for _ in 0..3 {
            let path = found_path();
            let outputs = world.controller.step(world.now, &Inputs {
                command: Some(Stamped::new(world.now, &command)),
                path: Some(Stamped::with_elements(world.now, &path, &places)),
                pose: Some(Stamped::new(world.now, &pose)),
                ranges: Some(Stamped::new(world.now, &tof)),
                scan: None,
                odometry: Some(Stamped::new(world.now, &odometry)),
            });
            prop_assert!(outputs.wheels.is_within(0.36 + 1e-9), "{outputs:?}");
            world.now = world.now.after(STEP);
        }
    }
}

fn found_path() -> Path {
    Path { request_id: 1, revision: 1, state: PlanState::from(PlanStateName::Found), ..Path::default() }
}

/// A robot with exact wheels among points that its eight sensors see exactly along their axes.
struct World {
    controller: WindowController,
    pose: Pose2,
    now: Time,
    wheels: WheelSpeeds,
    /// Round obstacles: x, y, radius.
    obstacles: Vec<(f64, f64, f64)>,
    least_clearance_m: f64,
    /// What is missing from the inputs, by place.
    missing: Option<usize>,
}

impl World {
    fn new(params: Params) -> Self {
        Self {
            controller: WindowController::new(params).unwrap(),
            pose: Pose2::IDENTITY,
            now: Time::from_secs_f64(1.0),
            wheels: WheelSpeeds::ZERO,
            obstacles: Vec::new(),
            least_clearance_m: f64::INFINITY,
            missing: None,
        }
    }

    fn ranges(&self) -> TofRanges {
        let mut range_m = [4.0_f32; 8];
        for (range_m, mount) in range_m.iter_mut().zip(TofRanges::MOUNTS) {
            let sensor = self.pose.compose(mount);
            for &(x, y, radius) in &self.obstacles {
                let centre = sensor.inverse_transform(Point2::new(x, y));
                if centre.x > 0.0 && centre.y.abs() < radius {
                    let hit_m = centre.x - (radius * radius - centre.y * centre.y).sqrt();
                    *range_m = range_m.min(hit_m.max(0.04) as f32);
                }
            }
        }
        TofRanges { range_m, status: [RangeStatus::from(RangeStatusName::Valid); 8] }
    }

    fn step(&mut self, command: &DriveCommand, places: &[Waypoint]) -> Outputs {
        let (path, tof) = (found_path(), self.ranges());
        let estimate = PoseEstimate {
            x_m: self.pose.x_m,
            y_m: self.pose.y_m,
            heading_rad: self.pose.heading_rad,
            state: LocationState::from(LocationStateName::Tracking),
            ..PoseEstimate::default()
        };
        let WheelSpeeds { left_mps, right_mps } = self.wheels;
        let (forward_mps, turn_rad_per_s) = (0.5 * (left_mps + right_mps), (right_mps - left_mps) / 0.4);
        let odometry = Odometry { forward_mps, turn_rad_per_s, ..Odometry::default() };
        let mut inputs = Inputs {
            command: Some(Stamped::new(self.now, command)),
            path: Some(Stamped::with_elements(self.now, &path, places)),
            pose: Some(Stamped::new(self.now, &estimate)),
            ranges: Some(Stamped::new(self.now, &tof)),
            scan: None,
            odometry: Some(Stamped::new(self.now, &odometry)),
        };
        match self.missing {
            Some(0) => inputs.command = None,
            Some(1) => inputs.pose = None,
            Some(2) => inputs.ranges = None,
            Some(3) => inputs.odometry = None,
            _ => {}
        }
        let outputs = self.controller.step(self.now, &inputs);
        self.wheels = outputs.wheels;
        let WheelSpeeds { left_mps, right_mps } = self.wheels;
        let seconds = STEP.as_secs_f64();
        self.pose = self
            .pose
            .after_arc(0.5 * (left_mps + right_mps) * seconds, (right_mps - left_mps) / 0.4 * seconds);
        self.now = self.now.after(STEP);
        for &(x, y, radius) in &self.obstacles {
            let centre = self.pose.inverse_transform(Point2::new(x, y));
            let (ahead, aside) = ((centre.x.abs() - 0.305).max(0.0), (centre.y.abs() - 0.255).max(0.0));
            self.least_clearance_m = self.least_clearance_m.min(ahead.hypot(aside) - radius);
        }
        outputs
    }
}

fn command(mode: DriveModeName) -> DriveCommand {
    DriveCommand { request_id: 1, max_speed_mps: 1.0, mode: DriveMode::from(mode), ..DriveCommand::default() }
}

fn waypoints(places: &[(f64, f64)]) -> Vec<Waypoint> {
    places.iter().map(|&(x_m, y_m)| Waypoint { x_m, y_m }).collect()
}

#[track_caller]
fn check_drive(places: &[(f64, f64)], obstacles: &[(f64, f64, f64)], most_s: f64) {
    let mut world = World::new(Params::default());
    world.obstacles = obstacles.to_vec();
    let (command, points) = (command(DriveModeName::FollowPath), waypoints(places));
    while world.step(&command, &points).behaviour != Behaviour::Reached {
        assert!(world.now.as_secs_f64() < most_s + 1.0, "not reached: {:?}", world.pose);
    }
    let (x, y) = places[places.len() - 1];
    assert!((world.pose.x_m - x).hypot(world.pose.y_m - y) < 0.1);
    assert!(world.least_clearance_m > 0.0, "{}", world.least_clearance_m);
}

#[test]
fn paths_are_followed() {
    check_drive(&[(0.0, 0.0), (4.0, 0.0)], &[], 16.0);
    check_drive(&[(0.0, 0.0), (3.0, 0.0), (3.0, 3.0)], &[], 28.0);
    check_drive(&[(0.0, 0.0), (-3.0, 0.1)], &[], 20.0);
    check_drive(&[(0.0, 0.0), (1.0, 0.4), (2.0, -0.4), (4.0, 0.0)], &[], 22.0);
    check_drive(&[(0.0, 0.0), (0.0, 0.5)], &[], 10.0);
}

#[test]
fn obstacles_beside_the_path_are_passed() {
    check_drive(&[(0.0, 0.0), (5.0, 0.0)], &[(2.5, 0.55, 0.2)], 30.0);
    check_drive(&[(0.0, 0.0), (5.0, 0.0)], &[(2.5, -0.55, 0.2), (3.5, 0.6, 0.2)], 30.0);
}

#[test]
fn a_wall_ahead_is_not_touched() {
    let mut world = World::new(Params::default());
    world.obstacles = (-10..=10).map(|place| (2.0, f64::from(place) * 0.1, 0.1)).collect();
    let (command, points) = (command(DriveModeName::FollowPath), waypoints(&[(0.0, 0.0), (4.0, 0.0)]));
    for _ in 0..600 {
        world.step(&command, &points);
    }
    assert!(world.least_clearance_m > 0.05, "{}", world.least_clearance_m);
    assert!(world.pose.x_m > 0.8, "{:?}", world.pose);
}

#[track_caller]
fn check_turn(heading_rad: f64) {
    let mut world = World::new(Params::default());
    let command = DriveCommand { heading_rad, ..command(DriveModeName::TurnTo) };
    for _ in 0..200 {
        world.step(&command, &[]);
    }
    assert!(angle::difference(heading_rad, world.pose.heading_rad).abs() < 0.05, "{:?}", world.pose);
    assert!(world.pose.x_m.hypot(world.pose.y_m) < 1e-6 && world.wheels == WheelSpeeds::ZERO);
}

#[test]
fn commanded_turns_end_at_their_heading() {
    check_turn(1.5);
    check_turn(-0.1);
    check_turn(-2.8);
    check_turn(PI);
}

#[test]
fn modes_do_what_they_say() {
    let mut world = World::new(Params::default());
    for _ in 0..40 {
        world.step(&command(DriveModeName::Creep), &[]);
    }
    assert_eq!(world.wheels, WheelSpeeds { left_mps: 0.15, right_mps: 0.15 });
    for _ in 0..40 {
        world.step(&command(DriveModeName::BackOff), &[]);
    }
    assert_eq!(world.wheels, WheelSpeeds { left_mps: -0.15, right_mps: -0.15 });
    for _ in 0..40 {
        world.step(&command(DriveModeName::Hold), &[]);
    }
    assert_eq!(world.wheels, WheelSpeeds::ZERO);
}

#[track_caller]
fn check_missing(missing: usize) {
    let mut world = World::new(Params::default());
    let (command, points) = (command(DriveModeName::FollowPath), waypoints(&[(0.0, 0.0), (4.0, 0.0)]));
    for _ in 0..40 {
        world.step(&command, &points);
    }
    assert!(world.wheels.left_mps > 0.3, "{:?}", world.wheels);
    world.missing = Some(missing);
    let outputs = world.step(&command, &points);
    assert_eq!((outputs.wheels, outputs.behaviour), (WheelSpeeds::ZERO, Behaviour::BadInput));
}

#[test]
fn missing_inputs_stop_at_once() {
    check_missing(0);
    check_missing(1);
    check_missing(2);
    check_missing(3);
}

#[track_caller]
fn check_refused(params: Params, expected: &str) {
    let error = WindowController::new(params).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains(expected), "no `{expected}` in: {error}");
}

#[test]
fn wrong_parameters_are_refused() {
    check_refused(
        Params { track_m: 0.0, ..Params::default() },
        "`track_m` is 0.0 m, which is out of range: it must be from 0.05 to 5 m",
    );
    check_refused(
        Params { top_speed_mps: f64::NAN, ..Params::default() },
        "`top_speed_mps` is not a finite number",
    );
    check_refused(
        Params { rotation_end_rad: 1.2, ..Params::default() },
        "rotation_end_rad = 1.2 is not below",
    );
    check_refused(Params { heading_weight: 0.0, ..Params::default() }, "heading_weight is 0");
}
