//! The ultrasonic robot finds its way: by all processes, in logical time.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::Value;
use tests::Graph;

fn run(arena: u32, seed: u64) -> Value {
    let world = format!("../worlds/arena-{arena}.toml");
    Graph::load("nxt").set("graph.defaults.world", world).seed(seed).run_in_lockstep()
}

fn figure(run: &Value, name: &str) -> f64 {
    run["run"]["figures"][name].as_f64().unwrap_or_else(|| panic!("no figure {name}: {run:#}"))
}

#[track_caller]
fn check_journey(arena: u32, seed: u64) {
    let run = run(arena, seed);
    assert_eq!(run["run"]["passed"], true, "arena {arena}, seed {seed}: {run:#}");
    assert_eq!(figure(&run, "contacts"), 0.0);
    assert!(figure(&run, "distance from target [cm]") <= 3.0);
    assert!(figure(&run, "least clearance [cm]") > 0.0);
}

#[test]
fn random_pairs_in_three_arenas() {
    for (arena, seed) in [(1, 201), (1, 202), (2, 203), (2, 204), (3, 205), (3, 206)] {
        check_journey(arena, seed);
    }
}

#[test]
fn the_third_arena_is_seen_to_repeat_itself_and_is_resolved_by_moving() {
    let graph = Graph::load("nxt").set("graph.defaults.world", "../worlds/arena-3.toml");
    let run = graph
        .set("simulator.random_start", false)
        .set("executive.random_target", false)
        .seed(1)
        .run_in_lockstep();
    assert_eq!(run["run"]["passed"], true, "{run:#}");
    assert!(figure(&run, "ambiguous scans") >= 1.0, "{run:#}");
    assert_eq!(figure(&run, "wrong locations"), 0.0, "{run:#}");
    // What it drives to tell the pockets apart is counted apart.
    assert!(figure(&run, "path length [cm]") > figure(&run, "path without localising [cm]") + 5.0, "{run:#}");
}

#[test]
fn errors_as_in_botsim() {
    let graph = Graph::load("nxt").set("ultrasonic-driver.noise", "botsim");
    let graph =
        graph.set("simulator.motion_errors", "proportional").set("localiser.cone_half_width_rad", 0.0);
    let run = graph.seed(3).run_in_lockstep();
    assert_eq!(run["run"]["passed"], true, "{run:#}");
}

#[test]
fn one_seed_is_one_digest() {
    let digest = |seed| {
        let run = Graph::load("nxt").seed(seed).run_in_lockstep();
        run["digest"]["digest"].as_str().unwrap().to_owned()
    };
    let first = digest(11);
    assert_eq!(first, digest(11));
    assert_ne!(first, digest(12));
}
