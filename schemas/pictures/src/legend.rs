//! What the marks of a drawing mean.

use crate::canvas::{Canvas, PictureError, letters_width_px, px, text, text_at};
use plotters::prelude::{Circle, Color, PathElement, Polygon, RGBAColor, Rectangle};
use plotters::style::text_anchor::{HPos, VPos};

const LETTERS_PX: f64 = 12.0;
const ROW_PX: f64 = 19.0;
const GLYPH_PX: f64 = 26.0;
const GAP_PX: f64 = 20.0;

/// The form of a mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Glyph {
    /// A line of this width in pixels.
    Line(f64),
    /// A broken line of this width in pixels.
    Dashed(f64),
    /// A full circle of this radius in pixels.
    Dot(f64),
    /// A circle of this radius in pixels, drawn two pixels wide.
    Ring(f64),
    /// A cross that reaches this many pixels from its middle.
    Cross(f64),
    /// A dot with a line of this length in pixels towards a heading.
    Arrow(f64),
    /// A surface.
    Area,
    /// A box with a line across at the median, and whiskers.
    BoxPlot,
}

/// A mark and its meaning.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The mark.
    pub glyph: Glyph,
    /// Its colour.
    pub colour: RGBAColor,
    /// What it stands for.
    pub words: String,
}

/// Marks and their meanings in rows.
#[derive(Debug, Clone)]
pub struct Legend<'a> {
    rows: Vec<Vec<&'a Entry>>,
}

impl<'a> Legend<'a> {
    /// As many beside each other as this width lets.
    pub fn new(entries: &'a [Entry], width_px: f64) -> Self {
        let mut rows: Vec<Vec<&Entry>> = Vec::new();
        let mut used_px = f64::INFINITY;
        for entry in entries {
            let own_px = Self::entry_width_px(entry);
            if used_px + own_px > width_px {
                rows.push(Vec::new());
                used_px = 0.0;
            }
            used_px += own_px;
            if let Some(row) = rows.last_mut() {
                row.push(entry);
            }
        }
        Self { rows }
    }

    /// How high it is.
    pub fn height_px(&self) -> f64 {
        ROW_PX * self.rows.len() as f64
    }

    /// Draws it with its upper left corner there.
    ///
    /// # Errors
    /// When the library refuses.
    pub fn draw(&self, canvas: &Canvas<'_>, left_px: f64, top_px: f64) -> Result<(), PictureError> {
        for (row, entries) in self.rows.iter().enumerate() {
            let middle_px = top_px + ROW_PX * (row as f64 + 0.5);
            let mut at_px = left_px;
            for entry in entries {
                mark(canvas, entry.glyph, entry.colour, [at_px, middle_px])?;
                let style = text(LETTERS_PX, HPos::Left, VPos::Center);
                text_at(canvas, &entry.words, (px(at_px + GLYPH_PX + 6.0), px(middle_px)), &style)?;
                at_px += Self::entry_width_px(entry);
            }
        }
        Ok(())
    }

    fn entry_width_px(entry: &Entry) -> f64 {
        GLYPH_PX + 6.0 + letters_width_px(&entry.words, LETTERS_PX) + GAP_PX
    }
}

/// A mark as it stands in a legend; its left end and the middle of its height.
fn mark(canvas: &Canvas<'_>, glyph: Glyph, colour: RGBAColor, [x, y]: [f64; 2]) -> Result<(), PictureError> {
    let at = |x: f64, y: f64| (px(x), px(y));
    let middle = x + 0.5 * GLYPH_PX;
    let width = |pixels: f64| px(pixels).max(1) as u32;
    let fine = colour.stroke_width(width(1.5));
    let drawn = match glyph {
        Glyph::Line(width_px) => canvas.draw(&PathElement::new(
            vec![at(x, y), at(x + GLYPH_PX, y)],
            colour.stroke_width(width(width_px)),
        )),
        Glyph::Dashed(width_px) => (0..3).try_for_each(|piece| {
            let left = x + 10.0 * f64::from(piece);
            let line = vec![at(left, y), at(left + 6.0, y)];
            canvas.draw(&PathElement::new(line, colour.stroke_width(width(width_px))))
        }),
        Glyph::Dot(radius_px) => canvas.draw(&Circle::new(at(middle, y), width(radius_px), colour.filled())),
        Glyph::Ring(radius_px) => {
            canvas.draw(&Circle::new(at(middle, y), width(radius_px), colour.stroke_width(width(2.0))))
        }
        Glyph::Cross(reach_px) => [1.0, -1.0].into_iter().try_for_each(|side| {
            let line =
                vec![at(middle - reach_px, y - side * reach_px), at(middle + reach_px, y + side * reach_px)];
            canvas.draw(&PathElement::new(line, fine))
        }),
        Glyph::Arrow(length_px) => {
            let line = vec![at(middle - 4.0, y), at(middle - 4.0 + length_px, y)];
            canvas
                .draw(&PathElement::new(line, colour.stroke_width(width(2.0))))
                .and_then(|()| canvas.draw(&Circle::new(at(middle - 4.0, y), width(3.0), colour.filled())))
        }
        Glyph::Area => {
            let corners = vec![at(x, y - 6.0), at(x + GLYPH_PX, y - 6.0), at(x + GLYPH_PX, y + 6.0)];
            let corners = corners.into_iter().chain([at(x, y + 6.0)]).collect::<Vec<_>>();
            canvas.draw(&Polygon::new(corners, colour))
        }
        Glyph::BoxPlot => {
            let (left, right) = (x + 6.0, x + GLYPH_PX - 6.0);
            let line = |from: (i32, i32), to: (i32, i32)| PathElement::new(vec![from, to], fine);
            canvas
                .draw(&Rectangle::new([at(left, y - 6.0), at(right, y + 6.0)], colour.mix(0.15).filled()))
                .and_then(|()| canvas.draw(&Rectangle::new([at(left, y - 6.0), at(right, y + 6.0)], fine)))
                .and_then(|()| canvas.draw(&line(at(x, y), at(left, y))))
                .and_then(|()| canvas.draw(&line(at(right, y), at(x + GLYPH_PX, y))))
                .and_then(|()| {
                    let median = vec![at(middle + 2.0, y - 6.0), at(middle + 2.0, y + 6.0)];
                    canvas.draw(&PathElement::new(median, colour.stroke_width(width(2.5))))
                })
        }
    };
    drawn.map_err(PictureError::of)
}
