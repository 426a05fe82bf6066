//! A service of one's own: written by `launch new` outside of this workspace, built, tested, and run in a
//! graph by its path.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use std::path::Path;
use std::process::{Command, Output};
use tests::launcher;

#[track_caller]
fn check(output: &Output) -> String {
    let words =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}");
    words
}

#[test]
fn a_new_service_passes_its_tests_and_runs_in_a_graph() {
    let folder = tempfile::tempdir().unwrap();
    let new = |name: &str| {
        Command::new(launcher()).args(["new", name, "--in"]).arg(folder.path()).output().unwrap()
    };
    check(&new("speed-meter"));
    assert!(!new("speed-meter").status.success(), "it would be written over");
    assert!(!new("Speed Meter").status.success(), "no name of a service");

    let service = folder.path().join("speed-meter");
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap();
    // What this workspace has compiled already is not compiled again.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let cargo = |arguments: &[&str]| {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
        Command::new(cargo)
            .args(arguments)
            .current_dir(&service)
            .env("CARGO_TARGET_DIR", target)
            .env_remove("RUSTFLAGS")
            .output()
            .unwrap()
    };
    check(&cargo(&["test"]));
    check(&cargo(&["build"]));
    check(&cargo(&["fmt", "--check"]));

    let graph = folder.path().join("robot.toml");
    // Files that a part names count from the folder of the graph that includes it.
    let world = sources.join("launch/worlds/cs-building.toml");
    let text = format!(
        "[graph]\nname = \"speed\"\ninclude = [{:?}]\n\n[graph.defaults]\nworld = {world:?}\n\n[graph.view]\nworld = {world:?}\n\n\
         [speed-meter]\nrun = {:?}\ntime_constant_s = 0.5\n",
        sources.join("launch/graphs/coffee.toml"),
        target.join("debug/speed-meter")
    );
    std::fs::write(&graph, text).unwrap();
    let run = Command::new(launcher())
        .arg("up")
        .arg(&graph)
        .args(["--lockstep", "--until", "3", "--no-view", "--no-build", "--record"])
        .arg(folder.path().join("run.mcap"))
        .args(["--board", &format!("new{}", std::process::id())])
        .output()
        .unwrap();
    check(&run);
    let recorded = recording::Recording::open(&folder.path().join("run.mcap")).unwrap();
    assert!(recorded.topics().iter().any(|topic| topic.name == "speed-meter/odometry"));
}
