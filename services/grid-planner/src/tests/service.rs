//! The planner as a service: requests, poses and readings in, paths out.

use super::hallway;
use crate::{GridPlanner, Inputs, Params, ParamsError};
use geometry::Pose2;
use messages::{
    LocationState, LocationStateName, Path, PlanRequest, PlanStateName, PoseEstimate, RangeStatus,
    RangeStatusName, Stamped, Time, TofRanges, Waypoint,
};
use proptest::prelude::*;

fn planner() -> GridPlanner {
    GridPlanner::with_grids(Params::default(), vec![(2, hallway())]).unwrap()
}

fn request(request_id: u64, goal_x_m: f64) -> PlanRequest {
    PlanRequest { request_id, goal_x_m, goal_y_m: 0.0, tolerance_m: 0.1, floor: 2, reserved: 0 }
}

fn estimate(x_m: f64, y_m: f64) -> PoseEstimate {
    let state = LocationState::from(LocationStateName::Tracking);
    PoseEstimate { x_m, y_m, floor: 2, state, ..PoseEstimate::default() }
}

/// All sensors see nothing, but for those given.
fn ranges(seen: &[(usize, f32)]) -> TofRanges {
    let mut ranges =
        TofRanges { status: [RangeStatus::from(RangeStatusName::OutOfBounds); 8], ..TofRanges::default() };
    for &(sensor, range_m) in seen {
        ranges.range_m[sensor] = range_m;
        ranges.status[sensor] = RangeStatus::from(RangeStatusName::Valid);
    }
    ranges
}

/// A step at a tenth of a second.
fn step(
    planner: &mut GridPlanner,
    tenths: u64,
    request: &PlanRequest,
    pose: &PoseEstimate,
    seen: Option<&TofRanges>,
) -> Option<(Path, Vec<Waypoint>)> {
    let now = Time::from_nanos(1_000_000_000 + tenths * 100_000_000);
    let inputs = Inputs {
        request: Some(Stamped::new(now, request)),
        pose: Some(Stamped::new(now, pose)),
        ranges: seen.map(|seen| Stamped::new(now, seen)),
    };
    planner.step(now, inputs).path.map(|(path, waypoints)| (path, waypoints.to_vec()))
}

#[test]
fn one_answer_to_a_request() {
    let mut planner = planner();
    let (path, waypoints) = step(&mut planner, 0, &request(1, 10.0), &estimate(0.0, 0.0), None).unwrap();
    assert_eq!((path.request_id, path.revision, path.floor), (1, 1, 2));
    assert_eq!(path.state.get().unwrap(), PlanStateName::Found);
    assert!((path.length_m - crate::length_m(&waypoints)).abs() < 1e-12 && path.length_m > 10.0);
    for tenths in 1..100 {
        assert_eq!(
            step(&mut planner, tenths, &request(1, 10.0), &estimate(tenths as f64 * 0.03, -0.25), None),
            None
        );
    }
    let (path, _) = step(&mut planner, 101, &request(2, 5.0), &estimate(3.0, -0.3), None).unwrap();
    assert_eq!((path.request_id, path.revision), (2, 1));
}

#[test]
fn no_request_no_path() {
    assert_eq!(step(&mut planner(), 0, &PlanRequest::default(), &estimate(0.0, 0.0), None), None);
    assert_eq!(planner().step(Time::ZERO, Inputs::default()).path, None);
}

#[test]
fn waits_for_a_pose() {
    let mut planner = planner();
    let state = |answer: Option<(Path, Vec<Waypoint>)>| answer.map(|(path, _)| path.state.get().unwrap());
    let elsewhere = PoseEstimate { floor: 3, ..estimate(0.0, 0.0) };
    assert_eq!(
        state(step(&mut planner, 0, &request(1, 9.0), &PoseEstimate::default(), None)),
        Some(PlanStateName::NoStart)
    );
    assert_eq!(state(step(&mut planner, 1, &request(1, 9.0), &PoseEstimate::default(), None)), None);
    assert_eq!(state(step(&mut planner, 2, &request(1, 9.0), &elsewhere, None)), None);
    assert_eq!(
        state(step(&mut planner, 3, &request(1, 9.0), &estimate(0.0, 0.0), None)),
        Some(PlanStateName::Found)
    );
}

#[test]
fn a_robot_that_strays_gets_a_new_path() {
    let mut planner = planner();
    step(&mut planner, 0, &request(1, 18.0), &estimate(0.0, -0.3), None).unwrap();
    assert_eq!(step(&mut planner, 30, &request(1, 18.0), &estimate(5.0, 0.0), None), None);
    let (path, waypoints) = step(&mut planner, 40, &request(1, 18.0), &estimate(5.0, 0.4), None).unwrap();
    assert_eq!((path.revision, waypoints[0].x_m), (2, 5.0));
}

/// Drives along the lane at 0.3 m/s towards a box whose near face is at `face_m`, seen by the two right front
/// sensors; counts the paths.
fn drive_towards_box(
    planner: &mut GridPlanner,
    face_m: f64,
    tenths: std::ops::Range<u64>,
) -> Vec<Vec<Waypoint>> {
    let mut paths = Vec::new();
    for tenth in tenths {
        let x_m = tenth as f64 * 0.03;
        let range_m = (face_m - x_m - 0.305) as f32;
        let near = if range_m > 0.0 { ranges(&[(2, range_m), (3, range_m)]) } else { ranges(&[]) };
        paths.extend(
            step(planner, tenth, &request(1, 18.0), &estimate(x_m, -0.3), Some(&near)).map(|(_, path)| path),
        );
    }
    paths
}

#[test]
fn plans_around_a_box_once() {
    let mut planner = planner();
    let paths = drive_towards_box(&mut planner, 6.0, 0..170);
    assert_eq!(paths.len(), 2, "the first path, and the one around the box: {paths:?}");
    assert!(super::y_at(&paths[1], 6.0) > 0.0, "{paths:?}");
    assert!(planner.obstacle_cells() > 0);
}

#[test]
fn known_walls_are_no_obstacles() {
    let mut planner = planner();
    let walls = ranges(&[(0, 0.30), (1, 0.30), (6, 0.89), (7, 0.89)]);
    for tenths in 0..50 {
        step(&mut planner, tenths, &request(1, 18.0), &estimate(tenths as f64 * 0.03, -0.3), Some(&walls));
    }
    assert_eq!(planner.obstacle_cells(), 0);
}

#[test]
fn far_and_invalid_readings_are_no_obstacles() {
    let mut planner = planner();
    let mut far = ranges(&[(2, 1.2), (3, 1.0)]);
    (far.range_m[4], far.status[4]) = (0.5, RangeStatus::from(RangeStatusName::Wrapped));
    (far.range_m[5], far.status[5]) = (0.5, RangeStatus(77));
    for tenths in 0..20 {
        step(&mut planner, tenths, &request(1, 18.0), &estimate(0.0, -0.3), Some(&far));
    }
    assert_eq!(planner.obstacle_cells(), 0);
}

#[test]
fn one_reading_is_not_yet_an_obstacle_and_passing_readings_free_it() {
    let mut planner = planner();
    let look = |planner: &mut GridPlanner, tenths, seen: &[(usize, f32)]| {
        step(planner, tenths, &request(1, 18.0), &estimate(0.0, 0.0), Some(&ranges(seen)));
        planner.obstacle_cells()
    };
    assert_eq!(look(&mut planner, 0, &[(3, 0.5)]), 0);
    let across = look(&mut planner, 1, &[(3, 0.5)]);
    assert!((1..=5).contains(&across), "at most 0.13 m across the cone: {across}");
    let across = look(&mut planner, 2, &[(3, 0.5)]);
    assert_eq!(look(&mut planner, 3, &[]), across, "it was seen three times");
    for tenths in 4..12 {
        look(&mut planner, tenths, &[]);
    }
    let flanks = look(&mut planner, 12, &[]);
    assert!(
        (1..across).contains(&flanks),
        "the middle is free, what lies at the cone's edge may stay: {flanks}"
    );
    for tenths in 13..80 {
        look(&mut planner, tenths, &[]);
    }
    assert_eq!(look(&mut planner, 80, &[]), 0);
}

#[test]
fn a_box_beside_the_lane_stays_known_when_no_sensor_looks_there_any_more() {
    let mut planner = planner();
    // Its corner lies 0.26 m beside the path: in the outermost cone from afar, beside all of them from near
    // by.
    for tenths in 0..30 {
        let x_m = 2.0 + 0.036 * tenths as f64;
        let seen = if x_m < 2.25 { ranges(&[(2, 0.9 - (x_m - 2.0) as f32)]) } else { ranges(&[]) };
        step(&mut planner, tenths, &request(1, 18.0), &estimate(x_m, 0.0), Some(&seen));
    }
    assert!(planner.obstacle_cells() > 0);
}

#[test]
fn what_is_not_seen_again_is_forgotten() {
    let mut planner = planner();
    for tenths in 0..3 {
        step(&mut planner, tenths, &request(1, 18.0), &estimate(0.0, 0.0), Some(&ranges(&[(3, 0.5)])));
    }
    let seen = planner.obstacle_cells();
    assert!(seen > 0);
    step(&mut planner, 190, &request(1, 18.0), &estimate(5.0, 0.0), None);
    assert_eq!(planner.obstacle_cells(), seen);
    step(&mut planner, 210, &request(1, 18.0), &estimate(5.0, 0.0), None);
    assert_eq!(planner.obstacle_cells(), 0);
}

#[test]
fn a_blocked_hallway_is_said_once_and_planned_when_it_opens() {
    let mut planner = planner();
    let wall = [(2, 0.6), (3, 0.6), (4, 0.6), (5, 0.6)];
    let mut states = Vec::new();
    for tenths in 0..200_u64 {
        let seen = if tenths < 60 { ranges(&wall) } else { ranges(&[]) };
        let y_m = if tenths % 20 < 10 { 0.35 } else { -0.35 };
        let answer = step(&mut planner, tenths, &request(1, 18.0), &estimate(2.0, y_m), Some(&seen));
        states.extend(answer.map(|(path, _)| path.state.get().unwrap()));
    }
    let (found, unreachable) = (PlanStateName::Found, PlanStateName::Unreachable);
    assert!(states.contains(&unreachable), "{states:?}");
    assert_eq!((states[0], states[states.len() - 1]), (found, found), "{states:?}");
    assert!(states.len() <= 6, "it flaps: {states:?}");
}

fn building() -> GridPlanner {
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/worlds/cs-building.toml");
    GridPlanner::new(Params { world: world.to_owned(), ..Params::default() }).unwrap()
}

#[track_caller]
fn check_building(floor: i32, from: [f64; 2], to: [f64; 2], longest_m: f64) -> Vec<Waypoint> {
    let request = PlanRequest { floor, goal_y_m: to[1], ..request(1, to[0]) };
    let pose = PoseEstimate { floor, ..estimate(from[0], from[1]) };
    let (path, waypoints) = step(&mut building(), 0, &request, &pose, None).unwrap();
    assert_eq!(path.state.get().unwrap(), PlanStateName::Found, "{from:?} {to:?}");
    assert!(path.length_m <= longest_m, "{path:?} {waypoints:?}");
    waypoints
}

#[test]
fn ways_in_the_building() {
    for floor in [2, 3] {
        check_building(floor, [3.6, -0.3], [28.0, -0.3], 24.5);
        check_building(floor, [28.0, 0.3], [3.6, 0.3], 24.5);
        check_building(floor, [3.6, -0.3], [1.6, 0.15], 2.5);
        check_building(floor, [1.6, 0.15], [1.6, -1.75], 2.0);
        check_building(floor, [1.6, -1.75], [12.0, -0.3], 12.0);
    }
    check_building(2, [3.6, 2.0], [10.0, -0.3], 7.8);
    let lane = check_building(2, [3.6, -0.3], [28.0, -0.3], 24.5);
    assert!(lane.iter().all(|point| (-0.345..=-0.245).contains(&point.y_m)), "{lane:?}");
}

#[test]
fn maps_of_another_kind_are_read() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/maps_ros");
    let params = |map: &str| Params { map: format!("{folder}/{map}"), map_floor: 2, ..Params::default() };
    if !std::path::Path::new(folder).exists() {
        println!("skipped: ../shared/data/maps_ros is missing");
        return;
    }
    let planner = GridPlanner::new(params("depot.yaml")).unwrap();
    let grid = planner.field(2).unwrap().grid();
    assert!(grid.width() > 100 && grid.occupied().contains(&0));
    assert!(GridPlanner::new(params("invalid_image.yaml")).is_err());
}

#[track_caller]
fn check_params(change: impl Fn(&mut Params), expected: &str) {
    let mut params = Params::default();
    change(&mut params);
    let error: ParamsError = GridPlanner::new(params).unwrap_err();
    assert!(error.to_string().contains(expected), "{error}");
}

#[test]
fn bad_parameters_are_refused() {
    check_params(|params| params.robot_radius_m = f64::NAN, "`robot_radius_m` is not a finite number");
    check_params(|params| params.resolution_m = 0.0, "`resolution_m` is 0");
    check_params(|params| params.world = "nowhere.toml".into(), "nowhere.toml");
    check_params(|params| (params.world, params.map) = ("a".into(), "b".into()), "leave one of them empty");
    assert!(GridPlanner::new(Params::default()).is_ok());
}

proptest! {
    #[test]
    fn nonsense_is_survived(numbers in proptest::collection::vec(proptest::num::f64::ANY, 6), ints in proptest::collection::vec(any::<u32>(), 20)) {
        let mut planner = planner();
        let state = LocationState(ints[0] % 5);
        for tenths in 0..4_u64 {
            let pose = PoseEstimate { x_m: numbers[0], y_m: numbers[1], heading_rad: numbers[2], floor: 2, state, ..PoseEstimate::default() };
            let request = PlanRequest {
                request_id: tenths / 2, goal_x_m: numbers[3], goal_y_m: numbers[4], tolerance_m: numbers[5], floor: 2, reserved: ints[1],
            };
            let mut seen = TofRanges::default();
            for sensor in 0..8 {
                seen.range_m[sensor] = f32::from_bits(ints[2 + sensor]);
                seen.status[sensor] = RangeStatus(ints[10 + sensor] % 9);
            }
            step(&mut planner, tenths * 11, &request, &pose, Some(&seen));
            step(&mut planner, tenths * 11 + 1, &request, &estimate(numbers[0] % 20.0, numbers[1] % 1.0), Some(&seen));
        }
    }
}

#[test]
fn poses_compose_as_the_overlay_expects() {
    let eye = Pose2::new(1.0, 0.0, 0.0).compose(TofRanges::MOUNTS[0]);
    assert!(eye.heading_rad < 0.0 && eye.y_m < 0.0, "sensor 0 looks to the right");
}
