//! What can be said of the mapper without a process.

use super::*;
use geometry::{Point2, Pose2, Scene, Segment};
use messages::{LocationState, LocationStateName};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const HIT: i16 = 619;
const MISS: i16 = -405;

/// 10 m by 10 m around the origin.
fn params() -> Params {
    Params { min_x_m: -5.0, min_y_m: -5.0, width_m: 10.0, height_m: 10.0, ..Params::default() }
}

fn empty(params: &Params) -> Map {
    Map::new(params, params.frame().unwrap())
}

/// All around, a degree apart.
fn turning() -> RangeScan {
    RangeScan { angle_step_rad: PI / 180.0, range_max_m: 8.0, ..RangeScan::default() }
}

/// Beams close to each other.
fn narrow() -> RangeScan {
    RangeScan { angle_step_rad: 0.01, range_max_m: 8.0, ..RangeScan::default() }
}

/// A square room around the origin.
fn room(half_m: f64) -> Scene {
    let corners = [[half_m, half_m], [-half_m, half_m], [-half_m, -half_m], [half_m, -half_m]];
    Scene::new((0..4).map(|at| Segment::between(corners[at], corners[(at + 1) % 4])))
}

fn look(scene: &Scene, robot: Pose2, scan: &RangeScan, beams: usize) -> Vec<f32> {
    let mount = Pose2::new(scan.sensor_x_m, scan.sensor_y_m, scan.sensor_heading_rad);
    let sensor = robot.compose(mount);
    (0..beams)
        .map(|beam| {
            let direction = sensor.heading_rad + scan.angle_min_rad + beam as f64 * scan.angle_step_rad;
            let hit = scene.walls().cast(sensor.position(), direction, 100.0);
            hit.map_or(f32::INFINITY, |hit| hit.range_m as f32)
        })
        .collect()
}

// ---- A single scan.

#[test]
fn a_square_room_is_free_inside_and_occupied_at_its_walls() {
    let mut map = empty(&params());
    let (robot, scan) = (Pose2::new(0.3, -0.2, 0.7), turning());
    // Walls in the middle of a row of cells.
    assert!(map.add(robot, &scan, &look(&room(2.025), robot, &scan, 360)));
    let frame = *map.frame();
    for cell in frame.cells() {
        let place = frame.centre(cell);
        let from_wall_m = 2.025 - place.x.abs().max(place.y.abs());
        let value = map.thousandths()[frame.index(cell).unwrap()];
        // Towards the corners beams graze, and end farther apart than cells.
        let in_corner = place.x.abs().min(place.y.abs()) > 1.0;
        match from_wall_m {
            inside if inside > 0.04 => assert_eq!(value, MISS, "{place} is inside"),
            outside if outside < -0.04 => assert_eq!(value, 0, "{place} is outside"),
            _ if in_corner => {}
            _ => assert_eq!(value, HIT, "{place} is wall"),
        }
    }
}

#[test]
fn what_is_seen_beyond_the_map_is_counted() {
    let mut map = empty(&params());
    let (robot, scan) = (Pose2::new(4.0, 0.0, 0.0), turning());
    let look_at = |half_m: f64| look(&room(half_m), robot, &scan, 360);
    assert!(map.add(robot, &scan, &look_at(4.9)));
    assert_eq!(map.beyond(), None);
    assert!(map.add(robot, &scan, &look_at(6.0)));
    let beyond = map.beyond().unwrap();
    assert!(beyond.readings > 100, "{beyond:?}");
    assert!((beyond.most.x - 6.0).abs() < 0.1 && (beyond.most.y - 6.0).abs() < 0.1, "{beyond:?}");
    assert!((beyond.least.y + 6.0).abs() < 0.1, "{beyond:?}");
}

#[test]
fn where_a_map_cannot_be_saved_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let params = |save: &str| {
        let save = folder.path().join(save).to_string_lossy().into_owned();
        Params { save, ..params() }
    };
    let refused = |save: &str, words: &str| {
        let error = params(save).check_files().unwrap_err().to_string();
        assert!(error.starts_with("save: ") && error.contains(words), "{error}");
    };
    params("house.yaml").check_files().unwrap();
    refused("house.pgm", "under the name of its YAML, such as ");
    refused("gone/house.yaml", "gone does not exist");
    std::fs::create_dir(folder.path().join("house")).unwrap();
    refused("house", "this is a folder");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the check has written something");
    let load = Params { load: "/dev/zero".to_owned(), ..Params::default() };
    assert!(load.check_files().unwrap_err().to_string().contains("/dev/zero: this is a device"));
}

#[test]
fn many_scans_settle_at_the_clamps() {
    let mut map = empty(&params());
    let (robot, scan) = (Pose2::new(0.3, -0.2, 0.7), turning());
    let ranges = look(&room(2.025), robot, &scan, 360);
    for _ in 0..50 {
        map.add(robot, &scan, &ranges);
    }
    let grid = map.to_trinary_grid();
    assert!(map.thousandths().iter().all(|value| [-3500, 0, 3500].contains(value)));
    assert_eq!(grid.at(Point2::new(1.0, 1.0)), Some(&geometry::Occupancy::FREE));
    assert_eq!(grid.at(Point2::new(2.03, 1.0)), Some(&geometry::Occupancy::OCCUPIED));
    assert_eq!(grid.at(Point2::new(3.0, 3.0)), Some(&geometry::Occupancy::UNKNOWN));
    assert!((map.log_odds_at(Point2::new(1.0, 1.0)).unwrap() + 3.5).abs() < 1e-9);
    assert_eq!(map.log_odds_at(Point2::new(9.0, 1.0)), None);
}

/// What one beam of 0.9 m says of a place along it.
#[track_caller]
fn check_beam(range_m: f32, at_m: f64, expected: i16) {
    let mut map = empty(&params());
    let scan = RangeScan { range_max_m: 3.0, ..narrow() };
    map.add(Pose2::new(0.0, 0.025, 0.0), &scan, &[range_m]);
    let cell = map.frame().cell_at(Point2::new(at_m, 0.025)).unwrap();
    assert_eq!(map.thousandths()[map.frame().index(cell).unwrap()], expected);
}

#[test]
fn what_a_beam_says() {
    check_beam(0.926, 0.5, MISS);
    check_beam(0.926, 0.875, MISS);
    check_beam(0.926, 0.926, HIT);
    check_beam(0.926, 0.975, 0);
    check_beam(2.99, 2.5, MISS);
    // Nothing seen: free up to the sensor's limit.
    check_beam(3.0, 2.9, MISS);
    check_beam(3.0, 3.1, 0);
    check_beam(60.0, 2.9, MISS);
    check_beam(f32::INFINITY, 2.9, MISS);
    // No reading.
    check_beam(0.0, 0.5, 0);
    check_beam(-1.0, 0.5, 0);
    check_beam(f32::NAN, 0.5, 0);
    check_beam(f32::NEG_INFINITY, 0.5, 0);
}

#[test]
fn a_beam_that_sees_nothing_clears_as_far_as_it_is_trusted() {
    let free_at = |params: Params, range_m: f32, x_m: f64| {
        let mut map = empty(&params);
        let scan = RangeScan { angle_min_rad: -0.1, range_max_m: 4.0, ..narrow() };
        map.add(Pose2::default(), &scan, &[range_m; 21]);
        map.log_odds_at(Point2::new(x_m, 0.02)).unwrap() < 0.0
    };
    let wary = Params { clear_max_m: 2.0, range_max_m: 3.0, ..params() };
    assert!(free_at(wary.clone(), 4.0, 1.9) && !free_at(wary.clone(), 4.0, 2.1));
    assert!(free_at(wary.clone(), 3.9, 2.9) && !free_at(wary.clone(), 3.9, 3.1));
    assert!(!free_at(Params { clear_max_m: 0.0, ..wary }, 4.0, 0.5));
}

#[test]
fn a_bad_beam_takes_nothing_from_its_neighbours() {
    let (robot, scan) = (Pose2::new(0.0, 0.0, 0.0), turning());
    let good = look(&room(2.0), robot, &scan, 360);
    let (mut all, mut without) = (empty(&params()), empty(&params()));
    all.add(robot, &scan, &good);
    let mut ranges = good;
    ranges[45] = f32::NAN;
    without.add(robot, &scan, &ranges);
    let changed =
        all.thousandths().iter().zip(without.thousandths()).filter(|(one, other)| one != other).count();
    // A sector a degree wide and 2.8 m long, along the diagonal.
    assert!((30..90).contains(&changed), "{changed} cells");
    let differ = |x_m: f64, y_m: f64| {
        all.log_odds_at(Point2::new(x_m, y_m)) != without.log_odds_at(Point2::new(x_m, y_m))
    };
    assert!(!differ(1.5, 1.3) && !differ(1.3, 1.5));
}

#[test]
fn the_sensor_sits_where_its_header_says() {
    let scan = RangeScan { sensor_x_m: 1.0, sensor_y_m: 0.5, sensor_heading_rad: FRAC_PI_2, ..turning() };
    let robot = Pose2::new(0.2, 0.1, -FRAC_PI_2);
    let mut map = empty(&params());
    // The sensor is at (0.7, -0.9) and looks along x; it turns left.
    map.add(robot, &scan, &[1.0; 30]);
    assert!(map.log_odds_at(Point2::new(1.2, -0.85)).unwrap() < 0.0);
    assert!(map.log_odds_at(Point2::new(1.69, -0.78)).unwrap() > 0.0);
}

// ---- Properties.

/// Thrun's table 9.2 for one cell, in the grid's units: straight ends instead of round ones, as sectors are
/// narrow.
fn by_hand(map: &Map, sensor: Pose2, scan: &RangeScan, ranges: &[f32], place: Point2<f64>) -> Option<i16> {
    const DOUBT: f64 = 1e-7;
    let (dx, dy) = (place.x - sensor.x_m, place.y - sensor.y_m);
    let (range_m, direction) = (dx.hypot(dy), dy.atan2(dx));
    let first = sensor.heading_rad + scan.angle_min_rad;
    let step = scan.angle_step_rad;
    let mut value = 0;
    for (beam, reading) in ranges.iter().enumerate() {
        let aside = geometry::angle::wrap(direction - first - beam as f64 * step);
        let half = 0.5 * step.abs();
        if (aside.abs() - half).abs() * range_m < DOUBT {
            return None;
        }
        let reading_m = f64::from(*reading);
        if aside.abs() > half || reading_m.is_nan() || reading_m <= 0.0 {
            continue;
        }
        let (limit_m, resolution_m) = (scan.range_max_m.min(10.0), map.frame().resolution_m());
        let free_m = if reading_m < limit_m { (reading_m - 0.5 * resolution_m).max(0.0) } else { limit_m };
        let along_m = range_m * aside.cos() / half.cos();
        if (along_m - free_m).abs() < DOUBT {
            return None;
        }
        if along_m < free_m {
            value = MISS;
        }
    }
    Some(value)
}

fn readings() -> impl Strategy<Value = Vec<f32>> {
    let reading =
        prop_oneof![8 => 0.05_f32..6.0, 1 => Just(f32::NAN), 1 => Just(99.0_f32), 1 => Just(0.0_f32)];
    prop::collection::vec(reading, 1..180)
}

fn poses() -> impl Strategy<Value = Pose2> {
    (-3.0..3.0, -3.0..3.0, -4.0..4.0).prop_map(|(x, y, heading)| Pose2::new(x, y, heading))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn every_cell_is_touched_once_and_as_the_model_says(robot in poses(), ranges in readings()) {
        let scan = RangeScan { angle_step_rad: TAU / 180.0, range_max_m: 4.5, ..RangeScan::default() };
        let mut map = empty(&params());
        prop_assert!(map.add(robot, &scan, &ranges));
        let frame = *map.frame();
        for (cell, value) in frame.cells().zip(map.thousandths()) {
            prop_assert!([0, HIT, MISS].contains(value), "{value} after one scan");
            if *value != HIT && let Some(expected) = by_hand(&map, robot, &scan, &ranges, frame.centre(cell)) {
                prop_assert_eq!(*value, expected, "at {}", frame.centre(cell));
            }
        }
        // Every beam that ends inside of the map leaves its mark.
        for (beam, reading) in ranges.iter().enumerate() {
            let direction = robot.heading_rad + beam as f64 * scan.angle_step_rad;
            let end = robot.transform(Point2::origin()) + geometry::Vector2::new(direction.cos(), direction.sin()) * f64::from(*reading);
            let seen = *reading > 0.0 && f64::from(*reading) < 4.5;
            // One place in the middle only where the beam is narrower than a cell.
            if seen && f64::from(*reading) * scan.angle_step_rad < 0.05 && let Some(cell) = frame.cell_at(end) {
                let near = [-1e-7, 1e-7].map(|off| frame.cell_at(end + geometry::Vector2::new(off, off)));
                prop_assert!(near != [Some(cell); 2] || map.thousandths()[frame.index(cell).unwrap()] == HIT);
            }
        }
    }

    #[test]
    fn the_order_of_the_beams_does_not_matter(robot in poses(), ranges in readings(), min_rad in -3.0..3.0) {
        let forth = RangeScan { angle_min_rad: min_rad, angle_step_rad: TAU / 180.0, range_max_m: 4.5, ..RangeScan::default() };
        let last_rad = min_rad + (ranges.len() - 1) as f64 * forth.angle_step_rad;
        let back = RangeScan { angle_min_rad: last_rad, angle_step_rad: -forth.angle_step_rad, ..forth };
        let (mut one, mut other) = (empty(&params()), empty(&params()));
        one.add(robot, &forth, &ranges);
        let reversed: Vec<f32> = ranges.iter().rev().copied().collect();
        other.add(robot, &back, &reversed);
        let differ = one.thousandths().iter().zip(other.thousandths()).filter(|(one, other)| one != other).count();
        // A place exactly between two cells may be rounded to either.
        prop_assert!(differ <= 2, "{differ} cells differ");
    }

    #[test]
    fn the_order_of_scans_does_not_matter_below_the_clamps(robots in prop::collection::vec(poses(), 2..4), ranges in readings()) {
        let (mut one, mut other) = (empty(&params()), empty(&params()));
        for robot in &robots {
            one.add(*robot, &turning(), &ranges);
        }
        for robot in robots.iter().rev() {
            other.add(*robot, &turning(), &ranges);
        }
        prop_assert_eq!(one.thousandths(), other.thousandths());
    }

    #[test]
    fn free_space_is_mapped_right(seed_poses in prop::collection::vec((-1.5..1.5, -1.5..1.5, -4.0..4.0), 8..12)) {
        let mut map = empty(&params());
        let (scene, scan) = (room(2.025), turning());
        for (x, y, heading) in seed_poses {
            let robot = Pose2::new(x, y, heading);
            map.add(robot, &scan, &look(&scene, robot, &scan, 360));
        }
        let (grid, frame) = (map.to_grid(), *map.frame());
        for cell in frame.cells() {
            let place = frame.centre(cell);
            let inside_m = 2.025 - place.x.abs().max(place.y.abs());
            let occupied = grid.get(cell).and_then(|cell| cell.probability());
            if inside_m > 0.05 {
                prop_assert!(occupied.is_some_and(|occupied| occupied < 0.1), "{place}: {occupied:?}");
            } else if inside_m < -0.05 {
                prop_assert_eq!(occupied, None, "{} lies behind the wall", place);
            }
        }
    }

    #[test]
    fn a_turned_grid_holds_the_same_map(robot in poses(), ranges in readings(), turn_rad in -3.0..3.0) {
        let frame = |heading_rad| geometry::GridFrame::new(200, 200, 0.05, Pose2 { x_m: 0.3, y_m: 0.2, heading_rad }).unwrap();
        let at = frame(turn_rad).origin();
        let mut plain = Map::new(&params(), frame(0.0));
        let mut turned = Map::new(&params(), frame(turn_rad));
        // The same pose as seen from each grid.
        plain.add(frame(0.0).origin().compose(robot), &turning(), &ranges);
        turned.add(at.compose(robot), &turning(), &ranges);
        let differ = plain.thousandths().iter().zip(turned.thousandths()).filter(|(one, other)| one != other).count();
        prop_assert!(differ <= 4, "{differ} cells differ");
    }

    #[test]
    fn nonsense_never_panics(
        header in prop::array::uniform6(prop::num::f64::ANY), ranges in prop::collection::vec(prop::num::f32::ANY, 0..400),
        pose in prop::array::uniform3(prop::num::f64::ANY), sane in 0_u8..64, state in 0_u32..6, floor in -1_i32..2,
    ) {
        // Each field is nonsense or not, so that nonsense gets past the first check.
        let pick = |index: usize, good: f64| if sane >> index & 1 == 1 { good } else { header[index] };
        let scan = RangeScan {
            sensor_x_m: pick(0, 0.1), sensor_y_m: pick(1, 0.0), sensor_heading_rad: pick(2, 0.0),
            angle_min_rad: pick(3, -1.0), angle_step_rad: pick(4, 0.02), range_max_m: pick(5, 5.0),
        };
        let places = if sane % 3 == 0 { [0.0, 0.0, 0.0] } else { pose };
        let pose = PoseEstimate { x_m: places[0], y_m: places[1], heading_rad: places[2], state: LocationState(state), floor, ..PoseEstimate::default() };
        let mut mapper = Mapper::new(params()).unwrap();
        let now = Time::from_secs_f64(1.0);
        let inputs = Inputs { pose: Some(Stamped::new(now, &pose)), scan: Some(Stamped::with_elements(now, &scan, &ranges)) };
        mapper.step(now, inputs);
        mapper.step(Time::from_secs_f64(3.0), Inputs::default());
        prop_assert_eq!(mapper.header().scans + mapper.header().unused_scans, 1);
        prop_assert!(mapper.map().thousandths().iter().all(|value| value.abs() <= 3500));
    }
}

#[test]
fn unusable_scans_are_refused() {
    let robot = Pose2::new(0.0, 0.0, 0.0);
    let mut map = empty(&params());
    let mut refused = |scan: RangeScan, beams: usize| !map.add(robot, &scan, &vec![1.0; beams]);
    assert!(!refused(turning(), 360));
    assert!(refused(turning(), 0));
    assert!(refused(RangeScan { angle_step_rad: 0.0, ..turning() }, 10));
    assert!(refused(RangeScan { angle_step_rad: f64::NAN, ..turning() }, 10));
    assert!(refused(RangeScan { sensor_x_m: f64::INFINITY, ..turning() }, 10));
    assert!(refused(RangeScan { range_max_m: 0.0, ..turning() }, 10));
    assert!(refused(turning(), 20_000));
    // More than one turn: the rest is left out.
    assert!(!refused(turning(), 1000));
}

// ---- Scans and poses that come in their own time.

fn estimate(x_m: f64, floor: i32) -> PoseEstimate {
    let state = LocationState::from(LocationStateName::Tracking);
    PoseEstimate { x_m, floor, state, ..PoseEstimate::default() }
}

/// A scan that sees something 1 m ahead, taken at a time in milliseconds.
fn scan_at<'a>(ms: u64, header: &'a RangeScan, ranges: &'a [f32]) -> Stamped<'a, RangeScan> {
    Stamped::with_elements(Time::from_nanos(ms * 1_000_000), header, ranges)
}

/// Poses (time in ms, x), then a scan at a time, with 20 ms steps until 1 s: where the scan is, if it is
/// anywhere.
#[track_caller]
fn check_placed(poses: &[(u64, f64)], scan_ms: u64, expected_x_m: Option<f64>) {
    let mut mapper = Mapper::new(params()).unwrap();
    let (header, ranges) = (RangeScan { angle_min_rad: -0.1, ..narrow() }, [1.0; 21]);
    for ms in (0..1000).step_by(20) {
        let now = Time::from_nanos(ms * 1_000_000);
        let pose = poses.iter().find(|(at, _)| *at == ms).map(|&(_, x_m)| estimate(x_m, 1));
        let scan = (ms == scan_ms).then(|| scan_at(ms, &header, &ranges));
        mapper.step(now, Inputs { pose: pose.as_ref().map(|pose| Stamped::new(now, pose)), scan });
    }
    let seen = mapper.header();
    assert_eq!((seen.scans, seen.unused_scans), if expected_x_m.is_some() { (1, 0) } else { (0, 1) });
    if let Some(x_m) = expected_x_m {
        let ahead = Point2::new(x_m + 1.005, 0.01);
        assert!(mapper.map().log_odds_at(ahead).unwrap() > 0.0, "no hit at {ahead}");
        assert!(mapper.map().log_odds_at(Point2::new(x_m + 0.5, 0.01)).unwrap() < 0.0);
        assert_eq!(mapper.map().log_odds_at(Point2::new(x_m + 1.2, 0.01)), Some(0.0));
    }
}

#[test]
fn a_scan_is_placed_where_it_was_taken() {
    check_placed(&[(100, 0.0)], 100, Some(0.0));
    check_placed(&[(100, 0.0), (200, 1.0)], 140, Some(0.4));
    check_placed(&[(100, 0.0), (200, 1.0), (300, 2.0)], 200, Some(1.0));
    // The next pose never comes, or is the first.
    check_placed(&[(100, 0.5)], 200, Some(0.5));
    check_placed(&[(200, 0.5)], 100, Some(0.5));
    // Too far away in time.
    check_placed(&[(100, 0.5)], 400, None);
    check_placed(&[(500, 0.5)], 100, None);
    check_placed(&[], 100, None);
}

#[test]
fn other_floors_are_left_out() {
    let header = narrow();
    let scans_on = |mapped: Option<i32>, robot: i32| {
        let mut mapper = Mapper::new(Params { floor: mapped, ..params() }).unwrap();
        let pose = estimate(0.0, robot);
        let now = Time::from_nanos(1_000_000);
        let pose = Some(Stamped::new(now, &pose));
        mapper.step(now, Inputs { pose, scan: Some(scan_at(1, &header, &[1.0])) });
        mapper.step(Time::from_secs_f64(2.0), Inputs::default());
        (mapper.header().scans, mapper.header().floor)
    };
    assert_eq!(scans_on(Some(2), 2), (1, 2));
    assert_eq!(scans_on(Some(2), 3), (0, 2));
    assert_eq!(scans_on(None, 3), (1, 3));
}

#[test]
fn a_changed_map_is_given_out_once_a_period() {
    let params =
        Params { save: "map.yaml".to_owned(), save_period_s: 0.4, publish_period_ms: 100, ..params() };
    let mut mapper = Mapper::new(params).unwrap();
    let header = narrow();
    let (mut published, mut saved) = (0, 0);
    for ms in (0..2000).step_by(20) {
        let now = Time::from_nanos(ms * 1_000_000);
        let pose = estimate(0.0, 1);
        // The last scan comes after a second.
        let scan = (ms < 1000).then(|| scan_at(ms, &header, &[1.0]));
        let outputs = mapper.step(now, Inputs { pose: Some(Stamped::new(now, &pose)), scan });
        published += u32::from(outputs.publish);
        saved += u32::from(outputs.save);
    }
    assert_eq!((published, saved), (11, 4));
}

// ---- Files and messages.

#[test]
fn a_saved_map_is_a_start() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("room.yaml");
    let (robot, scan) = (Pose2::new(0.3, -0.2, 0.7), turning());
    let mut map = empty(&params());
    for _ in 0..10 {
        map.add(robot, &scan, &look(&room(2.025), robot, &scan, 360));
    }
    let known = map.to_trinary_grid();
    known.save(&file, geometry::MapMode::Trinary, geometry::MapImage::Pgm).unwrap();
    let load = file.to_string_lossy().into_owned();
    let mapper = Mapper::new(Params { load, ..Params::default() }).unwrap();
    assert_eq!(mapper.map().to_trinary_grid(), known);
    assert_eq!((mapper.header().columns, mapper.header().rows), (200, 200));
}

#[test]
fn the_message_holds_the_map() {
    let mut mapper = Mapper::new(params()).unwrap();
    let (robot, scan) = (Pose2::new(0.3, -0.2, 0.7), turning());
    mapper.map.add(robot, &scan, &look(&room(2.025), robot, &scan, 360));
    let mut cells = vec![0; mapper.map().thousandths().len()];
    mapper.map().write_percents(&mut cells);
    let header = mapper.header();
    assert_eq!(header.grid(&cells).unwrap(), mapper.map().to_grid());
    assert_eq!(header.cell(&cells, 100, 100).percent(), Some(40));
    assert!(header.cell(&cells, 0, 0).is_unknown());
    assert!(header.cell(&cells, 200, 0).is_unknown() && header.cell(&cells[..10], 100, 100).is_unknown());
    assert_eq!(header.grid(&cells[1..]), None);
}

#[track_caller]
fn check_refused(params: Params, part: &str) {
    let error = Mapper::new(params).expect_err("refused").to_string();
    assert!(error.contains(part), "{error}");
}

#[test]
fn bad_parameters_are_refused() {
    check_refused(Params { resolution_m: 0.0, ..Params::default() }, "`resolution_m` is 0");
    check_refused(Params { hit_probability: 0.4, ..Params::default() }, "`hit_probability` is 0.4");
    check_refused(
        Params { miss_probability: f64::NAN, ..Params::default() },
        "`miss_probability` is not a finite number",
    );
    check_refused(
        Params { width_m: 2000.0, height_m: 2000.0, resolution_m: 0.01, ..Params::default() },
        "choose larger cells",
    );
    check_refused(Params { load: "no such map.yaml".to_owned(), ..Params::default() }, "no such map.yaml");
}
