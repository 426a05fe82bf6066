//! Draws the radar charts of Fig. 4 (NXT-036):
//!
//! `cargo run --release -p ultrasonic-driver --example radar -- OUT_DIR`.
//!
//! For scans at (0.20 m, 0.85 m) with heading 0 and at (0.86 m, 0.85 m) in the first arena: where the rays
//! meet the walls (a, c), and simulated ideal readings against those with all errors (b, d), with the four
//! windows that are kept.
#![allow(clippy::print_stdout, reason = "an example says what it wrote")]

use geometry::{Point2, Pose2, World};
use pictures::colours::{BLACK, BLUE, GREY, ORANGE, VERMILLION};
use pictures::{Glyph, Layer, Plan, Sheet};
use std::error::Error;
use std::path::Path;
use ultrasonic_driver::{NoiseProfile, Params, Reading, SimulatedSonar};

const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/worlds/arena-1.toml");
/// Half of a window (NXT-041).
const WINDOW_DEG: i32 = 15;
const REACH_M: f64 = 1.15;
const SEED: u64 = 4;
const SIDE_PX: f64 = 430.0;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: radar OUT_DIR")?;
    write(Path::new(&folder))
}

/// Writes a picture a pose into this folder.
pub(crate) fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let world = World::load(WORLD)?;
    for (name, x_m, y_m) in [("radar-20-85", 0.20, 0.85), ("radar-86-85", 0.86, 0.85)] {
        let file = folder.join(format!("{name}.svg"));
        std::fs::write(&file, sheet(&world, Pose2::new(x_m, y_m, 0.0)).svg()?)?;
        println!("{}", file.display());
    }
    Ok(())
}

/// Where a reading lies, seen from the sensor: ahead and to the left.
fn polar(degree: i32, range_m: f64) -> Point2<f64> {
    let (sine, cosine) = f64::from(degree).to_radians().sin_cos();
    Point2::new(range_m * cosine, range_m * sine)
}

fn scan(world: &World, pose: Pose2, params: Params) -> Vec<Point2<f64>> {
    let mut sonar = SimulatedSonar::in_world(params, world, SEED);
    let reading = |degree: i32| {
        let direction = Pose2::new(0.0, 0.0, f64::from(degree).to_radians());
        match sonar.measure(0, pose.compose(direction)) {
            Reading::Echo { range_m } => polar(degree, range_m.min(REACH_M)),
            Reading::Nothing => polar(degree, REACH_M),
            Reading::TooNear => polar(degree, 0.0),
        }
    };
    (0..=360).map(reading).collect()
}

/// The arena at the left, what the sensor hears at the right.
fn sheet(world: &World, pose: Pose2) -> Sheet {
    let title = format!("A sonar scan at x {:.2} m, y {:.2} m, heading 0", pose.x_m, pose.y_m);
    let words = format!(
        "1 scan of 361 readings, a degree apart, from the first arena; errors with seed {SEED} (NXT-036). No echo counts as \
         {REACH_M} m. Of a scan only the readings in the four windows are kept (NXT-041)."
    );
    Sheet::new(&title, &words).with(arena(world, pose)).with(radar(world, pose))
}

fn arena(world: &World, pose: Pose2) -> Plan {
    let walls = world.wall_segments(0);
    let lines = walls.iter().map(|wall| vec![wall.a, wall.b]).collect();
    let cast = geometry::Walls::new(walls);
    let hits = (0..360).step_by(3).filter_map(|degree| {
        let hit = cast.cast(pose.position(), f64::from(degree).to_radians(), 10.0)?;
        Some(pose.transform(polar(degree, hit.range_m)))
    });
    Plan::new("Where rays meet walls", Point2::new(-0.1, -0.1), Point2::new(1.2, 1.2), [SIDE_PX, SIDE_PX])
        .with(Layer::lines("walls", BLACK, 2.0, lines))
        .with(Layer::places(
            "where a ray meets a wall, 3 degrees apart",
            ORANGE,
            Glyph::Dot(3.0),
            hits.collect(),
        ))
        .with(Layer::poses("the sensor and its heading", BLUE, 18.0, vec![pose]))
}

fn radar(world: &World, pose: Pose2) -> Plan {
    let ring = |range_m: f64| (0..=90).map(|step| polar(4 * step, range_m)).collect::<Vec<_>>();
    let rings = [0.25, 0.5, 0.75, 1.0].map(ring).to_vec();
    let windows = (0..4).flat_map(|quarter| {
        let arc = (-WINDOW_DEG..=WINDOW_DEG).map(|aside| polar(90 * quarter + aside, REACH_M));
        let side = |degree: i32| (0..=30).map(move |step| polar(degree, REACH_M * f64::from(step) / 30.0));
        let (right, left) = (side(90 * quarter - WINDOW_DEG), side(90 * quarter + WINDOW_DEG));
        [arc.collect::<Vec<_>>(), right.collect(), left.collect()]
    });
    let ideal = Params { noise: NoiseProfile::None, half_cone_deg: 0.0, ..Params::default() };
    Plan::new("What the sensor hears", Point2::new(-1.2, -1.2), Point2::new(1.2, 1.2), [SIDE_PX, SIDE_PX])
        .with_axes("ahead", "to the left")
        .with(Layer::lines("0.25, 0.5, 0.75 and 1 m away", GREY, 1.0, rings).covering(0.45))
        .with(Layer::dashed("windows that are kept", BLACK, 1.0, windows.collect()))
        .with(Layer::lines("with all errors", BLUE, 1.5, vec![scan(world, pose, Params::default())]))
        .with(Layer::lines("ideal: a ray without errors", VERMILLION, 2.0, vec![scan(world, pose, ideal)]))
}
