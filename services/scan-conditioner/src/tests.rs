use crate::{Inputs, Params, Ring, ScanConditioner, nearest, windows};
use messages::{Parameters, RangeScan, SonarCommand, Stamped, Time};
use proptest::prelude::*;
use std::f64::consts::TAU;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn header() -> RangeScan {
    RangeScan { angle_step_rad: DEGREE, range_max_m: f64::from(2.55_f32), ..RangeScan::default() }
}

/// What a sensor with a cone of ±15 degrees reads in a rectangular room, by the distances of its four walls
/// from the sensor and the direction of the first of them.
fn room(distances_m: [f64; 4], turned_deg: f64) -> Vec<f32> {
    let ray = |direction: f64| {
        let walls = distances_m.iter().enumerate().map(|(quarter, distance_m)| {
            let askew = (direction - turned_deg - 90.0 * quarter as f64) * DEGREE;
            if askew.cos() > 1e-9 { distance_m / askew.cos() } else { f64::INFINITY }
        });
        walls.fold(2.55, f64::min)
    };
    (0..360)
        .map(|index| (-15..=15).map(|aside| ray(f64::from(index + aside))).fold(2.55, f64::min) as f32)
        .collect()
}

#[track_caller]
fn check_nearest(ranges: &[f32], bearing_deg: f64, range_m: f64, tolerance_deg: f64) {
    let ring = Ring::of_scan(&header(), ranges).expect("a ring");
    let (bearing_rad, found_m) = nearest(&ring, &Params::default()).expect("a wall");
    let askew_deg = geometry::angle::difference(bearing_rad, bearing_deg * DEGREE) / DEGREE;
    assert!(askew_deg.abs() <= tolerance_deg, "{askew_deg} deg off");
    assert!((found_m - range_m).abs() < 0.01, "{found_m} m instead of {range_m} m");
}

#[test]
fn the_nearest_wall_is_found_by_what_lies_beside_its_echo() {
    check_nearest(&room([0.2, 0.5, 0.7, 0.6], 0.0), 0.0, 0.2, 1.0);
    check_nearest(&room([0.2, 0.5, 0.7, 0.6], 37.0), 37.0, 0.2, 1.0);
    check_nearest(&room([0.9, 0.5, 0.3, 0.6], -100.0), 80.0, 0.3, 1.0);
    check_nearest(&room([0.9, 0.5, 0.8, 0.25], 10.0), -80.0, 0.25, 1.0);
}

#[test]
fn one_echo_makes_no_wall() {
    let mut ranges = room([0.2, 0.5, 0.7, 0.6], 0.0);
    ranges[180] = 0.05;
    check_nearest(&ranges, 0.0, 0.2, 1.0);
    // And one that is missing breaks none.
    ranges[2] = 2.55;
    check_nearest(&ranges, 0.0, 0.2, 2.0);
}

#[track_caller]
fn check_kept(ranges: &[f32], first_deg: f64, expected: [bool; 4]) {
    let ring = Ring::of_scan(&header(), ranges).expect("a ring");
    let kept = windows(&ring, first_deg * DEGREE, &Params::default()).map(|window| window.is_kept);
    assert_eq!(kept, expected);
}

#[test]
fn windows_look_straight_at_walls() {
    check_kept(&room([0.4, 0.5, 0.55, 0.45], 0.0), 0.0, [true; 4]);
    check_kept(&room([0.4, 0.5, 0.55, 0.45], 30.0), 30.0, [true; 4]);
    // The wall on the right is so near that it shows at the edges of the windows beside it.
    check_kept(&room([0.5, 0.6, 0.5, 0.15], 0.0), 0.0, [true, true, false, true]);
    // Askew by 40 degrees: the readings fall to one side. The first window stays in any case.
    check_kept(&room([0.5, 0.9, 0.7, 0.6], 40.0), 0.0, [true, false, false, false]);
    // Nothing in sight.
    check_kept(&[2.55; 360], 0.0, [true, false, false, false]);
}

fn step(ranges: &[f32], order: &SonarCommand) -> (messages::WallSurvey, Option<Vec<f32>>) {
    let mut conditioner = ScanConditioner::new(Params::default()).expect("default");
    let now = Time::from_nanos(1);
    let header = header();
    let inputs = Inputs {
        raw: Some(Stamped::with_elements(now, &header, ranges)),
        command: Some(Stamped::new(now, order)),
    };
    let outputs = conditioner.step(now, inputs);
    (outputs.survey.expect("a survey"), outputs.scan.map(|(_, kept)| kept.to_vec()))
}

#[test]
fn four_windows_of_31_readings_are_kept() {
    let ranges = room([0.4, 0.5, 0.55, 0.45], 0.0);
    let (survey, scan) =
        step(&ranges, &SonarCommand { command_id: 7, measure: 1, ..SonarCommand::default() });
    let kept = scan.expect("a scan to localise by");
    assert_eq!((survey.command_id, survey.readings, survey.kept_windows), (7, 124, 0b1111));
    for (index, range_m) in kept.iter().enumerate() {
        let within = (0..=4).any(|quarter| (index as i32 - 90 * quarter).abs() <= 15);
        assert_eq!(*range_m, if within { ranges[index] } else { 0.0 }, "at {index} degrees");
    }
}

#[test]
fn a_survey_alone_hands_nothing_on() {
    let ranges = room([0.2, 0.5, 0.7, 0.6], 20.0);
    let (survey, scan) = step(&ranges, &SonarCommand { command_id: 3, ..SonarCommand::default() });
    assert!(scan.is_none());
    assert_eq!((survey.readings, survey.kept_windows), (0, 0));
    assert!((survey.bearing_rad - 20.0 * DEGREE).abs() < 1.5 * DEGREE);
}

#[test]
fn a_scan_is_looked_at_once() {
    let mut conditioner = ScanConditioner::new(Params::default()).expect("default");
    let (header, ranges, now) = (header(), room([0.2; 4], 0.0), Time::from_nanos(1));
    let inputs = Inputs { raw: Some(Stamped::with_elements(now, &header, &ranges)), command: None };
    assert!(conditioner.step(now, inputs).survey.is_some());
    assert!(conditioner.step(now, inputs).survey.is_none());
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    let refused = |params: Params, text: &str| {
        assert!(params.check().is_err_and(|error| error.to_string().contains(text)), "{text}");
    };
    refused(Params { neighbours: 4, ..Params::default() }, "neighbours = 4");
    refused(Params { window_deg: f64::NAN, ..Params::default() }, "`window_deg` is not a finite number");
}

proptest! {
    #[test]
    fn the_nearest_wall_of_any_room(near in 0.10..0.5_f64, more in proptest::array::uniform3(0.1..0.8_f64), turned in -180.0..180.0_f64) {
        let distances = [near, near + more[0], near + more[1], near + more[2]];
        let ring = Ring::of_scan(&header(), &room(distances, turned.round())).expect("a ring");
        let (bearing_rad, range_m) = nearest(&ring, &Params::default()).expect("a wall");
        prop_assert!((range_m - near).abs() < 1e-3);
        // Where the neighbours are near as well the echo is cut off on a side.
        let askew = geometry::angle::difference(bearing_rad, turned.round() * DEGREE).abs();
        prop_assert!(askew < 16.0 * DEGREE);
    }

    #[test]
    fn any_message_is_survived(
        ranges in proptest::collection::vec(any::<f32>(), 0..400), numbers in proptest::array::uniform6(any::<f64>()),
        window_rad in any::<f64>(), measure in 0_u32..3, fitting in any::<bool>(),
    ) {
        let [sensor_x_m, sensor_y_m, sensor_heading_rad, angle_min_rad, angle_step_rad, range_max_m] = numbers;
        let step_rad = if fitting { TAU / ranges.len().max(1) as f64 } else { angle_step_rad };
        let raw = RangeScan { sensor_x_m, sensor_y_m, sensor_heading_rad, angle_min_rad, angle_step_rad: step_rad, range_max_m };
        let order = SonarCommand { command_id: 1, window_rad, measure, ..SonarCommand::default() };
        let mut conditioner = ScanConditioner::new(Params::default()).expect("default");
        let now = Time::from_nanos(1);
        let inputs = Inputs { raw: Some(Stamped::with_elements(now, &raw, &ranges)), command: Some(Stamped::new(now, &order)) };
        let outputs = conditioner.step(now, inputs);
        let survey = outputs.survey.expect("every scan is answered");
        prop_assert!(survey.nearest().is_none_or(|(_, range_m)| range_m > 0.0));
        prop_assert!(outputs.scan.is_none_or(|(_, kept)| kept.len() == ranges.len()));
    }
}
