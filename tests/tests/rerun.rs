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
