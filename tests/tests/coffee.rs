//! Coffee is delivered: by all processes, in logical time.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::Value;
use tests::Graph;

#[track_caller]
fn check_delivery(room: &str, seed: u64) {
    let run = Graph::load("coffee").set("navigator.default_order", room).seed(seed).run_in_lockstep();
    let figures = &run["run"]["figures"];
    assert_eq!(run["run"]["passed"], true, "room {room}, seed {seed}: {run:#}");
    assert_eq!(figures["contacts"], 0.0, "room {room}, seed {seed}: {run:#}");
    let halt_m = figures["halt distance from door centre [m]"].as_f64().unwrap();
    assert!(halt_m <= 0.10, "room {room}, seed {seed}: {run:#}");
}

#[test]
fn ten_rooms_and_seeds() {
    for (room, seed) in [
        ("201", 101),
        ("202", 102),
        ("203", 103),
        ("204", 104),
        ("206", 105),
        ("208", 106),
        ("210", 107),
        ("213", 108),
        ("302", 109),
        ("309", 110),
    ] {
        check_delivery(room, seed);
    }
}

fn digest(run: &Value) -> &str {
    run["digest"]["digest"].as_str().unwrap()
}

#[test]
fn one_seed_is_one_digest_and_another_seed_another() {
    let graph = Graph::load("coffee").with(&["--until", "20"]);
    let first = graph.clone().seed(7).run_in_lockstep();
    assert!(first["digest"]["messages"].as_u64().unwrap() > 5000, "{first:#}");
    let again = graph.clone().seed(7).run_in_lockstep();
    assert_eq!(digest(&first), digest(&again));
    let first_processor = graph.clone().seed(7).with(&["--cpu", "0"]).run_in_lockstep();
    assert_eq!(digest(&first), digest(&first_processor));
    let other = graph.seed(8).run_in_lockstep();
    assert_ne!(digest(&first), digest(&other));
}

#[test]
fn a_recording_has_the_digest_of_its_run_and_a_difference_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let record = |name: &str, set: Option<(&str, f64)>| {
        let file = folder.path().join(name);
        let mut graph = Graph::load("coffee").with(&["--until", "10", "--record", file.to_str().unwrap()]);
        if let Some((parameter, value)) = set {
            graph = graph.set(parameter, value);
        }
        (graph.run_in_lockstep(), file)
    };
    let (run, a) = record("a.mcap", None);
    let printed = std::process::Command::new(tests::launcher()).arg("digest").arg(&a).output().unwrap();
    assert!(String::from_utf8_lossy(&printed.stdout).starts_with(digest(&run)), "{printed:?}");
    let (_, same) = record("same.mcap", None);
    let diff = |other| {
        std::process::Command::new(tests::launcher()).arg("diff").arg(&a).arg(other).output().unwrap()
    };
    assert!(diff(&same).status.success());
    let (_, other) = record("other.mcap", Some(("tag-driver.sigma_m", 0.2)));
    let printed = diff(&other);
    let words = String::from_utf8_lossy(&printed.stdout).into_owned();
    assert_eq!(printed.status.code(), Some(1));
    assert!(words.starts_with("`tag/ranges` at "), "{words}");
}

#[test]
fn the_log_of_a_real_robot() {
    let run = Graph::load("malaga").run_in_lockstep();
    let figures = &run["run"]["figures"];
    assert_eq!(run["run"]["passed"], true, "{run:#}");
    assert!(figures["error, median [m]"].as_f64().unwrap() <= 0.25, "{run:#}");
    assert!(figures["error, 95 % [m]"].as_f64().unwrap() <= 0.8, "{run:#}");
    assert!(figures["ranges rejected"].as_f64().unwrap() > 50.0, "{run:#}");
}
