//! Pictures of recorded drives, true and estimated, on their maps:
//!
//! `cargo run --release -p particle-localiser --example trajectories -- results`
//!
//! writes an SVG file a log into that folder. Logs that are not in `../shared/data` are skipped.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, reason = "an example")]

#[path = "../tests/support/mod.rs"]
pub(crate) mod support;

use geometry::{Cell, Point2, Pose2};
use pictures::colours::{BLUE, GREY, VERMILLION};
use pictures::{Layer, Plan, Sheet};
use std::path::Path;
use support::{Drive, load, malaga, track};

const SEED: u64 = 1;
/// Ground shown around the drive.
const MARGIN_M: f64 = 4.0;

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "results".into());
    let names = ["intel", "freiburg-079", "csail", "belgioioso"];
    let logs = names.into_iter().filter_map(|name| Some((name, load(name)?)));
    for (name, drive) in logs.chain([("malaga", malaga())]) {
        write(Path::new(&folder), name, &drive);
    }
}

/// Follows a drive and writes its picture into this folder.
pub(crate) fn write(folder: &Path, name: &str, drive: &Drive) {
    std::fs::create_dir_all(folder).unwrap();
    let file = folder.join(format!("{name}.svg"));
    eprintln!("following {name}: {} scans ..", drive.looks.len());
    std::fs::write(&file, sheet(name, drive).svg().unwrap()).unwrap();
    println!("{}", file.display());
}

fn sheet(name: &str, drive: &Drive) -> Sheet {
    let run = track(drive, SEED, f64::INFINITY);
    let truth: Vec<Pose2> = drive.looks.iter().map(|look| look.truth).collect();
    let (median_m, median_deg) = run.quantile(0.5);
    let (most_m, most_deg) = run.quantile(1.0);
    let words = format!(
        "1 run with 500 particles from the first true pose on, seed {SEED}: {} scans over {:.0} m. Error: median {median_m:.3} m and \
         {median_deg:.2} deg, largest {most_m:.2} m and {most_deg:.1} deg.",
        run.errors.len(),
        run.path_m.last().copied().unwrap_or(0.0),
    );
    let axis = |of: fn(&Pose2) -> f64| {
        let values = truth.iter().map(of);
        let (least, most) = (values.clone().fold(f64::MAX, f64::min), values.fold(f64::MIN, f64::max));
        (least - MARGIN_M, most + MARGIN_M)
    };
    let ((left, right), (low, high)) = (axis(|pose| pose.x_m), axis(|pose| pose.y_m));
    let plan = Plan::new("", Point2::new(left, low), Point2::new(right, high), [860.0, 860.0]);
    let frame = drive.grid.frame();
    let is_wall = |cell: &Cell| drive.grid.get(*cell).is_some_and(|cell| cell.is_occupied(65));
    let walls = frame.cells().filter(is_wall).map(|cell| frame.centre(cell));
    let walls: Vec<Point2<f64>> = walls.filter(|&middle| plan.shows(middle)).collect();
    let line = |poses: &[Pose2]| vec![poses.iter().map(|pose| pose.position()).collect()];
    let plan = plan
        .with(Layer::squares("walls of the map", GREY, frame.resolution_m(), walls))
        .with(Layer::lines("true way", BLUE, 4.5, line(&truth)).covering(0.6))
        .with(Layer::lines("estimated way", VERMILLION, 1.5, line(&run.estimates)));
    Sheet::new(&format!("{name}: a recorded drive, true and estimated"), &words).with(plan)
}
