//! A piece of ground from above, to scale.

use crate::canvas::{Canvas, PictureError, letters_width_px, px, text, text_at, upright};
use crate::colours::{BLACK, GREY};
use crate::legend::{Entry, Glyph, Legend};
use crate::ticks::{tick_label, ticks};
use geometry::{Point2, Pose2};
use plotters::prelude::{Circle, Color, PathElement, Polygon, RGBColor, Rectangle, Text, WHITE};
use plotters::style::text_anchor::{HPos, VPos};

const LETTERS_PX: f64 = 12.0;
/// Names on the plan.
const NAMES_PX: f64 = 13.0;
/// Room for the numbers and the name of the axis at the left.
const LEFT_PX: f64 = 58.0;
const RIGHT_PX: f64 = 14.0;
/// Room for the numbers and the name of the axis below.
const BELOW_PX: f64 = 42.0;
const SCALE_BAR_PX: f64 = 22.0;
const TICKS_MOST: usize = 9;

/// Marks of one kind on a plan, and what they mean.
#[derive(Debug, Clone)]
pub struct Layer {
    entry: Entry,
    shape: Shape,
}

#[derive(Debug, Clone)]
enum Shape {
    Lines(Vec<Vec<Point2<f64>>>),
    Places(Vec<Point2<f64>>),
    Poses(Vec<Pose2>),
    Names(Vec<(Point2<f64>, String)>),
}

impl Layer {
    /// Lines from place to place.
    pub fn lines(words: &str, colour: RGBColor, width_px: f64, lines: Vec<Vec<Point2<f64>>>) -> Self {
        Self::new(words, colour, Glyph::Line(width_px), Shape::Lines(lines))
    }

    /// Broken lines, of which every second piece is drawn.
    pub fn dashed(words: &str, colour: RGBColor, width_px: f64, lines: Vec<Vec<Point2<f64>>>) -> Self {
        Self::new(words, colour, Glyph::Dashed(width_px), Shape::Lines(lines))
    }

    /// A mark at each place: a dot, a ring or a cross.
    pub fn places(words: &str, colour: RGBColor, glyph: Glyph, places: Vec<Point2<f64>>) -> Self {
        Self::new(words, colour, glyph, Shape::Places(places))
    }

    /// A dot at each pose, with a line of this many pixels towards its heading.
    pub fn poses(words: &str, colour: RGBColor, length_px: f64, poses: Vec<Pose2>) -> Self {
        Self::new(words, colour, Glyph::Arrow(length_px), Shape::Poses(poses))
    }

    /// Surfaces by their corners.
    pub fn surfaces(words: &str, colour: RGBColor, surfaces: Vec<Vec<Point2<f64>>>) -> Self {
        Self::new(words, colour, Glyph::Area, Shape::Lines(surfaces))
    }

    /// Squares of this side around places, as the cells of a grid are. Those that follow each other in a row
    /// become one surface.
    pub fn squares(
        words: &str,
        colour: RGBColor,
        side_m: f64,
        middles: impl IntoIterator<Item = Point2<f64>>,
    ) -> Self {
        let mut rows: Vec<[Point2<f64>; 2]> = Vec::new();
        for middle in middles {
            let joins = |last: Point2<f64>| {
                let step = middle - last;
                step.y.abs() < 0.01 * side_m && step.x > 0.0 && step.x < 1.01 * side_m
            };
            match rows.last_mut() {
                Some([_, last]) if joins(*last) => *last = middle,
                _ => rows.push([middle, middle]),
            }
        }
        let surface = |[first, last]: [Point2<f64>; 2]| {
            let half = 0.5 * side_m;
            let [left, right] = [first.x - half, last.x + half];
            // A little over the next row, or a seam of the paper shows between the two.
            let [low, high] = [first.y - 1.2 * half, first.y + 1.2 * half];
            [[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| Point2::new(x, y)).to_vec()
        };
        Self::surfaces(words, colour, rows.into_iter().map(surface).collect())
    }

    /// Words beside places, which need no explanation.
    pub fn names(names: Vec<(Point2<f64>, String)>) -> Self {
        Self::new("", BLACK, Glyph::Dot(0.0), Shape::Names(names))
    }

    /// This layer, of which this share covers what is below.
    #[must_use]
    pub fn covering(mut self, share: f64) -> Self {
        self.entry.colour = self.entry.colour.mix(share);
        self
    }

    fn new(words: &str, colour: RGBColor, glyph: Glyph, shape: Shape) -> Self {
        Self { entry: Entry { glyph, colour: colour.to_rgba(), words: words.to_owned() }, shape }
    }
}

/// A drawing in metres, the same in both directions.
#[derive(Debug, Clone)]
pub struct Plan {
    title: String,
    axes: [String; 2],
    low: Point2<f64>,
    high: Point2<f64>,
    px_per_m: f64,
    layers: Vec<Layer>,
}

impl Plan {
    /// A plan of the ground between two corners, as large as fits into this many pixels to each side. With a
    /// title of its own where there are several on a sheet.
    pub fn new(title: &str, low: Point2<f64>, high: Point2<f64>, [width_px, height_px]: [f64; 2]) -> Self {
        let side = |low: f64, high: f64| if high - low > 1e-9 { high - low } else { 1.0 };
        let (width_m, height_m) = (side(low.x, high.x), side(low.y, high.y));
        let high = Point2::new(low.x + width_m, low.y + height_m);
        Self {
            title: title.to_owned(),
            axes: ["x [m]".to_owned(), "y [m]".to_owned()],
            low,
            high,
            px_per_m: (width_px / width_m).min(height_px / height_m),
            layers: Vec::new(),
        }
    }

    /// Other names for the axes than x and y; their unit stays the metre.
    #[must_use]
    pub fn with_axes(mut self, across: &str, up: &str) -> Self {
        self.axes = [across, up].map(|name| format!("{name} [m]"));
        self
    }

    /// With these marks over those that are there.
    #[must_use]
    pub fn with(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// Whether a place lies on the plan.
    pub fn shows(&self, place: Point2<f64>) -> bool {
        (self.low.x..=self.high.x).contains(&place.x) && (self.low.y..=self.high.y).contains(&place.y)
    }

    /// The whole of it, with axes, scale bar and legend.
    pub(crate) fn size_px(&self) -> [f64; 2] {
        let [width_px, height_px] = self.ground_px();
        let entries = self.entries();
        let legend = Legend::new(&entries, self.legend_width_px());
        [self.width_px(width_px), self.head_px() + height_px + BELOW_PX + SCALE_BAR_PX + legend.height_px()]
    }

    /// Draws it with its upper left corner there.
    pub(crate) fn draw(&self, canvas: &Canvas<'_>, left_px: f64, top_px: f64) -> Result<(), PictureError> {
        let [width_px, height_px] = self.ground_px();
        let (left_px, top_px) = (left_px + LEFT_PX, top_px + self.head_px());
        if !self.title.is_empty() {
            let style = text(14.0, HPos::Left, VPos::Bottom);
            text_at(canvas, &self.title, (px(left_px), px(top_px - 8.0)), &style)?;
        }
        let map = Map { low: self.low, origin_px: [left_px, top_px + height_px], px_per_m: self.px_per_m };
        self.draw_axes(canvas, &map, [width_px, height_px])?;
        for layer in &self.layers {
            draw_layer(canvas, &map, layer)?;
        }
        let below_px = top_px + height_px + BELOW_PX;
        self.draw_scale_bar(canvas, left_px, below_px)?;
        let entries = self.entries();
        Legend::new(&entries, self.legend_width_px()).draw(canvas, left_px, below_px + SCALE_BAR_PX)
    }

    fn draw_axes(
        &self,
        canvas: &Canvas<'_>,
        map: &Map,
        [width_px, height_px]: [f64; 2],
    ) -> Result<(), PictureError> {
        let [left, bottom] = map.origin_px;
        let thin = GREY.mix(0.22).stroke_width(px(0.75) as u32);
        let line = |from: [f64; 2], to: [f64; 2], style| {
            let ends = [from, to].map(|[x, y]| (px(x), px(y)));
            canvas.draw(&PathElement::new(ends.to_vec(), style)).map_err(PictureError::of)
        };
        let across = ticks(self.low.x, self.high.x, ticks_for(width_px), false);
        let numbers = text(LETTERS_PX, HPos::Center, VPos::Top);
        for &x_m in &across {
            let x = map.px(Point2::new(x_m, self.low.y))[0];
            line([x, bottom], [x, bottom - height_px], thin)?;
            text_at(canvas, &tick_label(x_m, &across), (px(x), px(bottom + 5.0)), &numbers)?;
        }
        let up = ticks(self.low.y, self.high.y, ticks_for(height_px), false);
        let numbers = text(LETTERS_PX, HPos::Right, VPos::Center);
        for &y_m in &up {
            let y = map.px(Point2::new(self.low.x, y_m))[1];
            line([left, y], [left + width_px, y], thin)?;
            text_at(canvas, &tick_label(y_m, &up), (px(left - 6.0), px(y)), &numbers)?;
        }
        let frame = [(px(left), px(bottom - height_px)), (px(left + width_px), px(bottom))];
        let frame = Rectangle::new(frame, GREY.stroke_width(px(1.0) as u32));
        canvas.draw(&frame).map_err(PictureError::of)?;
        let name = text(LETTERS_PX, HPos::Center, VPos::Top);
        text_at(canvas, &self.axes[0], (px(left + 0.5 * width_px), px(bottom + 21.0)), &name)?;
        let name = upright(text(LETTERS_PX, HPos::Center, VPos::Top));
        text_at(canvas, &self.axes[1], (px(left - LEFT_PX + 4.0), px(bottom - 0.5 * height_px)), &name)
    }

    /// A length that people know, in the picture's scale.
    fn draw_scale_bar(&self, canvas: &Canvas<'_>, left_px: f64, top_px: f64) -> Result<(), PictureError> {
        let width_m = (self.high.x - self.low.x).min(self.high.y - self.low.y);
        let lengths = ticks(0.0, 0.5 * width_m, 4, false);
        let length_m = lengths.get(1).copied().unwrap_or(width_m);
        let (end_px, middle_px) = (left_px + length_m * self.px_per_m, top_px + 8.0);
        let strokes =
            [[left_px, 0.0, end_px, 0.0], [left_px, -4.0, left_px, 4.0], [end_px, -4.0, end_px, 4.0]];
        for [from_x, from_y, to_x, to_y] in strokes {
            let ends = vec![(px(from_x), px(middle_px + from_y)), (px(to_x), px(middle_px + to_y))];
            let bar = PathElement::new(ends, BLACK.stroke_width(px(2.0) as u32));
            canvas.draw(&bar).map_err(PictureError::of)?;
        }
        let style = text(LETTERS_PX, HPos::Left, VPos::Center);
        let words = format!("{} m", tick_label(length_m, &[0.0, length_m]));
        text_at(canvas, &words, (px(end_px + 8.0), px(middle_px)), &style)
    }

    fn entries(&self) -> Vec<Entry> {
        let told = self.layers.iter().map(|layer| &layer.entry).filter(|entry| !entry.words.is_empty());
        told.cloned().collect()
    }

    fn ground_px(&self) -> [f64; 2] {
        [self.high.x - self.low.x, self.high.y - self.low.y].map(|side_m| side_m * self.px_per_m)
    }

    fn head_px(&self) -> f64 {
        if self.title.is_empty() { 6.0 } else { 26.0 }
    }

    /// A narrow plan leaves its legend room.
    fn width_px(&self, ground_px: f64) -> f64 {
        LEFT_PX + ground_px.max(360.0) + RIGHT_PX
    }

    fn legend_width_px(&self) -> f64 {
        self.width_px(self.ground_px()[0]) - LEFT_PX - RIGHT_PX
    }
}

/// Numbers need room between them.
fn ticks_for(side_px: f64) -> usize {
    ((side_px / 55.0) as usize).clamp(2, TICKS_MOST)
}

/// From metres to the canvas.
struct Map {
    low: Point2<f64>,
    /// Where `low` lies, in pixels; y grows downwards.
    origin_px: [f64; 2],
    px_per_m: f64,
}

impl Map {
    fn px(&self, place: Point2<f64>) -> [f64; 2] {
        let [x, y] = self.origin_px;
        [x + (place.x - self.low.x) * self.px_per_m, y - (place.y - self.low.y) * self.px_per_m]
    }

    fn at(&self, place: Point2<f64>) -> (i32, i32) {
        let [x, y] = self.px(place);
        (px(x), px(y))
    }
}

fn draw_layer(canvas: &Canvas<'_>, map: &Map, layer: &Layer) -> Result<(), PictureError> {
    let Entry { glyph, colour, .. } = layer.entry;
    let stroke = |width_px: f64| colour.stroke_width(px(width_px).max(1) as u32);
    let drawn = match &layer.shape {
        Shape::Lines(lines) => lines.iter().try_for_each(|line| {
            let corners: Vec<(i32, i32)> = line.iter().map(|&place| map.at(place)).collect();
            match glyph {
                Glyph::Area => canvas.draw(&Polygon::new(corners, colour)),
                Glyph::Dashed(width_px) => corners
                    .windows(2)
                    .step_by(2)
                    .try_for_each(|piece| canvas.draw(&PathElement::new(piece.to_vec(), stroke(width_px)))),
                Glyph::Line(width_px) => canvas.draw(&PathElement::new(corners, stroke(width_px))),
                _ => Ok(()),
            }
        }),
        Shape::Places(places) => places.iter().try_for_each(|&place| match glyph {
            Glyph::Ring(radius_px) => {
                canvas.draw(&Circle::new(map.at(place), px(radius_px) as u32, stroke(2.0)))
            }
            Glyph::Cross(reach_px) => [1, -1].into_iter().try_for_each(|side| {
                let ((x, y), reach) = (map.at(place), px(reach_px));
                let line = vec![(x - reach, y - side * reach), (x + reach, y + side * reach)];
                canvas.draw(&PathElement::new(line, stroke(1.5)))
            }),
            Glyph::Dot(radius_px) => {
                canvas.draw(&Circle::new(map.at(place), px(radius_px) as u32, colour.filled()))
            }
            _ => Ok(()),
        }),
        Shape::Poses(poses) => poses.iter().try_for_each(|pose| {
            let Glyph::Arrow(length_px) = glyph else { return Ok(()) };
            let [x, y] = map.px(pose.position());
            let (sine, cosine) = pose.heading_rad.sin_cos();
            let end = (px(x + length_px * cosine), px(y - length_px * sine));
            canvas.draw(&PathElement::new(vec![(px(x), px(y)), end], stroke(2.0)))?;
            canvas.draw(&Circle::new((px(x), px(y)), px(3.0) as u32, colour.filled()))
        }),
        Shape::Names(names) => names.iter().try_for_each(|(place, name)| {
            let [x, y] = map.px(*place);
            let (left, bottom) = (x + 8.0, y - 4.0);
            // Paper behind it, so that it can be read over lines.
            let right = left + letters_width_px(name, NAMES_PX);
            let paper = [(px(left - 2.0), px(bottom - NAMES_PX)), (px(right + 2.0), px(bottom + 2.0))];
            canvas.draw(&Rectangle::new(paper, WHITE.mix(0.75).filled()))?;
            let style = text(NAMES_PX, HPos::Left, VPos::Bottom);
            canvas.draw(&Text::new(name.clone(), (px(left), px(bottom)), style))
        }),
    };
    drawn.map_err(PictureError::of)
}
