//! What happens in logical time happens in every run: slow computers, planned deaths, orders from outside,
//! and tests that go step by step.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tests::{Graph, Running, launcher};

fn digest(run: &Value) -> String {
    run["digest"]["digest"].as_str().unwrap_or_else(|| panic!("{run:#}")).to_owned()
}

/// Runs it so often, and returns the last run, which was like the others.
#[track_caller]
fn equal_runs(graph: &Graph, runs: usize) -> Value {
    let first = graph.run_in_lockstep();
    let mut last = first.clone();
    for _ in 1..runs {
        last = graph.run_in_lockstep();
        assert_eq!(digest(&first), digest(&last));
    }
    last
}

#[track_caller]
fn check_delivered(run: &Value) {
    assert_eq!(run["run"]["passed"], true, "{run:#}");
}

#[test]
fn a_slow_controller_makes_another_run_the_same_every_time() {
    let graph = Graph::load("coffee").seed(7).with(&["--until", "20"]);
    let fast = graph.run_in_lockstep();
    let slow = equal_runs(&graph.clone().set("controller.launch.compute_ms", 20), 2);
    let slower = equal_runs(&graph.set("controller.launch.compute_ms", 20.5), 2);
    assert_ne!(digest(&fast), digest(&slow));
    assert_ne!(digest(&slow), digest(&slower));
}

#[test]
fn coffee_is_delivered_by_slow_computers() {
    let mut graph = Graph::load("coffee").seed(7);
    for role in ["localiser", "planner", "navigator", "controller", "collision-avoidance", "base-driver"] {
        graph = graph.set(&format!("{role}.launch.compute_ms"), 5);
    }
    check_delivered(&equal_runs(&graph, 2));
}

#[test]
fn messages_of_a_slow_step_come_when_it_is_computed() {
    let graph = Graph::load("coffee")
        .set("controller.launch.compute_ms", 35.5)
        .set("simulator.launch.compute_ms", 0)
        .lockstep(7)
        .start();
    graph.advance(Duration::from_secs(1));
    let commands = graph.collect("wheels/desired");
    let moments: Vec<u64> = commands.iter().map(|(at, _)| at.as_nanos()).collect();
    assert!(commands.len() > 10, "{moments:?}");
    assert_eq!(moments[0] % 500_000, 0, "{moments:?}");
    // No step begins before the one before it is computed.
    assert!(moments.windows(2).all(|pair| pair[1] - pair[0] >= 35_500_000), "{moments:?}");
}

fn with_faults(faults: Value) -> Graph {
    Graph::load("coffee").seed(7).with(&["--set", &format!("graph.fault={}", toml_of(&faults))])
}

/// JSON's tables with the signs of TOML.
fn toml_of(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<_> =
                fields.iter().map(|(key, value)| format!("{key} = {}", toml_of(value))).collect();
            format!("{{ {} }}", fields.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(toml_of).collect::<Vec<_>>().join(", ")),
        plain => plain.to_string(),
    }
}

#[test]
fn the_planner_dies_on_the_way_and_the_coffee_arrives_in_three_equal_runs() {
    let graph = with_faults(
        json!([{"at_s": 30.0, "kill": "planner"}, {"at_s": 45.0, "stop": "planner", "for_s": 3.0}]),
    );
    let run = equal_runs(&graph, 3);
    check_delivered(&run);
    assert_eq!(run["run"]["restarts"], 2, "{run:#}");
    let undisturbed = Graph::load("coffee").seed(7).run_in_lockstep();
    assert_ne!(digest(&run), digest(&undisturbed));
}

#[test]
fn everybody_dies_once_and_the_coffee_arrives_in_equal_runs() {
    let roles = [
        "collision-avoidance",
        "controller",
        "base-driver",
        "navigator",
        "planner",
        "localiser",
        "tof-driver",
        "tag-driver",
        "angle-correction",
        "door-locator",
        "current-state",
    ];
    let faults = roles
        .iter()
        .enumerate()
        .map(|(index, role)| json!({"at_s": 15.0 + 3.0 * index as f64, "kill": role}));
    let graph = with_faults(faults.collect()).set("referee.time_limit_s", 400.0);
    let run = equal_runs(&graph, 2);
    check_delivered(&run);
    assert_eq!(run["run"]["restarts"], roles.len(), "{run:#}");
}

fn speed_mps(wheels: &Value) -> f64 {
    wheels["left_mps"].as_f64().unwrap().abs() + wheels["right_mps"].as_f64().unwrap().abs()
}

fn driving(graph: Graph) -> Running {
    let graph = graph.lockstep(7).start();
    graph.wait_for("wheels/applied", |wheels| speed_mps(wheels) > 0.5, Duration::from_secs(60));
    graph
}

#[test]
fn the_wheels_stand_when_their_driver_dies() {
    let graph = driving(Graph::load("coffee"));
    let died = graph.kill("base-driver");
    graph.advance(Duration::from_millis(99));
    let applied = graph.collect("wheels/applied");
    assert!(applied.iter().all(|(at, _)| *at <= died), "the dead speak");
    // The successor speaks after 100 ms, and begins with zero.
    graph.advance(Duration::from_millis(2));
    let applied = graph.collect("wheels/applied");
    let (at, first) = applied.iter().find(|(at, _)| *at > died).unwrap();
    assert_eq!(at.since(died), Duration::from_millis(100));
    assert_eq!(speed_mps(first), 0.0, "{first:#}");
    graph.wait_for("wheels/applied", |wheels| speed_mps(wheels) > 0.5, Duration::from_secs(10));
}

#[track_caller]
fn check_wheels_stand(fault: &str, role: &str) {
    let graph = driving(Graph::load("coffee").set(&format!("{role}.launch.restart"), false));
    let now_s = graph.now().as_secs_f64();
    drop(graph);
    let fault = format!("[{{ at_s = {}, {fault} = \"{role}\" }}]", now_s + 0.005);
    let graph = Graph::load("coffee")
        .set(&format!("{role}.launch.restart"), false)
        .with(&["--set", &format!("graph.fault={fault}")]);
    let graph = driving(graph);
    let died = graph.now();
    graph.advance(Duration::from_secs(3));
    let applied = graph.collect("wheels/applied");
    let late = applied.iter().filter(|(at, _)| at.since(died) > Duration::from_millis(125));
    let late: Vec<_> = late.collect();
    assert!(late.len() > 50 && late.iter().all(|(_, wheels)| speed_mps(wheels) == 0.0), "{role}");
}

#[test]
fn the_wheels_stand_when_nobody_commands_them_any_more() {
    check_wheels_stand("kill", "controller");
    check_wheels_stand("kill", "collision-avoidance");
    check_wheels_stand("stop", "controller");
}

#[test]
fn a_death_that_nobody_planned_ends_the_run_with_its_name() {
    let graph = Graph::load("coffee").lockstep(7).start();
    tests::signal(graph.pid("localiser"), "KILL");
    let result =
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| graph.advance(Duration::from_secs(5))));
    assert!(result.is_err());
    let status = graph.wait_for_end(Duration::from_secs(10));
    assert_eq!(status.code(), Some(1));
    assert!(graph.output().contains("`localiser` died"), "{}", graph.output());
}

#[test]
fn orders_from_outside_come_out_the_same_in_a_rerun() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ordered.mcap");
    let board = format!("order{}", std::process::id());
    // A run that goes on while somebody orders: at what moment he comes is chance.
    let mut run = Command::new(launcher())
        .args([
            "up",
            "coffee",
            "--no-build",
            "--no-view",
            "--lockstep",
            "--seed",
            "7",
            "--speed",
            "20",
            "--until",
            "30",
        ])
        .args(["--set", "navigator.default_order=\"\"", "--board", &board, "--record"])
        .arg(&file)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../launch"))
        .spawn()
        .unwrap();
    let mut orders = 0;
    while run.try_wait().unwrap().is_none() {
        if orders < 2 {
            let ordered =
                Command::new(launcher()).args(["order", "205", "--board", &board]).output().unwrap();
            orders += usize::from(ordered.status.success());
        }
        board::clock::sleep(Duration::from_millis(100));
    }
    assert_eq!(orders, 2, "nobody could order");
    let report = check_rerun(&file, &[]);
    assert_eq!(report["digests"]["rerun"]["topics"]["mission/orders"][0], 2, "{report:#}");
}

#[track_caller]
fn check_rerun(file: &Path, arguments: &[&str]) -> Value {
    let rerun = Command::new(launcher())
        .arg("rerun")
        .arg(file)
        .args(["--no-build", "--json"])
        .args(arguments)
        .output()
        .unwrap();
    let report: Value = serde_json::from_slice(&rerun.stdout).unwrap_or_default();
    assert_eq!(report["same"], true, "{report:#}\n{}", String::from_utf8_lossy(&rerun.stderr));
    report
}

#[test]
fn a_run_with_faults_and_slow_computers_comes_out_the_same_in_a_rerun() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("faulty.mcap");
    let faults = json!([
        {"at_s": 10.0, "kill": "planner", "down_s": 0.5},
        {"at_s": 12.0, "stop": "controller", "for_s": 0.3},
        {"at_s": 14.0, "stop": "localiser"},
    ]);
    let graph =
        with_faults(faults).set("controller.launch.compute_ms", 7).set("planner.launch.compute_ms", 60);
    let _ = graph.with(&["--until", "20", "--record", file.to_str().unwrap()]).run_in_lockstep();
    let report = check_rerun(&file, &[]);
    assert!(report["digests"]["rerun"]["messages"].as_u64().unwrap() > 5000);
    for role in ["planner", "controller", "localiser", "navigator"] {
        check_rerun(&file, &["--only", role]);
    }
}

/// One test as the machine sees it: everything that was published.
fn a_test() -> Vec<(messages::Time, Value)> {
    let graph = Graph::load("coffee").set("navigator.default_order", "").lockstep(3).start();
    graph.advance(Duration::from_millis(1234));
    graph.publish("mission/orders", json!({"room": "211"}));
    graph.wait_for("world/truth", |robot| robot["x_m"].as_f64() > Some(4.0), Duration::from_secs(60));
    graph.kill("localiser");
    graph.advance(Duration::from_secs(3));
    ["wheels/desired", "location/pose", "mission/status"]
        .iter()
        .flat_map(|topic| graph.collect(topic))
        .collect()
}

#[test]
fn a_test_in_logical_time_sees_the_same_every_time() {
    let first = a_test();
    assert!(first.len() > 500, "{}", first.len());
    assert_eq!(first, a_test());
}

#[test]
fn a_failed_test_says_what_happened_and_keeps_the_recording() {
    let name = format!("failing-{}", std::process::id());
    let board = std::sync::Arc::new(std::sync::Mutex::new(String::new()));
    let place = std::sync::Arc::new(std::sync::Mutex::new(None));
    let (board_of_it, place_of_it) = (board.clone(), place.clone());
    let failing = std::thread::Builder::new().name(name.clone()).spawn(move || {
        let graph = Graph::load("coffee").lockstep(7).start();
        *board_of_it.lock().unwrap() = graph.board().to_owned();
        *place_of_it.lock().unwrap() = Some(graph.place().clone());
        graph.advance(Duration::from_millis(700));
        graph.publish("mission/orders", json!({"room": "205"}));
        graph.kill("controller");
        graph.publish("mission/orders", json!({"room": "206"}));
        graph.advance(Duration::from_millis(1234));
        panic!("on purpose");
    });
    assert!(failing.unwrap().join().is_err());
    let place = place.lock().unwrap().clone().unwrap();
    assert!(!place.exists() && place.shared_memory().is_empty(), "the board of a failed test stays behind");
    let kept = tests::failed_graphs().join(format!("{name}-{}.mcap", board.lock().unwrap()));
    let digest = Command::new(launcher()).arg("digest").arg(&kept).output().unwrap();
    assert!(digest.status.success(), "{}", String::from_utf8_lossy(&digest.stderr));
    // What the test did to the graph is on record too.
    check_rerun(&kept, &[]);
    check_rerun(&kept, &["--only", "controller"]);
    std::fs::remove_file(kept).unwrap();
}
