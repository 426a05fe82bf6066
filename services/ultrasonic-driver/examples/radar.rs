//! Draws the radar charts of Fig. 4 (NXT-036): `cargo run -p ultrasonic-driver --example radar -- OUT_DIR`.
//!
//! For scans at (20, 85) with heading 0 and at (86, 85) in the first arena: where the rays meet the walls (a, c), and simulated ideal
//! readings against those with all errors (b, d), with the four windows that are kept.
#![allow(clippy::print_stdout, reason = "an example says what it wrote")]

use geometry::{Point2, Pose2, World};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;
use ultrasonic_driver::{NoiseProfile, Params, Reading, SimulatedSonar};

const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/worlds/arena-1.toml");
/// Half of a window (NXT-041).
const WINDOW_DEG: i32 = 15;
const REACH_M: f64 = 1.15;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: radar OUT_DIR")?;
    std::fs::create_dir_all(&folder)?;
    let world = World::load(WORLD)?;
    for (name, x_m, y_m) in [("radar-20-85", 0.20, 0.85), ("radar-86-85", 0.86, 0.85)] {
        let file = Path::new(&folder).join(format!("{name}.svg"));
        draw(&file, &world, Pose2::new(x_m, y_m, 0.0))?;
        println!("{}", file.display());
    }
    Ok(())
}

/// Where a reading lies, seen from the sensor.
fn polar(degree: i32, range_m: f64) -> (f64, f64) {
    let (sine, cosine) = f64::from(degree).to_radians().sin_cos();
    (range_m * cosine, range_m * sine)
}

fn scan(world: &World, pose: Pose2, params: Params) -> Vec<(f64, f64)> {
    let mut sonar = SimulatedSonar::in_world(params, world, 4);
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

fn draw(file: &Path, world: &World, pose: Pose2) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (1000, 540)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(500);
    let title = format!("scan at ({:.0}, {:.0})", 100.0 * pose.x_m, 100.0 * pose.y_m);

    let mut map = ChartBuilder::on(&left)
        .caption(format!("{title}: where rays meet walls"), ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(30)
        .y_label_area_size(40)
        .build_cartesian_2d(-0.1..1.2, -0.1..1.2)?;
    map.configure_mesh().light_line_style(TRANSPARENT).x_desc("x [m]").y_desc("y [m]").draw()?;
    let walls = world.wall_segments(0);
    map.draw_series(
        walls
            .iter()
            .map(|wall| PathElement::new([(wall.a.x, wall.a.y), (wall.b.x, wall.b.y)], RED.stroke_width(2))),
    )?;
    let lines = geometry::Walls::new(walls);
    let hits = (0..360).step_by(3).filter_map(|degree| {
        let hit = lines.cast(pose.position(), f64::from(degree).to_radians(), 10.0)?;
        let (ahead_m, aside_m) = polar(degree, hit.range_m);
        let end = pose.transform(Point2::new(ahead_m, aside_m));
        Some(Circle::new((end.x, end.y), 3, RGBColor(220, 170, 0).filled()))
    });
    map.draw_series(hits)?;
    map.draw_series([Circle::new((pose.x_m, pose.y_m), 5, BLACK.filled())])?;

    let mut radar = ChartBuilder::on(&right)
        .caption(format!("{title}: ideal (red), with errors (blue)"), ("sans-serif", 18))
        .margin(12)
        .build_cartesian_2d(-1.2..1.2, -1.2..1.2)?;
    for ring in 1..=4 {
        let circle = (0..=90).map(|step| polar(4 * step, 0.25 * f64::from(ring)));
        radar.draw_series([PathElement::new(circle.collect::<Vec<_>>(), RGBColor(210, 210, 210))])?;
        radar.draw_series([Text::new(
            format!("{} cm", 25 * ring),
            (0.01, 0.25 * f64::from(ring) + 0.02),
            ("sans-serif", 11).into_font().color(&RGBColor(120, 120, 120)),
        )])?;
    }
    for quarter in 0..4 {
        let arc = (-WINDOW_DEG..=WINDOW_DEG).map(|aside| polar(90 * quarter + aside, REACH_M));
        let side = |degree: i32| (0..=30).map(move |step| polar(degree, REACH_M * f64::from(step) / 30.0));
        let (right, left) = (side(90 * quarter - WINDOW_DEG), side(90 * quarter + WINDOW_DEG));
        for line in [arc.collect::<Vec<_>>(), right.collect(), left.collect()] {
            // Dotted: every other piece.
            radar.draw_series(
                line.windows(2).step_by(2).map(|piece| PathElement::new(piece.to_vec(), BLACK)),
            )?;
        }
    }
    let ideal = Params { noise: NoiseProfile::None, half_cone_deg: 0.0, ..Params::default() };
    radar.draw_series([PathElement::new(scan(world, pose, Params::default()), BLUE.stroke_width(1))])?;
    radar.draw_series([PathElement::new(scan(world, pose, ideal), RED.stroke_width(2))])?;
    area.present()?;
    Ok(())
}
