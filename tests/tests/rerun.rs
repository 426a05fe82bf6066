//! Recorded runs come out the same again: whole, and service by service on the recorded inputs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;
use tests::{Graph, launcher};

/// Ten seconds of the coffee robot on its way.
fn recorded(graph: Graph) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let _ = graph.with(&["--until", "10", "--record", file.to_str().unwrap()]).run_in_lockstep();
    (folder, file)
}

fn rerun(file: &Path, arguments: &[&str]) -> (Option<i32>, Value) {
    let output = run(file, &[arguments, &["--json"]].concat());
    let printed = String::from_utf8_lossy(&output.stdout);
    let report = serde_json::from_str(&printed)
        .unwrap_or_else(|error| panic!("{error}: {printed}\n{}", String::from_utf8_lossy(&output.stderr)));
    (output.status.code(), report)
}

fn run(file: &Path, arguments: &[&str]) -> Output {
    Command::new(launcher()).arg("rerun").arg(file).arg("--no-build").args(arguments).output().unwrap()
}

#[track_caller]
fn check_same(file: &Path, arguments: &[&str]) {
    let (code, report) = rerun(file, arguments);
    assert_eq!((code, &report["same"]), (Some(0), &Value::Bool(true)), "{arguments:?}: {report:#}");
}

#[track_caller]
fn check_differs(file: &Path, arguments: &[&str], closed_or_open: &str, topic: &str) {
    let (code, report) = rerun(file, arguments);
    assert_eq!((code, &report["same"]), (Some(1), &Value::Bool(false)), "{arguments:?}: {report:#}");
    assert_eq!(report["loop"], closed_or_open, "{arguments:?}");
    let difference = &report["difference"];
    assert_eq!(difference["topic"], topic, "{arguments:?}: {difference:#}");
    assert!(difference["stamp_ns"].as_u64().unwrap() > 0, "{difference:#}");
    assert_ne!(difference["a"], difference["b"], "{difference:#}");
}

#[track_caller]
fn check_refused(file: &Path, arguments: &[&str], words: &str) {
    let output = run(file, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains(words), "{arguments:?}: {said}");
}

#[test]
fn whole_and_service_by_service() {
    let (_folder, file) = recorded(Graph::load("coffee").seed(7));
    let (code, report) = rerun(&file, &[]);
    assert_eq!(code, Some(0), "{report:#}");
    assert_eq!(report["digests"]["recorded"]["digest"], report["digests"]["rerun"]["digest"]);
    assert!(report["digests"]["rerun"]["messages"].as_u64().unwrap() > 4000, "{report:#}");
    for role in report["services"].as_array().unwrap() {
        check_same(&file, &["--only", role.as_str().unwrap()]);
    }
    check_same(&file, &["--only", "planner", "--only", "controller"]);
    // What was so already changes nothing.
    check_same(&file, &["--set", "collision-avoidance.front_radius_m=0.2"]);
}

#[test]
fn a_change_is_shown_where_it_begins() {
    let (_folder, file) = recorded(Graph::load("coffee").seed(8));
    check_differs(&file, &["--with", "controller=window-controller"], "open", "wheels/desired");
    check_differs(&file, &["--set", "tag-driver.sigma_m=0.2"], "open", "tag/ranges");
    check_differs(&file, &["--set", "tag-driver.sigma_m=0.2", "--closed"], "closed", "tag/ranges");
}

/// A whole drive of the ultrasonic robot, to its verdict.
fn judged() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let graph = Graph::load("nxt").seed(1).with(&["--record", file.to_str().unwrap()]);
    let end = graph.run_in_lockstep();
    assert_eq!(end["run"]["passed"], true, "{end:#}");
    (folder, file)
}

#[test]
fn a_closed_loop_tells_both_verdicts_and_what_a_change_came_to() {
    let (_folder, file) = judged();
    let (_, report) = rerun(&file, &[]);
    let judge = &report["judge"];
    assert_eq!(judge["recorded"], judge["rerun"], "{judge:#}");
    assert_eq!(judge["recorded"]["verdict"], "passed", "{judge:#}");
    assert!(
        judge["figures"].as_array().unwrap().iter().all(|figure| figure["difference"] == 0.0),
        "{judge:#}"
    );
    // A judge without patience.
    let change = ["--set", "referee.time_limit_s=5", "--closed"];
    let (code, report) = rerun(&file, &change);
    let judge = &report["judge"];
    assert_eq!(code, Some(1));
    assert_eq!(
        (&judge["recorded"]["verdict"], &judge["rerun"]["verdict"]),
        (&"passed".into(), &"failed".into())
    );
    assert!(judge["rerun"]["remark"].as_str().unwrap().contains("not there after 5 s"), "{judge:#}");
    let time = judge["figures"].as_array().unwrap().iter().find(|figure| figure["unit"] == "s").unwrap();
    let [was, is, by] = ["recorded", "rerun", "difference"].map(|side| time[side].as_f64().unwrap());
    assert!(is < was && (is - was - by).abs() < 1e-9, "{time:#}");
    let printed = String::from_utf8(run(&file, &change).stdout).unwrap();
    let lines: Vec<&str> = printed.lines().collect();
    let place = |words: &str| lines.iter().position(|line| line.contains(words)).unwrap();
    // The verdicts come before the topics.
    assert!(place("recorded   PASSED") < place("rerun      FAILED"), "{printed}");
    assert!(place("rerun      FAILED") < place("first difference"), "{printed}");
}

#[test]
fn a_change_that_takes_longer_is_judged_at_its_own_end() {
    let (_folder, file) = judged();
    let (_, report) = rerun(&file, &["--set", "controller.speed_mps=0.04", "--closed"]);
    let judge = &report["judge"];
    assert_ne!(judge["rerun"]["verdict"], "undecided", "{judge:#}");
}

#[test]
fn a_run_without_a_judge_says_so() {
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../launch/graphs").canonicalize().unwrap();
    let text = std::fs::read_to_string(graphs.join("nxt.toml")).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("finish")).map(|line| line.to_owned() + "\n");
    let here = tempfile::tempdir().unwrap();
    let graph = here.path().join("nobody-judges.toml");
    let worlds = format!("\"{}/worlds/", graphs.parent().unwrap().display());
    std::fs::write(&graph, lines.collect::<String>().replace("\"../worlds/", &worlds)).unwrap();
    let (_folder, file) = recorded(Graph::load(graph.to_str().unwrap()).without("referee"));
    let (_, report) = rerun(&file, &[]);
    assert_eq!(report["judge"], Value::Null);
    let remarks = report["remarks"].to_string();
    assert!(remarks.contains("no topic of this graph is that of a judge"), "{remarks}");
}

#[test]
fn swaps_and_parameters_of_the_run_are_on_record() {
    let graph =
        Graph::load("coffee").swap("controller", "window-controller").set("navigator.default_order", "211");
    let (_folder, file) = recorded(graph.without("current-state").with(&["--seed", "9"]));
    check_same(&file, &[]);
    check_same(&file, &["--only", "controller"]);
    check_differs(&file, &["--with", "controller=fuzzy-controller"], "open", "wheels/desired");
}

#[test]
fn what_cannot_be_run_is_refused() {
    let (folder, file) = recorded(Graph::load("coffee"));
    check_refused(&file, &["--with", "planer=grid-planner"], "did you mean `planner`?");
    check_refused(&file, &["--only", "planer"], "no service `planer`");
    check_refused(&file, &["--set", "graph.seed=2"], "--closed");
    check_refused(Path::new("/nowhere.mcap"), &[], "/nowhere.mcap");
    let alone = folder.path().join("alone.mcap");
    check_same(&file, &["--only", "planner", "--record", alone.to_str().unwrap()]);
    check_refused(&alone, &[], "planner alone");
}
