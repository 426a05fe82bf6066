//! Nothing of a board stays behind, however it ends.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use board::clock;
use board::place::Place;
use std::process::Command;
use std::time::Duration;
use tests::{Graph, launcher, signal};

fn waiting_robot() -> Graph {
    Graph::load("coffee").set("navigator.default_order", "")
}

/// Files of the board in shared memory, in its folder and beside it.
fn remains(place: &Place) -> Vec<String> {
    let mut remains: Vec<String> =
        place.shared_memory().iter().map(|path| path.display().to_string()).collect();
    if place.exists() {
        remains.push(place.root().display().to_string());
    }
    remains
}

#[test]
fn after_ctrl_c() {
    let graph = waiting_robot().start();
    let place = graph.place().clone();
    assert!(!remains(&place).is_empty());
    assert!(graph.stop().success(), "{}", graph.output());
    assert_eq!(remains(&place), Vec::<String>::new());
}

#[test]
fn after_the_stop_command() {
    let graph = waiting_robot().start();
    let place = graph.place().clone();
    let output = Command::new(launcher()).args(["stop", "--board", graph.board()]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(remains(&place), Vec::<String>::new());
    assert!(graph.wait_for_end(Duration::from_secs(5)).success());
}

#[test]
fn the_services_leave_when_the_launcher_is_killed_and_the_next_command_cleans_up() {
    let graph = waiting_robot().start();
    let place = graph.place().clone();
    let pids: Vec<u32> = ["base-driver", "controller", "simulator"].map(|role| graph.pid(role)).to_vec();
    graph.kill_launcher();
    let deadline = clock::monotonic().after(Duration::from_secs(5));
    while pids.iter().any(|&pid| board::switchboard::process_lives(pid)) {
        assert!(clock::monotonic() < deadline, "services live on without their launcher");
        clock::sleep(Duration::from_millis(5));
    }
    let output = Command::new(launcher()).args(["ps", "--board", graph.board()]).output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(words.contains("cleared away what was left"), "{words}");
    assert_eq!(remains(&place), Vec::<String>::new());
}

#[test]
fn after_everything_was_killed_at_once() {
    let graph = waiting_robot().start();
    let place = graph.place().clone();
    let pids: Vec<u32> = ["base-driver", "controller", "simulator", "navigator", "planner"]
        .map(|role| graph.pid(role))
        .to_vec();
    graph.kill_launcher();
    pids.iter().for_each(|&pid| signal(pid, "KILL"));
    // Of this board alone: without its name the command clears away those of the tests beside it too.
    let output = Command::new(launcher()).args(["ps", "--board", graph.board()]).output().unwrap();
    assert!(!String::from_utf8_lossy(&output.stderr).contains("cannot be cleared"), "{output:?}");
    assert_eq!(remains(&place), Vec::<String>::new());
}
