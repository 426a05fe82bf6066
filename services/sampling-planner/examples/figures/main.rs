//! The figures of the paper's planner, as SVG:
//!
//! `cargo run --release -p sampling-planner --example figures -- OUT_DIR`.
//!
//! `fig5.svg`: the arena shrunk by half the robot, thirty waypoints, and the one that was chosen (NXT-077).
//! `fig6.svg`: random waypoints against A* from star to star, with what else was to be had of one waypoint
//! (NXT-078).
#![allow(clippy::print_stdout, reason = "an example says what it wrote")]

mod lattice;

use geometry::{Point2, World};
use messages::PlanStateName;
use pictures::colours::{BLACK, BLUE, GREEN, GREY, PALE, VERMILLION};
use pictures::{Glyph, Layer, Plan, Sheet};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use sampling_planner::{Params, Question, Router, SamplingPlanner, View, length_m};
use std::path::Path;

const ARENA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/default.toml");
/// Between stars, in metres.
const SPACING_M: f64 = 0.10;
/// Alternatives drawn.
const ALTERNATIVES: usize = 4;
/// Waypoints of a plan.
const SAMPLES: u32 = 30;
/// Side of the squares by which the configuration space is filled, in metres.
const SQUARE_M: f64 = 0.005;

type Trouble = Box<dyn std::error::Error>;

fn main() -> Result<(), Trouble> {
    let folder = std::env::args().nth(1).ok_or("name the folder for the figures: -- OUT_DIR")?;
    write(Path::new(&folder))
}

/// Writes both figures into this folder.
pub(crate) fn write(folder: &Path) -> Result<(), Trouble> {
    std::fs::create_dir_all(folder)?;
    let world = World::load(ARENA)?;
    let planner = SamplingPlanner::in_world(Params::default(), &world, 1)?;
    let view = View::new(planner.space(1).ok_or("the arena has a floor 1")?, &[], 0.0);
    for (name, sheet) in [("fig5.svg", figure_5(&view)?), ("fig6.svg", figure_6(&view)?)] {
        let file = folder.join(name);
        std::fs::write(&file, sheet.svg()?)?;
        println!("{}", file.display());
    }
    Ok(())
}

/// A plan with thirty samples.
fn plan(view: &View<'_>, start: Point2<f64>, goal: Point2<f64>, seed: u64) -> Result<Router, Trouble> {
    let (samples, tries_max) = ([SAMPLES, SAMPLES], 1);
    let (tolerance_m, escape_m, literal) = (0.0, 0.0, false);
    let question = Question { start, goal, tolerance_m, escape_m, samples, tries_max, literal };
    let mut router = Router::default();
    match router.plan(view, &question, &mut Pcg64::seed_from_u64(seed)) {
        PlanStateName::Found => Ok(router),
        state => Err(format!("no path from {start} to {goal}: {state:?}").into()),
    }
}

fn places(router: &Router) -> Vec<Point2<f64>> {
    router.waypoints().iter().map(|place| Point2::new(place.x_m, place.y_m)).collect()
}

fn figure_5(view: &View<'_>) -> Result<Sheet, Trouble> {
    let (start, goal, seed) = (Point2::new(0.50, 0.10), Point2::new(0.90, 0.90), 5);
    let router = plan(view, start, goal, seed)?;
    let way = places(&router);
    let path = format!("the path: {:.3} m, {}", length_m(router.waypoints()), turns(&way));
    let arena = arena(view)
        .with(Layer::places("random waypoints", GREY, Glyph::Dot(3.0), router.samples().to_vec()))
        .with(Layer::lines(&path, VERMILLION, 3.0, vec![way.clone()]))
        .with(Layer::places("", VERMILLION, Glyph::Dot(4.0), way.clone()))
        .with(ends(&way, ["start", "target"]));
    let words = format!(
        "1 plan, seed {seed}: {SAMPLES} waypoints, {} chosen (NXT-077). The robot is a point in the arena that is shrunk by half of it.",
        router.chosen()
    );
    Ok(Sheet::new("A path through random waypoints", &words).with(arena))
}

fn figure_6(view: &View<'_>) -> Result<Sheet, Trouble> {
    let (start, goal, seed) = (Point2::new(0.20, 0.20), Point2::new(0.80, 0.80), 3);
    let router = plan(view, start, goal, seed)?;
    let way = places(&router);
    let way_of_stars = lattice::path(view, start, goal, SPACING_M).ok_or("no path from star to star")?;
    let through = |middle: Point2<f64>| [start, middle, goal];
    let is_open = |way: &[Point2<f64>; 3]| view.is_open(way[0], way[1]) && view.is_open(way[1], way[2]);
    let mut others: Vec<_> = router.samples().iter().map(|&sample| through(sample)).filter(is_open).collect();
    others.retain(|other| !way.contains(&other[1]));
    others.sort_by(|a, b| lattice::length_m(a).total_cmp(&lattice::length_m(b)));
    others.truncate(ALTERNATIVES);
    let middles: Vec<Point2<f64>> = others.iter().map(|other| other[1]).collect();
    let dashes = others.iter().flat_map(|other| other.windows(2).map(|ends| pieces(ends[0], ends[1])));
    let told =
        |name: &str, way: &[Point2<f64>]| format!("{name}: {:.3} m, {}", lattice::length_m(way), turns(way));
    let (of_stars, of_samples) =
        (told("A* from star to star", &way_of_stars), told("random waypoints", &way));
    let arena = arena(view)
        .with(Layer::places("stars, 0.1 m apart", GREY, Glyph::Cross(3.0), stars(view, start, SPACING_M)))
        .with(Layer::dashed("other open ways by one waypoint", GREEN, 1.5, dashes.collect()))
        .with(Layer::places("", GREEN, Glyph::Dot(3.5), middles))
        .with(Layer::lines(&of_stars, BLUE, 3.0, vec![way_of_stars.clone()]))
        .with(Layer::places("", BLUE, Glyph::Dot(3.5), way_of_stars))
        .with(Layer::lines(&of_samples, VERMILLION, 3.0, vec![way.clone()]))
        .with(Layer::places("", VERMILLION, Glyph::Dot(4.0), way.clone()))
        .with(ends(&way, ["A", "B"]));
    let words = format!(
        "1 plan each, {SAMPLES} random waypoints with seed {seed}; A* over the eight neighbours of each star (NXT-078)."
    );
    Ok(Sheet::new("Random waypoints against A* on a grid", &words).with(arena))
}

fn turns(way: &[Point2<f64>]) -> String {
    match lattice::turns(way) {
        1 => "1 turn".to_owned(),
        count => format!("{count} turns"),
    }
}

/// The stars: places on a square grid through the start, as many as are free.
fn stars(view: &View<'_>, start: Point2<f64>, spacing_m: f64) -> Vec<Point2<f64>> {
    const FAR: i32 = 20;
    let steps = (-FAR..=FAR).flat_map(|row| (-FAR..=FAR).map(move |column| (column, row)));
    let places = steps.map(|step| lattice::place(start, spacing_m, step));
    places.filter(|&place| view.space().covers(place) && view.is_free(place)).collect()
}

/// The configuration space shaded, and the walls.
fn arena(view: &View<'_>) -> Plan {
    let (low, high) = (Point2::new(-0.05, -0.05), Point2::new(1.15, 1.15));
    let count = ((high.x - low.x) / SQUARE_M) as u32;
    let at = |index: u32| SQUARE_M * (f64::from(index) + 0.5);
    let middles = (0..count).flat_map(|row| (0..count).map(move |column| (column, row)));
    let middles = middles.map(|(column, row)| Point2::new(low.x + at(column), low.y + at(row)));
    let free = middles.filter(|&middle| view.is_free(middle));
    let walls = view.space().walls().map(|wall| vec![wall.a, wall.b]).collect();
    Plan::new("", low, high, [640.0, 640.0])
        .with(Layer::squares("where the robot's middle may be", PALE, SQUARE_M, free))
        .with(Layer::lines("walls", BLACK, 2.0, walls))
}

fn ends(way: &[Point2<f64>], names: [&str; 2]) -> Layer {
    let both = way.first().into_iter().chain(way.last()).zip(names);
    Layer::names(both.map(|(&place, name)| (place, name.to_owned())).collect())
}

/// The way in pieces of a centimetre, of which a broken line leaves out every second.
fn pieces(from: Point2<f64>, to: Point2<f64>) -> Vec<Point2<f64>> {
    let count = ((to - from).norm() / 0.01).ceil().max(1.0) as u32;
    (0..=count).map(|index| from + (to - from) * (f64::from(index) / f64::from(count))).collect()
}
