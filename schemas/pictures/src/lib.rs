//! Drawings as SVG that say what they show: for plots of experiments, for examples and for tests.
//!
//! A [`Sheet`] has a title and one or more [`Plan`]s to scale, each with axes in metres, a scale bar and a
//! legend; a chart of another kind is drawn on a [`Canvas`] with the same [`ticks`], [`Legend`] and
//! [`colours`]. [`lacks`] says what a drawing leaves its reader to guess.
//!
//! ```
//! use geometry::Point2;
//! use pictures::{Glyph, Layer, Plan, Sheet, colours};
//!
//! let (low, high) = (Point2::new(0.0, 0.0), Point2::new(4.0, 3.0));
//! let way = vec![Point2::new(0.5, 0.5), Point2::new(2.0, 2.5), Point2::new(3.5, 2.0)];
//! let plan = Plan::new("Plan", low, high, [400.0, 300.0])
//!     .with(Layer::lines("way", colours::BLUE, 2.0, vec![way.clone()]))
//!     .with(Layer::places("waypoints", colours::VERMILLION, Glyph::Dot(4.0), way));
//! let svg = Sheet::new("A way", "One plan, seed 7").with(plan).svg()?;
//!
//! assert!(svg.starts_with("<svg"));
//! assert_eq!(pictures::lacks(&svg, &["waypoints"]), Vec::<String>::new());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod canvas;
mod lacks;
mod legend;
mod plan;
mod sheet;
mod ticks;

#[cfg(test)]
mod tests;

pub use canvas::{Canvas, PictureError, bold, draw, letters_width_px, px, text, text_at, upright, wrapped};
pub use lacks::lacks;
pub use legend::{Entry, Glyph, Legend};
pub use plan::{Layer, Plan};
pub use plotters;
pub use sheet::Sheet;
pub use ticks::{tick_label, ticks};

/// Colours that people with any kind of colour vision can tell apart (Okabe and Ito 2008, "Color Universal
/// Design").
pub mod colours {
    use plotters::style::RGBColor;

    /// Text, walls.
    pub const BLACK: RGBColor = RGBColor(0, 0, 0);
    /// What is there but not spoken of.
    pub const GREY: RGBColor = RGBColor(120, 128, 136);
    /// A surface behind everything.
    pub const PALE: RGBColor = RGBColor(226, 236, 245);
    /// The first thing to look at.
    pub const BLUE: RGBColor = RGBColor(0, 114, 178);
    /// What is compared with it, or did not go well.
    pub const VERMILLION: RGBColor = RGBColor(213, 94, 0);
    /// A third.
    pub const GREEN: RGBColor = RGBColor(0, 158, 115);
    /// A fourth.
    pub const PURPLE: RGBColor = RGBColor(204, 121, 167);
    /// A fifth.
    pub const ORANGE: RGBColor = RGBColor(230, 159, 0);
}
