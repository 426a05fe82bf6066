//! Recorded laser drives: maps of the even scans, localised on the odd ones from raw odometry.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod support;

use particle_localiser::Params;
use support::{Entry, Log, Run, load, run};

fn tracking_params() -> Params {
    Params { min_particles: 500, max_particles: 500, ..Params::default() }
}

/// Follows the log from its first pose on with 500 particles.
#[track_caller]
fn check_tracking(name: &str, seeds: u64, most_m: f64, bar_m: f64, bar_deg: f64) {
    let Some(log) = load(name) else { return };
    let mut medians = Vec::new();
    for seed in 0..seeds {
        let run = run(&log, tracking_params(), seed, 0, most_m, true);
        let ((error_m, error_rad), worst) = (run.quantile(0.5), run.quantile(1.0));
        let far = run.errors.iter().filter(|error| error.0 > 1.0).count();
        println!(
            "{name}, seed {seed}: median {error_m:.4} m, {:.3} deg; worst {:.2} m",
            error_rad.to_degrees(),
            worst.0
        );
        assert!(far == 0, "{name}, seed {seed}: {far} of {} scans more than 1 m off", run.errors.len());
        medians.push((error_m, error_rad.to_degrees()));
    }
    medians.sort_by(|a, b| a.0.total_cmp(&b.0));
    let median_m = medians[medians.len() / 2].0;
    medians.sort_by(|a, b| a.1.total_cmp(&b.1));
    let median_deg = medians[medians.len() / 2].1;
    assert!(median_m <= bar_m && median_deg <= bar_deg, "{name}: {median_m} m, {median_deg} deg");
}

/// Starts without a pose, spread over the log; right is within 0.5 m at the end of 10 m of travel.
#[track_caller]
fn check_global(name: &str, starts: usize, least_right: usize) {
    let Some(log) = load(name) else { return };
    let scans = log.entries.iter().filter(|entry| matches!(entry, Entry::Scan { .. })).count();
    let is_right = |start: &usize| {
        let run = run(&log, Params::default(), *start as u64, start * (scans * 9 / 10) / starts, 10.0, false);
        let right = run.errors.last().is_some_and(|error| error.0 < 0.5) && run.found.last() == Some(&true);
        if !right {
            println!("{name}, start {start}: {:?} at the end", run.errors.last());
        }
        right
    };
    let right = (0..starts).filter(is_right).count();
    println!("{name}: {right} of {starts} starts right");
    assert!(right >= least_right, "{name}: {right} of {starts}");
}

/// The same particles, whoever weighs them.
fn fingerprint(log: &Log, threads: u32) -> Run {
    let params = Params { threads, beams: 180, ..Params::default() };
    run(log, params, 7, 100, 3.0, false)
}

#[test]
fn intel_is_followed() {
    check_tracking("intel", 1, 100.0, 0.06, 0.5);
}

#[test]
fn belgioioso_is_followed() {
    check_tracking("belgioioso", 1, 100.0, 0.10, 1.0);
}

#[test]
fn intel_is_found() {
    check_global("intel", 3, 2);
}

#[test]
fn two_threads_give_the_same_bits_as_one() {
    let Some(log) = load("intel") else { return };
    let (one, two) = (fingerprint(&log, 1), fingerprint(&log, 2));
    assert_eq!(one.last, two.last);
    assert_eq!(one.errors, two.errors);
    assert!(one.particles[0] > 600, "a global start, large enough for two threads");
}

#[test]
#[ignore = "a minute; the bars of the laser logs"]
fn all_logs_twenty_seeds() {
    check_tracking("intel", 20, f64::INFINITY, 0.06, 0.5);
    check_tracking("freiburg-079", 20, f64::INFINITY, 0.06, 0.5);
    check_tracking("csail", 20, f64::INFINITY, 0.10, 1.0);
    check_tracking("belgioioso", 20, f64::INFINITY, 0.10, 1.0);
}

#[test]
#[ignore = "a minute; the bars of the laser logs"]
fn forty_starts_without_a_pose() {
    check_global("intel", 40, 38);
    check_global("freiburg-079", 40, 38);
}
