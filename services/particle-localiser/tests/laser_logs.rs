//! Recorded laser drives: maps of the even scans, localised on the odd ones from raw odometry; and the drive
//! in Málaga on its own map.
//!
//! This is a sample. All of it, with the figures: `cargo bench -p particle-localiser --bench accuracy`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod support;

use particle_localiser::Params;
use support::{Drive, Look, Robot, Run, follow, found, load, malaga, recovered};

/// Medians of a drive that is followed with 500 particles stay below the bars, with every seed, and no
/// estimate goes astray.
#[track_caller]
fn check_tracking(drive: Option<Drive>, seeds: u64, most_m: f64, bar_m: f64, bar_deg: f64) {
    let Some(drive) = drive else { return };
    let worst = follow(&drive, seeds, most_m);
    assert!(worst.median_m <= bar_m && worst.median_deg <= bar_deg && worst.farthest_m < 1.0, "{worst:?}");
}

#[test]
fn intel_is_followed() {
    check_tracking(load("intel"), 1, 100.0, 0.06, 0.5);
}

#[test]
fn belgioioso_is_followed() {
    check_tracking(load("belgioioso"), 1, 100.0, 0.10, 0.5);
}

#[test]
fn malaga_is_followed() {
    check_tracking(Some(malaga()), 2, f64::INFINITY, 0.08, 1.0);
}

#[test]
fn intel_is_found() {
    let Some(drive) = load("intel") else { return };
    assert!(found(&drive, 3) >= 2);
}

#[test]
fn carried_robots_find_themselves() {
    assert!(recovered(&malaga(), 5, 5.0) >= 4);
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
