//! Services die at random instants, in their start-up too, and the robot stays safe and whole.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::Value;
use std::process::Command;
use tests::launcher;

fn chaos(board: &str, arguments: &[&str]) -> (bool, Value, String) {
    let output = Command::new(launcher())
        .args(["chaos", "coffee", "--no-build", "--json", "--board", board])
        .args(arguments)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.success(), serde_json::from_slice(&output.stdout).unwrap_or_default(), words)
}

#[test]
fn twenty_five_deeds_leave_a_whole_and_safe_robot() {
    // Deaths come from the seed; when they meet what, from the machine. A failure is one whatever the seed.
    let (sound, report, words) =
        chaos(&format!("chaos{}", std::process::id()), &["--kills", "25", "--seed", "4"]);
    assert!(sound, "{report:#}\n{words}");
    assert_eq!(report["healed"], 25);
    assert_eq!(report["contacts"], 0);
    assert_eq!(report["left_behind"], 0);
    assert!(report["way_m"].as_f64() > Some(0.0), "{report:#}");
    let chain = ["base-driver", "collision-avoidance", "controller", "tof-driver"];
    assert!(chain.iter().all(|role| report["wheels"][role]["in_time"].as_u64() > Some(0)), "{report:#}");
}

/// A robot that does not keep the promise, or of which nobody can know whether it does.
#[track_caller]
fn check_unsound(board: &str, changes: &[&str], spare: &[&str], says: &str) {
    let set = changes.iter().flat_map(|change| ["--set", change]);
    let spare = spare.iter().flat_map(|role| ["--spare", role]);
    let arguments: Vec<&str> = ["--kills", "5", "--seed", "1"].into_iter().chain(set).chain(spare).collect();
    let (sound, report, words) = chaos(&format!("{board}{}", std::process::id()), &arguments);
    let told = format!("{} {}", report["broken"], report["doubts"]);
    assert!(!sound && told.contains(says), "{report:#}\n{words}");
}

/// Everybody of the robot but the driver of the wheels.
const ALL_BUT_DRIVER: [&str; 10] = [
    "tof-driver",
    "tag-driver",
    "collision-avoidance",
    "localiser",
    "angle-correction",
    "door-locator",
    "navigator",
    "planner",
    "controller",
    "current-state",
];

#[test]
fn a_robot_that_stands_proves_nothing() {
    check_unsound(
        "stands",
        &["collision-avoidance.front_radius_m=3.9", "collision-avoidance.memory_m=0"],
        &[],
        "turning wheels",
    );
}

#[test]
fn motors_that_run_on_without_their_driver_are_seen() {
    check_unsound("runs-on", &["simulator.watchdog_ms=1000"], &ALL_BUT_DRIVER, "rims at");
}

#[test]
fn deadlines_that_the_graph_makes_longer_are_no_excuse() {
    // As long as the check lets them be.
    let changes = [
        "base-driver.guard_deadline_ms=300",
        "base-driver.command_deadline_ms=1000",
        "graph.defaults.top_speed_mps=0.25",
    ];
    check_unsound("patient", &changes, &[], "wheels told to turn");
}

#[test]
fn without_the_truth_nobody_knows_of_contacts() {
    check_unsound(
        "blind",
        &["graph.view.truth=\"mission/orders\""],
        &[],
        "nobody knows whether the robot has touched",
    );
}

#[test]
fn who_is_spared_must_exist() {
    let (sound, _, words) = chaos(&format!("spare{}", std::process::id()), &["--spare", "plannr"]);
    assert!(!sound && words.contains("plannr"), "{words}");
}
