//! One service for another while the robot drives.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use messages::{AppliedWheels, DriveReasonName, View};
use std::process::{Command, Output};
use std::time::Duration;
use tests::{Graph, Running, launcher};

fn driving() -> Running {
    let graph = Graph::load("coffee").set("referee.time_limit_s", 300.0).start();
    graph.wait_for("wheels/applied", |applied| applied["reason"] == "Driving", Duration::from_secs(60));
    graph
}

fn launch(graph: &Running, arguments: &[&str]) -> Output {
    Command::new(launcher()).args(arguments).args(["--board", graph.board()]).output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn controller_planner_and_localiser_are_swapped_while_the_robot_drives() {
    let graph = driving();
    let mut applied = graph.reader("wheels/applied");
    while applied.next().is_some() {}
    let fuzzy = graph.pid("controller");
    for (role, binary) in [
        ("controller", "window-controller"),
        ("planner", "grid-planner"),
        ("localiser", "tag-localiser"),
        ("controller", "fuzzy-controller"),
    ] {
        let before = graph.pid(role);
        assert_eq!(graph.swap(role, binary)["done"]["run"], binary);
        assert_ne!(graph.pid(role), before);
        while let Some((_, bytes)) = applied.next() {
            let reason = View::<AppliedWheels>::parse(bytes).unwrap().message.reason.get().unwrap();
            let late = matches!(reason, DriveReasonName::StaleCommand | DriveReasonName::StaleGuard);
            assert!(!late, "the swap of `{role}` stopped the wheels: {reason:?}");
        }
    }
    assert!(!board::switchboard::process_lives(fuzzy), "who was swapped out lives on");
    let output = launch(&graph, &["swap", "--back", "controller"]);
    assert!(words(&output).contains("`window-controller`"), "{}", words(&output));
    let output = launch(&graph, &["swap", "--back", "controller"]);
    assert!(words(&output).contains("`fuzzy-controller`"), "{}", words(&output));
    // And on it goes, without a contact so far.
    graph.wait_for("wheels/applied", |applied| applied["reason"] == "Driving", Duration::from_secs(30));
    let truth = graph.wait_for("world/truth", |_| true, Duration::from_secs(5));
    assert_eq!(truth["contacts"], 0, "{truth:#}");
}

#[test]
fn a_shadow_says_nothing_to_the_robot_and_is_compared() {
    let graph = driving();
    let controller = graph.pid("controller");
    let mut own = graph.reader("wheels/desired");
    let output = launch(
        &graph,
        &["swap", "controller=window-controller", "--shadow", "--for", "2", "--json", "--no-build"],
    );
    let report: serde_json::Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", words(&output)));
    let desired = &report["topics"]["wheels/desired"];
    assert!(
        desired["messages"].as_u64() > Some(20) && desired["shadow_messages"].as_u64() > Some(20),
        "{report:#}"
    );
    assert!(desired["fields"]["left_mps"]["unequal"].as_u64() > Some(0), "{report:#}");
    assert_eq!(graph.pid("controller"), controller);
    let mut generations = Vec::new();
    while let Some((envelope, _)) = own.next() {
        generations.push(envelope.generation);
    }
    generations.dedup();
    assert_eq!(generations.len(), 1, "the shadow was heard");
}

#[test]
fn a_recording_follows_topics_that_are_added() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let graph = Graph::load("coffee").with(&["--record", &file.to_string_lossy()]).start();
    graph.wait_for("wheels/applied", |applied| applied["reason"] == "Driving", Duration::from_secs(60));
    launch(
        &graph,
        &["swap", "controller=window-controller", "--shadow", "--for", "1", "--json", "--no-build"],
    );
    graph.stop();
    let recording = recording::Recording::open(&file).unwrap();
    assert!(recording.is_complete());
    let shadows = recording.as_recorded(|topic| topic.name == "shadow/wheels/desired").count();
    assert!(shadows > 5, "{shadows} messages of the shadow");
}

#[test]
fn a_newcomer_that_cannot_play_the_role_is_refused_and_the_old_one_goes_on() {
    let graph = Graph::load("coffee").set("navigator.default_order", "").start();
    let planner = graph.pid("planner");
    #[track_caller]
    fn refused(graph: &Running, arguments: &[&str], with: &str) {
        let output = launch(graph, arguments);
        assert!(!output.status.success());
        assert!(words(&output).contains(with), "{}", words(&output));
    }
    refused(&graph, &["swap", "planner=grid-plannr", "--no-build"], "did you mean `grid-planner`?");
    refused(&graph, &["swap", "plannr=grid-planner", "--no-build"], "there is no service `plannr`");
    refused(&graph, &["swap", "planner", "--no-build"], "is not ROLE=BINARY");
    refused(&graph, &["swap", "planner=current-state", "--no-build"], "plan/path");
    refused(
        &graph,
        &["swap", "planner=grid-planner", "--set", "robot_radius_m=-1", "--no-build"],
        "robot_radius_m",
    );
    refused(&graph, &["swap", "--back", "planner"], "nothing to go back to");
    assert_eq!(graph.pid("planner"), planner);
}
