//! The guard with a laser.

use super::*;

fn laser(params: impl FnOnce(&mut Params)) -> Params {
    let mut all = Params { sensor: Sensor::Laser, ..Params::default() };
    params(&mut all);
    all
}

/// 181 beams from the robot's front edge, each `range_m` of its direction in degrees.
fn scan_of(range_m: impl Fn(i32) -> f32) -> (RangeScan, Vec<f32>) {
    let header = RangeScan {
        sensor_x_m: 0.25,
        angle_min_rad: (-90.0_f64).to_radians(),
        angle_step_rad: 1.0_f64.to_radians(),
        range_max_m: 30.0,
        ..RangeScan::default()
    };
    (header, (-90..=90).map(range_m).collect())
}

fn scan_said(params: Params, scan: &(RangeScan, Vec<f32>)) -> Clearance {
    let mut guard = CollisionAvoidance::new(params).unwrap();
    let mut said = Clearance::default();
    for step in 1..=5 {
        let now = Time::from_secs_f64(f64::from(step) * 0.1);
        let inputs =
            Inputs { scan: Some(Stamped::with_elements(now, &scan.0, &scan.1)), ..Inputs::default() };
        said = guard.step(now, inputs).clearance;
    }
    said
}

#[track_caller]
fn check_scan(range_m: impl Fn(i32) -> f32, reason: Why, faces: u32) {
    let said = scan_said(laser(|_| ()), &scan_of(range_m));
    assert_eq!((said.reason, said.violated_faces), (reason.into(), faces), "{said:?}");
    assert_eq!(said.signal == Verdict::Go, reason == Why::Clear);
}

#[test]
fn a_laser_guards_the_three_faces() {
    check_scan(|_| 5.0, Why::Clear, 0);
    check_scan(|_| 81.0, Why::Clear, 0);
    check_scan(|_| f32::INFINITY, Why::Clear, 0);
    // The hull's front edge is 55 mm ahead of the sensor.
    check_scan(|degrees| if degrees == 0 { 0.26 } else { 5.0 }, Why::Clear, 0);
    check_scan(|degrees| if degrees == 0 { 0.25 } else { 5.0 }, Why::Violation, Face::Front as u32);
    check_scan(|degrees| if degrees == -90 { 0.31 } else { 5.0 }, Why::Clear, 0);
    check_scan(|degrees| if degrees == -90 { 0.30 } else { 5.0 }, Why::Violation, Face::Right as u32);
    check_scan(|degrees| if degrees == 90 { 0.30 } else { 5.0 }, Why::Violation, Face::Left as u32);
    // Ahead, but beside the body's width and margin.
    check_scan(|degrees| if degrees == 75 { 0.35 } else { 5.0 }, Why::Clear, 0);
    // Within the hull.
    check_scan(|degrees| if degrees == 0 { 0.01 } else { 5.0 }, Why::Violation, Face::Front as u32);
    check_scan(|_| f32::NAN, Why::SensorFault, 0);
    check_scan(|_| 0.0, Why::SensorFault, 0);
    check_scan(|degrees| if degrees % 3 == 0 { 0.0 } else { 5.0 }, Why::Clear, 0);
    let mut broken = scan_of(|_| 5.0);
    broken.0.angle_step_rad = f64::NAN;
    assert_eq!(scan_said(laser(|_| ()), &broken).reason, Why::SensorFault);
    let mut backwards = scan_of(|_| 5.0);
    backwards.0.sensor_heading_rad = std::f64::consts::PI;
    assert_eq!(scan_said(laser(|_| ()), &backwards).reason, Why::SensorFault);
    assert_eq!(scan_said(laser(|_| ()), &(RangeScan::default(), Vec::new())).reason, Why::SensorFault);
    let (header, ranges) = scan_of(|_| 5.0);
    assert_eq!(scan_said(Params::default(), &(header, ranges)).reason, Why::Start);
}

proptest! {
    #[test]
    fn any_scan_is_survived(header in prop::array::uniform6(any::<f64>()), ranges in prop::collection::vec(any::<f32>(), 0..50)) {
        let [sensor_x_m, sensor_y_m, sensor_heading_rad, angle_min_rad, angle_step_rad, range_max_m] = header;
        let header = RangeScan { sensor_x_m, sensor_y_m, sensor_heading_rad, angle_min_rad, angle_step_rad, range_max_m };
        let said = scan_said(laser(|_| ()), &(header, ranges));
        prop_assert!(said.front_m >= 0.0 && said.right_m >= 0.0 && said.left_m >= 0.0);
    }
}

// ---- What cannot be seen.

#[test]
fn too_near_to_be_measured_is_the_nearest_there_is() {
    let all = |direction: fn(i32) -> bool| {
        move |degrees: i32| if direction(degrees) { f32::NEG_INFINITY } else { 5.0 }
    };
    check_scan(all(|degrees| degrees < -46), Why::Violation, Face::Right as u32 | Face::Front as u32);
    check_scan(all(|degrees| degrees < -81), Why::Violation, Face::Right as u32);
    check_scan(all(|degrees| degrees == -90), Why::Violation, Face::Right as u32);
    check_scan(all(|degrees| degrees > 78), Why::Violation, Face::Front as u32 | Face::Left as u32);
    check_scan(all(|degrees| degrees == 85), Why::Violation, Face::Left as u32);
    check_scan(all(|degrees| degrees == 3), Why::Violation, Face::Front as u32);
    check_scan(all(|_| true), Why::Violation, 7);
}

/// The reason, and what each face has to say when these directions cannot be read and everything else is 5 m
/// away.
fn blind(where_to: impl Fn(i32) -> bool) -> (Why, [f32; 3]) {
    let said = scan_said(laser(|_| ()), &scan_of(|degrees| if where_to(degrees) { f32::NAN } else { 5.0 }));
    (said.reason.get().unwrap(), [said.front_m, said.right_m, said.left_m])
}

#[track_caller]
fn check_blind(where_to: impl Fn(i32) -> bool, faces: [bool; 3]) {
    let (reason, said_m) = blind(where_to);
    assert_eq!(reason == Why::Clear, faces == [false; 3], "{said_m:?}");
    assert_eq!(said_m.map(|said_m| said_m == 0.0), faces, "{reason:?} {said_m:?}");
}

#[test]
fn a_face_that_cannot_be_seen_is_a_fault_of_that_face() {
    check_blind(|_| false, [false; 3]);
    check_blind(|_| true, [true; 3]);
    // Only the beam straight ahead can be read.
    check_blind(|degrees| degrees != 0 && degrees.abs() <= 40, [true, false, false]);
    // Two of three beams.
    check_blind(|degrees| degrees % 3 != 0, [true, true, true]);
    check_blind(|degrees| degrees % 3 == 0, [false; 3]);
    check_blind(|degrees| degrees < -75, [false, true, false]);
    check_blind(|degrees| degrees > 75, [false, false, true]);
    // A hole in which a leg could stand at the radius.
    check_blind(|degrees| (10..40).contains(&degrees), [true, false, false]);
    check_blind(|degrees| (10..13).contains(&degrees), [false; 3]);
}

#[test]
fn what_could_hide_in_a_gap_counts_as_there() {
    let (_, [whole_m, ..]) = blind(|_| false);
    assert!(whole_m > 4.9);
    // Ten centimetres fit between beams 4 degrees apart from 1.43 m on.
    let (_, [front_m, ..]) = blind(|degrees| (-1..=1).contains(&degrees));
    assert!((1.2..1.45).contains(&front_m), "{front_m}");
}

#[track_caller]
fn check_covers(from_degrees: f64, to_degrees: f64, faces: [bool; 3]) {
    let beams = 181;
    let header = RangeScan {
        sensor_x_m: 0.25,
        angle_min_rad: from_degrees.to_radians(),
        angle_step_rad: (to_degrees - from_degrees).to_radians() / f64::from(beams - 1),
        range_max_m: 30.0,
        ..RangeScan::default()
    };
    let said = scan_said(laser(|_| ()), &(header, vec![5.0; beams as usize]));
    assert_eq!([said.front_m, said.right_m, said.left_m].map(|said_m| said_m == 0.0), faces, "{said:?}");
    assert_eq!(said.signal == Verdict::Go, faces == [false; 3]);
}

#[test]
fn a_scan_that_does_not_cover_a_face_does_not_guard_it() {
    check_covers(-90.0, 90.0, [false; 3]);
    check_covers(90.0, -90.0, [false; 3]);
    check_covers(-135.0, 135.0, [false; 3]);
    check_covers(-179.0, 179.0, [false; 3]);
    check_covers(-45.0, 45.0, [true; 3]);
    check_covers(-90.0, 0.0, [true, false, true]);
    check_covers(90.0, 270.0, [true, true, true]);
}

proptest! {
    /// A world of a few things as wide as a leg or wider, seen by a laser some of whose beams cannot be read:
    /// the guard never says that a face is farther than the nearest of them, whichever beams it could not
    /// read.
    #[test]
    fn no_face_is_said_to_be_farther_than_it_is(
        things in prop::collection::vec((-1.6..1.6_f64, 0.35..3.0_f64, 0.05..0.3_f64), 0..4),
        blind in prop::collection::vec((-95_i32..95, 1_i32..60), 0..6),
        unreadable in prop_oneof![Just(f32::NAN), Just(0.0_f32), Just(-1.0_f32)],
    ) {
        let params = laser(|_| ());
        let hull = params.hull();
        let discs: Vec<_> = things.iter()
            .map(|&(bearing, range, radius)| (0.25 + range * bearing.cos(), range * bearing.sin(), radius))
            .filter(|&(x, y, radius)| hull.distance_to_m(geometry::Point2::new(x, y)) > radius)
            .collect();
        let range_m = |degrees: i32| {
            let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
            discs.iter().filter_map(|&(x, y, radius)| {
                let (x, y) = (x - 0.25, y);
                let (along, aside) = (x * cosine + y * sine, -x * sine + y * cosine);
                (along > 0.0 && aside.abs() <= radius).then(|| along - (radius * radius - aside * aside).sqrt())
            }).fold(f64::INFINITY, f64::min)
        };
        let is_blind = |degrees: i32| blind.iter().any(|&(from, count)| (from..from + count).contains(&degrees));
        let scan = scan_of(|degrees| if is_blind(degrees) { unreadable } else { range_m(degrees) as f32 });
        let said = scan_said(params.clone(), &scan);
        // What is seen of each face with all beams, finely.
        let full = scan_said(params.clone(), &scan_of(|degrees| range_m(degrees) as f32));
        for (name, said_m, true_m) in [("front", said.front_m, full.front_m), ("right", said.right_m, full.right_m), ("left", said.left_m, full.left_m)] {
            // A disc is met by no beam but those that pass; its rim may lie beside the last of them, and its
            // middle be 1.5 times a beam's width off.
            prop_assert!(said_m <= true_m + 0.12, "{name}: {said_m} m said, {true_m} m true");
        }
        let violated = full.violated_faces != 0;
        prop_assert!(!violated || said.signal == Verdict::Stop, "{said:?} although {full:?}");
    }
}
