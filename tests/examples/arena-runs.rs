//! Pictures of the ultrasonic robot's runs in the three arenas (NXT-100, Fig. 9), from the presets of the maps:
//! `cargo run --release -p tests --example arena-runs -- results` writes an SVG file an arena into that folder.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example says what it wrote")]

use geometry::World;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;
use tests::Graph;

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "results".into());
    std::fs::create_dir_all(&folder).unwrap();
    for arena in 1..=3 {
        let file = Path::new(&folder).join(format!("arena-{arena}.svg"));
        std::fs::write(&file, picture(arena)).unwrap();
        println!("{}", file.display());
    }
}

/// Walls black; the way that was driven blue, dotted where it was only to tell places apart; grey where the robot might have been after a
/// scan, orange where it knew that it was; the target red.
fn picture(arena: u32) -> String {
    let file = format!("{}/../launch/worlds/arena-{arena}.toml", env!("CARGO_MANIFEST_DIR"));
    let outline = World::load(file).unwrap().floors[0].outline_polygon().unwrap();
    let graph = Graph::load("nxt")
        .set("graph.defaults.world", format!("../worlds/arena-{arena}.toml"))
        .set("simulator.random_start", false)
        .set("executive.random_target", false);
    let run = graph.lockstep(1).start();
    while !run.has_ended() {
        run.advance(Duration::from_secs(5));
    }
    let (low, high) = outline.bounds();
    let margin_m = 0.1;
    let (width_m, height_m) = (high.x - low.x + 2.0 * margin_m, high.y - low.y + 2.0 * margin_m);
    let (left, top) = (low.x - margin_m, -high.y - margin_m);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='900' height='{:.0}' viewBox='{left:.3} {top:.3} {width_m:.3} {height_m:.3}'>\n\
         <rect x='{left:.3}' y='{top:.3}' width='100%' height='100%' fill='white'/>\n",
        900.0 * height_m / width_m
    );
    let corners: Vec<String> =
        outline.corners().iter().map(|at| format!("{:.3},{:.3}", at.x, -at.y)).collect();
    let _ = writeln!(
        svg,
        "<polygon points='{}' fill='#f7f7f4' stroke='black' stroke-width='0.008'/>",
        corners.join(" ")
    );
    let clouds = run.collect("location/particles");
    let mut seen: Vec<[String; 3]> = Vec::new();
    for place in clouds.iter().flat_map(|(_, cloud)| places(cloud)).filter(|place| place.1 > 0.02) {
        let ([x, y, heading], share) = place;
        let key = [x, y, heading].map(|number| format!("{number:.2}"));
        if !seen.contains(&key) {
            seen.push(key);
            let colour = if share > 0.95 { "#e08020" } else { "#999999" };
            let _ = writeln!(svg, "{}", arrow(x, y, heading, colour));
        }
    }
    let status = run.collect("journey/status");
    let is_localising = |at: messages::Time| {
        let last = status.iter().rev().find(|(time, _)| *time <= at);
        last.is_some_and(|(_, status)| status["only_localising"] == 1)
    };
    let truth = run.collect("world/truth");
    for (before, after) in truth.iter().zip(truth.iter().skip(1)) {
        let [(x1, y1), (x2, y2)] = [&before.1, &after.1].map(|at| (number(at, "x_m"), number(at, "y_m")));
        if (x1, y1) != (x2, y2) {
            let dots = if is_localising(after.0) { " opacity='0.35'" } else { "" };
            let _ = writeln!(
                svg,
                "<line x1='{x1:.4}' y1='{:.4}' x2='{x2:.4}' y2='{:.4}' stroke='#2060c0' stroke-width='0.01' stroke-linecap='round'{dots}/>",
                -y1, -y2
            );
        }
    }
    if let Some((_, status)) = status.last() {
        let (x, y) = (number(status, "target_x_m"), number(status, "target_y_m"));
        let _ = writeln!(
            svg,
            "<circle cx='{x:.3}' cy='{:.3}' r='0.018' fill='none' stroke='#c02020' stroke-width='0.006'/>",
            -y
        );
        let summary = run.collect("run/summary");
        println!("arena {arena}: {}", summary.last().map_or(&Value::Null, |(_, summary)| &summary["remark"]));
    }
    svg + "</svg>\n"
}

fn number(message: &Value, field: &str) -> f64 {
    message[field].as_f64().unwrap_or(f64::NAN)
}

/// Poses of a cloud's clusters, and their shares.
fn places(cloud: &Value) -> Vec<([f64; 3], f64)> {
    let count = cloud["cluster_count"].as_u64().unwrap_or(0) as usize;
    let clusters = cloud["clusters"].as_array().map_or(&[][..], |clusters| clusters);
    let place = |cluster: &Value| {
        (["x_m", "y_m", "heading_rad"].map(|field| number(cluster, field)), number(cluster, "share"))
    };
    clusters.iter().take(count).map(place).collect()
}

fn arrow(x: f64, y: f64, heading: f64, colour: &str) -> String {
    let (sine, cosine) = heading.sin_cos();
    format!(
        "<circle cx='{x:.3}' cy='{:.3}' r='0.012' fill='{colour}'/><line x1='{x:.3}' y1='{:.3}' x2='{:.3}' y2='{:.3}' stroke='{colour}' stroke-width='0.008'/>",
        -y,
        -y,
        x + 0.06 * cosine,
        -(y + 0.06 * sine)
    )
}
