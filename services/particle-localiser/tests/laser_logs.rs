//! Recorded laser drives: maps of the even scans, localised on the odd ones from raw odometry; and the drive in Málaga on its own map.
//!
//! What `cargo test` runs is a sample. All of it, with the figures: `cargo test --release -p particle-localiser --test laser_logs --
//! --include-ignored --nocapture --test-threads 1`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod support;

use particle_localiser::Params;
use support::{Drive, Look, Robot, Run, kidnap, load, malaga, track};

/// Medians of a drive that is followed with 500 particles stay below the bars, with every seed, and no estimate goes astray.
#[track_caller]
fn check_tracking(name: &str, drive: Option<Drive>, seeds: u64, most_m: f64, bar_m: f64, bar_deg: f64) {
    let Some(drive) = drive else { return };
    let (mut worst_m, mut worst_deg, mut farthest_m): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for seed in 0..seeds {
        let run = track(&drive, seed, most_m);
        let ((error_m, error_deg), farthest) = (run.quantile(0.5), run.quantile(1.0).0);
        println!("{name}, seed {seed}: median {error_m:.4} m, {error_deg:.3} deg; largest {farthest:.2} m");
        worst_m = worst_m.max(error_m);
        worst_deg = worst_deg.max(error_deg);
        farthest_m = farthest_m.max(farthest);
    }
    println!(
        "{name}: {} scans, {seeds} seeds: the worst medians are {worst_m:.4} m and {worst_deg:.3} deg, the largest error {farthest_m:.2} m",
        drive.looks.len()
    );
    assert!(worst_m <= bar_m && worst_deg <= bar_deg, "{name}: {worst_m} m, {worst_deg} deg");
    assert!(farthest_m < 1.0, "{name}: an estimate went astray by {farthest_m} m");
}

/// Starts without a pose, spread over the drive; right is within 0.5 m at the end of 10 m of travel, and to know it.
#[track_caller]
fn check_global(name: &str, drive: Option<Drive>, starts: usize, least_right: usize) {
    let Some(drive) = drive else { return };
    let is_right = |start: &usize| {
        let looks = &drive.looks[start * (drive.looks.len() * 9 / 10) / starts..];
        let run = Run::of(&mut Robot::new(&drive, Params::default(), *start as u64), looks, 10.0);
        if !run.is_right() {
            println!("{name}, start {start}: {:?} at the end", run.errors.last());
        }
        run.is_right()
    };
    let right = (0..starts).filter(is_right).count();
    println!("{name}: {right} of {starts} starts right");
    assert!(right >= least_right, "{name}: {right} of {starts}");
}

/// Robots that are carried elsewhere know where they are within so much travel.
#[track_caller]
fn check_kidnapped(name: &str, drive: Option<Drive>, runs: u64, most_m: f64, least_right: usize) {
    let Some(drive) = drive else { return };
    let is_right = |seed: &u64| {
        let run = kidnap(&drive, Params::default(), *seed, most_m);
        if !run.is_right() {
            println!("{name}, run {seed}: {:?} at the end", run.errors.last());
        }
        run.is_right()
    };
    let right = (0..runs).filter(is_right).count();
    println!("{name}: {right} of {runs} carried robots found themselves within {most_m} m");
    assert!(right >= least_right, "{name}: {right} of {runs}");
}

#[test]
fn intel_is_followed() {
    check_tracking("intel", load("intel"), 1, 100.0, 0.06, 0.5);
}

#[test]
fn belgioioso_is_followed() {
    check_tracking("belgioioso", load("belgioioso"), 1, 100.0, 0.10, 0.5);
}

#[test]
fn malaga_is_followed() {
    check_tracking("malaga", Some(malaga()), 2, f64::INFINITY, 0.08, 1.0);
}

#[test]
fn intel_is_found() {
    check_global("intel", load("intel"), 3, 2);
}

#[test]
fn carried_robots_find_themselves() {
    check_kidnapped("malaga", Some(malaga()), 5, 5.0, 4);
}

#[test]
fn two_threads_give_the_same_bits_as_one() {
    let drive = malaga();
    let run = |threads: u32| {
        let params = Params { threads, ..Params::default() };
        let mut robot = Robot::new(&drive, params, 7);
        let run = Run::of(&mut robot, &drive.looks, 3.0);
        (run, robot.localiser.filter().particles().clone())
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one, two);
    assert!(one.0.particles[0] >= 500, "a search large enough for two threads");
    let other_seed = Run::of(&mut Robot::new(&drive, Params::default(), 8), &drive.looks, 3.0);
    assert_ne!(one.0.estimates, other_seed.estimates);
}

#[test]
fn a_successor_goes_on_where_its_predecessor_was() {
    let drive = malaga();
    let mut robot = Robot::new(&drive, Params::default(), 3);
    let before = Run::of(&mut robot, &drive.looks[..60], f64::INFINITY);
    assert!(before.is_right());
    let text = serde_json::to_string(&robot.localiser.snapshot().unwrap()).unwrap();
    let mut successor = robot.replaced(&drive, 4, &serde_json::from_str(&text).unwrap());
    // At once, before it has seen a scan.
    let (last, now) = (*before.estimates.last().unwrap(), successor.wait().pose().unwrap());
    assert!(now.distance_m(last) < 0.03, "{now:?} for {last:?}");
    // While nobody followed it the robot drove on for a step: odometry tells how far.
    let scanless = Look { ranges: Vec::new(), ..drive.looks[60].clone() };
    successor.drive(&scanless);
    let after = Run::of(&mut successor, &drive.looks[61..90], f64::INFINITY);
    assert!(after.quantile(1.0).0 < 0.5, "{:?}", after.errors);
}

#[test]
fn a_predecessors_nonsense_is_left_alone() {
    let drive = malaga();
    let mut robot = Robot::new(&drive, Params::default(), 3);
    Run::of(&mut robot, &drive.looks[..5], f64::INFINITY);
    let sound = serde_json::to_value(robot.localiser.snapshot().unwrap()).unwrap();
    let knows = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut state = sound.clone();
        change(&mut state);
        robot.replaced(&drive, 4, &serde_json::from_value(state).unwrap()).wait().pose().is_ok()
    };
    assert!(knows(&|_| ()));
    assert!(!knows(&|state| state["belief"]["origin"][0] = 1e30.into()));
    assert!(!knows(&|state| state["belief"]["averages"]["slow"] = 1e300.into()));
    assert!(!knows(&|state| state["belief"]["particles"] = Vec::<f32>::new().into()));
}

#[test]
#[ignore = "a minute; the bars of the laser logs"]
fn all_logs_twenty_seeds() {
    check_tracking("intel", load("intel"), 20, f64::INFINITY, 0.06, 0.5);
    check_tracking("freiburg-079", load("freiburg-079"), 20, f64::INFINITY, 0.06, 0.5);
    check_tracking("csail", load("csail"), 20, f64::INFINITY, 0.10, 0.5);
    check_tracking("belgioioso", load("belgioioso"), 20, f64::INFINITY, 0.10, 0.5);
    check_tracking("malaga", Some(malaga()), 20, f64::INFINITY, 0.08, 1.0);
}

#[test]
#[ignore = "a minute; the bars of the laser logs"]
fn forty_starts_without_a_pose() {
    check_global("intel", load("intel"), 40, 38);
    check_global("freiburg-079", load("freiburg-079"), 40, 38);
    check_global("malaga", Some(malaga()), 40, 38);
}

#[test]
#[ignore = "a minute; the bars of the carried robot"]
fn forty_carried_robots() {
    check_kidnapped("malaga", Some(malaga()), 40, 5.0, 38);
    // No bar of ours: seven scans in 10 m, as these logs have them, are few.
    check_kidnapped("intel", load("intel"), 40, 10.0, 16);
    check_kidnapped("freiburg-079", load("freiburg-079"), 40, 10.0, 36);
}
