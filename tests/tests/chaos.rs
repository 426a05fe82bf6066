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

#[test]
fn who_is_spared_must_exist() {
    let (sound, _, words) = chaos(&format!("spare{}", std::process::id()), &["--spare", "plannr"]);
    assert!(!sound && words.contains("plannr"), "{words}");
}
