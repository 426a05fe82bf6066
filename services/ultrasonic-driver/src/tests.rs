use crate::{
    DeviceError, Inputs, NoiseProfile, Params, Reading, SimulatedSonar, UltrasonicDevice, UltrasonicDriver,
};
use geometry::{Pose2, World};
use messages::{
    Parameters, SonarCommand, SonarMode, SonarModeName, SonarStatusName, Stamped, Time, WorldTruth,
};
use proptest::prelude::*;

/// A box, two metres long and one metre wide.
const BOX: &str =
    "name = \"box\"\n[[floor]]\nnumber = 0\noutline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]\n";

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn sonar(params: Params) -> SimulatedSonar {
    SimulatedSonar::in_world(params, &World::parse(BOX).expect("a box"), 1)
}

fn ideal() -> Params {
    Params { noise: NoiseProfile::None, ..Params::default() }
}

#[track_caller]
fn check_ideal(params: Params, x_m: f64, heading_deg: f64, expected_m: f64) {
    let Reading::Echo { range_m } = sonar(params).measure(0, Pose2::new(x_m, 0.5, heading_deg.to_radians()))
    else {
        unreachable!("no echo");
    };
    assert!((range_m - expected_m).abs() < 1e-3, "{range_m} m instead of {expected_m} m");
}

#[test]
fn the_nearest_within_the_cone_counts() {
    check_ideal(ideal(), 0.3, 180.0, 0.3);
    // The perpendicular lies within the cone up to 15 degrees ...
    check_ideal(ideal(), 0.3, 165.0, 0.3);
    // ... and beyond it the cone's edge is 10 degrees askew.
    check_ideal(ideal(), 0.3, 155.0, 0.3 / 10.0_f64.to_radians().cos());
    // A ray has no cone.
    check_ideal(Params { half_cone_deg: 0.0, ..ideal() }, 0.3, 155.0, 0.3 / 25.0_f64.to_radians().cos());
}

#[test]
fn ranges_have_limits() {
    let near = sonar(Params { range_min_m: 0.05, ..ideal() })
        .measure(0, Pose2::new(0.04, 0.5, std::f64::consts::PI));
    assert_eq!(near, Reading::TooNear);
    let far = Params { range_max_m: 1.2, half_cone_deg: 0.0, ..ideal() };
    assert_eq!(sonar(far).measure(0, Pose2::new(0.3, 0.5, 0.0)), Reading::Nothing);
    assert_eq!(sonar(ideal()).measure(7, Pose2::new(0.3, 0.5, 0.0)), Reading::Nothing, "no such floor");
}

/// Mean and standard deviation of the errors at 0.5 m from a wall, and the share without an echo.
fn errors(noise: NoiseProfile, askew_deg: f64) -> (f64, f64, f64) {
    let mut sonar = sonar(Params { noise, half_cone_deg: 0.0, ..Params::default() });
    let expected_m = 0.5 / askew_deg.to_radians().cos();
    let pose = Pose2::new(0.5, 0.5, (180.0 - askew_deg).to_radians());
    let errors: Vec<f64> = (0..2000)
        .filter_map(|_| match sonar.measure(0, pose) {
            Reading::Echo { range_m } => Some(range_m - expected_m),
            _ => None,
        })
        .collect();
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let variance = errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt(), 1.0 - count / 2000.0)
}

#[test]
fn errors_grow_with_the_angle_of_incidence() {
    let (mean_m, sigma_m, lost) = errors(NoiseProfile::Paper, 0.0);
    assert!(mean_m.abs() < 0.001 && (0.009..0.012).contains(&sigma_m) && lost == 0.0, "{mean_m} {sigma_m}");
    let (mean_30_m, sigma_30_m, _) = errors(NoiseProfile::Paper, 30.0);
    let (mean_40_m, sigma_40_m, lost_40) = errors(NoiseProfile::Paper, 40.0);
    assert!(mean_30_m > mean_m && mean_40_m > mean_m, "weak echoes are late");
    assert!(sigma_30_m > sigma_m && sigma_40_m > sigma_m, "{sigma_30_m} {sigma_40_m}");
    assert!(lost_40 > 0.03, "{lost_40}");
}

#[test]
fn corners_are_heard_and_edges_less() {
    // A corner within the cone answers as a wall does that faces the sensor; an edge as one that is met
    // askew.
    let spread = |world: &str, place: Pose2| {
        let world = World::parse(world).expect("a world");
        let params = Params {
            resolution_m: 0.0,
            lost_share: 0.0,
            ray_step_deg: 0.1,
            half_cone_deg: 0.3,
            ..Params::default()
        };
        let mut sonar = SimulatedSonar::in_world(params, &world, 5);
        let ranges: Vec<f64> = (0..2000)
            .filter_map(|_| match sonar.measure(0, place) {
                Reading::Echo { range_m } => Some(range_m),
                _ => None,
            })
            .collect();
        let mean = ranges.iter().sum::<f64>() / ranges.len() as f64;
        (ranges.iter().map(|range| (range - mean).powi(2)).sum::<f64>() / ranges.len() as f64).sqrt()
    };
    let square = "name = \"square\"\n[[floor]]\nnumber = 0\noutline = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]\n";
    let corner_m = spread(square, Pose2::new(1.0, 1.0, 45.0_f64.to_radians()));
    assert!((0.009..0.0115).contains(&corner_m), "{corner_m}");
    // An L: from below its arm's end both of its walls are met at 45 degrees.
    let bent = "name = \"L\"\n[[floor]]\nnumber = 0\noutline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]\n";
    let edge_m = spread(bent, Pose2::new(0.5, 0.5, 45.0_f64.to_radians()));
    assert!(edge_m > 1.5 * corner_m, "{edge_m} for {corner_m}");
    // One of the walls of the edge faces this sensor nearly.
    let faced_m = spread(bent, Pose2::new(0.5, 0.98, 2.0_f64.to_radians()));
    assert!(faced_m < 1.2 * corner_m, "{faced_m} for {corner_m}");
}

#[test]
fn botsim_scatters_in_x_and_y_alike() {
    for askew_deg in [0.0, 40.0] {
        let (mean_m, sigma_m, lost) = errors(NoiseProfile::Botsim, askew_deg);
        assert!(
            mean_m.abs() < 0.001 && (0.009..0.011).contains(&sigma_m) && lost == 0.0,
            "{mean_m} {sigma_m}"
        );
    }
}

/// A sensor that says along which direction it looks.
#[derive(Debug)]
struct Compass(Result<(), DeviceError>);

impl UltrasonicDevice for Compass {
    fn ping(&mut self, _now: Time, direction_rad: f64) -> Result<Reading, DeviceError> {
        self.0.map(|()| Reading::Echo { range_m: 0.1 + direction_rad })
    }
}

fn driver(device: Compass) -> UltrasonicDriver {
    let params = Params { range_max_m: 10.0, ..Params::default() };
    UltrasonicDriver::with_device(params, Box::new(device)).expect("a driver")
}

fn order(command_id: u64, mode: SonarModeName) -> SonarCommand {
    SonarCommand { command_id, mode: mode.into(), ..SonarCommand::default() }
}

#[test]
fn a_scan_goes_once_around_and_then_it_watches_ahead_again() {
    let mut driver = driver(Compass(Ok(())));
    let scan = order(1, SonarModeName::Ultrascan);
    let (mut scans, mut ahead_at) = (Vec::new(), Vec::new());
    for step in 0..200 {
        let now = at(20 * step);
        let outputs = driver.step(now, Inputs { command: Some(Stamped::new(now, &scan)), truth: None });
        if let Some((header, ranges)) = outputs.scan {
            assert_eq!(ranges.len(), 360);
            for index in 0..ranges.len() {
                let (direction_rad, range_m) = header.beam(ranges, index).expect("a reading");
                assert!((range_m - 0.1 - direction_rad).abs() < 1e-5);
            }
            scans.push(step);
        }
        ahead_at.extend(outputs.ahead.map(|ahead| (step, ahead.range_m)));
    }
    // 360 readings of 5 ms each, and back four times as fast.
    assert_eq!(scans, [89]);
    assert_eq!(ahead_at.first(), Some(&(113, 0.1)));
    assert_eq!(ahead_at.len(), 87);
}

#[test]
fn it_returns_when_it_is_told_to() {
    let mut driver = driver(Compass(Ok(())));
    let (scan, back) = (order(1, SonarModeName::Ultrascan), order(2, SonarModeName::Return));
    for step in 0..100 {
        let now = at(20 * step);
        let command = if step < 10 { &scan } else { &back };
        let outputs = driver.step(now, Inputs { command: Some(Stamped::new(now, command)), truth: None });
        assert!(outputs.scan.is_none() && outputs.ahead.is_none());
    }
    let watch = order(3, SonarModeName::WatchAhead);
    let outputs = (100..103).map(|step| {
        let now = at(20 * step);
        driver.step(now, Inputs { command: Some(Stamped::new(now, &watch)), truth: None }).ahead.is_some()
    });
    assert_eq!(outputs.collect::<Vec<_>>(), [false, true, true]);
}

#[test]
fn a_silent_sensor_is_a_fault_and_one_never_heard_says_nothing() {
    let silent =
        driver(Compass(Err(DeviceError::Silent { silent_ms: 400 }))).step(at(0), Inputs::default()).ahead;
    assert_eq!(silent.map(|ahead| ahead.status.get()), Some(Ok(SonarStatusName::Fault)));
    assert!(driver(Compass(Err(DeviceError::NeverHeard))).step(at(0), Inputs::default()).ahead.is_none());
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    let refused = |params: Params, text: &str| {
        assert!(params.check().is_err_and(|error| error.to_string().contains(text)), "{text}");
    };
    refused(Params { sigma_m: f64::NAN, ..Params::default() }, "`sigma_m` is not a finite number");
    refused(Params { lost_from_deg: 70.0, ..Params::default() }, "lost_from_deg = 70");
    refused(Params { readings: 0, ..Params::default() }, "`readings` is 0");
}

proptest! {
    #[test]
    fn any_message_is_survived(
        numbers in proptest::array::uniform3(any::<f64>()), ids in proptest::collection::vec((any::<u64>(), any::<u32>()), 1..30), floor in any::<i32>(),
    ) {
        let params = Params { readings: 16, ..Params::default() };
        let mut driver = UltrasonicDriver::with_device(params.clone(), Box::new(sonar(params))).expect("a driver");
        let [x_m, y_m, heading_rad] = numbers;
        let truth = WorldTruth { x_m, y_m, heading_rad, floor, ..WorldTruth::default() };
        for (step, (command_id, mode)) in (0..).zip(ids) {
            let command = SonarCommand { command_id, mode: SonarMode(mode % 5), window_rad: x_m, measure: mode };
            let now = at(20 * step);
            let inputs = Inputs { command: Some(Stamped::new(now, &command)), truth: Some(Stamped::new(now, &truth)) };
            let outputs = driver.step(now, inputs);
            prop_assert!(outputs.ahead.is_none_or(|ahead| ahead.distance_m().is_some()));
        }
    }

    #[test]
    fn readings_stay_within_their_limits(x in 0.05..1.95_f64, y in 0.05..0.95_f64, heading in -3.0..3.0_f64) {
        let mut sonar = sonar(Params::default());
        match sonar.measure(0, Pose2::new(x, y, heading)) {
            Reading::Echo { range_m } => prop_assert!((0.03..2.55).contains(&range_m)),
            Reading::Nothing | Reading::TooNear => {}
        }
    }
}
