//! The figures of the paper's planner, as SVG: `cargo run -p sampling-planner --example figures -- OUT_DIR`.
//!
//! `fig5.svg`: the arena shrunk by half the robot, thirty waypoints, and the one that was chosen (NXT-077). `fig6.svg`: random waypoints
//! against A* from star to star, with what else was to be had of one waypoint (NXT-078).

mod lattice;

use geometry::{Point2, World};
use messages::PlanStateName;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use sampling_planner::{Params, Question, Router, SamplingPlanner, View, length_m};
use std::path::Path;

const ARENA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/arenas/default.toml");
/// Between stars, in metres.
const SPACING_M: f64 = 0.10;
/// Alternatives drawn.
const ALTERNATIVES: usize = 4;
const RED: RGBColor = RGBColor(200, 40, 40);
const BLUE: RGBColor = RGBColor(30, 90, 160);
const GREEN: RGBColor = RGBColor(40, 140, 70);
const GREY: RGBColor = RGBColor(120, 130, 140);
const SPACE: RGBColor = RGBColor(228, 236, 244);

type Trouble = Box<dyn std::error::Error>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn main() -> Result<(), Trouble> {
    let folder = std::env::args().nth(1).ok_or("name the folder for the figures: -- OUT_DIR")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let world = World::load(ARENA)?;
    let planner = SamplingPlanner::in_world(Params::default(), &world, 1)?;
    let view = View::new(planner.space(1).ok_or("the arena has a floor 1")?, &[], 0.0);
    figure_5(&folder.join("fig5.svg"), &view)?;
    figure_6(&folder.join("fig6.svg"), &view)
}

/// A plan with thirty samples.
fn plan(view: &View<'_>, start: Point2<f64>, goal: Point2<f64>, seed: u64) -> Result<Router, Trouble> {
    let (samples, tries_max) = ([30, 30], 1);
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

fn figure_5(file: &Path, view: &View<'_>) -> Result<(), Trouble> {
    let (start, goal) = (Point2::new(0.50, 0.10), Point2::new(0.90, 0.90));
    let router = plan(view, start, goal, 5)?;
    let way = places(&router);
    let area = SVGBackend::new(file, (720, 720)).into_drawing_area();
    let title = format!(
        "30 waypoints, {} chosen: {:.1} cm from (50, 10) to (90, 90)",
        router.chosen(),
        100.0 * length_m(router.waypoints())
    );
    let mut chart = arena(&area, view, &title)?;
    chart.draw_series(router.samples().iter().map(|&place| Circle::new(cm(place), 3, GREY.filled())))?;
    line(&mut chart, &way, RED, "path")?;
    ends(&mut chart, &way, ["start", "target"])?;
    legend(&mut chart)?;
    area.present()?;
    println!("{}: {title}", file.display());
    Ok(())
}

fn figure_6(file: &Path, view: &View<'_>) -> Result<(), Trouble> {
    let (start, goal) = (Point2::new(0.20, 0.20), Point2::new(0.80, 0.80));
    let router = plan(view, start, goal, 3)?;
    let way = places(&router);
    let way_of_stars = lattice::path(view, start, goal, SPACING_M).ok_or("no path from star to star")?;
    let area = SVGBackend::new(file, (720, 720)).into_drawing_area();
    let title = "From A (20, 20) to B (80, 80)";
    let mut chart = arena(&area, view, title)?;
    let all = stars(view, start, SPACING_M);
    chart.draw_series(all.into_iter().map(|star| Cross::new(cm(star), 3, GREY.mix(0.8))))?;

    let through = |middle: Point2<f64>| [start, middle, goal];
    let is_open = |way: &[Point2<f64>; 3]| view.is_open(way[0], way[1]) && view.is_open(way[1], way[2]);
    let mut others: Vec<_> = router.samples().iter().map(|&sample| through(sample)).filter(is_open).collect();
    others.retain(|other| !way.contains(&other[1]));
    others.sort_by(|a, b| lattice::length_m(a).total_cmp(&lattice::length_m(b)));
    others.truncate(ALTERNATIVES);
    let name = "other waypoints";
    for (index, other) in others.iter().enumerate() {
        let dots = other.windows(2).flat_map(|ends| dots(ends[0], ends[1]));
        let drawn = chart.draw_series(dots.map(|dot| Circle::new(cm(dot), 1, GREEN.filled())))?;
        if index == 0 {
            drawn.label(name).legend(|(x, y)| Circle::new((x + 9, y), 3, GREEN.filled()));
        }
        chart.draw_series([Circle::new(cm(other[1]), 3, GREEN.filled())])?;
    }
    let of_stars = format!(
        "A*: {:.1} cm, {} turns",
        100.0 * lattice::length_m(&way_of_stars),
        lattice::turns(&way_of_stars)
    );
    line(&mut chart, &way_of_stars, BLUE, &of_stars)?;
    let of_samples = format!(
        "30 random waypoints: {:.1} cm, {} turn",
        100.0 * lattice::length_m(&way),
        lattice::turns(&way)
    );
    line(&mut chart, &way, RED, &of_samples)?;
    ends(&mut chart, &way, ["A", "B"])?;
    legend(&mut chart)?;
    area.present()?;
    println!("{}: {of_stars}; {of_samples}", file.display());
    Ok(())
}

/// The stars: places on a square grid through the start, as many as are free.
fn stars(view: &View<'_>, start: Point2<f64>, spacing_m: f64) -> Vec<Point2<f64>> {
    const FAR: i32 = 20;
    let steps = (-FAR..=FAR).flat_map(|row| (-FAR..=FAR).map(move |column| (column, row)));
    let places = steps.map(|step| lattice::place(start, spacing_m, step));
    places.filter(|&place| view.space().covers(place) && view.is_free(place)).collect()
}

/// Axes in centimetres, the configuration space shaded, and the walls.
fn arena<'a, 'b>(
    area: &'a DrawingArea<SVGBackend<'b>, plotters::coord::Shift>,
    view: &View<'_>,
    title: &str,
) -> Result<Chart<'a, 'b>, Trouble> {
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 20))
        .margin(14)
        .x_label_area_size(36)
        .y_label_area_size(44)
        .build_cartesian_2d(-5.0..115.0, -5.0..115.0)?;
    chart.configure_mesh().disable_mesh().x_desc("x, cm").y_desc("y, cm").draw()?;
    let free =
        (0..212).flat_map(|column| (0..212).map(move |row| (column, row))).filter_map(|(column, row)| {
            let place = Point2::new(f64::from(column), f64::from(row)) * 0.005;
            view.is_free(place).then_some(cm(place))
        });
    chart.draw_series(
        free.map(|(x, y)| Rectangle::new([(x - 0.27, y - 0.27), (x + 0.27, y + 0.27)], SPACE.filled())),
    )?;
    let walls: Vec<_> = view.space().walls().copied().collect();
    chart.draw_series(
        walls.iter().map(|wall| PathElement::new([cm(wall.a), cm(wall.b)], BLACK.stroke_width(2))),
    )?;
    Ok(chart)
}

fn line(chart: &mut Chart<'_, '_>, way: &[Point2<f64>], colour: RGBColor, name: &str) -> Result<(), Trouble> {
    let corners: Vec<_> = way.iter().map(|&place| cm(place)).collect();
    chart.draw_series(corners.iter().map(|&corner| Circle::new(corner, 3, colour.filled())))?;
    chart
        .draw_series([PathElement::new(corners, colour.stroke_width(3))])?
        .label(name)
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
    Ok(())
}

fn ends(chart: &mut Chart<'_, '_>, way: &[Point2<f64>], names: [&'static str; 2]) -> Result<(), Trouble> {
    let both = way.first().into_iter().chain(way.last()).zip(names);
    chart.draw_series(both.map(|(&place, name)| {
        EmptyElement::at(cm(place))
            + Circle::new((0, 0), 5, BLACK.filled())
            + Text::new(name, (9, -6), ("sans-serif", 16).into_font())
    }))?;
    Ok(())
}

fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Result<(), Trouble> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}

/// Dots a centimetre and a half apart.
fn dots(from: Point2<f64>, to: Point2<f64>) -> impl Iterator<Item = Point2<f64>> {
    let count = ((to - from).norm() / 0.015) as u32;
    (0..count).map(move |index| from + (to - from) * (f64::from(index) / f64::from(count)))
}

fn cm(place: Point2<f64>) -> (f64, f64) {
    (100.0 * place.x, 100.0 * place.y)
}
