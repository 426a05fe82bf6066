//! The radar charts say what they show.

#![allow(clippy::unwrap_used, dead_code, reason = "a test that cannot go on shall stop")]

#[path = "../examples/radar.rs"]
mod radar;

#[test]
fn charts_have_axes_scale_legend_and_count() {
    let folder = tempfile::tempdir().unwrap();
    radar::write(folder.path()).unwrap();
    let words =
        ["x [m]", "y [m]", "ahead [m]", "to the left [m]", "1 scan of 361 readings", "seed 4", "walls"];
    let legend =
        ["where a ray meets a wall", "windows that are kept", "with all errors", "ideal", "the sensor"];
    for name in ["radar-20-85.svg", "radar-86-85.svg"] {
        let svg = std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert_eq!(pictures::lacks(&svg, &[&words[..], &legend].concat()), Vec::<String>::new(), "{name}");
    }
}
