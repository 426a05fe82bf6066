//! The paper, and words on it.

use plotters::coord::Shift;
use plotters::prelude::{BLACK, DrawingArea, IntoDrawingArea, IntoFont, SVGBackend, Text, WHITE};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, FontTransform, TextStyle};

/// What everything is drawn on. Its lengths are quarters of a pixel ([`px`]), since the library draws in
/// whole numbers, and a line of whole pixels is a flight of steps.
pub type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

const QUARTERS: f64 = 4.0;

/// A drawing that came to nothing.
#[derive(Debug, Clone, thiserror::Error)]
#[error("the picture cannot be drawn: {0}")]
pub struct PictureError(String);

impl PictureError {
    /// Of whatever the library says.
    pub fn of(cause: impl std::fmt::Display) -> Self {
        Self(cause.to_string())
    }
}

/// A length on a [`Canvas`], of pixels.
pub fn px(pixels: f64) -> i32 {
    (pixels * QUARTERS).round() as i32
}

/// The SVG text of a drawing of this size in pixels. The title is what a browser shows of it and a screen
/// reader reads; it has to be written on the canvas too.
///
/// # Errors
/// When `with` does not succeed.
pub fn draw(
    title: &str,
    width_px: f64,
    height_px: f64,
    with: impl FnOnce(&Canvas<'_>) -> Result<(), PictureError>,
) -> Result<String, PictureError> {
    let mut svg = String::new();
    let [width, height] = [width_px, height_px].map(|pixels| px(pixels.max(1.0)) as u32);
    {
        let canvas = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
        canvas.fill(&WHITE).map_err(PictureError::of)?;
        with(&canvas)?;
        canvas.present().map_err(PictureError::of)?;
    }
    // The size on a page is in pixels, that of its coordinates stays in quarters.
    let written = format!("width=\"{width}\" height=\"{height}\"");
    let meant = format!("width=\"{}\" height=\"{}\"", width_px.round(), height_px.round());
    let svg = svg.replacen(&written, &meant, 1);
    let title = title.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let Some(head) = svg.find("<svg").and_then(|begin| Some(begin + svg[begin..].find('>')? + 1)) else {
        return Err(PictureError::of("the library has written no SVG"));
    };
    Ok(format!("{}\n<title>{title}</title>{}", &svg[..head], &svg[head..]))
}

/// Black letters of this height.
pub fn text(height_px: f64, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    // The library divides by this number.
    let size = height_px * QUARTERS * 1.24;
    ("sans-serif", size).into_font().color(&BLACK).pos(Pos::new(horizontal, vertical))
}

/// Writes at a place of the canvas, in quarters of a pixel.
///
/// # Errors
/// When the library refuses.
pub fn text_at(
    canvas: &Canvas<'_>,
    words: &str,
    at: (i32, i32),
    style: &TextStyle<'_>,
) -> Result<(), PictureError> {
    canvas.draw(&Text::new(words.to_owned(), at, style.clone())).map_err(PictureError::of)
}

/// These letters, bold.
pub fn bold(style: TextStyle<'static>) -> TextStyle<'static> {
    TextStyle { font: style.font.clone().style(FontStyle::Bold), ..style }
}

/// These letters, read from below to above.
pub fn upright(style: TextStyle<'static>) -> TextStyle<'static> {
    TextStyle { font: style.font.clone().transform(FontTransform::Rotate270), ..style }
}

/// Roughly how wide letters of this height are in all: SVG leaves the choice of the letters to whoever shows
/// it.
pub fn letters_width_px(words: &str, height_px: f64) -> f64 {
    0.56 * height_px * words.chars().count() as f64
}

/// Words in lines that are not wider than this.
pub fn wrapped(words: &str, height_px: f64, width_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split_whitespace() {
        match lines.last_mut() {
            Some(line) if letters_width_px(&format!("{line} {word}"), height_px) <= width_px => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
