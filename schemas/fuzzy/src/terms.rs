//! Membership functions: every shape that the field's tools share, as one plain enum.
//!
//! Formulas: Jang, Sun & Mizutani 1997, chapter 2, for triangle, trapezoid, Gaussian, bell and sigmoids;
//! Zadeh's S and Z curves; spike, cosine, concave and ramp as fuzzylite defines them (its manual, "linguistic
//! terms").

use std::f64::consts::PI;

/// A membership function over a variable's universe, or the value of a Sugeno conclusion.
#[derive(Debug, Clone, PartialEq)]
pub enum Term {
    /// Feet `a`, `c`, top `b`; `a` or `c` may be infinite for a shoulder.
    Triangle([f64; 3]),
    /// Feet `a`, `d`, top `b` to `c`; `a` or `d` may be infinite for a shoulder.
    Trapezoid([f64; 4]),
    /// 0 at `start`, 1 at `end` and beyond; falls if `end < start`.
    Ramp([f64; 2]),
    /// 1 from `start` to `end`.
    Rectangle([f64; 2]),
    /// Straight lines through (x, degree), constant beyond the first and the last point.
    Points(Vec<(f64, f64)>),
    /// `mean, deviation`.
    Gaussian([f64; 2]),
    /// `mean, deviation` of the left flank, `mean, deviation` of the right one; the product of both.
    GaussianProduct([f64; 4]),
    /// `center, width, slope`: `1 / (1 + |(x - center) / width|^(2 slope))`.
    Bell([f64; 3]),
    /// `inflection, slope`: `1 / (1 + exp(-slope (x - inflection)))`.
    Sigmoid([f64; 2]),
    /// `left, rising, falling, right`: the distance between the sigmoids (left, rising) and (right, falling).
    SigmoidDifference([f64; 4]),
    /// `left, rising, falling, right`: the product of the sigmoids (left, rising) and (right, falling).
    SigmoidProduct([f64; 4]),
    /// `start, end`: two parabolas up from 0 to 1.
    SShape([f64; 2]),
    /// `start, end`: two parabolas down from 1 to 0.
    ZShape([f64; 2]),
    /// `bottom left, top left, top right, bottom right`: an S shape times a Z shape.
    PiShape([f64; 4]),
    /// `center, width`: one period of a raised cosine.
    Cosine([f64; 2]),
    /// `inflection, end`: a hyperbola that reaches 1 at `end`; falls if `end < inflection`.
    Concave([f64; 2]),
    /// `center, width`: `exp(-|10 (x - center) / width|)`.
    Spike([f64; 2]),
    /// `start, direction`: 1 from `start` on, towards the sign of `direction`.
    Binary([f64; 2]),
    /// A single value: 1 there and 0 elsewhere, or the value of a Sugeno conclusion of order zero.
    Singleton(f64),
    /// A Sugeno conclusion of order one: a factor for each input variable in their order, then the constant.
    Linear(Vec<f64>),
}

/// What is wrong with a term's numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TermError {
    /// A number is NaN, or infinite where no shoulder can be.
    #[error("the term has a number that is not finite: {0}")]
    NotFinite(f64),
    /// Corners that must not decrease do.
    #[error("the term's corners must not decrease, but {0} comes before {1}")]
    Decreasing(f64, f64),
    /// A width, deviation or distance that must be positive is not.
    #[error("the term's width must be positive, but is {0}")]
    Width(f64),
    /// A degree outside [0, 1].
    #[error("a degree of membership lies in [0, 1], but one is {0}")]
    Degree(f64),
    /// A list without points.
    #[error("the term has no points")]
    Empty,
}

/// A straight part of a membership function: degree `y0` at `x0` to degree `y1` at `x1 > x0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) x0: f64,
    pub(crate) y0: f64,
    pub(crate) x1: f64,
    pub(crate) y1: f64,
}

impl Piece {
    /// The degree at `x`, the piece being prolonged.
    pub(crate) fn at(&self, x: f64) -> f64 {
        self.y0 + (self.y1 - self.y0) * ((x - self.x0) / (self.x1 - self.x0))
    }
}

impl Term {
    /// The degree of membership of `x`, in [0, 1]; NaN for NaN. A Sugeno conclusion of order one has none:
    /// NaN.
    pub fn membership(&self, x: f64) -> f64 {
        if x.is_nan() {
            return f64::NAN;
        }
        match *self {
            Self::Triangle([a, b, c]) => trapezoid(x, [a, b, b, c]),
            Self::Trapezoid(corners) => trapezoid(x, corners),
            Self::Ramp([start, end]) if start < end => ((x - start) / (end - start)).clamp(0.0, 1.0),
            Self::Ramp([start, end]) => ((start - x) / (start - end)).clamp(0.0, 1.0),
            Self::Rectangle([start, end]) => indicator(x >= start && x <= end),
            Self::Points(ref points) => interpolate(points, x),
            Self::Gaussian([mean, deviation]) => gaussian(x, mean, deviation),
            Self::GaussianProduct([left, left_deviation, right, right_deviation]) => {
                let rise = if x <= left { gaussian(x, left, left_deviation) } else { 1.0 };
                let fall = if x >= right { gaussian(x, right, right_deviation) } else { 1.0 };
                rise * fall
            }
            Self::Bell([center, width, slope]) => {
                1.0 / (1.0 + ((x - center) / width).abs().powf(2.0 * slope))
            }
            Self::Sigmoid([inflection, slope]) => sigmoid(x, inflection, slope),
            Self::SigmoidDifference([left, rising, falling, right]) => {
                (sigmoid(x, left, rising) - sigmoid(x, right, falling)).abs()
            }
            Self::SigmoidProduct([left, rising, falling, right]) => {
                sigmoid(x, left, rising) * sigmoid(x, right, falling)
            }
            Self::SShape([start, end]) => s_shape(x, start, end),
            Self::ZShape([start, end]) => 1.0 - s_shape(x, start, end),
            Self::PiShape([a, b, c, d]) => s_shape(x, a, b) * (1.0 - s_shape(x, c, d)),
            Self::Cosine([center, width]) if (x - center).abs() > 0.5 * width => 0.0,
            Self::Cosine([center, width]) => 0.5 * (1.0 + (2.0 / width * PI * (x - center)).cos()),
            Self::Concave([inflection, end]) if inflection <= end && x < end => {
                (end - inflection) / (2.0 * end - inflection - x)
            }
            Self::Concave([inflection, end]) if inflection > end && x > end => {
                (inflection - end) / (inflection - 2.0 * end + x)
            }
            Self::Concave(_) => 1.0,
            Self::Spike([center, width]) => (-(10.0 / width * (x - center)).abs()).exp(),
            Self::Binary([start, direction]) => {
                indicator(if direction > 0.0 { x >= start } else { x <= start })
            }
            Self::Singleton(value) => indicator((x - value).abs() <= 0.0),
            Self::Linear(_) => f64::NAN,
        }
    }

    /// Refuses numbers that describe no membership function.
    pub fn check(&self) -> Result<(), TermError> {
        let widths: &[f64] = match self {
            Self::Triangle([a, b, c]) => return corners(&[*a, *b, *b, *c]),
            Self::Trapezoid(all) => return corners(all),
            Self::Ramp([start, end]) | Self::Concave([start, end]) => &[(end - start).abs()],
            Self::Rectangle([start, end]) | Self::SShape([start, end]) | Self::ZShape([start, end]) => {
                &[end - start]
            }
            Self::Points(points) => return polyline(points),
            Self::Linear(factors) if factors.is_empty() => return Err(TermError::Empty),
            Self::Linear(factors) => return finite(factors),
            Self::GaussianProduct([_, left, _, right]) => &[*left, *right],
            Self::Bell([_, width, slope]) => &[*width, *slope],
            Self::PiShape([a, b, c, d]) => &[b - a, d - c],
            Self::Gaussian([_, width]) | Self::Cosine([_, width]) | Self::Spike([_, width]) => &[*width],
            Self::Sigmoid(_) | Self::SigmoidDifference(_) | Self::SigmoidProduct(_) | Self::Binary(_) => &[],
            Self::Singleton(_) => &[],
        };
        match self {
            Self::Binary([start, direction]) if !direction.is_nan() => finite(&[*start])?,
            other => finite(&other.numbers())?,
        }
        match widths.iter().find(|width| **width <= 0.0) {
            Some(width) => Err(TermError::Width(*width)),
            None => Ok(()),
        }
    }

    /// The numbers that describe the term, in the order of its documentation; points as x, y, x, y.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Triangle(n) | Self::Bell(n) => n.to_vec(),
            Self::Trapezoid(n)
            | Self::GaussianProduct(n)
            | Self::SigmoidDifference(n)
            | Self::SigmoidProduct(n)
            | Self::PiShape(n) => n.to_vec(),
            Self::Ramp(n)
            | Self::Rectangle(n)
            | Self::Gaussian(n)
            | Self::Sigmoid(n)
            | Self::SShape(n)
            | Self::ZShape(n)
            | Self::Cosine(n)
            | Self::Concave(n)
            | Self::Spike(n)
            | Self::Binary(n) => n.to_vec(),
            Self::Points(points) => points.iter().flat_map(|&(x, y)| [x, y]).collect(),
            Self::Singleton(value) => vec![*value],
            Self::Linear(factors) => factors.clone(),
        }
    }

    /// The corners of a membership function made of straight lines; a jump is two corners at one place.
    /// Beyond the first and the last the degree stays. `None` for curves and for values.
    pub(crate) fn corners(&self) -> Option<Vec<(f64, f64)>> {
        let all = match *self {
            Self::Triangle([a, b, c]) => vec![(a, 0.0), (b, 1.0), (c, 0.0)],
            Self::Trapezoid([a, b, c, d]) => vec![(a, 0.0), (b, 1.0), (c, 1.0), (d, 0.0)],
            Self::Ramp([start, end]) if start < end => vec![(start, 0.0), (end, 1.0)],
            Self::Ramp([start, end]) => vec![(end, 1.0), (start, 0.0)],
            Self::Rectangle([start, end]) => vec![(start, 0.0), (start, 1.0), (end, 1.0), (end, 0.0)],
            Self::Binary([start, direction]) if direction > 0.0 => vec![(start, 0.0), (start, 1.0)],
            Self::Binary([start, _]) => vec![(start, 1.0), (start, 0.0)],
            Self::Points(ref points) => points.clone(),
            _ => return None,
        };
        Some(all.into_iter().filter(|(x, _)| x.is_finite()).collect())
    }

    /// The straight parts over `low..high`, without gaps; `None` for curves and for values.
    pub(crate) fn pieces(&self, low: f64, high: f64) -> Option<Vec<Piece>> {
        let corners = self.corners()?;
        let (first, last) = (*corners.first()?, *corners.last()?);
        let ends = [(low.min(first.0), first.1), (high.max(last.0), last.1)];
        let all: Vec<_> = [ends[0]].into_iter().chain(corners).chain([ends[1]]).collect();
        let pieces =
            all.windows(2).map(|pair| Piece { x0: pair[0].0, y0: pair[0].1, x1: pair[1].0, y1: pair[1].1 });
        let cut = pieces.filter(|piece| piece.x1.min(high) > piece.x0.max(low)).map(|piece| {
            let (x0, x1) = (piece.x0.max(low), piece.x1.min(high));
            Piece { x0, y0: piece.at(x0), x1, y1: piece.at(x1) }
        });
        Some(cut.collect())
    }

    /// Places where a curve bends sharply or its parts meet: where an adaptive integral should be divided.
    pub(crate) fn joints(&self) -> Vec<f64> {
        match *self {
            Self::Gaussian([m, s]) => vec![m - 3.0 * s, m - s, m, m + s, m + 3.0 * s],
            Self::GaussianProduct([a, s, b, t]) => vec![a - 3.0 * s, a - s, a, b, b + t, b + 3.0 * t],
            Self::Bell([center, width, _]) => vec![center - width, center, center + width],
            Self::Sigmoid([inflection, _]) => vec![inflection],
            Self::SigmoidDifference([left, _, _, right]) | Self::SigmoidProduct([left, _, _, right]) => {
                vec![left, right]
            }
            Self::SShape([a, b]) | Self::ZShape([a, b]) => vec![a, 0.5 * (a + b), b],
            Self::PiShape([a, b, c, d]) => vec![a, 0.5 * (a + b), b, c, 0.5 * (c + d), d],
            Self::Cosine([center, width]) => vec![center - 0.5 * width, center, center + 0.5 * width],
            Self::Concave([_, end]) => vec![end],
            Self::Spike([center, width]) => vec![center - 0.2 * width, center, center + 0.2 * width],
            _ => self.corners().unwrap_or_default().into_iter().map(|(x, _)| x).collect(),
        }
    }
}

fn indicator(inside: bool) -> f64 {
    if inside { 1.0 } else { 0.0 }
}

/// Corners that coincide make an upright flank, which belongs to the term.
fn trapezoid(x: f64, [a, b, c, d]: [f64; 4]) -> f64 {
    if x < a || x > d {
        0.0
    } else if x < b {
        if a.is_infinite() { 1.0 } else { (x - a) / (b - a) }
    } else if x <= c || d.is_infinite() {
        1.0
    } else {
        (d - x) / (d - c)
    }
}

fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let after = points.partition_point(|point| point.0 <= x);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (None, None) => 0.0,
        (None, Some(&(_, y))) | (Some((_, y)), None) => y,
        (Some((x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * ((x - x0) / (x1 - x0)),
    }
}

fn gaussian(x: f64, mean: f64, deviation: f64) -> f64 {
    (-(x - mean) * (x - mean) / (2.0 * deviation * deviation)).exp()
}

fn sigmoid(x: f64, inflection: f64, slope: f64) -> f64 {
    1.0 / (1.0 + (-slope * (x - inflection)).exp())
}

fn s_shape(x: f64, start: f64, end: f64) -> f64 {
    let part = (x - start) / (end - start);
    if part <= 0.0 {
        0.0
    } else if part <= 0.5 {
        2.0 * part * part
    } else if part < 1.0 {
        1.0 - 2.0 * (1.0 - part) * (1.0 - part)
    } else {
        1.0
    }
}

fn finite(numbers: &[f64]) -> Result<(), TermError> {
    match numbers.iter().find(|number| !number.is_finite()) {
        Some(number) => Err(TermError::NotFinite(*number)),
        None => Ok(()),
    }
}

fn not_decreasing(numbers: impl Iterator<Item = f64> + Clone) -> Result<(), TermError> {
    match numbers.clone().zip(numbers.skip(1)).find(|(before, after)| before > after) {
        Some((before, after)) => Err(TermError::Decreasing(before, after)),
        None => Ok(()),
    }
}

/// The outer corners may be infinite outwards.
fn corners(all: &[f64; 4]) -> Result<(), TermError> {
    finite(&all[1..3])?;
    for (outer, bad) in [(all[0], f64::INFINITY), (all[3], f64::NEG_INFINITY)] {
        if outer.is_nan() || outer.total_cmp(&bad).is_eq() {
            return Err(TermError::NotFinite(outer));
        }
    }
    not_decreasing(all.iter().copied())?;
    if all[3] > all[0] { Ok(()) } else { Err(TermError::Width(all[3] - all[0])) }
}

fn polyline(points: &[(f64, f64)]) -> Result<(), TermError> {
    if points.is_empty() {
        return Err(TermError::Empty);
    }
    for &(x, y) in points {
        finite(&[x, y])?;
        if !(0.0..=1.0).contains(&y) {
            return Err(TermError::Degree(y));
        }
    }
    not_decreasing(points.iter().map(|point| point.0))
}
