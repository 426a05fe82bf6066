//! Pictures of the ultrasonic robot's runs in the three arenas (NXT-100, Fig. 9), from the presets of the
//! maps: `cargo run --release -p tests --example arena-runs -- results` writes an SVG file an arena into that
//! folder.
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used, reason = "an example")]

use geometry::{Point2, Pose2, World};
use messages::Time;
use pictures::colours::{BLACK, BLUE, GREEN, GREY, ORANGE, VERMILLION};
use pictures::{Glyph, Layer, Plan, Sheet};
use recording::{Message, Recording};
use serde_json::Value;
use std::path::Path;
use tests::Graph;

const SEED: u64 = 1;
/// Ground shown around an arena.
const MARGIN_M: f64 = 0.1;
/// A cluster with less of the weight is not drawn.
const SHARE_LEAST: f64 = 0.02;
/// With so much of the weight the robot takes the place for its own.
const SHARE_CERTAIN: f64 = 0.95;

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "results".into());
    for arena in 1..=3 {
        write(Path::new(&folder), arena);
    }
}

/// Runs the robot in this arena, and writes the picture of its run into the folder.
pub(crate) fn write(folder: &Path, arena: u32) {
    std::fs::create_dir_all(folder).unwrap();
    let file = folder.join(format!("arena-{arena}.svg"));
    std::fs::write(&file, sheet(arena).svg().unwrap()).unwrap();
    println!("{}", file.display());
}

/// All that was said in a run, as far as it is drawn.
struct Run {
    clouds: Vec<(Time, Value)>,
    truth: Vec<(Time, Value)>,
    status: Vec<(Time, Value)>,
    verdict: String,
}

fn run(arena: u32) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let graph = Graph::load("nxt")
        .set("graph.defaults.world", format!("../worlds/arena-{arena}.toml"))
        .set("simulator.random_start", false)
        .set("executive.random_target", false)
        .seed(SEED)
        .with(&["--record", file.to_str().unwrap()]);
    eprintln!("arena {arena}: the robot is on its way ..");
    let end = graph.run_in_lockstep();
    let word = if end["run"]["passed"] == true { "passed" } else { "did not pass" };
    let verdict = format!("{word} ({})", end["run"]["remark"].as_str().unwrap_or("no remark"));
    eprintln!("arena {arena}: {verdict}, after {:.1} s of logical time", number(&end, "logical_s"));
    let recording = Recording::open(&file).unwrap();
    let collect = |topic: &str| said(&recording, topic);
    Run {
        clouds: collect("location/particles"),
        truth: collect("world/truth"),
        status: collect("journey/status"),
        verdict,
    }
}

/// Everything that was said on a topic, and when.
fn said(recording: &Recording, topic: &str) -> Vec<(Time, Value)> {
    let (_, described) = recording.manifest().topic(topic).unwrap();
    let messages = recording.as_recorded(|other| other.name == topic).map(Result::unwrap);
    let json = |message: Message| {
        (Time::from_nanos(message.envelope.stamp_ns), described.message.to_json(message.bytes()))
    };
    messages.map(json).collect()
}

fn sheet(arena: u32) -> Sheet {
    let file = format!("{}/../launch/worlds/arena-{arena}.toml", env!("CARGO_MANIFEST_DIR"));
    let outline = World::load(file).unwrap().floors[0].outline_polygon().unwrap();
    let run = run(arena);
    let (low, high) = outline.bounds();
    let mut corners = outline.corners().to_vec();
    corners.extend(corners.first().copied());
    let [driving, localising] = ways(&run);
    let (certain, possible): (Vec<_>, Vec<_>) =
        places(&run.clouds).into_iter().partition(|(_, share)| *share > SHARE_CERTAIN);
    let poses = |places: Vec<(Pose2, f64)>| places.into_iter().map(|(pose, _)| pose).collect();
    let target = run.status.last().map(|(_, status)| point(status, "target_x_m", "target_y_m"));
    let start = run.truth.first().map(|(_, truth)| (point(truth, "x_m", "y_m"), "start".to_owned()));
    let margin = geometry::Vector2::new(MARGIN_M, MARGIN_M);
    let plan = Plan::new("", low - margin, high + margin, [760.0, 760.0])
        .with(Layer::lines("walls", BLACK, 2.5, vec![corners]))
        .with(Layer::poses("where it might have been, after a scan", GREY, 16.0, poses(possible)))
        .with(Layer::lines("driven to tell places apart", GREEN, 3.0, localising))
        .with(Layer::lines("driven towards the target", BLUE, 3.0, driving))
        .with(Layer::poses("where it knew that it was", ORANGE, 16.0, poses(certain)))
        .with(Layer::places("target", VERMILLION, Glyph::Ring(8.0), target.into_iter().collect()))
        .with(Layer::names(start.into_iter().collect()));
    let words = format!("1 run from the map's preset start to its target, seed {SEED}: {}.", run.verdict);
    Sheet::new(&format!("The ultrasonic robot in arena {arena}"), &words).with(plan)
}

/// The ways that were driven towards the target, and those that were driven only to tell places apart.
fn ways(run: &Run) -> [Vec<Vec<Point2<f64>>>; 2] {
    let is_localising = |at: Time| {
        let last = run.status.iter().rev().find(|(time, _)| *time <= at);
        last.is_some_and(|(_, status)| status["only_localising"] == 1)
    };
    let mut ways: [Vec<Vec<Point2<f64>>>; 2] = Default::default();
    let mut last: Option<(Point2<f64>, usize)> = None;
    for (at, truth) in &run.truth {
        let (place, kind) = (point(truth, "x_m", "y_m"), usize::from(is_localising(*at)));
        match last {
            Some((before, _)) if before == place => continue,
            Some((before, known)) if known != kind => ways[kind].push(vec![before, place]),
            Some(_) => ways[kind].last_mut().unwrap().push(place),
            None => ways[kind].push(vec![place]),
        }
        last = Some((place, kind));
    }
    ways
}

/// Poses of all clusters that were ever weighty enough, and their shares; each place once.
fn places(clouds: &[(Time, Value)]) -> Vec<(Pose2, f64)> {
    let clusters = clouds.iter().flat_map(|(_, cloud)| {
        let count = cloud["cluster_count"].as_u64().unwrap_or(0) as usize;
        cloud["clusters"].as_array().into_iter().flatten().take(count)
    });
    let mut places: Vec<(Pose2, f64)> = Vec::new();
    for cluster in clusters {
        let [x_m, y_m, heading_rad, share] =
            ["x_m", "y_m", "heading_rad", "share"].map(|field| number(cluster, field));
        let pose = Pose2 { x_m, y_m, heading_rad };
        let is_known = |(known, _): &(Pose2, f64)| {
            known.distance_m(pose) < 0.01 && (known.heading_rad - heading_rad).abs() < 0.01
        };
        if share > SHARE_LEAST && !places.iter().any(is_known) {
            places.push((pose, share));
        }
    }
    places
}

fn point(message: &Value, x: &str, y: &str) -> Point2<f64> {
    Point2::new(number(message, x), number(message, y))
}

fn number(message: &Value, field: &str) -> f64 {
    message[field].as_f64().unwrap_or(f64::NAN)
}
