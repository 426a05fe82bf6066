use crate::*;
use geometry::{Cone, Scene};
use messages::{LocationStateName, RangeStatus};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

/// A hallway 1.7 m wide: 207 on the right at 10 m, 208 on the right at 13 m, 209 on the left at 16 m, nothing
/// on the map after 18 m though a recess is there, and an elevator at 25 m.
const WORLD: &str = r#"
name = "five doors"
[[floor]]
number = 2
walls = [[[0.0, -0.85], [20.0, -0.85], [20.0, -0.95], [20.9, -0.95], [20.9, -0.85], [30.0, -0.85]], [[0.0, 0.85], [30.0, 0.85]]]
[[door]]
room = "207"
floor = 2
at = [10.0, -0.85]
into_room = [0, -1]
[[door]]
room = "208"
floor = 2
at = [13.0, -0.85]
into_room = [0, -1]
[[door]]
room = "209"
floor = 2
at = [16.0, 0.85]
into_room = [0, 1]
[[elevator]]
name = "main"
floors = [2]
at = [25.0, -0.85]
into_car = [0, -1]
"#;

fn world() -> World {
    World::parse(WORLD).unwrap()
}

/// A robot that passes doors.
#[derive(Debug, Clone)]
struct Pass {
    from_m: f64,
    to_m: f64,
    speed_mps: f64,
    period_s: f64,
    /// Where it keeps across the hallway.
    across_m: f64,
    /// Half of the sensors' cone in degrees; 0 for a thin beam.
    half_cone_deg: f64,
    sigma_m: f64,
    seed: u64,
    target: &'static str,
    open: bool,
    params: Params,
}

impl Default for Pass {
    fn default() -> Self {
        Self {
            from_m: 7.8,
            to_m: 12.0,
            speed_mps: 0.3,
            period_s: 0.1,
            across_m: -0.3,
            half_cone_deg: 13.5,
            sigma_m: 0.005,
            seed: 1,
            target: "",
            open: false,
            params: Params::default(),
        }
    }
}

/// What was said, and where the robot's centre truly was.
type Said = Vec<(f64, DoorSighting)>;

impl Pass {
    fn run(&self) -> Said {
        let mut locator = DoorLocator::with_world(self.params.clone(), &world()).unwrap();
        self.run_on(&mut locator)
    }

    fn run_on(&self, locator: &mut DoorLocator) -> Said {
        let mut map = world();
        map.doors[0].open = self.open;
        let scene = map.scene(2).scene;
        let mut random = Pcg64::seed_from_u64(self.seed);
        let gauss = |random: &mut Pcg64, sigma: f64| Normal::new(0.0, sigma).unwrap().sample(random);
        let way = (self.to_m - self.from_m).signum();
        // Wheels of another size than believed.
        let scale = 1.0 + gauss(&mut random, 0.01);
        let begin_m = self.from_m + way * self.speed_mps * self.period_s * random.random::<f64>();
        let mission = MissionStatus { room: RoomName::truncated(self.target), ..MissionStatus::default() };
        let mut said = Vec::new();
        for step in 0.. {
            let gone_m = self.speed_mps * self.period_s * f64::from(step);
            let x_m = begin_m + way * gone_m;
            if (x_m - self.to_m) * way > 0.0 {
                return said;
            }
            let now = Time::from_secs_f64(1.0 + self.period_s * f64::from(step));
            // It weaves by a degree and a half.
            let weave_rad = 1.5_f64.to_radians() * (1.7 * gone_m + self.seed as f64).sin();
            let pose = Pose2::new(x_m, self.across_m, weave_rad);
            let ranges = self.ranges(&scene, pose, &mut random);
            let location = PoseEstimate {
                x_m: x_m + gauss(&mut random, 0.1),
                y_m: self.across_m + gauss(&mut random, 0.1),
                heading_rad: pose.heading_rad + gauss(&mut random, 0.035),
                floor: 2,
                state: LocationStateName::Tracking.into(),
                ..PoseEstimate::default()
            };
            let travel_m = way * gone_m * scale + 100.0;
            let odometry = Odometry {
                heading_rad: geometry::angle::wrap(pose.heading_rad + 2.0),
                forward_mps: way * self.speed_mps,
                left_travel_m: travel_m,
                right_travel_m: travel_m,
                ..Odometry::default()
            };
            let inputs = Inputs {
                ranges: Some(Stamped::new(now, &ranges)),
                location: Some(Stamped::new(now, &location)),
                odometry: Some(Stamped::new(now, &odometry)),
                mission: (!self.target.is_empty()).then(|| Stamped::new(now, &mission)),
            };
            said.extend(locator.step(now, inputs).sighting.map(|sighting| (x_m, sighting)));
        }
        said
    }

    /// The nearest thing in each cone, with noise as in COF-030: above 1 m anything.
    fn ranges(&self, scene: &Scene, pose: Pose2, random: &mut Pcg64) -> TofRanges {
        let half_width_rad = self.half_cone_deg.to_radians();
        let columns = if self.half_cone_deg > 0.0 { 21 } else { 1 };
        let cone = Cone { half_width_rad, half_height_rad: 0.0, columns, rows: 1, max_range_m: 4.0 };
        let (mut ranges, mut hits) = (TofRanges::default(), Vec::new());
        for (sensor, mount) in TofRanges::MOUNTS.iter().enumerate() {
            scene.cast_cone(pose.compose(*mount), 0.25, &cone, &mut hits);
            let nearest_m = hits.iter().flatten().map(|hit| hit.range_m).min_by(f64::total_cmp);
            match nearest_m.filter(|&m| m < 1.0) {
                Some(m) => {
                    ranges.range_m[sensor] =
                        (m + Normal::new(0.0, self.sigma_m).unwrap().sample(random)) as f32
                }
                None if random.random_bool(0.5) => ranges.status[sensor] = RangeStatus(4),
                None => ranges.range_m[sensor] = random.random_range(1.001..4.0),
            }
        }
        ranges
    }
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |worst, error| error.abs().max(worst))
}

// ---- The paper's window.

const NEVER: [usize; 0] = [];

/// The readings (in mm) at which a window with halves of `half` fires.
fn fires(half: usize, readings_mm: &[f64]) -> Vec<usize> {
    let mut window = Window::default();
    let params = Params::default();
    let fired = |&(_, &mm): &(usize, &f64)| window.take((mm < 4000.0).then_some(mm / 1000.0), half, &params);
    readings_mm.iter().enumerate().filter(fired).map(|(index, _)| index).collect()
}

/// `wall` readings of 300 mm, then those given.
fn after_wall(wall: usize, then_mm: &[f64]) -> Vec<f64> {
    [vec![300.0; wall], then_mm.to_vec()].concat()
}

/// COF-104, COF-105, COF-111 and part 5: with a recess of 100 mm all four new points must be on the door.
#[test]
fn four_of_four_points_on_the_door_fire_and_three_do_not() {
    assert_eq!(fires(4, &after_wall(8, &[400.0; 4])), [11]);
    assert_eq!(fires(4, &after_wall(8, &[400.0, 400.0, 400.0, 300.0, 300.0])), NEVER);
    assert_eq!(fires(4, &after_wall(8, &[400.0, 300.0, 300.0, 300.0])), NEVER);
    assert_eq!(fires(4, &after_wall(8, &[400.0, 400.0, 300.0, 300.0])), NEVER);
    // "More than" 80 mm.
    assert_eq!(fires(4, &after_wall(8, &[380.0; 4])), NEVER);
    assert_eq!(fires(4, &after_wall(8, &[381.0; 4])), [11]);
    // A few lower points at the frame (COF-105).
    assert_eq!(fires(4, &after_wall(8, &[350.0, 395.0, 400.0, 405.0, 400.0])), [11]);
}

/// COF-109: two doors in a row, four points each, as in Fig. 3.
#[test]
fn two_doors_in_a_row_fire_twice() {
    let door = [400.0; 4];
    let row = after_wall(8, &[&door[..], &[300.0; 5], &door, &[300.0; 5]].concat());
    assert_eq!(fires(4, &row), [11, 20]);
}

/// COF-108: at high speed the rise is one to two points and needs a small window; at low speed it needs a
/// large one.
#[test]
fn the_window_must_fit_the_speed() {
    assert_eq!(fires(2, &after_wall(4, &[400.0, 400.0, 300.0, 300.0])), [5]);
    assert_eq!(fires(4, &after_wall(8, &[400.0, 400.0, 300.0, 300.0])), NEVER);
    // A gradual rise over 20 points.
    let gradual: Vec<_> = (0..20).map(|point| 300.0 + 5.0 * f64::from(point)).chain([400.0; 40]).collect();
    assert_eq!(fires(4, &after_wall(8, &gradual)), NEVER);
    assert_eq!(fires(30, &after_wall(60, &gradual)).len(), 1);
}

/// COF-110 and note 2.6.
#[test]
fn noise_is_an_open_door() {
    assert_eq!(fires(4, &after_wall(8, &[2000.0, 9999.0, 1500.0, 3000.0])), [9]);
    assert_eq!(fires(4, &after_wall(8, &[2000.0, 300.0, 300.0, 300.0])), NEVER);
}

#[track_caller]
fn check_half_window(speed_mps: f64, period_s: f64, expected: usize) {
    assert_eq!(Params::default().half_window(0.91, speed_mps, period_s), expected);
}

/// X-26: round(width / (speed x period)), at least 2; 0.9 m/s and 0.25 s give the paper's 4.
#[test]
fn faster_is_a_smaller_window() {
    check_half_window(0.9, 0.25, 4);
    check_half_window(0.3, 0.25, 12);
    check_half_window(-0.3, 0.25, 12);
    check_half_window(0.3, 0.1, 30);
    check_half_window(3.0, 0.25, 2);
    check_half_window(0.01, 0.05, 128);
    check_half_window(0.0, 0.1, 128);
    check_half_window(0.0, 0.0, 128);
    check_half_window(f64::NAN, 0.1, 128);
}

// ---- Passes.

/// Errors of `offset_m` in metres over a set of passes: at the first sighting, when the centre is truly
/// beside, and when both ends of the door have been seen.
#[derive(Debug, Default)]
struct Errors {
    first: Vec<f64>,
    beside: Vec<f64>,
    whole: Vec<f64>,
    passes: usize,
}

fn errors(speeds_mps: &[f64], periods_s: &[f64], seeds: u64, change: impl Fn(&mut Pass)) -> Errors {
    let mut errors = Errors::default();
    for (&speed_mps, &period_s) in speeds_mps.iter().flat_map(|v| periods_s.iter().map(move |p| (v, p))) {
        for seed in 0..seeds {
            let across_m = -0.2 - 0.025 * (seed % 10) as f64;
            let mut pass =
                Pass { speed_mps, period_s, seed, across_m, from_m: 7.5, to_m: 11.5, ..Pass::default() };
            change(&mut pass);
            let said = pass.run();
            let error = |&(x_m, sighting): &(f64, DoorSighting)| sighting.offset_m - (10.0 - x_m);
            assert!(said.iter().all(|(_, sighting)| sighting.room.as_str() == "207"), "{pass:?}");
            errors.passes += 1;
            errors.first.extend(said.first().map(error));
            errors.whole.extend(said.iter().find(|(_, sighting)| sighting.confidence == 0.95).map(error));
            let nearest = said.iter().min_by(|a, b| (a.0 - 10.0).abs().total_cmp(&(b.0 - 10.0).abs()));
            errors.beside.extend(nearest.filter(|said| (said.0 - 10.0).abs() < 0.13).map(error));
        }
    }
    errors
}

#[track_caller]
fn check_errors(name: &str, errors: &Errors, beside_rms_m: f64, beside_worst_m: f64, whole_rms_m: f64) {
    let line = |errors: &[f64]| {
        let (count, rms_mm, worst_mm) = (errors.len(), 1000.0 * rms(errors), 1000.0 * worst(errors));
        let mean_mm = 1000.0 * errors.iter().sum::<f64>() / count as f64;
        format!("{count}: mean {mean_mm:.0} mm, rms {rms_mm:.0} mm, worst {worst_mm:.0} mm")
    };
    println!("{name} ({} passes): first {}", errors.passes, line(&errors.first));
    println!("    beside {}; whole {}", line(&errors.beside), line(&errors.whole));
    // At 0.9 m/s and 0.25 s three readings of the door may come after its centre line.
    assert!(10 * errors.beside.len() >= 9 * errors.passes, "{name}: beside {}", line(&errors.beside));
    assert!(errors.whole.len() == errors.passes, "{name}: whole {}", line(&errors.whole));
    assert!(rms(&errors.beside) < beside_rms_m, "{name}: beside {}", line(&errors.beside));
    assert!(worst(&errors.beside) < beside_worst_m, "{name}: beside {}", line(&errors.beside));
    assert!(rms(&errors.whole) < whole_rms_m, "{name}: whole {}", line(&errors.whole));
}

#[test]
fn slow_passes_find_the_centre_line() {
    let slow = |change: fn(&mut Pass)| errors(&[0.1, 0.2, 0.3], &[0.05, 0.1], 8, change);
    check_errors("slow, cone 27 degrees", &slow(|_| ()), 0.030, 0.080, 0.020);
    check_errors("slow, cone 15 degrees", &slow(|pass| pass.half_cone_deg = 7.5), 0.030, 0.080, 0.020);
    check_errors(
        "slow, backwards",
        &slow(|pass| (pass.from_m, pass.to_m) = (12.2, 8.5)),
        0.030,
        0.080,
        0.020,
    );
    check_errors("slow, open door", &slow(|pass| pass.open = true), 0.050, 0.100, 0.040);
}

#[test]
fn fast_passes_find_the_centre_line() {
    let fast = |periods: &[f64]| errors(&[0.45, 0.6, 0.9], periods, 12, |_| ());
    check_errors("fast, 0.05 s", &fast(&[0.05]), 0.035, 0.100, 0.020);
    check_errors("fast, 0.1 s", &fast(&[0.1]), 0.040, 0.100, 0.030);
    check_errors("fast, 0.25 s", &fast(&[0.25]), 0.080, 0.200, 0.060);
}

/// The first door teaches how late the cone leaves the wall, so the second is found better before its far
/// edge.
#[test]
fn doors_passed_teach_the_cones_lag() {
    let pass = Pass { to_m: 13.0, half_cone_deg: 2.0, across_m: -0.15, from_m: 8.0, ..Pass::default() };
    let said = pass.run();
    let error_at = |room: &str, centre_m: f64| {
        let of_room = said.iter().filter(|(_, sighting)| sighting.room.as_str() == room);
        let (x_m, sighting) =
            of_room.min_by(|a, b| (a.0 - centre_m).abs().total_cmp(&(b.0 - centre_m).abs())).unwrap();
        (sighting.offset_m - (centre_m - x_m)).abs()
    };
    let (first_m, second_m) = (error_at("207", 10.0), error_at("208", 13.0));
    assert!(second_m < 0.6 * first_m && second_m < 0.03, "{first_m} {second_m}");
}

fn final_words(pass: &Pass) -> (Said, DoorSighting) {
    let said = pass.run();
    let last = said.last().expect("a door is seen").1;
    (said, last)
}

/// COF-046, note 2.6: confidence grows, and the record names the door.
#[test]
fn a_sighting_tells_everything_about_the_door() {
    let (said, last) = final_words(&Pass::default());
    assert_eq!((last.room.as_str(), last.side, last.floor), ("207", Side::Right.into(), 2));
    assert_eq!((last.centre_x_m, last.centre_y_m, last.sightings), (10.0, -0.85, 1));
    assert_eq!(last.state, DoorState::Closed);
    let steps: Vec<_> = said.iter().map(|(_, sighting)| sighting.confidence).collect();
    assert_eq!((steps[0], last.confidence), (0.5, 0.95));
    assert!(steps.is_sorted() && steps.contains(&0.8));
    // It is confirmed before the robot's centre is there.
    let confirmed = said.iter().find(|(_, sighting)| sighting.confidence == 0.8).unwrap();
    assert!(confirmed.0 < 9.9, "{}", confirmed.0);
}

#[test]
fn an_open_door_is_told_from_a_closed_one() {
    for seed in 0..10 {
        let (_, last) = final_words(&Pass { open: true, seed, ..Pass::default() });
        assert_eq!((last.state, last.room.as_str()), (DoorState::Open.into(), "207"));
    }
}

#[test]
fn a_door_on_the_left_is_seen_by_the_left_sensors() {
    let (_, last) = final_words(&Pass { from_m: 14.0, to_m: 17.5, across_m: 0.3, ..Pass::default() });
    assert_eq!((last.room.as_str(), last.side, last.sightings), ("209", Side::Left.into(), 1));
}

#[test]
fn two_doors_are_two_sightings() {
    let (said, last) = final_words(&Pass { to_m: 14.5, ..Pass::default() });
    assert_eq!((last.room.as_str(), last.sightings), ("208", 2));
    assert!(said.iter().any(|(_, sighting)| sighting.room.as_str() == "207"));
}

/// X-25: what the map does not show, and the elevator, are no doors.
#[test]
fn what_is_no_door_of_the_map_is_not_said() {
    assert_eq!(Pass { from_m: 18.2, to_m: 22.5, ..Pass::default() }.run(), []);
    assert_eq!(Pass { from_m: 22.5, to_m: 27.5, ..Pass::default() }.run(), []);
    let mut blind = DoorLocator::new(Params::default()).unwrap();
    assert_eq!(Pass::default().run_on(&mut blind), []);
}

#[test]
fn only_the_target_is_an_entrance() {
    let entered = |target, strict_paper| {
        let params = Params { strict_paper, ..Params::default() };
        let said = Pass { target, params, from_m: 6.0, ..Pass::default() }.run();
        let first = said.iter().find(|(_, sighting)| sighting.at_entrance == 1);
        first.map(|&(x_m, _)| x_m)
    };
    let (free, wanted) = (entered("", false).unwrap(), entered("207", false).unwrap());
    assert!((free - 9.9).abs() < 0.1 && (wanted - 9.9).abs() < 0.1, "{free} {wanted}");
    assert_eq!(entered("208", false), None);
    // COF-111: the paper's rule fires at the end of the door, almost past it.
    let paper = entered("207", true).unwrap();
    assert!((10.05..10.6).contains(&paper), "{paper}");
}

/// The second sensor contradicts: something that only the front sensor saw is no door.
#[test]
fn a_door_that_the_second_sensor_does_not_see_is_taken_back() {
    let mut locator = DoorLocator::with_world(Params::default(), &world()).unwrap();
    let mut confidences = Vec::new();
    for step in 0..120 {
        let now = Time::from_secs_f64(1.0 + 0.1 * f64::from(step));
        let x_m = 8.0 + 0.02 * f64::from(step);
        let deep = |at_m: f64| if (9.6..10.4).contains(&at_m) { 0.4_f32 } else { 0.3 };
        // The back sensor sees nothing of it.
        let ranges = TofRanges {
            range_m: [0.3, deep(x_m + 0.1385), 4.0, 4.0, 4.0, 4.0, 1.1, 1.1],
            ..TofRanges::default()
        };
        let state = LocationStateName::Tracking.into();
        let location = PoseEstimate { x_m, y_m: -0.3, floor: 2, state, ..PoseEstimate::default() };
        let odometry =
            Odometry { left_travel_m: x_m, right_travel_m: x_m, forward_mps: 0.2, ..Odometry::default() };
        let inputs = Inputs {
            ranges: Some(Stamped::new(now, &ranges)),
            location: Some(Stamped::new(now, &location)),
            odometry: Some(Stamped::new(now, &odometry)),
            mission: None,
        };
        confidences.extend(locator.step(now, inputs).sighting.map(|sighting| sighting.confidence));
    }
    let end = confidences.iter().position(|&confidence| confidence == 0.0);
    assert!(confidences[0] == 0.5 && end.is_some(), "{confidences:?}");
    assert!(!confidences.contains(&0.8));
}

#[track_caller]
fn check_refused(params: Params, words: &str) {
    let error = DoorLocator::new(params).expect_err("these make no sense").to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    check_refused(Params { rise_m: f64::NAN, ..Params::default() }, "`rise_m` is not a finite number");
    check_refused(Params { edge_readings: 2, ..Params::default() }, "`edge_readings` is 2");
    check_refused(
        Params { half_window_min: 9, half_window_max: 8, ..Params::default() },
        "half_window_max = 8",
    );
    check_refused(Params { world: "no/such/file.toml".into(), ..Params::default() }, "no/such/file.toml");
}

prop_compose! {
    fn any_frame()(range_m in prop::array::uniform8(prop_oneof![4 => 0.1_f32..0.6, 1 => any::<f32>()]), status in prop::array::uniform8(0_u32..8),
        odometry in prop::array::uniform6(prop_oneof![4 => -3.0..3.0_f64, 1 => any::<f64>()]), pose in prop::array::uniform3(prop_oneof![4 => -1.0..12.0_f64, 1 => any::<f64>()]),
        step_ms in 0_u64..400) -> (TofRanges, Odometry, PoseEstimate, u64) {
        let [x_m, y_m, heading_rad, forward_mps, left_travel_m, right_travel_m] = odometry;
        let odometry = Odometry { x_m, y_m, heading_rad, forward_mps, turn_rad_per_s: 0.0, left_travel_m, right_travel_m };
        let [x_m, y_m, heading_rad] = pose;
        let state = LocationStateName::Tracking.into();
        let location = PoseEstimate { x_m, y_m, heading_rad, floor: 2, state, ..PoseEstimate::default() };
        (TofRanges { range_m, status: status.map(RangeStatus) }, odometry, location, step_ms)
    }
}

proptest! {
    #[test]
    fn anything_is_survived(frames in prop::collection::vec(any_frame(), 1..80)) {
        let mut locator = DoorLocator::with_world(Params::default(), &world()).unwrap();
        let mut now = Time::from_secs_f64(1.0);
        for (ranges, odometry, location, step_ms) in &frames {
            now = now.after(std::time::Duration::from_millis(*step_ms));
            let said = locator.step(now, Inputs {
                ranges: Some(Stamped::new(now, ranges)),
                location: Some(Stamped::new(now, location)),
                odometry: Some(Stamped::new(now, odometry)),
                mission: None,
            }).sighting;
            if let Some(said) = said {
                prop_assert!(said.offset_m.is_finite() && (0.0..=1.0).contains(&said.confidence));
            }
        }
    }
}
