//! The pictures of drives say what they show.

#![allow(clippy::unwrap_used, dead_code, reason = "a test that cannot go on shall stop")]

#[path = "../examples/trajectories.rs"]
mod trajectories;

#[test]
fn a_drive_has_axes_scale_legend_and_count() {
    let folder = tempfile::tempdir().unwrap();
    let mut drive = trajectories::support::malaga();
    drive.looks.truncate(60);
    trajectories::write(folder.path(), "malaga", &drive);
    let svg = std::fs::read_to_string(folder.path().join("malaga.svg")).unwrap();
    let words = ["x [m]", "y [m]", "1 run with 500 particles", "seed 1: 60 scans", "Error: median "];
    let legend = ["walls of the map", "true way", "estimated way"];
    assert_eq!(pictures::lacks(&svg, &[&words[..], &legend].concat()), Vec::<String>::new());
}
