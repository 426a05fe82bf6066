//! Pictures of recorded drives, true and estimated, on their maps: `cargo run --release -p particle-localiser --example trajectories --
//! results` writes an SVG file a log into that folder. Logs that are not in `../shared/data` are skipped.
#![allow(clippy::unwrap_used, reason = "an example")]

#[path = "../tests/support/mod.rs"]
mod support;

use geometry::{Point2, Pose2};
use std::fmt::Write as _;
use support::{Drive, load, malaga, track};

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "results".into());
    std::fs::create_dir_all(&folder).unwrap();
    let names = ["intel", "freiburg-079", "csail", "belgioioso"];
    let logs = names.into_iter().filter_map(|name| Some((name, load(name)?)));
    for (name, drive) in logs.chain([("malaga", malaga())]) {
        let file = format!("{folder}/{name}.svg");
        std::fs::write(&file, picture(name, &drive)).unwrap();
        println!("{file}");
    }
}

/// Walls grey, the truth wide and blue, the estimates thin and orange.
fn picture(name: &str, drive: &Drive) -> String {
    let run = track(drive, 1, f64::INFINITY);
    let truth: Vec<Pose2> = drive.looks.iter().map(|look| look.truth).collect();
    let margin_m = 4.0;
    let least = |axis: fn(&Pose2) -> f64| truth.iter().map(axis).fold(f64::MAX, f64::min) - margin_m;
    let most = |axis: fn(&Pose2) -> f64| truth.iter().map(axis).fold(f64::MIN, f64::max) + margin_m;
    let (left, right, low, high) =
        (least(|pose| pose.x_m), most(|pose| pose.x_m), least(|pose| pose.y_m), most(|pose| pose.y_m));
    let (error_m, error_deg) = run.quantile(0.5);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='900' height='{:.0}' viewBox='{left:.2} {:.2} {:.2} {:.2}'>\n\
         <rect x='{left:.2}' y='{:.2}' width='100%' height='100%' fill='white'/>\n",
        900.0 * (high - low + 2.0) / (right - left),
        -high - 2.0,
        right - left,
        high - low + 2.0,
        -high - 2.0,
    );
    svg += "<path stroke='#888' stroke-width='0.06' fill='none' d='";
    let frame = drive.grid.frame();
    for cell in frame.cells() {
        let middle = frame.centre(cell);
        let is_shown = middle.x > left && middle.x < right && middle.y > low && middle.y < high;
        if is_shown && drive.grid.get(cell).is_some_and(|cell| cell.is_occupied(65)) {
            let _ = write!(svg, "M{:.2} {:.2}h.05", middle.x - 0.025, -middle.y);
        }
    }
    svg += "'/>\n";
    svg += &line("#3b82c4", 0.16, truth.iter().map(|pose| pose.position()));
    svg += &line("#e8590c", 0.05, run.estimates.iter().map(|pose| pose.position()));
    let _ = writeln!(
        svg,
        "<text x='{:.2}' y='{:.2}' font-size='{:.2}' font-family='sans-serif'>{name}: truth blue, estimate orange; median {error_m:.3} m, \
         {error_deg:.2}\u{b0}</text>\n</svg>",
        left + 0.3,
        -high - 0.6,
        (right - left) / 36.0,
    );
    svg
}

fn line(colour: &str, width_m: f64, points: impl Iterator<Item = Point2<f64>>) -> String {
    let points: Vec<String> = points.map(|point| format!("{:.3},{:.3}", point.x, -point.y)).collect();
    format!(
        "<polyline fill='none' stroke='{colour}' stroke-width='{width_m}' stroke-linejoin='round' points='{}'/>\n",
        points.join(" ")
    )
}
