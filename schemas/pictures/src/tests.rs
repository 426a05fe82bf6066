//! Marks of axes, legends, and that a drawing says what it shows.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use crate::canvas::{letters_width_px, wrapped};
use crate::colours::{BLUE, VERMILLION};
use crate::*;
use geometry::{Point2, Pose2};
use proptest::prelude::*;

#[track_caller]
fn check_ticks(low: f64, high: f64, whole: bool, expected: &[&str]) {
    let found = ticks(low, high, 6, whole);
    let labels: Vec<String> = found.iter().map(|&tick| tick_label(tick, &found)).collect();
    assert_eq!(labels, expected, "{low} to {high}");
}

#[test]
fn marks_stand_at_round_numbers() {
    check_ticks(0.0, 1.0, false, &["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    check_ticks(0.0, 1.0, true, &["0", "1"]);
    check_ticks(-0.05, 3.05, true, &["0", "1", "2", "3"]);
    check_ticks(0.0, 20.0, true, &["0", "5", "10", "15", "20"]);
    check_ticks(-3.2, 14.6, false, &["0", "5", "10"]);
    check_ticks(0.0123, 0.0141, false, &["0.0125", "0.0130", "0.0135", "0.0140"]);
    check_ticks(-0.3, 0.3, false, &["-0.2", "0.0", "0.2"]);
    check_ticks(1e6, 5e6, false, &["1000000", "2000000", "3000000", "4000000", "5000000"]);
    check_ticks(2.0, 2.0, false, &[]);
    check_ticks(f64::NAN, 1.0, false, &[]);
    check_ticks(0.0, f64::INFINITY, false, &[]);
}

fn sheet() -> Sheet {
    let way = vec![Point2::new(0.0, 0.0), Point2::new(2.0, 1.0)];
    let plan = Plan::new("", Point2::new(-0.5, -0.5), Point2::new(2.5, 1.5), [600.0, 600.0])
        .with(Layer::lines("the way <driven>", BLUE, 2.0, vec![way.clone()]))
        .with(Layer::places("a place", VERMILLION, Glyph::Ring(4.0), way))
        .with(Layer::poses("a pose", BLUE, 12.0, vec![Pose2::new(1.0, 1.0, 0.5)]));
    Sheet::new("A way & its end", "1 run, seed 7").with(plan)
}

#[test]
fn a_drawing_says_what_it_shows() {
    let svg = sheet().svg().unwrap();
    let words = ["1 run, seed 7", "x [m]", "y [m]", "0.5 m", "the way <driven>", "a place", "a pose"];
    assert_eq!(lacks(&svg, &words), Vec::<String>::new(), "{svg}");
    assert_eq!(lacks(&svg, &["z [m]"]), ["`z [m]`"]);
    assert_eq!(lacks("<svg></svg>", &[]), ["a title", "numbers at an axis"]);
}

/// The length of the first line of this colour, in pixels.
fn length_px(svg: &str, colour: &str) -> f64 {
    let line = svg.split("<polyline").find(|part| part.contains(colour)).unwrap();
    let points = line.split_once("points=\"").unwrap().1.split_once('"').unwrap().0;
    let numbers: Vec<f64> = points.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    (numbers[2] - numbers[0]).hypot(numbers[3] - numbers[1]) / 4.0
}

#[test]
fn a_plan_is_to_scale_in_both_directions() {
    let svg = sheet().svg().unwrap();
    // 600 pixels for 3 m.
    assert!((length_px(&svg, "#0072B2") - 200.0 * 5.0_f64.sqrt()).abs() < 0.5, "{svg}");
    let turned = Plan::new("", Point2::new(0.0, 0.0), Point2::new(1.0, 6.0), [600.0, 600.0])
        .with(Layer::lines("up", BLUE, 1.0, vec![vec![Point2::new(0.5, 1.0), Point2::new(0.5, 3.0)]]));
    let svg = Sheet::new("t", "").with(turned).svg().unwrap();
    assert!((length_px(&svg, "#0072B2") - 200.0).abs() < 0.5, "{svg}");
}

#[test]
fn squares_side_by_side_are_one_surface() {
    let middles =
        [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0), (0.4, 0.0), (0.0, 0.1)].map(|(x, y)| Point2::new(x, y));
    let plan = Plan::new("", Point2::new(-1.0, -1.0), Point2::new(1.0, 1.0), [200.0, 200.0])
        .with(Layer::squares("walls", VERMILLION, 0.1, middles));
    let svg = Sheet::new("t", "").with(plan).svg().unwrap();
    // And one in the legend.
    assert_eq!(svg.matches("<polygon").count(), 4, "{svg}");
}

#[test]
fn long_words_are_broken_between_words() {
    assert_eq!(wrapped("one two three", 10.0, letters_width_px("one two", 10.0)), ["one two", "three"]);
    assert_eq!(wrapped("incomprehensible", 10.0, 5.0), ["incomprehensible"]);
    assert_eq!(wrapped(" ", 10.0, 5.0), Vec::<String>::new());
}

#[test]
fn a_legend_takes_as_many_rows_as_it_needs() {
    let entry = |words: &str| {
        let colour = plotters::style::Color::to_rgba(&BLUE);
        Entry { glyph: Glyph::Dot(3.0), colour, words: words.to_owned() }
    };
    let entries = ["one", "two", "three"].map(entry);
    let high = |width_px: f64| Legend::new(&entries, width_px).height_px();
    assert_eq!((high(1000.0), high(10.0)), (high(1000.0), 3.0 * high(1000.0)));
    assert_eq!(Legend::new(&[], 100.0).height_px(), 0.0);
}

proptest! {
    #[test]
    fn marks_lie_between_the_ends_and_differ(low in -1e6..1e6_f64, span in 1e-6..1e6_f64, most in 2..12_usize) {
        let found = ticks(low, low + span, most, false);
        let slack = 1e-6 * span + 1e-9 * low.abs();
        prop_assert!(found.len() <= most);
        prop_assert!(found.iter().all(|tick| *tick >= low - slack && *tick <= low + span + slack));
        let labels: Vec<String> = found.iter().map(|&tick| tick_label(tick, &found)).collect();
        prop_assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
    }

    #[test]
    fn counts_have_whole_marks(low in -100.0..100.0_f64, span in 0.1..1000.0_f64, most in 2..12_usize) {
        prop_assert!(ticks(low, low + span, most, true).iter().all(|tick| tick.fract() == 0.0));
    }
}
