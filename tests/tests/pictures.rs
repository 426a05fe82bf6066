//! Pictures of runs say what they show.

#![allow(clippy::unwrap_used, dead_code, reason = "a test that cannot go on shall stop")]

#[path = "../examples/arena-runs.rs"]
mod arena_runs;

#[test]
fn a_run_in_an_arena_has_axes_scale_legend_and_count() {
    let folder = tempfile::tempdir().unwrap();
    arena_runs::write(folder.path(), 1);
    let svg = std::fs::read_to_string(folder.path().join("arena-1.svg")).unwrap();
    let words = ["x [m]", "y [m]", "The ultrasonic robot in arena 1", "1 run from", "seed 1: passed ("];
    let legend = [
        "walls",
        "where it might have been, after a scan",
        "where it knew that it was",
        "driven to tell places apart",
        "driven towards the target",
        "target",
        "start",
    ];
    assert_eq!(pictures::lacks(&svg, &[&words[..], &legend].concat()), Vec::<String>::new());
}
