//! The localiser's particles depend on its seed and on what was recorded, not on when the operating system
//! lets it run.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use serde_json::{Value, json};
use std::time::Duration;
use tests::Graph;

/// The laser scans of the recorded drive in Málaga, localised without a start.
fn drive() -> Graph {
    let graph = Graph::load("laser-log")
        .set("log-player.file", "data/malaga/log.txt.gz")
        .set("log-player.format", "steps")
        .set("log-player.timing", "auto")
        .set("log-player.scans", "all")
        .set("log-player.truth", "data/malaga/truth.txt")
        .set("log-player.period_s", 0.03)
        .set("localiser.map", "data/malaga/map-in-truth-frame.yaml")
        .set("localiser.cloud_particles", 20)
        // With every step.
        .set("localiser.cloud_period_s", 1e-6);
    graph.set("referee.max_median_m", 10.0).set("referee.max_p95_m", 100.0)
}

/// The clouds of a run, each once.
fn clouds(messages: Vec<(messages::Time, Value)>) -> Vec<Value> {
    let mut clouds: Vec<Value> = messages.into_iter().map(|(_, cloud)| cloud).collect();
    clouds.dedup();
    clouds
}

#[test]
fn live_or_in_logical_time_the_particles_are_the_same() {
    let logical = drive().lockstep(5).start();
    while !logical.has_ended() {
        logical.advance(Duration::from_secs(5));
    }
    let expected = clouds(logical.collect("location/particles"));
    assert!(expected.len() > 100 && expected.last().unwrap()["count"] != json!(0), "{}", expected.len());

    let live = drive().seed(5).start();
    let travelled = |cloud: &Value| cloud == expected.last().unwrap();
    live.wait_for("location/particles", travelled, Duration::from_secs(60));
    let found = clouds(live.collect("location/particles"));
    // Where two scans wait for the process at once, the first one's cloud is not shown.
    let mut rest = expected.iter();
    let shown = found.iter().take_while(|cloud| rest.any(|other| other == *cloud)).count();
    assert!(shown >= expected.len() * 9 / 10, "{shown} of {} clouds agree", expected.len());
    assert!(rest.next().is_none(), "all of them were looked at");
}
