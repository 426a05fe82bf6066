//! A box a variant, for every figure: quartiles as the box, whiskers to the farthest value within 1.5 boxes (Tukey 1977), and each run as
//! a dot, red when it did not pass.

use super::report::Group;
use super::statistics::quantile;
use super::store::Outcome;
use plotters::prelude::*;
use std::path::Path;

const WIDTH: u32 = 960;
const ROW_HEIGHT: u32 = 56;
const PASSED: RGBColor = RGBColor(90, 110, 130);
const OTHERWISE: RGBColor = RGBColor(200, 40, 40);
const BOX: RGBColor = RGBColor(30, 90, 160);

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
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let first = quantile(&sorted, 0.25)?;
    let (median, third) = (quantile(&sorted, 0.5)?, quantile(&sorted, 0.75)?);
    let reach = 1.5 * (third - first);
    // Between neighbours a quartile may lie beyond the farthest value within reach; the whisker then ends at the box.
    let low = sorted.iter().copied().find(|value| *value >= first - reach)?.min(first);
    let high = sorted.iter().copied().rev().find(|value| *value <= third + reach)?.max(third);
    Some(Box5 { low, first, median, third, high })
}

/// Draws a figure; nothing when no run knows it.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn draw(
    file: &Path,
    figure: &str,
    groups: &[Group<'_>],
) -> Result<(), Box<dyn std::error::Error>> {
    let values: Vec<f64> = groups.iter().flat_map(|group| group.values(figure, false)).collect();
    let (Some(least), Some(most)) =
        (values.iter().copied().reduce(f64::min), values.iter().copied().reduce(f64::max))
    else {
        return Ok(());
    };
    let margin = if most > least { 0.05 * (most - least) } else { 0.5 };
    let height = 110 + ROW_HEIGHT * u32::try_from(groups.len())?;
    let longest = groups.iter().map(|group| group.name.chars().count()).max().unwrap_or(0);
    let label_width = u32::try_from(longest)?.saturating_mul(8).clamp(80, 420);
    let area = SVGBackend::new(file, (WIDTH, height)).into_drawing_area();
    area.fill(&WHITE)?;
    let rows = i32::try_from(groups.len())?;
    let mut chart = ChartBuilder::on(&area)
        .caption(figure, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(label_width)
        .build_cartesian_2d(least - margin..most + margin, f64::from(rows) - 0.5..-0.5)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .y_labels(0)
        .x_label_style(("sans-serif", 14))
        .light_line_style(BLACK.mix(0.04))
        .draw()?;
    for (row, group) in (0..rows).zip(groups) {
        let y = f64::from(row);
        let (_, pixel_y) = chart.backend_coord(&(least, y));
        let style = ("sans-serif", 14).into_font().color(&BLACK);
        let style = style.pos(plotters::style::text_anchor::Pos::new(
            plotters::style::text_anchor::HPos::Right,
            plotters::style::text_anchor::VPos::Center,
        ));
        area.draw(&Text::new(group.name.to_owned(), (label_width as i32 + 4, pixel_y), style))?;
        for (index, run) in group.runs.iter().enumerate() {
            let Some(&value) = run.figures.get(figure).filter(|value| value.is_finite()) else { continue };
            // Equal values side by side: dots are spread by the golden ratio, the same in every drawing.
            let spread = (index as f64 * 0.618_034).fract() - 0.5;
            let colour = if run.outcome == Outcome::Passed { PASSED } else { OTHERWISE };
            chart.draw_series([Circle::new((value, y + 0.5 * spread), 2, colour.mix(0.45).filled())])?;
        }
        let Some(five) = box_of(&group.values(figure, false)) else { continue };
        let line = BOX.stroke_width(2);
        chart.draw_series([
            Rectangle::new([(five.first, y - 0.25), (five.third, y + 0.25)], BOX.mix(0.15).filled()),
            Rectangle::new([(five.first, y - 0.25), (five.third, y + 0.25)], BOX.stroke_width(1)),
        ])?;
        chart.draw_series([
            PathElement::new([(five.low, y), (five.first, y)], line),
            PathElement::new([(five.third, y), (five.high, y)], line),
            PathElement::new([(five.median, y - 0.25), (five.median, y + 0.25)], BOX.stroke_width(3)),
        ])?;
    }
    area.present()?;
    Ok(())
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
