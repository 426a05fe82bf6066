//! A controller that means ill: whatever it asks, the robot touches nothing, and however it breaks down, the
//! old one has the role again and nothing is left.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use board::clock;
use serde_json::Value;
use std::process::Command;
use std::time::Duration;
use tests::{Graph, Running, launcher};

/// Ways to drive badly.
const DRIVES: [&str; 12] = [
    "max",
    "max-backwards",
    "spin",
    "spin-right",
    "oscillate",
    "waggle",
    "shake",
    "wander",
    "nan",
    "huge",
    "flood",
    "stale",
];

/// It drives decently for a while, and then as the mode says.
#[track_caller]
fn check_touches_nothing(graph: &str, decent: &str, begins_s: f64) {
    let mut driven = 0;
    for (seed, mode) in (1..).zip(DRIVES) {
        let graph = Graph::load(graph)
            .swap("controller", "hostile-controller")
            .set("controller.mode", mode)
            .set("controller.decent", decent)
            .set("controller.begins_s", begins_s)
            .lockstep(seed)
            .start();
        // Until the robot is here or there, and as long again as it takes to touch something from anywhere
        // near.
        graph.advance(Duration::from_secs_f64(begins_s + 8.0));
        let truth = graph.collect("world/truth");
        let (_, last) = truth.last().unwrap();
        assert_eq!(last["contacts"], 0, "{mode}: {last}");
        let place = |truth: &Value| ["x_m", "y_m"].map(|key| truth[key].as_f64().unwrap());
        let ([x_m, y_m], [to_x_m, to_y_m]) = (place(&truth[0].1), place(last));
        driven += u32::from((to_x_m - x_m).hypot(to_y_m - y_m) > 0.05);
    }
    // Some look around for longer before they set out.
    assert!(driven > 6, "only {driven} have driven");
}

#[test]
fn whatever_it_asks_the_coffee_robot_touches_nothing() {
    check_touches_nothing("coffee", "fuzzy", 12.0);
}

#[test]
fn whatever_it_asks_the_ultrasonic_robot_touches_nothing() {
    check_touches_nothing("nxt", "motion", 12.0);
}

fn swap(graph: &Running, arguments: &[&str]) -> String {
    let mut command = Command::new(launcher());
    command.arg("swap").args(arguments).args(["--no-build", "--board", graph.board()]);
    let output = command.output().unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn status(graph: &Running) -> Value {
    let output = Command::new(launcher()).args(["ps", "--json", "--board", graph.board()]).output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

/// What plays the role now.
fn player(graph: &Running) -> String {
    let status = status(graph);
    let services = status["services"].as_array().cloned().unwrap_or_default();
    let service = services.into_iter().find(|service| service["role"] == "controller");
    service.map_or(String::new(), |service| service["run"].as_str().unwrap_or_default().to_owned())
}

fn wait_for_player(graph: &Running, wanted: &str) {
    let deadline = clock::monotonic().after(Duration::from_secs(30));
    while !player(graph).contains(wanted) {
        assert!(clock::monotonic() < deadline, "`{wanted}` does not play:\n{}", graph.output());
        clock::sleep(Duration::from_millis(50));
    }
}

fn contacts(graph: &Running) -> u64 {
    graph.wait_for("world/truth", |_| true, Duration::from_secs(5))["contacts"].as_u64().unwrap()
}

/// Takes the role from a robot that drives, breaks down, and is sent away.
#[track_caller]
fn check_handed_back(mode: &str) {
    let graph = Graph::load("coffee").start();
    graph.wait_for("world/truth", |robot| robot["left_mps"].as_f64() > Some(0.2), Duration::from_secs(60));
    let mode_is = format!("mode={mode:?}");
    let words = swap(&graph, &["controller=hostile-controller", "--set", &mode_is]);
    // It may be gone already, or be about to go.
    wait_for_player(&graph, "fuzzy-controller");
    assert!(graph.output().contains("fuzzy-controller` has the role again"), "{words}\n{}", graph.output());
    graph.wait_for("world/truth", |robot| robot["left_mps"].as_f64() > Some(0.2), Duration::from_secs(60));
    assert_eq!(contacts(&graph), 0);
    graph.stop();
}

#[test]
fn one_that_ends_in_any_way_hands_the_role_back() {
    for mode in ["exit-zero", "exit-two", "abort", "hang", "busy"] {
        check_handed_back(mode);
    }
}

/// The processes with such a command line.
fn count(command: &str) -> usize {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let lines = processes.filter_map(|process| std::fs::read(process.path().join("cmdline")).ok());
    lines.filter(|line| String::from_utf8_lossy(line).replace('\0', " ").trim() == command).count()
}

#[test]
fn its_children_end_with_it() {
    let graph = Graph::load("coffee").start();
    graph.wait_for("world/truth", |robot| robot["left_mps"].as_f64() > Some(0.2), Duration::from_secs(60));
    // With children in groups and sessions of their own.
    swap(&graph, &["controller=hostile-controller", "--set", "mode=\"fork\""]);
    wait_for_player(&graph, "hostile-controller");
    let deadline = clock::monotonic().after(Duration::from_secs(20));
    while count("sleep 120") == 0 {
        assert!(clock::monotonic() < deadline, "it has no children:\n{}", graph.output());
        clock::sleep(Duration::from_millis(10));
    }
    swap(&graph, &["--back", "controller"]);
    wait_for_player(&graph, "fuzzy-controller");
    let deadline = clock::monotonic().after(Duration::from_secs(20));
    while count("sleep 120") > 0 {
        assert!(clock::monotonic() < deadline, "children are left:\n{}", graph.output());
        clock::sleep(Duration::from_millis(50));
    }
    assert_eq!(contacts(&graph), 0);
    graph.stop();
}

#[test]
fn its_words_do_not_fill_the_disk_and_its_memory_is_bounded() {
    let graph = Graph::load("coffee").set("controller.launch.memory_mb", 200).start();
    graph.wait_for("world/truth", |robot| robot["left_mps"].as_f64() > Some(0.2), Duration::from_secs(60));
    swap(&graph, &["controller=hostile-controller", "--set", "mode=\"memory\""]);
    wait_for_player(&graph, "fuzzy-controller");
    assert!(graph.output().contains("has the role again"), "{}", graph.output());
    swap(&graph, &["controller=hostile-controller", "--set", "mode=\"log\""]);
    wait_for_player(&graph, "hostile-controller");
    clock::sleep(Duration::from_secs(3));
    assert_eq!(contacts(&graph), 0);
    let folder = std::path::PathBuf::from(status(&graph)["logs"].as_str().unwrap());
    let bytes: u64 =
        std::fs::read_dir(folder).unwrap().flatten().map(|file| file.metadata().unwrap().len()).sum();
    assert!(bytes < 8 << 20, "{bytes} bytes of logs");
    swap(&graph, &["--back", "controller"]);
    wait_for_player(&graph, "fuzzy-controller");
    graph.stop();
}
