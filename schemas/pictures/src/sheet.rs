//! One drawing: a title, what it was made of, and plans beside each other.

use crate::Plan;
use crate::canvas::{PictureError, bold, draw, px, text, text_at, wrapped};
use plotters::style::text_anchor::{HPos, VPos};

const MARGIN_PX: f64 = 16.0;
const TITLE_PX: f64 = 17.0;
const WORDS_PX: f64 = 12.5;
/// From line to line, in heights of letters.
const LINE: f64 = 1.4;

/// A drawing that can stand alone.
#[derive(Debug, Clone)]
pub struct Sheet {
    title: String,
    /// What is shown: of how many runs, with which seed, and what came of them.
    made_of: String,
    plans: Vec<Plan>,
}

impl Sheet {
    /// A drawing with a title, and a sentence that says of how many runs (or scans, or plans) it is and where
    /// its randomness came from.
    pub fn new(title: &str, made_of: &str) -> Self {
        Self { title: title.to_owned(), made_of: made_of.to_owned(), plans: Vec::new() }
    }

    /// With this plan at the right of those that are there.
    #[must_use]
    pub fn with(mut self, plan: Plan) -> Self {
        self.plans.push(plan);
        self
    }

    /// The drawing as SVG.
    ///
    /// # Errors
    /// When the library refuses.
    pub fn svg(&self) -> Result<String, PictureError> {
        let sizes: Vec<[f64; 2]> = self.plans.iter().map(Plan::size_px).collect();
        let inner_px = sizes.iter().map(|size| size[0]).sum::<f64>();
        let title = wrapped(&self.title, TITLE_PX, inner_px);
        let words = wrapped(&self.made_of, WORDS_PX, inner_px);
        let head_px = LINE * (TITLE_PX * title.len() as f64 + WORDS_PX * words.len() as f64) + 8.0;
        let below_px = sizes.iter().map(|size| size[1]).fold(0.0, f64::max);
        let size_px = [inner_px + 2.0 * MARGIN_PX, head_px + below_px + 2.0 * MARGIN_PX];
        draw(&self.title, size_px[0], size_px[1], |canvas| {
            let mut top_px = MARGIN_PX;
            let lines = title.iter().map(|line| (line, TITLE_PX, true));
            for (line, height_px, is_title) in lines.chain(words.iter().map(|line| (line, WORDS_PX, false))) {
                let style = text(height_px, HPos::Left, VPos::Top);
                let style = if is_title { bold(style) } else { style };
                text_at(canvas, line, (px(MARGIN_PX), px(top_px)), &style)?;
                top_px += LINE * height_px;
            }
            let mut left_px = MARGIN_PX;
            for (plan, size) in self.plans.iter().zip(&sizes) {
                plan.draw(canvas, left_px, MARGIN_PX + head_px)?;
                left_px += size[0];
            }
            Ok(())
        })
    }
}
