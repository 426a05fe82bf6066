//! A box a variant, for every figure: quartiles as the box, whiskers to the farthest value within 1.5 boxes
//! (Tukey 1977), and each run as a mark of its own, by which is seen whether it passed.

use super::compare::Group;
use super::store::{Outcome, Record};
use crate::statistics::{quantile, sorted};
use pictures::colours::{BLUE, GREY, VERMILLION};
use pictures::{Canvas, Entry, Glyph, Legend, PictureError, px, text, text_at, tick_label, ticks};
use plotters::prelude::{Circle, Color, PathElement, RGBColor, Rectangle};
use plotters::style::text_anchor::{HPos, VPos};

const WIDTH_PX: f64 = 960.0;
const MARGIN_PX: f64 = 16.0;
const LETTERS_PX: f64 = 12.0;
/// Title and what it is made of.
const HEAD_PX: f64 = 58.0;
/// Numbers and name of the axis.
const AXIS_PX: f64 = 44.0;
/// The column with the number of runs.
const COUNT_PX: f64 = 66.0;
/// Room for names of variants, at least and at most.
const NAMES_PX: [f64; 2] = [70.0, 330.0];
/// All rows together are about so high; a row at least, and at most.
const ROWS_PX: f64 = 560.0;
const ROW_PX: [f64; 2] = [22.0, 52.0];

/// The five numbers of a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Box5 {
    pub(super) low: f64,
    pub(super) first: f64,
    pub(super) median: f64,
    pub(super) third: f64,
    pub(super) high: f64,
}

/// Quartiles and whiskers; `None` without values.
pub(super) fn box_of(values: &[f64]) -> Option<Box5> {
    let sorted = sorted(values);
    let first = quantile(&sorted, 0.25)?;
    let (median, third) = (quantile(&sorted, 0.5)?, quantile(&sorted, 0.75)?);
    let reach = 1.5 * (third - first);
    // Between neighbours a quartile may lie beyond the farthest value within reach; the whisker then ends at
    // the box.
    let low = sorted.iter().copied().find(|value| *value >= first - reach)?.min(first);
    let high = sorted.iter().copied().rev().find(|value| *value <= third + reach)?.max(third);
    Some(Box5 { low, first, median, third, high })
}

/// Where everything lies, in pixels.
struct Frame {
    left: f64,
    right: f64,
    row: f64,
    rows: usize,
    /// The ends of the axis.
    ends: [f64; 2],
}

impl Frame {
    fn new(groups: &[Group<'_>], [least, most]: [f64; 2]) -> Self {
        let widest = groups.iter().map(|group| pictures::letters_width_px(group.name, LETTERS_PX));
        let names = widest.fold(0.0, f64::max).clamp(NAMES_PX[0], NAMES_PX[1]);
        let margin = if most > least { 0.04 * (most - least) } else { 0.5_f64.max(0.05 * most.abs()) };
        Self {
            left: MARGIN_PX + names + 10.0,
            right: WIDTH_PX - MARGIN_PX - COUNT_PX,
            row: (ROWS_PX / groups.len().max(1) as f64).clamp(ROW_PX[0], ROW_PX[1]),
            rows: groups.len(),
            ends: [least - margin, most + margin],
        }
    }

    fn x(&self, value: f64) -> f64 {
        let share = (value - self.ends[0]) / (self.ends[1] - self.ends[0]);
        self.left + share * (self.right - self.left)
    }

    fn middle(&self, row: usize) -> f64 {
        HEAD_PX + self.row * (row as f64 + 0.5)
    }

    fn bottom(&self) -> f64 {
        HEAD_PX + self.row * self.rows as f64
    }
}

/// The drawing of a figure as SVG; `None` when no run knows it.
pub(super) fn draw(
    experiment: &str,
    figure: &str,
    groups: &[Group<'_>],
) -> Result<Option<String>, PictureError> {
    let values: Vec<f64> = groups.iter().flat_map(|group| group.values(figure, false)).collect();
    let sorted = sorted(&values);
    let (Some(&least), Some(&most)) = (sorted.first(), sorted.last()) else { return Ok(None) };
    let frame = Frame::new(groups, [least, most]);
    let meanings = meanings();
    let legend = Legend::new(&meanings, WIDTH_PX - 2.0 * MARGIN_PX);
    let height_px = frame.bottom() + AXIS_PX + legend.height_px() + MARGIN_PX;
    let svg = pictures::draw(&format!("{experiment}: {figure}"), WIDTH_PX, height_px, |canvas| {
        let style = pictures::bold(text(16.0, HPos::Left, VPos::Top));
        let title = format!("{experiment}: {figure}");
        text_at(canvas, &title, (px(MARGIN_PX), px(12.0)), &style)?;
        let runs: usize = groups.iter().map(|group| group.runs.len()).sum();
        let words = format!("{} of {runs} runs know this figure; {} variants", values.len(), groups.len());
        let style = text(LETTERS_PX, HPos::Left, VPos::Top);
        text_at(canvas, &words, (px(MARGIN_PX), px(34.0)), &style)?;
        draw_axis(canvas, &frame, figure, &values)?;
        for (row, group) in groups.iter().enumerate() {
            draw_row(canvas, &frame, row, group, figure)?;
        }
        legend.draw(canvas, MARGIN_PX, frame.bottom() + AXIS_PX)
    })?;
    Ok(Some(svg))
}

fn meanings() -> Vec<Entry> {
    let entry = |glyph, colour: RGBColor, words: &str| Entry {
        glyph,
        colour: colour.to_rgba(),
        words: words.to_owned(),
    };
    vec![
        entry(Glyph::Dot(2.5), GREY, "a run that passed"),
        entry(Glyph::Cross(3.5), VERMILLION, "a run that did not pass"),
        entry(
            Glyph::BoxPlot,
            BLUE,
            "all runs: quartiles, median (thick), farthest run within 1.5 boxes (whiskers)",
        ),
    ]
}

/// Name and unit as people write them below an axis: what has no unit is a number of things, or a share.
fn axis_name(figure: &str) -> String {
    if figure.ends_with(']') { figure.to_owned() } else { format!("{figure} [number]") }
}

fn draw_axis(canvas: &Canvas<'_>, frame: &Frame, figure: &str, values: &[f64]) -> Result<(), PictureError> {
    let are_counts = values.iter().all(|value| value.fract() == 0.0) && !figure.ends_with(']');
    let ticks = ticks(frame.ends[0], frame.ends[1], 9, are_counts);
    let style = text(LETTERS_PX, HPos::Center, VPos::Top);
    let bottom = frame.bottom();
    for &tick in &ticks {
        let x = frame.x(tick);
        line(canvas, [x, HEAD_PX], [x, bottom], GREY, 0.75, 0.22)?;
        text_at(canvas, &tick_label(tick, &ticks), (px(x), px(bottom + 5.0)), &style)?;
    }
    for (from, to) in
        [([frame.left, bottom], [frame.right, bottom]), ([frame.left, HEAD_PX], [frame.left, bottom])]
    {
        line(canvas, from, to, GREY, 1.0, 1.0)?;
    }
    let middle = 0.5 * (frame.left + frame.right);
    text_at(canvas, &axis_name(figure), (px(middle), px(bottom + 22.0)), &style)
}

fn draw_row(
    canvas: &Canvas<'_>,
    frame: &Frame,
    row: usize,
    group: &Group<'_>,
    figure: &str,
) -> Result<(), PictureError> {
    let middle = frame.middle(row);
    let name = text(LETTERS_PX, HPos::Right, VPos::Center);
    text_at(canvas, &shortened(group.name), (px(frame.left - 10.0), px(middle)), &name)?;
    let values = group.values(figure, false);
    let count = text(LETTERS_PX, HPos::Left, VPos::Center);
    text_at(canvas, &format!("n = {}", values.len()), (px(frame.right + 10.0), px(middle)), &count)?;
    if let Some(five) = box_of(&values) {
        draw_box(canvas, frame, row, five)?;
    }
    // Over the box, so that each can be counted.
    group
        .runs
        .iter()
        .enumerate()
        .try_for_each(|(index, run)| draw_run(canvas, frame, row, index, run, figure))
}

fn draw_box(canvas: &Canvas<'_>, frame: &Frame, row: usize, five: Box5) -> Result<(), PictureError> {
    let middle = frame.middle(row);
    let half = 0.28 * frame.row;
    let [low, first, median, third, high] =
        [five.low, five.first, five.median, five.third, five.high].map(|value| frame.x(value));
    let corners = [(px(first), px(middle - half)), (px(third), px(middle + half))];
    canvas.draw(&Rectangle::new(corners, BLUE.mix(0.12).filled())).map_err(PictureError::of)?;
    let edge = BLUE.stroke_width(px(1.0) as u32);
    canvas.draw(&Rectangle::new(corners, edge)).map_err(PictureError::of)?;
    for [from, to] in [[low, first], [third, high]] {
        line(canvas, [from, middle], [to, middle], BLUE, 1.5, 1.0)?;
    }
    for end in [low, high] {
        line(canvas, [end, middle - 0.5 * half], [end, middle + 0.5 * half], BLUE, 1.5, 1.0)?;
    }
    line(canvas, [median, middle - half], [median, middle + half], BLUE, 3.0, 1.0)
}

fn draw_run(
    canvas: &Canvas<'_>,
    frame: &Frame,
    row: usize,
    index: usize,
    run: &Record,
    figure: &str,
) -> Result<(), PictureError> {
    let Some(&value) = run.figures.get(figure).filter(|value| value.is_finite()) else { return Ok(()) };
    // Equal values side by side: marks are spread by the golden ratio, the same in every drawing.
    let spread = (index as f64 * 0.618_034).fract() - 0.5;
    let [x, y] = [frame.x(value), frame.middle(row) + 0.7 * frame.row * spread];
    if run.outcome == Outcome::Passed {
        let dot = Circle::new((px(x), px(y)), px(2.0) as u32, GREY.mix(0.55).filled());
        return canvas.draw(&dot).map_err(PictureError::of);
    }
    line(canvas, [x - 3.0, y - 3.0], [x + 3.0, y + 3.0], VERMILLION, 1.5, 0.85)?;
    line(canvas, [x - 3.0, y + 3.0], [x + 3.0, y - 3.0], VERMILLION, 1.5, 0.85)
}

fn line(
    canvas: &Canvas<'_>,
    from: [f64; 2],
    to: [f64; 2],
    colour: RGBColor,
    width_px: f64,
    cover: f64,
) -> Result<(), PictureError> {
    let ends = [from, to].map(|[x, y]| (px(x), px(y)));
    let style = colour.mix(cover).stroke_width(px(width_px) as u32);
    canvas.draw(&PathElement::new(ends.to_vec(), style)).map_err(PictureError::of)
}

/// A name that fits into its column.
fn shortened(name: &str) -> String {
    let fits = |name: &str| pictures::letters_width_px(name, LETTERS_PX) <= NAMES_PX[1];
    if fits(name) {
        return name.to_owned();
    }
    let mut short = name.to_owned();
    while short.pop().is_some() && !fits(&format!("{short} ..")) {}
    format!("{} ..", short.trim_end())
}

/// A file name for a figure.
pub(super) fn file_name(figure: &str) -> String {
    let mut name = String::new();
    for letter in figure.chars() {
        match letter {
            letter if letter.is_alphanumeric() => name.extend(letter.to_lowercase()),
            _ if !name.is_empty() && !name.ends_with('-') => name.push('-'),
            _ => {}
        }
    }
    format!("{}.svg", name.trim_end_matches('-'))
}
