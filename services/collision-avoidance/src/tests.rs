use crate::*;
use geometry::{Cone, Pose2, Scene, Segment, Surface};
use messages::{GuardReasonName as Why, GuardSignal, RangeStatus};
use proptest::prelude::*;

mod laser;
mod near;
mod sight;

/// "Nothing in range".
const FAR: f32 = f32::INFINITY;
const NO_TARGET: RangeStatus = RangeStatus(4);

fn frame(range_m: [f32; 8]) -> TofRanges {
    let status = range_m.map(|m| if m == FAR { NO_TARGET } else { RangeStatus(0) });
    TofRanges { range_m: range_m.map(|m| if m == FAR { 0.0 } else { m }), status }
}

/// All sensors alike.
fn everywhere(range_m: f32) -> TofRanges {
    frame([range_m; 8])
}

/// Sides clear at 0.3 m, the front as given from right to left.
fn ahead(front_m: [f32; 4]) -> TofRanges {
    let [a, b, c, d] = front_m;
    frame([0.3, 0.3, a, b, c, d, 0.9, 0.9])
}

/// A guard fed at 10 Hz, with odometry if wanted.
struct Bench {
    guard: CollisionAvoidance,
    now_s: f64,
    odometry: Option<Odometry>,
    said: Clearance,
}

impl Bench {
    fn new(params: Params) -> Self {
        let guard = CollisionAvoidance::new(params).unwrap();
        Self { guard, now_s: 1.0, odometry: Some(Odometry::default()), said: Clearance::default() }
    }

    fn feed(&mut self, ranges: &TofRanges) -> Clearance {
        self.now_s += 0.1;
        let now = Time::from_secs_f64(self.now_s);
        let odometry = self.odometry.as_ref().map(|odometry| Stamped::new(now, odometry));
        self.said = self
            .guard
            .step(now, Inputs { ranges: Some(Stamped::new(now, ranges)), odometry, ..Inputs::default() })
            .clearance;
        self.said
    }

    fn feed_times(&mut self, times: usize, ranges: &TofRanges) -> Clearance {
        (0..times).for_each(|_| {
            self.feed(ranges);
        });
        self.said
    }

    /// Moves the robot along x and says how fast.
    fn drive(&mut self, step_m: f64) {
        if let Some(odometry) = &mut self.odometry {
            odometry.x_m += step_m;
            odometry.forward_mps = step_m / 0.1;
        }
    }

    #[track_caller]
    fn expect(&self, verdict: Verdict, reason: Why) {
        assert_eq!((self.said.signal, self.said.reason), (verdict.into(), reason.into()), "{:?}", self.said);
    }
}

#[track_caller]
fn check_steady(params: Params, ranges: TofRanges, expected: Verdict) {
    let said = Bench::new(params).feed_times(20, &ranges);
    assert_eq!(said.signal, GuardSignal::from(expected), "{said:?}");
}

fn radii(front_m: f64, side_m: f64) -> Params {
    let mut params = Params { front_radius_m: front_m, right_radius_m: side_m, ..Params::default() };
    params.left_radius_m = side_m;
    params
}

#[test]
fn a_reading_lower_than_the_radius_violates() {
    let default = Params::default;
    check_steady(default(), ahead([0.200; 4]), Verdict::Go);
    check_steady(default(), ahead([FAR, FAR, 0.199, FAR]), Verdict::Stop);
    check_steady(default(), frame([0.050, 0.050, FAR, FAR, FAR, FAR, 0.050, 0.050]), Verdict::Go);
    check_steady(default(), frame([0.049, 0.3, FAR, FAR, FAR, FAR, FAR, FAR]), Verdict::Stop);
    check_steady(default(), frame([0.3, 0.049, FAR, FAR, FAR, FAR, FAR, FAR]), Verdict::Stop);
    check_steady(default(), frame([0.3, 0.3, FAR, FAR, FAR, FAR, 0.049, FAR]), Verdict::Stop);
    check_steady(default(), frame([0.3, 0.3, FAR, FAR, FAR, FAR, FAR, 0.010]), Verdict::Stop);
    check_steady(default(), everywhere(FAR), Verdict::Go);
    check_steady(radii(0.35, 0.15), everywhere(0.35), Verdict::Go);
    check_steady(radii(0.35, 0.15), everywhere(0.3499), Verdict::Stop);
}

/// COF-065: with 100 mm everywhere a robot that keeps to the right never leaves the first stop.
#[test]
fn a_radius_of_100_mm_everywhere_never_starts_beside_the_wall() {
    let beside_the_wall = frame([0.080, 0.080, FAR, FAR, FAR, FAR, 1.11, 1.11]);
    let said = Bench::new(radii(0.100, 0.100)).feed_times(100, &beside_the_wall);
    assert_eq!((said.signal, said.changes), (Verdict::Stop.into(), 0));
    check_steady(Params::default(), beside_the_wall, Verdict::Go);
}

/// COF-065 and note 2.5: at 0.36 m/s, 0.5 m/s² and frames of 0.1 s a robot stops within 200 mm, and not
/// within 50 mm.
#[test]
fn a_radius_of_50_mm_everywhere_hits_the_obstacle() {
    let gap_left_m = |params: Params| {
        let mut bench = Bench::new(params);
        bench.feed_times(5, &everywhere(FAR));
        let (mut gap_m, mut speed_mps) = (1.0_f64, 0.36_f64);
        while speed_mps > 0.0 && gap_m > 0.0 {
            bench.drive(speed_mps * 0.1);
            let said = bench.feed(&ahead([gap_m as f32; 4]));
            // The wheels obey a frame later.
            gap_m -= speed_mps * 0.1;
            speed_mps -= if said.signal == Verdict::Stop { 0.05 } else { 0.0 };
        }
        gap_m
    };
    assert!(gap_left_m(radii(0.050, 0.050)) <= 0.0);
    assert!(gap_left_m(Params::default()) > 0.0);
}

#[test]
fn the_first_signal_is_stop_until_three_clear_frames() {
    let mut bench = Bench::new(Params::default());
    let silent = bench.guard.step(Time::from_secs_f64(1.0), Inputs::default()).clearance;
    assert_eq!((silent.signal, silent.reason), (Verdict::Stop.into(), Why::Start.into()));
    bench.feed_times(2, &everywhere(1.0));
    bench.expect(Verdict::Stop, Why::Start);
    bench.feed(&everywhere(1.0));
    bench.expect(Verdict::Go, Why::Clear);
    assert_eq!(bench.said.changes, 1);
}

#[test]
fn a_frame_seen_twice_counts_once() {
    let mut bench = Bench::new(Params::default());
    let ranges = everywhere(1.0);
    let now = Time::from_secs_f64(1.0);
    for _ in 0..10 {
        let inputs = Inputs { ranges: Some(Stamped::new(now, &ranges)), ..Inputs::default() };
        bench.said = bench.guard.step(now, inputs).clearance;
    }
    bench.expect(Verdict::Stop, Why::Start);
}

/// COF-066, COF-067: one message when an obstacle comes, one when it is gone.
#[test]
fn an_obstacle_stops_and_its_leaving_releases() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([1.0; 4]));
    bench.feed(&frame([0.04, 0.3, 1.0, 1.0, 1.0, 1.0, 0.9, 0.9]));
    bench.expect(Verdict::Stop, Why::Violation);
    assert_eq!(bench.said.violated_faces, Face::Right as u32);
    bench.feed_times(2, &ahead([1.0; 4]));
    bench.expect(Verdict::Stop, Why::Settling);
    bench.feed(&ahead([1.0; 4]));
    bench.expect(Verdict::Go, Why::Clear);
    assert_eq!(bench.said.changes, 3);
    // A person who walks ahead and away is followed by the readings, not remembered.
    for gap_m in [0.35, 0.19, 0.15, 0.30, 0.45, 0.60] {
        bench.feed(&ahead([FAR, gap_m, gap_m, FAR]));
    }
    bench.expect(Verdict::Go, Why::Clear);
}

#[test]
fn two_clear_frames_and_one_not_begin_anew() {
    let mut bench = Bench::new(Params::default());
    for gap_m in [1.0, 1.0, 0.04, 1.0, 1.0, 0.04, 1.0, 1.0] {
        bench.feed(&frame([gap_m, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
        assert_eq!(bench.said.signal, Verdict::Stop);
    }
}

#[test]
fn strict_paper_clears_with_one_frame_and_remembers_nothing() {
    let mut bench = Bench::new(Params { strict_paper: true, ..Params::default() });
    bench.feed(&ahead([1.0; 4]));
    bench.expect(Verdict::Go, Why::Clear);
    bench.feed(&ahead([FAR, 0.12, 0.12, FAR]));
    bench.expect(Verdict::Stop, Why::Violation);
    bench.feed(&ahead([FAR; 4]));
    bench.expect(Verdict::Go, Why::Clear);
}

#[track_caller]
fn check_status(status: u32, range_m: f32, verdict: Verdict, reason: Why) {
    for sensor in 0..8 {
        let mut bench = Bench::new(Params::default());
        bench.feed_times(3, &everywhere(1.0));
        let mut ranges = everywhere(1.0);
        ranges.status[sensor] = RangeStatus(status);
        ranges.range_m[sensor] = range_m;
        bench.feed(&ranges);
        bench.expect(verdict, reason);
    }
}

#[test]
fn what_a_sensor_says_of_its_reading_decides() {
    check_status(0, 1.0, Verdict::Go, Why::Clear);
    check_status(1, 0.01, Verdict::Go, Why::Clear);
    check_status(2, 0.01, Verdict::Go, Why::Clear);
    check_status(3, 1.0, Verdict::Stop, Why::Violation);
    check_status(4, 0.01, Verdict::Go, Why::Clear);
    check_status(5, 1.0, Verdict::Stop, Why::SensorFault);
    check_status(7, 0.01, Verdict::Go, Why::Clear);
    check_status(9, 1.0, Verdict::Stop, Why::SensorFault);
    check_status(13, 1.0, Verdict::Stop, Why::Violation);
    check_status(42, 1.0, Verdict::Stop, Why::SensorFault);
    check_status(255, 0.0, Verdict::Go, Why::Clear);
    check_status(0, f32::NAN, Verdict::Stop, Why::SensorFault);
    check_status(0, f32::INFINITY, Verdict::Stop, Why::SensorFault);
    check_status(0, -0.5, Verdict::Stop, Why::SensorFault);
    // what is nearer than the minimum violates even the sides.
    check_status(0, 0.0, Verdict::Stop, Why::Violation);
}

#[test]
fn silence_is_a_stop() {
    let mut bench = Bench::new(Params::default());
    let ranges = everywhere(1.0);
    bench.feed_times(3, &ranges);
    let last = Time::from_secs_f64(bench.now_s);
    let mut after = |ms: u64| {
        let now = last.after(Duration::from_millis(ms));
        let inputs = Inputs { ranges: Some(Stamped::new(last, &ranges)), ..Inputs::default() };
        bench.guard.step(now, inputs).clearance
    };
    assert_eq!(after(300).reason, Why::Clear);
    assert_eq!(after(301).reason, Why::Stale);
    assert_eq!(after(301).signal, Verdict::Stop);
    assert_eq!(after(301).front_m, 0.0);
}

#[test]
fn a_frame_of_old_readings_is_silence() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &everywhere(1.0));
    let now = Time::from_secs_f64(bench.now_s + 0.1);
    let ranges = everywhere(1.0);
    let old = Stamped { origin: Time::from_secs_f64(bench.now_s - 0.5), ..Stamped::new(now, &ranges) };
    bench.said = bench.guard.step(now, Inputs { ranges: Some(old), ..Inputs::default() }).clearance;
    bench.expect(Verdict::Stop, Why::Stale);
}

#[test]
fn a_frame_from_the_future_is_none() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &everywhere(1.0));
    let ranges = everywhere(1.0);
    let future = Stamped::new(Time::from_secs_f64(1e6), &ranges);
    for ms in [200, 400] {
        let now = Time::from_secs_f64(bench.now_s + f64::from(ms) / 1000.0);
        bench.said = bench.guard.step(now, Inputs { ranges: Some(future), ..Inputs::default() }).clearance;
    }
    bench.expect(Verdict::Stop, Why::Stale);
}

#[test]
fn one_silent_sensor_is_a_stop() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &everywhere(1.0));
    let mut ranges = everywhere(1.0);
    ranges.status[7] = RangeStatus(255);
    bench.feed_times(2, &ranges);
    bench.expect(Verdict::Go, Why::Clear);
    bench.feed_times(3, &ranges);
    bench.expect(Verdict::Stop, Why::Stale);
}

/// Fig. 4: the centre falls, and rises at point 21, where the shelf drops out of view; the left one sees a
/// bar from point 11; the right one sees the other end of the hallway, noisily.
fn mail_cart(point: usize) -> TofRanges {
    let noise = [1.9, FAR, 2.7, 1.4, FAR, 3.3][point % 6];
    let centre = if point < 21 { 1.02 - 0.045 * point as f32 } else { 1.7 };
    let left = if point < 11 { noise } else { 1.15 - 0.045 * point as f32 };
    ahead([noise, noise, centre, left])
}

/// Points at which the signal is GO, when the robot drives on whatever the guard says (as in the paper's
/// experiment).
fn goes(
    params: Params,
    scene: impl Fn(usize) -> TofRanges,
    points: usize,
    with_odometry: bool,
) -> Vec<usize> {
    let mut bench = Bench::new(params);
    if !with_odometry {
        bench.odometry = None;
    }
    let go = |&point: &usize| {
        bench.drive(0.045);
        bench.feed(&scene(point)).signal == Verdict::Go
    };
    (1..=points).filter(go).collect()
}

#[test]
fn the_mail_cart_of_fig_4_stays_an_obstacle_after_point_21() {
    // The centre reads 0.165 m at point 19: stop. Only the strict rule falls for the rise at point 21, once
    // the bar is out of sight.
    let shelf_only = |point| {
        let TofRanges { mut range_m, mut status } = mail_cart(point);
        (range_m[5], status[5]) = (0.0, NO_TARGET);
        TofRanges { range_m, status }
    };
    for with_odometry in [true, false] {
        assert_eq!(goes(Params::default(), mail_cart, 30, with_odometry), (3..=18).collect::<Vec<_>>());
        assert_eq!(goes(Params::default(), shelf_only, 30, with_odometry), (3..=18).collect::<Vec<_>>());
    }
    let strict = Params { strict_paper: true, ..Params::default() };
    let fooled: Vec<_> = (1..=18).chain(21..=30).collect();
    assert_eq!(goes(strict, shelf_only, 30, true), fooled);
}

#[test]
fn a_vanished_obstacle_is_forgotten_after_three_quiet_seconds() {
    for with_odometry in [true, false] {
        let mut bench = Bench::new(Params::default());
        if !with_odometry {
            bench.odometry = None;
        }
        bench.feed_times(3, &ahead([FAR; 4]));
        bench.feed_times(3, &ahead([FAR, 0.15, FAR, FAR]));
        bench.drive(0.0);
        bench.feed_times(30, &ahead([FAR; 4]));
        bench.expect(Verdict::Stop, Why::Remembered);
        assert_eq!(bench.said.violated_faces, Face::Front as u32);
        bench.feed_times(2, &ahead([FAR; 4]));
        bench.expect(Verdict::Go, Why::Clear);
    }
}

#[test]
fn forward_motion_keeps_the_memory() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([FAR, 0.19, FAR, FAR]));
    for _ in 0..100 {
        bench.drive(0.003);
        bench.feed(&ahead([FAR; 4]));
        bench.expect(Verdict::Stop, Why::Remembered);
    }
}

#[test]
fn what_vanished_beyond_the_radius_waits_at_its_place() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([FAR, 0.385, FAR, FAR]));
    let mut stopped_after_m = None;
    for step in 1..=40 {
        bench.drive(0.01);
        let said = bench.feed(&ahead([FAR; 4]));
        let left_m = (0.385 - 0.01 * f64::from(step)).max(0.0) as f32;
        assert!((said.front_m - left_m).abs() < 1e-5, "{said:?} {left_m}");
        if said.signal == Verdict::Stop && stopped_after_m.is_none() {
            stopped_after_m = Some(step);
            bench.expect(Verdict::Stop, Why::Remembered);
        }
    }
    assert_eq!(stopped_after_m, Some(19));
}

#[test]
fn backing_off_explains_a_rise_and_ends_a_memory() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([FAR, 0.15, 0.15, FAR]));
    // 0.3 m back in one frame: the wall now reads 0.45 m.
    bench.drive(-0.3);
    bench.feed_times(3, &ahead([FAR, 0.45, 0.45, FAR]));
    bench.expect(Verdict::Go, Why::Clear);
    assert_eq!(bench.said.front_m, 0.45);
    // It vanishes at 0.15 m, and 0.4 m farther back the sensor would see it.
    bench.feed_times(3, &ahead([FAR, 0.15, FAR, FAR]));
    bench.feed(&ahead([FAR; 4]));
    bench.expect(Verdict::Stop, Why::Remembered);
    (0..10).for_each(|_| {
        bench.drive(-0.04);
        bench.feed(&ahead([FAR; 4]));
    });
    assert_eq!(bench.said.front_m, f32::INFINITY);
    bench.expect(Verdict::Go, Why::Clear);
}

#[test]
fn turning_away_leaves_the_obstacle_aside() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([0.3, FAR, FAR, FAR]));
    bench.odometry.as_mut().unwrap().heading_rad = 1.2;
    bench.feed_times(3, &ahead([FAR; 4]));
    bench.expect(Verdict::Go, Why::Clear);
    assert_eq!(bench.said.front_m, f32::INFINITY);
    // Turned back, it is still there.
    bench.odometry.as_mut().unwrap().heading_rad = 0.0;
    bench.feed(&ahead([FAR; 4]));
    assert!((bench.said.front_m - 0.3).abs() < 1e-5);
}

/// Fig. 5: the right wall is steady; sensor 2 is noisy until it sees the seat's fabric; sensor 4 sees the
/// pole and past it in turn.
#[test]
fn the_pole_of_fig_5_holds_the_stop_though_it_flickers() {
    let chair = |point: usize| {
        let left_m = 1.2 - 0.04 * point as f32;
        let fabric = if point < 8 { [1.3, 2.2, FAR][point % 3] } else { left_m + 0.15 };
        let pole = if point.is_multiple_of(2) && point > 3 { left_m } else { 1.8 };
        let mut ranges = ahead([fabric.max(0.04), FAR, pole.max(0.04), FAR]);
        (ranges.range_m[0], ranges.range_m[1]) = (0.21, 0.21);
        ranges
    };
    // 0.16 m at point 26 is the first violation.
    assert_eq!(goes(Params::default(), chair, 30, true), (3..=25).filter(|&p| p < 25).collect::<Vec<_>>());
}

/// Fig. 6: the left wall at 200 mm, the front noisy above 1000 mm, then a steady fall from point 27.
#[test]
fn the_sofa_of_fig_6_stops_the_robot_once() {
    let sofa = |point: usize| {
        let front =
            if point < 27 { [1.2, 3.1, 1.7, FAR][point % 4] } else { 1.0 - 0.04 * (point - 27) as f32 };
        frame([1.1, 1.1, front, front, front, front, 0.2, 0.2])
    };
    // 1.0 - 0.04 * 21 = 0.16 at point 48 is below the radius, 0.20 at point 47 is not.
    assert_eq!(goes(Params::default(), sofa, 50, true), (3..=47).collect::<Vec<_>>());
}

/// A robot that drives at 0.3 m/s towards a body in a 1.7 m wide hallway, seen through the true cones: the
/// gap at which it halts, and how often the signal changed in the two seconds that it then stands there.
fn approach(body: geometry::Body, y_m: f64) -> (f64, u64) {
    let walls = [-0.85, 0.85].map(|y| Segment::between([-5.0, y], [20.0, y]));
    let mut scene = Scene::new(walls);
    scene.add_body(body, Pose2::new(4.0, y_m, 0.0), Surface::Furniture(0));
    let half_rad = 13.5_f64.to_radians();
    let cone =
        Cone { half_width_rad: half_rad, half_height_rad: half_rad, columns: 9, rows: 9, max_range_m: 4.0 };
    let mut bench = Bench::new(Params::default());
    let mut halted = None;
    for _ in 0..300 {
        let pose = Pose2::new(bench.odometry.unwrap().x_m, -0.35, 0.0);
        let mut hits = Vec::new();
        let mut range_m = [FAR; 8];
        for (range_m, mount) in range_m.iter_mut().zip(TofRanges::MOUNTS) {
            scene.cast_cone(pose.compose(mount), 0.25, &cone, &mut hits);
            let nearest = hits.iter().flatten().map(|hit| hit.range_m).min_by(f64::total_cmp);
            *range_m = nearest.filter(|&m| m < 2.0).map_or(FAR, |m| m as f32);
        }
        let said = bench.feed(&frame(range_m));
        match (said.signal == Verdict::Go, halted) {
            (true, None) => bench.drive(0.03),
            _ => bench.drive(0.0),
        }
        if said.signal == Verdict::Stop && said.changes > 0 && halted.is_none() {
            halted = Some((bench.now_s, said.front_m, said.changes));
        }
        if let Some((since_s, gap_m, changes)) = halted
            && bench.now_s > since_s + 2.0
        {
            return (f64::from(gap_m), said.changes - changes);
        }
    }
    (f64::INFINITY, 0)
}

#[track_caller]
fn check_approach(kind: geometry::BodyKind, y_m: f64) {
    let (gap_m, changes) = approach(geometry::Body::of(kind), y_m);
    assert!((0.1..0.2).contains(&gap_m) && changes == 0, "{kind:?}: {gap_m} m, {changes} changes");
}

#[test]
fn furniture_in_the_way_halts_the_robot_for_good() {
    check_approach(geometry::BodyKind::MailCart, -0.4);
    check_approach(geometry::BodyKind::Sofa, -0.3);
    check_approach(geometry::BodyKind::CardboardBox, -0.3);
}

// ---- Parameters.

#[track_caller]
fn check_refused(change: impl FnOnce(&mut Params), words: &str) {
    let mut params = Params::default();
    change(&mut params);
    let error = CollisionAvoidance::new(params).expect_err("these make no sense").to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    check_refused(|p| p.front_radius_m = f64::NAN, "`front_radius_m` is not a finite number");
    check_refused(|p| p.front_radius_m = 0.03, "front_radius_m = 0.03 is not above");
    check_refused(|p| p.left_radius_m = 0.04, "left_radius_m = 0.04 is not above");
    check_refused(|p| p.memory_m = 0.1, "memory_m = 0.1 is below front_radius_m = 0.2");
    check_refused(|p| p.heartbeat_ms = 400, "heartbeat_ms = 400 is above max_age_ms = 300");
    check_refused(|p| p.clear_frames = 0, "`clear_frames` is 0");
    check_refused(|p| p.max_age_ms = 0, "`max_age_ms` is 0");
    Params { memory_m: 0.0, ..Params::default() }.check().unwrap();
}

// ---- Anything may come.

prop_compose! {
    fn any_ranges()(range_m in prop::array::uniform8(any::<f32>()), status in prop::array::uniform8(prop_oneof![Just(0), 0_u32..14, any::<u32>()]))
        -> TofRanges {
        TofRanges { range_m, status: status.map(RangeStatus) }
    }
}

prop_compose! {
    /// Mostly plausible frames, so that GO is reached at all.
    fn likely_ranges()(range_m in prop::array::uniform8(prop_oneof![9 => 0.2_f32..4.0, 1 => 0.0_f32..0.3]), hidden in 0_usize..60, status in 0_u32..14) -> TofRanges {
        let mut ranges = frame(range_m);
        if let Some(slot) = ranges.status.get_mut(hidden) {
            *slot = RangeStatus(status);
        }
        ranges
    }
}

prop_compose! {
    fn any_odometry()(n in prop::array::uniform7(prop_oneof![-2.0..2.0_f64, any::<f64>()])) -> Odometry {
        let [x_m, y_m, heading_rad, forward_mps, turn_rad_per_s, left_travel_m, right_travel_m] = n;
        Odometry { x_m, y_m, heading_rad, forward_mps, turn_rad_per_s, left_travel_m, right_travel_m }
    }
}

proptest! {
    #[test]
    fn any_bytes_are_survived_and_a_violation_is_a_stop(
        frames in prop::collection::vec((prop_oneof![3 => likely_ranges(), 1 => any_ranges()], prop::option::of(any_odometry()), 0_u64..400), 1..40)
    ) {
        let mut guard = CollisionAvoidance::new(Params::default()).unwrap();
        let mut now = Time::from_secs_f64(1.0);
        for (ranges, odometry, gap_ms) in &frames {
            now = now.after(Duration::from_millis(gap_ms + 1));
            let odometry = odometry.as_ref().map(|odometry| Stamped::new(now, odometry));
            let said = guard.step(now, Inputs { ranges: Some(Stamped::new(now, ranges)), odometry, ..Inputs::default() }).clearance;
            let radius = |sensor| if (2..6).contains(&sensor) { 0.2 } else { 0.05 };
            let bad = (0..8).any(|sensor| match ranges.reading(sensor) {
                Reading::Distance(m) => m < radius(sensor),
                Reading::Fault => true,
                _ => false,
            });
            prop_assert!(!bad || said.signal == Verdict::Stop);
            prop_assert_eq!(said.signal == Verdict::Go, said.reason == Why::Clear);
            prop_assert!(said.signal == Verdict::Stop || said.violated_faces == 0);
            prop_assert!(said.front_m >= 0.0 && said.right_m >= 0.0 && said.left_m >= 0.0);
        }
    }
}

#[test]
fn a_successor_remembers_what_its_predecessor_saw_vanish() {
    let mut bench = Bench::new(Params::default());
    bench.feed_times(3, &ahead([FAR; 4]));
    bench.feed_times(3, &ahead([FAR, 0.15, FAR, FAR]));
    // It vanishes while nobody looks: the successor knows where it was.
    let snapshot = bench.guard.snapshot();
    let text = serde_json::to_string(&snapshot).unwrap();
    let mut successor = Bench::new(Params::default());
    successor.guard.restore(&serde_json::from_str(&text).unwrap());
    successor.feed_times(5, &ahead([FAR; 4]));
    successor.expect(Verdict::Stop, Why::Remembered);
    let mut forgetful = Bench::new(Params::default());
    forgetful.feed_times(5, &ahead([FAR; 4]));
    forgetful.expect(Verdict::Go, Why::Clear);
}
