//! The figures say what they show.

#![allow(clippy::unwrap_used, dead_code, reason = "a test that cannot go on shall stop")]

#[path = "../examples/figures/main.rs"]
mod figures;

#[track_caller]
fn check(folder: &std::path::Path, name: &str, words: &[&str]) {
    let svg = std::fs::read_to_string(folder.join(name)).unwrap();
    let axes = ["x [m]", "y [m]", "0.2 m", "walls", "where the robot's middle may be"];
    assert_eq!(pictures::lacks(&svg, &[&axes, words].concat()), Vec::<String>::new(), "{name}");
}

#[test]
fn figures_have_axes_scale_legend_and_count() {
    let folder = tempfile::tempdir().unwrap();
    figures::write(folder.path()).unwrap();
    check(
        folder.path(),
        "fig5.svg",
        &["1 plan, seed 5", "random waypoints", "the path: ", "start", "target"],
    );
    check(
        folder.path(),
        "fig6.svg",
        &[
            "1 plan each",
            "seed 3",
            "stars, 0.1 m apart",
            "other open ways by one waypoint",
            "A* from star to star: ",
            "random waypoints: ",
        ],
    );
}
