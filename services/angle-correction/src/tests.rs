use crate::*;
use geometry::{Pose2, Ray, Scene};
use messages::{LocationStateName, RangeStatus};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};

/// The hallway outside 209 and 210: 1.7 m wide, a marked area between the doors, an open hallway at the right
/// from 5 m to 7 m.
const WORLD: &str = r#"
name = "outside 209 and 210"
[[floor]]
number = 2
walls = [
  [[0.0, -0.85], [5.0, -0.85], [5.0, -6.0]],
  [[7.0, -6.0], [7.0, -0.85], [20.0, -0.85]],
  [[0.0, 0.85], [20.0, 0.85]],
]
[[door]]
room = "210"
floor = 2
at = [11.0, -0.85]
into_room = [0, -1]
[[area]]
name = "middle"
floor = 2
kind = "measure"
rectangle = { min = [4.0, -0.85], max = [10.4, 0.85] }
"#;

fn world() -> World {
    World::parse(WORLD).unwrap()
}

fn scene() -> Scene {
    world().scene(2).scene
}

fn service(change: impl FnOnce(&mut Params)) -> AngleCorrection {
    let mut params = Params { generate_areas: false, ..Params::default() };
    change(&mut params);
    AngleCorrection::with_world(params, &world()).unwrap()
}

/// What thin beams read at that pose, each with an error in metres.
fn ranges_at(scene: &Scene, pose: Pose2, error_m: impl FnMut() -> f64) -> TofRanges {
    let mut error_m = error_m;
    let mut ranges = TofRanges::default();
    for (sensor, mount) in TofRanges::MOUNTS.iter().enumerate() {
        let mount = pose.compose(*mount);
        let hit = scene.cast_ray(&Ray::level(mount.position(), mount.heading_rad, 0.25), 4.0);
        match hit {
            Some(hit) => ranges.range_m[sensor] = (hit.range_m + error_m()).max(0.0) as f32,
            None => ranges.status[sensor] = RangeStatus(4),
        }
    }
    ranges
}

fn estimate(pose: Pose2) -> PoseEstimate {
    let state = LocationStateName::Tracking.into();
    PoseEstimate {
        x_m: pose.x_m,
        y_m: pose.y_m,
        heading_rad: pose.heading_rad,
        floor: 2,
        state,
        ..PoseEstimate::default()
    }
}

fn degrees(x_m: f64, y_m: f64, degrees: f64) -> Pose2 {
    Pose2::new(x_m, y_m, degrees.to_radians())
}

/// One frame at one pose.
fn once(service: &mut AngleCorrection, pose: Pose2, ranges: &TofRanges) -> Option<HeadingCorrection> {
    let location = estimate(pose);
    let now = Time::from_secs_f64(1.0);
    let inputs = Inputs {
        ranges: Some(Stamped::new(now, ranges)),
        location: Some(Stamped::new(now, &location)),
        ..Inputs::default()
    };
    service.step(now, inputs).correction
}

#[track_caller]
fn check_formula(difference_mm: f64, expected_deg: f64) {
    let front_m = 0.4 + difference_mm / 1000.0;
    let right = wall_angle_rad(front_m, 0.4, Side::Right).to_degrees();
    let left = wall_angle_rad(front_m, 0.4, Side::Left).to_degrees();
    assert!((right - expected_deg).abs() < 0.01 && (left + expected_deg).abs() < 0.01, "{right} {left}");
}

/// Requirements part 5.
#[test]
fn the_formula_gives_the_papers_numbers() {
    check_formula(0.0, 0.0);
    check_formula(4.835, 1.0);
    check_formula(24.234, 5.0);
    check_formula(64.97, 13.2);
    check_formula(567.93, 64.0);
    // Situation 4: 277 tan 19° of the wall and 100 / cos 19° of the recess.
    let difference_mm = 277.0 * 19_f64.to_radians().tan() + 100.0 / 19_f64.to_radians().cos();
    assert!((difference_mm - 201.1).abs() < 0.1);
    check_formula(difference_mm, 35.98);
}

#[track_caller]
fn check_situation(pose: Pose2, side: Side, expected_deg: f64) {
    let ranges = ranges_at(&scene(), pose, || 0.0);
    let said = once(&mut service(|_| ()), pose, &ranges).unwrap();
    assert_eq!((said.valid, said.frames, said.side), (1, 1, side.into()));
    assert!((said.angle_rad.to_degrees() - expected_deg).abs() < 0.01, "{}", said.angle_rad.to_degrees());
    assert_eq!(said.area.as_str(), "middle");
    assert_eq!(said.correct == 1, expected_deg.abs() >= 5.0);
}

/// Fig. 7: situations 1 to 3 in the area, where the calculated angle is the true one.
#[test]
fn situations_1_to_3_are_measured() {
    check_situation(degrees(8.5, -0.35, 35.0), Side::Right, 35.0);
    check_situation(degrees(8.5, -0.35, 0.0), Side::Right, 0.0);
    // The right front sensor looks into the open hallway, and the left wall is nearer.
    check_situation(degrees(4.9, 0.25, 12.0), Side::Left, 12.0);
    // Driving the other way, right and left have changed places, and the sign has not.
    check_situation(degrees(8.5, 0.35, 180.0 + 20.0), Side::Right, 20.0);
    check_situation(degrees(8.5, -0.35, 180.0 - 20.0), Side::Left, -20.0);
}

/// Situation 3: the right sensors would have given a wrong angle, far above the true one.
#[test]
fn the_open_hallway_of_situation_3_would_mislead_the_right_side() {
    let pose = degrees(4.9, 0.25, 12.0);
    let ranges = ranges_at(&scene(), pose, || 0.0);
    let (front, back) = (ranges.reading(1), ranges.reading(0));
    assert!(matches!(front, Reading::Distance(m) if m > 1.0) || front == Reading::NoTarget);
    let Reading::Distance(back_m) = back else { panic!("{back:?}") };
    let front_m = if let Reading::Distance(front_m) = front { front_m } else { 4.0 };
    let misled_rad = wall_angle_rad(front_m.into(), back_m.into(), Side::Right);
    assert!(back_m < 0.85 && misled_rad.to_degrees() > 60.0, "{back_m} {front_m}");
    // Nearer to the right wall, with the back sensor in range: no update at all rather than a wrong one.
    let pose = degrees(4.9, -0.3, 5.0);
    let ranges = ranges_at(&scene(), pose, || 0.0);
    assert!(matches!(ranges.reading(0), Reading::Distance(m) if m < 0.85));
    let left_m = [6, 7].map(|sensor| matches!(ranges.reading(sensor), Reading::Distance(m) if m < 0.85));
    assert_eq!(left_m, [false, false]);
    assert_eq!(once(&mut service(|_| ()), pose, &ranges), None);
}

/// Situation 4: past the area, the front right sensor on a closed door 100 mm deeper than the wall.
#[test]
fn situation_4_is_prevented_and_would_read_36_degrees() {
    let pose = degrees(10.5, -0.45, 19.0);
    let ranges = ranges_at(&scene(), pose, || 0.0);
    let angle_rad = wall_angle_rad(f64::from(ranges.range_m[1]), f64::from(ranges.range_m[0]), Side::Right);
    assert!((angle_rad.to_degrees() - 35.98).abs() < 0.01, "{}", angle_rad.to_degrees());
    assert_eq!(once(&mut service(|_| ()), pose, &ranges), None);
    // Neither do areas made from walls and doors let it pass, nor a marked area that reaches too far.
    let mut everywhere = world();
    everywhere.areas[0].rectangle.as_mut().unwrap().max[0] = 20.0;
    for generate_areas in [false, true] {
        let params = Params { generate_areas, ..Params::default() };
        let mut service = AngleCorrection::with_world(params, &everywhere).unwrap();
        assert_eq!(once(&mut service, pose, &ranges), None);
    }
}

#[track_caller]
fn check_sides(range_m: [f32; 4], expected: Option<Side>) {
    let [d0, d1, d6, d7] = range_m;
    let ranges = TofRanges { range_m: [d0, d1, 3.0, 3.0, 3.0, 3.0, d6, d7], ..TofRanges::default() };
    let said = once(&mut service(|_| ()), degrees(8.5, 0.0, 0.0), &ranges);
    assert_eq!(said.map(|said| said.side), expected.map(Into::into));
}

/// COF-085 to COF-089 and X-20.
#[test]
fn the_nearer_side_with_both_readings_below_850_mm_is_used() {
    check_sides([0.3, 0.3, 1.1, 1.1], Some(Side::Right));
    check_sides([1.1, 1.1, 0.3, 0.3], Some(Side::Left));
    check_sides([0.60, 0.60, 0.59, 0.59], Some(Side::Left));
    check_sides([0.849, 0.849, 1.1, 1.1], Some(Side::Right));
    check_sides([0.850, 0.849, 1.1, 1.1], None);
    check_sides([0.849, 0.850, 1.1, 1.1], None);
    check_sides([0.3, 1.2, 0.7, 0.7], Some(Side::Left));
    check_sides([0.3, 1.2, 0.7, 0.86], None);
    check_sides([f32::NAN, 0.3, 1.1, 1.1], None);
}

#[test]
fn an_obstacle_ahead_prevents_a_measurement() {
    let pose = degrees(8.5, -0.35, 10.0);
    let mut ranges = ranges_at(&scene(), pose, || 0.0);
    let now = Time::from_secs_f64(1.0);
    let location = estimate(pose);
    let with = |clearance: Option<Clearance>, ranges: &TofRanges| {
        let inputs = Inputs {
            ranges: Some(Stamped::new(now, ranges)),
            location: Some(Stamped::new(now, &location)),
            clearance: clearance.as_ref().map(|clearance| Stamped::new(now, clearance)),
            odometry: None,
        };
        service(|_| ()).step(now, inputs).correction.is_some()
    };
    let warning = |faces: u32| Clearance {
        violated_faces: faces,
        reason: GuardReasonName::Violation.into(),
        ..Clearance::default()
    };
    assert!(with(None, &ranges));
    assert!(with(Some(warning(0)), &ranges));
    assert!(with(Some(warning(Face::Right as u32)), &ranges));
    assert!(!with(Some(warning(Face::Front as u32)), &ranges));
    assert!(!with(
        Some(Clearance { reason: GuardReasonName::Remembered.into(), ..Clearance::default() }),
        &ranges
    ));
    (ranges.range_m[3], ranges.status[3]) = (0.19, RangeStatus(0));
    assert!(!with(None, &ranges));
}

/// A drive along x at 0.4 m/s with 10 frames a second, from and to.
fn drive(service: &mut AngleCorrection, from_m: f64, to_m: f64) -> Vec<(f64, HeadingCorrection)> {
    let scene = scene();
    let mut said = Vec::new();
    for step in 0..=((to_m - from_m) / 0.04) as usize {
        let pose = degrees(from_m + 0.04 * step as f64, -0.35, 0.0);
        let now = Time::from_secs_f64(1.0 + 0.1 * step as f64);
        let (ranges, location) = (ranges_at(&scene, pose, || 0.0), estimate(pose));
        let inputs = Inputs {
            ranges: Some(Stamped::new(now, &ranges)),
            location: Some(Stamped::new(now, &location)),
            ..Inputs::default()
        };
        said.extend(service.step(now, inputs).correction.map(|correction| (pose.x_m, correction)));
    }
    said
}

/// COF-084: at once on entering, then averages, and one last word on leaving.
#[test]
fn entering_an_area_speaks_at_once() {
    let said = drive(&mut service(|_| ()), 6.5, 11.5);
    // The right wall is whole from 7.14 m on (the back sensor), and the left one is too far.
    let (first, last) = (said.first().unwrap(), said.last().unwrap());
    assert!((first.0 - 7.16).abs() < 0.03 && (first.1.valid, first.1.frames) == (1, 1), "{first:?}");
    assert_eq!(said[1].1.frames, 5);
    assert!((last.0 - 10.38).abs() < 0.06 && last.1.valid == 0, "{last:?}");
    assert!(said[1..said.len() - 1].iter().all(|(_, correction)| (5..=25).contains(&correction.frames)));
}

#[test]
fn walls_without_doors_give_areas() {
    let mut without_marks = world();
    without_marks.areas.clear();
    let mut service = AngleCorrection::with_world(Params::default(), &without_marks).unwrap();
    let said = drive(&mut service, 6.5, 13.5);
    let measured: Vec<_> = said.iter().filter(|(_, said)| said.valid == 1).map(|&(x_m, _)| x_m).collect();
    // From 7.0 + 0.377 on, up to the door's edge at 10.545 less 0.377, and again from 11.455 + 0.377 on.
    assert!(measured.iter().all(|x_m| (7.37..10.17).contains(x_m) || *x_m > 11.83), "{measured:?}");
    assert!(
        measured.iter().any(|x_m| *x_m < 7.42) && measured.iter().any(|x_m| (11.83..11.90).contains(x_m))
    );
}

#[test]
fn elsewhere_nothing_is_said() {
    let pose = degrees(2.0, -0.35, 0.0);
    let ranges = ranges_at(&scene(), pose, || 0.0);
    assert_eq!(once(&mut service(|_| ()), pose, &ranges), None);
    let pose = degrees(8.5, -0.35, 0.0);
    let ranges = ranges_at(&scene(), pose, || 0.0);
    assert_eq!(once(&mut AngleCorrection::new(Params::default()).unwrap(), pose, &ranges), None);
    let lost = PoseEstimate { state: LocationStateName::Lost.into(), ..estimate(pose) };
    let now = Time::from_secs_f64(1.0);
    let inputs = |location, at: Time| Inputs {
        ranges: Some(Stamped::new(now, &ranges)),
        location: Some(Stamped::new(at, location)),
        ..Inputs::default()
    };
    assert_eq!(service(|_| ()).step(now, inputs(&lost, now)).correction, None);
    let upstairs = PoseEstimate { floor: 3, ..estimate(pose) };
    assert_eq!(service(|_| ()).step(now, inputs(&upstairs, now)).correction, None);
    let late = Time::from_secs_f64(1.4);
    assert_eq!(service(|_| ()).step(late, inputs(&estimate(pose), late)).correction, None);
}

/// Errors in degrees over many visits: of the first frame, and of the average after `frames`.
fn errors(frames: usize, turning: bool) -> (Vec<f64>, Vec<f64>) {
    let scene = scene();
    let mut random = rand_pcg::Pcg64::seed_from_u64(7);
    let noise = Normal::new(0.0, 0.005).unwrap();
    let (mut singles, mut averages) = (Vec::new(), Vec::new());
    for visit in 0..200 {
        let mut service = service(|_| ());
        for frame in 0..frames {
            let turned_deg = if turning { 0.8 * frame as f64 } else { 0.0 };
            let truth_deg = f64::from(visit % 41 - 20) + turned_deg;
            let pose = degrees(8.5, -0.35, truth_deg);
            let ranges = ranges_at(&scene, pose, || noise.sample(&mut random));
            let odometry = Odometry { heading_rad: (turned_deg + 77.0).to_radians(), ..Odometry::default() };
            let now = Time::from_secs_f64(1.0 + 0.1 * frame as f64);
            let location = estimate(pose);
            let inputs = Inputs {
                ranges: Some(Stamped::new(now, &ranges)),
                location: Some(Stamped::new(now, &location)),
                clearance: None,
                odometry: Some(Stamped::new(now, &odometry)),
            };
            if let Some(said) = service.step(now, inputs).correction.filter(|said| said.valid == 1) {
                let error_deg = said.angle_rad.to_degrees() - truth_deg;
                match (said.frames, frame + 1 == frames) {
                    (1, _) => singles.push(error_deg),
                    (_, true) => averages.push(error_deg),
                    _ => {}
                }
            }
        }
    }
    (singles, averages)
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

/// COF-093 and X-22, with 5 mm of noise: a single frame is good for 1.5 degrees (one deviation), averages for
/// 1 degree.
#[test]
fn averages_are_good_for_one_degree() {
    for turning in [false, true] {
        let (singles, averages) = errors(25, turning);
        assert_eq!(singles.len(), 200);
        assert!(averages.len() > 190, "{}", averages.len());
        assert!(rms(&singles) < 1.5, "{}", rms(&singles));
        assert!(rms(&averages) < 0.35, "{averages:?}");
        assert!(averages.iter().all(|error| error.abs() < 1.0));
    }
    let (_, five) = errors(5, false);
    assert!(rms(&five) < 0.75, "{}", rms(&five));
}

#[test]
fn the_deviation_claimed_is_the_deviation_seen() {
    let (singles, _) = errors(1, false);
    let claimed = wall_angle_sigma_rad(0.2, 0.005).to_degrees();
    assert!((0.8..1.25).contains(&(rms(&singles) / claimed)), "{} {claimed}", rms(&singles));
}

#[test]
fn one_wild_frame_does_not_move_the_average() {
    let mut service = service(|_| ());
    let pose = degrees(8.5, -0.35, 0.0);
    let good = ranges_at(&scene(), pose, || 0.0);
    let mut wild = good;
    wild.range_m[1] += 0.2;
    let location = estimate(pose);
    let mut last = None;
    let mut feed = |step: u64, ranges: &TofRanges| {
        let now = Time::from_nanos(1_000_000_000 + step * 100_000_000);
        let inputs = Inputs {
            ranges: Some(Stamped::new(now, ranges)),
            location: Some(Stamped::new(now, &location)),
            ..Inputs::default()
        };
        last = service.step(now, inputs).correction.or(last);
        last.unwrap().angle_rad.to_degrees()
    };
    (0..8).for_each(|step| assert!(feed(step, &good).abs() < 1e-3));
    assert!(feed(8, &wild).abs() < 1e-3);
    assert!(feed(9, &good).abs() < 1e-3);
    // Three in a row are the truth.
    (10..13).for_each(|step| {
        feed(step, &wild);
    });
    assert!((feed(13, &wild) - (0.2_f64 / 0.277).atan().to_degrees()).abs() < 1e-2);
}

#[track_caller]
fn check_refused(params: Params, words: &str) {
    let error = AngleCorrection::new(params).expect_err("these make no sense").to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    check_refused(
        Params { half_hallway_m: f64::NAN, ..Params::default() },
        "`half_hallway_m` is not a finite number",
    );
    check_refused(Params { door_margin_m: 0.1, ..Params::default() }, "`door_margin_m` is 0.1");
    check_refused(
        Params { window_frames: 3, ..Params::default() },
        "window_frames = 3 is below averaged_frames = 5",
    );
    check_refused(Params { world: "no/such/file.toml".into(), ..Params::default() }, "no/such/file.toml");
}

proptest! {
    #[test]
    fn anything_is_survived(
        range_m in prop::array::uniform8(prop_oneof![any::<f32>(), 0.0_f32..1.0]), status in prop::array::uniform8(0_u32..7),
        place in prop::array::uniform3(prop_oneof![any::<f64>(), -1.0..12.0]), heading in any::<f64>(), floor in 1_i32..4
    ) {
        let ranges = TofRanges { range_m, status: status.map(RangeStatus) };
        let [x_m, y_m, heading_rad] = place;
        let location = PoseEstimate { floor, ..estimate(Pose2 { x_m, y_m, heading_rad }) };
        let odometry = Odometry { heading_rad: heading, ..Odometry::default() };
        let now = Time::from_secs_f64(1.0);
        let mut service = service(|params| params.generate_areas = true);
        let said = service.step(now, Inputs {
            ranges: Some(Stamped::new(now, &ranges)),
            location: Some(Stamped::new(now, &location)),
            clearance: None,
            odometry: Some(Stamped::new(now, &odometry)),
        }).correction;
        if let Some(said) = said {
            prop_assert!(said.angle_rad.is_finite() && said.sigma_rad > 0.0 && said.wall_heading_rad.is_finite());
        }
    }
}
