//! The files of users through the whole product: looked at before a start, and not lost at the end.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;
use tests::{Graph, build, launcher};

/// A drive straight on between two walls.
fn drive() -> String {
    let mut log = String::new();
    for number in 0..200 {
        let (x_m, at_s) = (0.02 * f64::from(number), 0.02 * f64::from(number));
        let _ = writeln!(log, "ODOM {x_m} 0 0 0.1 0 0 {at_s} h {at_s}");
        let _ = writeln!(log, "FLASER 181{} {x_m} 0 0 {x_m} 0 0 {at_s} h {at_s}", " 2.00".repeat(181));
    }
    log
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// A picture of which only the head is whole: of 3000 by 2000 pixels, with a cell for each.
fn head_of_a_map(folder: &Path) -> String {
    let header = b"\x00\x00\x0b\xb8\x00\x00\x07\xd0\x08\x00\x00\x00\x00\x77\x79\x4d\xe6";
    let mut png = b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR".to_vec();
    png.extend(header);
    png.extend(b"\x00\x00\x00\x05IDATxxxxx\x00\x00\x00\x00");
    std::fs::write(folder.join("map.png"), png).unwrap();
    let yaml = folder.join("map.yaml");
    std::fs::write(&yaml, "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\nnegate: 0\n").unwrap();
    text(&yaml)
}

fn interface(service: &str, params: &serde_json::Value) -> Output {
    let mut command = Command::new(build().join(service));
    command.args(["--interface", "--params", &params.to_string()]).output().unwrap()
}

#[track_caller]
fn says(output: &Output, code: i32, words: &str) {
    let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(said.contains(words), "{said}");
}

#[test]
fn a_service_says_what_it_is_without_reading_its_data() {
    let folder = tempfile::tempdir().unwrap();
    let map = head_of_a_map(folder.path());
    let log = folder.path().join("drive.log.gz");
    std::fs::write(&log, "no gzip").unwrap();
    let missing = text(&folder.path().join("missing"));
    for (service, key, file) in [
        ("grid-planner", "map", &map),
        ("particle-localiser", "map", &map),
        ("mapper", "load", &map),
        ("log-player", "file", &text(&log)),
    ] {
        says(&interface(service, &serde_json::json!({ key: file })), 0, "\"ports\"");
        // What is not there is missed at once.
        let output = interface(service, &serde_json::json!({ key: missing }));
        assert!(!output.status.success());
        assert!(String::from_utf8_lossy(&output.stderr).contains(&missing), "{output:?}");
    }
}

#[test]
fn a_map_that_cannot_be_saved_any_more_fails_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (log, maps) = (folder.path().join("drive.log"), folder.path().join("maps"));
    std::fs::write(&log, drive()).unwrap();
    std::fs::create_dir(&maps).unwrap();
    let run = |lose: bool| {
        let run = Graph::load("laser-map")
            .set("log-player.file", text(&log))
            .set("mapper.save", text(&maps.join("map.yaml")))
            .lockstep(1)
            .start();
        run.advance(Duration::from_millis(500));
        if lose {
            std::fs::remove_dir_all(&maps).unwrap();
        }
        while !run.has_ended() {
            run.advance(Duration::from_secs(1));
        }
        let code = run.wait_for_end(Duration::from_secs(60)).code();
        (code, run.output())
    };
    let (code, output) = run(false);
    assert_eq!(code, Some(0), "{output}");
    assert!(geometry::OccupancyGrid::load(maps.join("map.yaml")).is_ok());
    let (code, output) = run(true);
    assert_eq!(code, Some(1), "{output}");
    assert!(output.contains("the map is not saved"), "{output}");
}

#[test]
fn graphs_are_included_by_name_or_from_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    let check = |include: &str| {
        let graph = folder.path().join("mine.toml");
        let text =
            format!("[graph]\nname = \"mine\"\ninclude = [{include:?}]\n\n[navigator]\nperiod_ms = 200\n");
        std::fs::write(&graph, text).unwrap();
        Command::new(launcher()).args(["check", "--no-build"]).arg(&graph).output().unwrap()
    };
    says(&check("coffee"), 0, "mine");
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../launch/graphs");
    says(&check(&text(&graphs.canonicalize().unwrap().join("coffee.toml"))), 0, "mine");
    says(&check("coffe"), 1, "coffee");
}
