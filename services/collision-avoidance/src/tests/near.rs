//! What the guard tells to be near the hull.

use super::*;
use geometry::Point2;
use messages::{LocationStateName, PoseEstimate};

/// The points told after these frames, fed with the robot at these poses in the frame of odometry.
fn told(params: Params, looks: &[(Pose2, TofRanges)]) -> (Clearance, Vec<Point2<f64>>) {
    let mut guard = CollisionAvoidance::new(params).unwrap();
    let mut last = None;
    for (index, (pose, ranges)) in looks.iter().enumerate() {
        let now = Time::from_secs_f64(1.0 + 0.05 * index as f64);
        let (x_m, y_m, heading_rad) = (pose.x_m, pose.y_m, pose.heading_rad);
        let odometry = Odometry { x_m, y_m, heading_rad, ..Odometry::default() };
        let inputs = Inputs {
            ranges: Some(Stamped::new(now, ranges)),
            odometry: Some(Stamped::new(now, &odometry)),
            ..Inputs::default()
        };
        let outputs = guard.step(now, inputs);
        let points = outputs.near.iter().map(|point| Point2::new(point.x_m.into(), point.y_m.into()));
        last = Some((outputs.clearance, points.collect()));
    }
    last.unwrap()
}

/// How near to this place of the robot's frame something is told to be.
#[track_caller]
fn check_told(points: &[Point2<f64>], x_m: f64, y_m: f64, is_there: bool) {
    let nearest_m = points.iter().map(|point| (point - Point2::new(x_m, y_m)).norm()).fold(9.0, f64::min);
    assert_eq!(nearest_m < 0.045, is_there, "{nearest_m} m from ({x_m}, {y_m}): {points:?}");
}

#[test]
fn what_the_sensors_see_is_told_with_the_place_from_where_it_is_seen() {
    let here = Pose2::new(3.0, -2.0, 1.0);
    let (said, points) = told(Params::default(), &[(here, ahead([0.3, FAR, FAR, FAR]))]);
    assert_eq!(said.at(), Some(here));
    check_told(&points, 0.605, -0.1725, true);
    check_told(&points, 0.1385, -0.555, true);
    check_told(&points, 0.605, 0.0, false);
    assert_eq!((said.front_radius_m, said.right_radius_m, said.left_radius_m), (0.2, 0.05, 0.05));
    assert_eq!(said.max_age_ms, 300);
}

#[test]
fn without_odometry_it_says_that_it_does_not_know() {
    let mut bench = Bench::new(Params::default());
    bench.odometry = None;
    bench.feed(&everywhere(0.3));
    assert_eq!(bench.said.at(), None);
}

#[test]
fn what_was_seen_a_moment_ago_is_told_where_it_is_now() {
    // Beside the nose, then beside the tail, where no sensor looks any more.
    let seen = frame([FAR, 0.12, FAR, FAR, FAR, FAR, FAR, FAR]);
    let looks = [
        (Pose2::IDENTITY, seen),
        (Pose2::new(0.06, 0.0, 0.0), seen),
        (Pose2::new(0.3, 0.0, 0.0), everywhere(FAR)),
    ];
    let (_, points) = told(Params::default(), &looks);
    check_told(&points, -0.13, -0.375, true);
    // Where the robot stands, nothing else does.
    let (_, points) = told(
        Params::default(),
        &[(Pose2::IDENTITY, ahead([FAR, 0.1, 0.1, FAR])), (Pose2::new(0.2, 0.0, 0.0), everywhere(FAR))],
    );
    check_told(&points, 0.205, 0.0, false);
    // In another frame places mean nothing.
    let (_, points) =
        told(Params::default(), &[(Pose2::IDENTITY, seen), (Pose2::new(5.0, 0.0, 0.0), everywhere(FAR))]);
    assert!(points.is_empty(), "{points:?}");
}

/// Whether what lay beside the nose is still told beside the tail, where no sensor looks, after so many
/// frames there.
#[track_caller]
fn check_remembered(frames: usize, at: impl Fn(usize) -> Pose2, is_there: bool) {
    let seen = frame([FAR, 0.12, FAR, FAR, FAR, FAR, FAR, FAR]);
    let mut looks = vec![(Pose2::IDENTITY, seen), (Pose2::new(0.06, 0.0, 0.0), seen)];
    looks.extend((0..frames).map(|index| (at(index), everywhere(FAR))));
    let (_, points) = told(Params::default(), &looks);
    let x_m = 0.17 - at(frames - 1).x_m;
    check_told(&points, x_m, -0.375, is_there);
}

#[test]
fn what_was_seen_is_remembered_for_longer_while_the_robot_stands() {
    let stands = |_| Pose2::new(0.3, 0.0, 0.0);
    let trembles = |frame: usize| Pose2::new(0.3, 0.0, if frame.is_multiple_of(2) { 0.01 } else { -0.01 });
    let goes_to_and_fro = |frame: usize| Pose2::new(0.3 + 0.05 * (frame / 10 % 2) as f64, 0.0, 0.0);
    check_remembered(700, stands, true);
    check_remembered(700, trembles, true);
    check_remembered(900, stands, false);
    check_remembered(300, goes_to_and_fro, true);
    check_remembered(700, goes_to_and_fro, false);
}

/// What the sensors of a robot at `pose` see of a long wall along the line y = `wall_y_m`, in the middle of
/// their cones.
fn beside(wall_y_m: f64, pose: Pose2) -> TofRanges {
    frame(TofRanges::MOUNTS.map(|mount| {
        let eye = pose.compose(mount);
        let range_m = (wall_y_m - eye.y_m) / eye.heading_rad.sin();
        if (0.0..1.0).contains(&range_m) { range_m as f32 } else { FAR }
    }))
}

#[test]
fn a_wall_goes_on_where_the_corner_of_the_hull_comes_first() {
    for degrees in [-25.0_f64, -15.0, -5.0, 0.0, 5.0] {
        let heading_rad = degrees.to_radians();
        let poses = (0..20).map(|step| {
            let way_m = 0.015 * f64::from(step);
            Pose2::new(way_m * heading_rad.cos(), way_m * heading_rad.sin(), heading_rad)
        });
        let looks: Vec<_> = poses.map(|pose| (pose, beside(-0.62, pose))).collect();
        let (_, points) = told(Params::default(), &looks);
        let here = looks.last().unwrap().0;
        for ahead_m in [0.2, 0.3, 0.4] {
            let corner = here.transform(Point2::new(ahead_m, 0.0));
            let on_wall = here.inverse_transform(Point2::new(corner.x, -0.62));
            check_told(&points, on_wall.x, on_wall.y, true);
        }
    }
}

/// Between the sensor and the corner nobody looks: what comes into view of it may reach to the corner.
#[track_caller]
fn check_at_corner(sensor: usize, range_m: f32, corner: [f64; 2], is_there: bool) {
    let mut ranges = [FAR; TOF_COUNT];
    ranges[sensor] = range_m;
    let (_, points) = told(Params::default(), &[(Pose2::IDENTITY, frame(ranges))]);
    check_told(&points, corner[0], corner[1], is_there);
}

#[test]
fn what_comes_into_view_may_be_at_the_corner_already() {
    check_at_corner(1, 0.2, [0.305, -0.355], true);
    check_at_corner(6, 0.2, [0.305, 0.355], true);
    check_at_corner(0, 0.2, [-0.305, -0.355], true);
    check_at_corner(2, 0.3, [0.455, -0.285], true);
    check_at_corner(5, 0.3, [0.455, 0.285], true);
    // Right at the sensor.
    check_at_corner(2, 0.05, [0.335, -0.285], true);
    check_at_corner(1, 0.03, [0.305, -0.285], true);
    // Farther away there is time; and the inner sensors have neighbours.
    check_at_corner(1, 0.3, [0.305, -0.405], false);
    check_at_corner(2, 0.4, [0.505, -0.285], false);
    check_at_corner(3, 0.3, [0.455, -0.285], false);
}

#[test]
fn a_box_beside_the_wall_is_no_wall_across_the_way() {
    // The nose is beside the box, the tail still beside the wall.
    let poses = (0..20).map(|step| Pose2::new(0.02 * f64::from(step), 0.0, 0.0));
    let looks: Vec<_> = poses
        .map(|pose| {
            let side_m = |x_m: f64| if pose.x_m + x_m > 0.30 { 0.10 } else { 0.30 };
            (pose, frame([side_m(-0.1385), side_m(0.1385), FAR, FAR, FAR, FAR, FAR, FAR]))
        })
        .collect();
    let (_, points) = told(Params::default(), &looks);
    let in_the_way = points.iter().filter(|point| point.x > 0.31 && point.y.abs() < 0.30);
    assert_eq!(in_the_way.count(), 0, "{points:?}");
}

#[test]
fn the_walls_of_the_map_are_near_while_the_pose_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("room.toml");
    let world = "name = \"room\"\n[[floor]]\nnumber = 2\nwalls = [[[0.0, 0.0], [10.0, 0.0]]]\n";
    std::fs::write(&file, world).unwrap();
    let params = Params { world: file.to_str().unwrap().to_owned(), ..Params::default() };
    let points = |change: fn(&mut PoseEstimate)| {
        let mut pose = PoseEstimate {
            x_m: 5.0,
            y_m: 0.5,
            floor: 2,
            state: LocationStateName::Tracking.into(),
            ..PoseEstimate::default()
        };
        pose.covariance[0] = 0.0025;
        change(&mut pose);
        let mut guard = CollisionAvoidance::new(params.clone()).unwrap();
        let (now, odometry) = (Time::from_secs_f64(1.0), Odometry::default());
        let inputs = Inputs {
            odometry: Some(Stamped::new(now, &odometry)),
            pose: Some(Stamped::new(now, &pose)),
            ..Inputs::default()
        };
        guard.step(now, inputs).near.len()
    };
    assert!(points(|_| ()) > 20);
    assert_eq!(points(|pose| pose.y_m = 3.0), 0);
    assert_eq!(points(|pose| pose.floor = 3), 0);
    assert_eq!(points(|pose| pose.covariance[4] = 0.04), 0);
    assert_eq!(points(|pose| pose.covariance[8] = f64::NAN), 0);
    assert_eq!(points(|pose| pose.state = LocationStateName::Lost.into()), 0);
    let missing = Params { world: "no such file".to_owned(), ..Params::default() };
    assert!(CollisionAvoidance::new(missing).is_err_and(|error| error.to_string().starts_with("world: ")));
}

#[test]
fn a_successor_tells_what_its_predecessor_saw() {
    let now = Time::from_secs_f64(1.0);
    let (ranges, odometry) = (ahead([FAR, 0.4, FAR, FAR]), Odometry::default());
    let mut first = CollisionAvoidance::new(Params::default()).unwrap();
    let inputs = Inputs {
        ranges: Some(Stamped::new(now, &ranges)),
        odometry: Some(Stamped::new(now, &odometry)),
        ..Inputs::default()
    };
    let count = first.step(now, inputs).near.len();
    let text = serde_json::to_string(&first.snapshot()).unwrap();
    let mut successor = CollisionAvoidance::new(Params::default()).unwrap();
    successor.restore(&serde_json::from_str(&text).unwrap());
    let inputs = Inputs { ranges: None, ..inputs };
    let near = successor.step(now, inputs).near.len();
    // Not the rims of the views, and not yet what is only assumed.
    assert!(near > 0 && near <= count, "{near} of {count}");
}

proptest! {
    #[test]
    fn no_more_is_told_than_there_is_room_for(
        looks in prop::collection::vec((prop::array::uniform3(-1.0..1.0_f64), any_ranges()), 1..60)
    ) {
        let looks: Vec<_> = looks.into_iter().map(|([x, y, heading], ranges)| (Pose2::new(x, y, heading), ranges)).collect();
        let (_, points) = told(Params::default(), &looks);
        prop_assert!(points.len() <= 256 && points.iter().all(|point| point.x.is_finite() && point.y.is_finite()));
    }
}
