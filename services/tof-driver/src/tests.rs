use super::*;
use geometry::World;
use messages::{RangeStatusName, Reading};
use proptest::prelude::*;

/// A hallway 1.7 m wide along x with a closed door at x = 10 on its right, long enough that its ends are far.
pub(crate) const HALLWAY: &str = r#"
name = "hallway"
[[floor]]
number = 2
walls = [[[-20.0, -0.85], [20.0, -0.85]], [[-20.0, 0.85], [20.0, 0.85]]]
[[door]]
room = "210"
floor = 2
at = [10.0, -0.85]
into_room = [0, -1]
"#;

pub(crate) fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

pub(crate) fn truth(x_m: f64, y_m: f64, heading_rad: f64) -> WorldTruth {
    WorldTruth { x_m, y_m, heading_rad, floor: 2, ..WorldTruth::default() }
}

pub(crate) fn sensors(params: Params, world: &str) -> SimulatedTof {
    SimulatedTof::in_world(params, &World::parse(world).unwrap(), 11)
}

pub(crate) fn silent_noise() -> Params {
    Params { noise: NoiseProfile::None, no_target_fraction: 1.0, ..Params::default() }
}

pub(crate) fn frame(device: &mut SimulatedTof, truth: &WorldTruth) -> TofRanges {
    device.see(Some(Stamped::new(at(5), truth)));
    device.read(at(5)).unwrap()
}

fn distance_m(ranges: &TofRanges, sensor: usize) -> f64 {
    match ranges.reading(sensor) {
        Reading::Distance(range_m) => range_m.into(),
        other => panic!("sensor {sensor}: {other:?}"),
    }
}

/// What each sensor reads, in mm, where `None` stands for no target.
#[track_caller]
fn check(pose: (f64, f64, f64), expected_mm: [Option<i32>; 8]) {
    let ranges = frame(&mut sensors(silent_noise(), HALLWAY), &truth(pose.0, pose.1, pose.2));
    let read = std::array::from_fn(|sensor| match ranges.reading(sensor) {
        Reading::Distance(range_m) => Some((range_m * 1000.0).round() as i32),
        Reading::NoTarget => None,
        other => panic!("sensor {sensor}: {other:?}"),
    });
    assert_eq!(read, expected_mm);
}

#[test]
fn sees_walls_at_their_distance() {
    let [near, far] = [Some(245), Some(945)];
    check((0.0, -0.35, 0.0), [near, near, None, None, None, None, far, far]);
    let middle = Some(595);
    check((0.0, 0.0, 0.0), [middle, middle, None, None, None, None, middle, middle]);
    // On the left, looking back: what was right is left.
    check((0.0, -0.35, std::f64::consts::PI), [far, far, None, None, None, None, near, near]);
    // A closed door is 100 mm deeper than the wall.
    check((10.0, -0.35, 0.0), [Some(345), Some(345), None, None, None, None, far, far]);
}

#[test]
fn looks_at_a_wall_ahead_with_all_four_front_sensors() {
    let [ahead, aside] = [Some(345), None];
    check((0.0, 0.2, std::f64::consts::FRAC_PI_2), [aside, aside, ahead, ahead, ahead, ahead, aside, aside]);
}

/// The angle that the paper's formula gives for a robot turned by `true_deg` (COF-081), seen by sensors
/// without noise.
#[track_caller]
fn check_angle(y_m: f64, true_deg: f64, tolerance_deg: f64) {
    let ranges = frame(&mut sensors(silent_noise(), HALLWAY), &truth(0.0, y_m, true_deg.to_radians()));
    let angle_rad = ((distance_m(&ranges, 1) - distance_m(&ranges, 0)) / TofRanges::SIDE_BASE_M).atan();
    assert!((angle_rad.to_degrees() - true_deg).abs() < tolerance_deg, "{}", angle_rad.to_degrees());
}

#[test]
fn side_sensors_give_the_papers_angles() {
    check_angle(-0.35, 0.0, 0.2);
    check_angle(-0.35, 5.0, 0.4);
    check_angle(-0.30, -5.0, 0.4);
    check_angle(-0.30, 12.0, 0.6);
    check_angle(-0.30, 35.0, 1.0);
}

/// Mean and standard deviation of sensor 0 over many frames at the right wall.
fn statistics(noise: NoiseProfile) -> (f64, f64) {
    let mut device = sensors(Params { noise, ..Params::default() }, HALLWAY);
    let place = truth(0.0, -0.35, 0.0);
    let readings: Vec<f64> = (0..2000).map(|_| distance_m(&frame(&mut device, &place), 0)).collect();
    let mean = readings.iter().sum::<f64>() / 2000.0;
    (mean, (readings.iter().map(|reading| (reading - mean).powi(2)).sum::<f64>() / 1999.0).sqrt())
}

#[test]
fn readings_scatter_as_their_profile_says() {
    let (mean, sigma) = statistics(NoiseProfile::Paper);
    assert!((mean - 0.245).abs() < 0.001 && (0.0046..0.0054).contains(&sigma), "{mean} {sigma}");
    let (mean, sigma) = statistics(NoiseProfile::Datasheet);
    assert!((mean - 0.245).abs() < 0.001 && (0.0061..0.0073).contains(&sigma), "{mean} {sigma}");
}

#[test]
fn above_one_metre_there_is_only_noise() {
    let mut device = sensors(Params::default(), HALLWAY);
    let place = truth(0.0, -0.35, 0.0);
    let (mut nothing, mut low, mut high) = (0, f64::INFINITY, 0.0_f64);
    for _ in 0..2000 {
        match frame(&mut device, &place).reading(3) {
            Reading::NoTarget => nothing += 1,
            Reading::Distance(range_m) => (low, high) = (low.min(range_m.into()), high.max(range_m.into())),
            other => panic!("{other:?}"),
        }
    }
    assert!((900..1100).contains(&nothing), "{nothing}");
    assert!((1.0..1.05).contains(&low) && (2.85..=2.9).contains(&high), "{low} {high}");
}

#[test]
fn too_near_is_clipped_at_the_minimum() {
    let ranges = frame(&mut sensors(silent_noise(), HALLWAY), &truth(0.0, -0.58, 0.0));
    assert_eq!(ranges.status[0], RangeStatusName::MinimumClipped);
    assert_eq!(ranges.reading(0), Reading::Distance(0.040));
}

#[track_caller]
fn check_reach(mode: DistanceMode, strong_light: bool, timing_budget_ms: u32, expected_m: f64) {
    let params = Params { mode, strong_light, timing_budget_ms, period_ms: 200, ..Params::default() };
    params.check().unwrap();
    assert_eq!(params.reach_m(), expected_m);
}

#[test]
fn modes_have_their_reach() {
    check_reach(DistanceMode::Short, false, 20, 1.3);
    check_reach(DistanceMode::Short, true, 20, 1.3);
    check_reach(DistanceMode::Medium, false, 33, 2.9);
    check_reach(DistanceMode::Medium, true, 33, 0.7);
    check_reach(DistanceMode::Long, false, 33, 3.6);
    check_reach(DistanceMode::Long, false, 140, 4.0);
    check_reach(DistanceMode::Long, true, 140, 0.7);
}

#[test]
fn strong_light_blinds_beyond_its_reach() {
    let params = Params { strong_light: true, ..silent_noise() };
    let ranges = frame(&mut sensors(params, HALLWAY), &truth(0.0, -0.35, 0.0));
    assert_eq!((ranges.reading(0), ranges.reading(6)), (Reading::Distance(0.245), Reading::NoTarget));
}

#[test]
fn broken_sensors_say_so() {
    let params = Params { broken_sensors: vec![2], ..Params::default() };
    let ranges = frame(&mut sensors(params, HALLWAY), &truth(0.0, -0.35, 0.0));
    assert_eq!(ranges.reading(2), Reading::Fault);
    assert_ne!(ranges.reading(0), Reading::Fault);
}

#[test]
fn silence_before_the_first_truth_and_faults_after_the_last() {
    let mut driver = TofDriver::with_device(Box::new(sensors(Params::default(), HALLWAY)));
    assert_eq!(driver.step(at(0), Inputs::default()).ranges, None);
    let place = truth(0.0, 0.0, 0.0);
    let seen = Inputs { truth: Some(Stamped::new(at(10), &place)) };
    assert_ne!(driver.step(at(10), seen).ranges.unwrap().reading(0), Reading::Fault);
    assert_ne!(driver.step(at(310), seen).ranges.unwrap().reading(0), Reading::Fault);
    let late = driver.step(at(311), seen).ranges.unwrap();
    assert_eq!(late, ALL_BROKEN);
    assert!((0..TOF_COUNT).all(|sensor| late.reading(sensor) == Reading::Fault));
}

#[test]
fn one_seed_one_noise() {
    let run = |seed| {
        let world = World::parse(HALLWAY).unwrap();
        frame(&mut SimulatedTof::in_world(Params::default(), &world, seed), &truth(0.0, -0.35, 0.0))
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = TofDriver::new(params, 0).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    refuse(Params { timing_budget_ms: 20, ..Params::default() }, "timing_budget_ms = 20 is below the 33 ms");
    refuse(Params { period_ms: 36, ..Params::default() }, "period_ms = 36 has no room");
    refuse(Params { field_of_view_deg: 90.0, ..Params::default() }, "`field_of_view_deg` is 90");
    refuse(Params { noise_above_m: f64::NAN, ..Params::default() }, "`noise_above_m` is not a finite number");
    refuse(Params { broken_sensors: vec![8], ..Params::default() }, "names 8");
    refuse(Params { world: "nowhere.toml".into(), ..Params::default() }, "nowhere.toml");
    assert!(
        TofDriver::new(
            Params { timing_budget_ms: 20, mode: DistanceMode::Short, period_ms: 24, ..Params::default() },
            0
        )
        .is_ok()
    );
}

proptest! {
    /// Whatever the truth claims, every reading is one that a sensor could give.
    #[test]
    fn readings_stay_possible(x in any::<f64>(), y in -2.0f64..2.0, heading in any::<f64>(), floor in 0i32..4) {
        let mut device = sensors(Params::default(), HALLWAY);
        let ranges = frame(&mut device, &WorldTruth { x_m: x, y_m: y, heading_rad: heading, floor, ..WorldTruth::default() });
        for sensor in 0..TOF_COUNT {
            prop_assert_ne!(ranges.reading(sensor), Reading::Fault);
            prop_assert!((0.040..=2.9).contains(&ranges.range_m[sensor]));
        }
    }

    /// In the middle of the hallway, opposite sensors of a robot that looks along it add up to its width.
    #[test]
    fn the_walls_are_a_hallway_apart(x in -10.0f64..8.0, y in -0.3f64..0.3) {
        let ranges = frame(&mut sensors(silent_noise(), HALLWAY), &truth(x, y, 0.0));
        let across_m = distance_m(&ranges, 0) + 0.51 + distance_m(&ranges, 7);
        prop_assert!((across_m - 1.7).abs() < 0.003, "{}", across_m);
    }
}

#[test]
fn mounts_are_those_of_the_paper() {
    let [front, side] = [0.115, TofRanges::SIDE_BASE_M];
    let gap = |a: usize, b: usize| TofRanges::MOUNTS[a].distance_m(TofRanges::MOUNTS[b]);
    assert!([gap(2, 3), gap(3, 4), gap(4, 5)].iter().all(|gap| (gap - front).abs() < 1e-12));
    assert!((gap(0, 1) - side).abs() < 1e-12 && (gap(6, 7) - side).abs() < 1e-12);
}
