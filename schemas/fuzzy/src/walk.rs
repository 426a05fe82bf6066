//! A walk along the accumulated conclusion of terms made of straight lines: exact, for every defuzzification.

use super::norms::{SNorm, TNorm, smaller};
use super::system::Method;
use super::terms::Piece;

/// Degrees nearer to the highest one than this share its rank.
const SAME_DEGREE: f64 = 1e-12;

#[derive(Debug, Clone)]
pub(crate) struct Walk {
    product: bool,
    accumulation: SNorm,
    low: f64,
    high: f64,
    cells: Vec<Cell>,
    lines: Vec<Line>,
    active: Vec<Active>,
    cuts: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Cell {
    x0: f64,
    x1: f64,
    lines: std::ops::Range<usize>,
}

/// A term inside a cell, by its degrees at both ends.
#[derive(Debug, Clone, Copy)]
struct Line {
    entry: usize,
    y0: f64,
    y1: f64,
}

#[derive(Debug, Clone, Copy)]
struct Active {
    y0: f64,
    y1: f64,
    cap: f64,
    /// Values at the ends of the part that is being walked.
    start: f64,
    end: f64,
}

impl Walk {
    /// `None` unless activation and accumulation keep straight lines straight.
    pub(crate) fn new(
        entries: &[Vec<Piece>],
        (low, high): (f64, f64),
        activation: TNorm,
        accumulation: SNorm,
    ) -> Option<Self> {
        let product = activation == TNorm::Product;
        let straight = matches!(accumulation, SNorm::Maximum | SNorm::BoundedSum | SNorm::NormalisedSum);
        if !straight || !(product || activation == TNorm::Minimum) {
            return None;
        }
        let mut ends: Vec<f64> = entries.iter().flatten().flat_map(|piece| [piece.x0, piece.x1]).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|after, before| *after <= *before);
        let (mut cells, mut lines) = (Vec::new(), Vec::new());
        for pair in ends.windows(2) {
            let (x0, x1) = (pair[0], pair[1]);
            let middle = 0.5 * (x0 + x1);
            let first = lines.len();
            for (entry, pieces) in entries.iter().enumerate() {
                if let Some(piece) = pieces.iter().find(|piece| piece.x0 <= middle && middle <= piece.x1) {
                    let (y0, y1) = (piece.at(x0), piece.at(x1));
                    if y0 + y1 > 0.0 {
                        lines.push(Line { entry, y0, y1 });
                    }
                }
            }
            cells.push(Cell { x0, x1, lines: first..lines.len() });
        }
        let (active, cuts) = (Vec::with_capacity(entries.len()), Vec::with_capacity(entries.len() + 2));
        Some(Self { product, accumulation, low, high, cells, lines, active, cuts })
    }

    pub(crate) fn defuzzify(&mut self, degrees: &[f64], method: Method) -> Option<f64> {
        match method {
            Method::Bisector => self.bisector(degrees),
            Method::MeanOfMaxima | Method::Leftmost | Method::Rightmost => self.maxima(degrees, method),
            _ => self.centroid(degrees),
        }
    }

    fn centroid(&mut self, degrees: &[f64]) -> Option<f64> {
        let centre = 0.5 * (self.low + self.high);
        let (mut area, mut moment) = (0.0, 0.0);
        self.pieces(degrees, |Piece { x0, y0, x1, y1 }| {
            let (x0, x1) = (x0 - centre, x1 - centre);
            area += 0.5 * (x1 - x0) * (y0 + y1);
            moment += (x1 - x0) * (y0 * (2.0 * x0 + x1) + y1 * (x0 + 2.0 * x1)) / 6.0;
        });
        (area > 0.0).then(|| centre + moment / area)
    }

    fn bisector(&mut self, degrees: &[f64]) -> Option<f64> {
        let mut area = 0.0;
        self.pieces(degrees, |piece| area += 0.5 * (piece.x1 - piece.x0) * (piece.y0 + piece.y1));
        if area <= 0.0 {
            return None;
        }
        let (mut left, mut place) = (0.5 * area, None);
        self.pieces(degrees, |Piece { x0, y0, x1, y1 }| {
            let width = x1 - x0;
            let part = 0.5 * width * (y0 + y1);
            if place.is_none() && part >= left {
                // y0 t + (y1 - y0) t² / 2 = left / width, in the form that does not cancel.
                let root = (y0 * y0 + 2.0 * (y1 - y0) * left / width).max(0.0).sqrt();
                let t = if y0 + root > 0.0 { 2.0 * left / width / (y0 + root) } else { 0.0 };
                place = Some(x0 + width * t.clamp(0.0, 1.0));
            }
            left -= part;
        });
        place.or(Some(self.high))
    }

    fn maxima(&mut self, degrees: &[f64], method: Method) -> Option<f64> {
        let mut highest: f64 = 0.0;
        self.pieces(degrees, |piece| highest = highest.max(piece.y0).max(piece.y1));
        if highest <= 0.0 {
            return None;
        }
        let (mut leftmost, mut rightmost) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut width, mut moment, mut peaks, mut places) = (0.0, 0.0, 0.0, 0.0);
        let mut last_peak = f64::NEG_INFINITY;
        self.pieces(degrees, |Piece { x0, y0, x1, y1 }| {
            let top = |y: f64| y >= highest - SAME_DEGREE;
            for (x, y) in [(x0, y0), (x1, y1)] {
                if top(y) {
                    leftmost = leftmost.min(x);
                    rightmost = rightmost.max(x);
                    if x > last_peak {
                        (peaks, places, last_peak) = (peaks + 1.0, places + x, x);
                    }
                }
            }
            if top(y0) && top(y1) {
                width += x1 - x0;
                moment += 0.5 * (x1 - x0) * (x0 + x1);
            }
        });
        Some(match method {
            Method::Leftmost => leftmost,
            Method::Rightmost => rightmost,
            _ if width > 0.0 => moment / width,
            _ => places / peaks,
        })
    }

    /// Calls `visit` for each straight part of the accumulated conclusion, from left to right; parts at zero
    /// are left out.
    fn pieces(&mut self, degrees: &[f64], mut visit: impl FnMut(Piece)) {
        for cell in &self.cells {
            self.active.clear();
            self.cuts.clear();
            for line in &self.lines[cell.lines.clone()] {
                let degree = degrees[line.entry];
                if degree <= 0.0 {
                    continue;
                }
                let (y0, y1, cap) = if self.product {
                    (line.y0 * degree, line.y1 * degree, 1.0)
                } else {
                    (line.y0, line.y1, degree)
                };
                self.active.push(Active { y0, y1, cap, start: 0.0, end: 0.0 });
                if (y0 - cap) * (y1 - cap) < 0.0 {
                    self.cuts.push((cap - y0) / (y1 - y0));
                }
            }
            if self.active.is_empty() {
                continue;
            }
            self.cuts.extend([0.0, 1.0]);
            self.cuts.sort_unstable_by(f64::total_cmp);
            for ends in self.cuts.windows(2) {
                if ends[1] <= ends[0] {
                    continue;
                }
                for line in &mut self.active {
                    line.start = smaller(line.cap, line.y0 + (line.y1 - line.y0) * ends[0]);
                    line.end = smaller(line.cap, line.y0 + (line.y1 - line.y0) * ends[1]);
                }
                let width = cell.x1 - cell.x0;
                let (x0, x1) = (cell.x0 + width * ends[0], cell.x0 + width * ends[1]);
                match self.accumulation {
                    SNorm::Maximum => envelope(&self.active, x0, x1, &mut visit),
                    sum => total(&self.active, x0, x1, sum == SNorm::BoundedSum, &mut visit),
                }
            }
        }
    }
}

/// The upper envelope of straight lines: stay on the highest until a steeper one crosses it.
fn envelope(lines: &[Active], x0: f64, x1: f64, visit: &mut impl FnMut(Piece)) {
    let slope = |line: &Active| line.end - line.start;
    let higher = |a: &Active, b: &Active| a.start > b.start || (a.start >= b.start && slope(a) > slope(b));
    let mut current = lines[0];
    for line in &lines[1..] {
        if higher(line, &current) {
            current = *line;
        }
    }
    let mut position = 0.0;
    loop {
        let (mut next, mut following) = (1.0, None);
        for line in lines {
            if slope(line) > slope(&current) {
                let crossing = (current.start - line.start) / (slope(line) - slope(&current));
                let steeper = following.is_some_and(|other: Active| slope(line) > slope(&other));
                if crossing > position && (crossing < next || (crossing <= next && steeper)) {
                    (next, following) = (crossing, Some(*line));
                }
            }
        }
        let at = |t: f64| (x0 + (x1 - x0) * t, current.start + slope(&current) * t);
        let ((left, y0), (right, y1)) = (at(position), at(next));
        visit(Piece { x0: left, y0, x1: right, y1 });
        match following {
            Some(line) => (current, position) = (line, next),
            None => return,
        }
    }
}

fn total(lines: &[Active], x0: f64, x1: f64, bounded: bool, visit: &mut impl FnMut(Piece)) {
    let y0: f64 = lines.iter().map(|line| line.start).sum();
    let y1: f64 = lines.iter().map(|line| line.end).sum();
    if bounded && (y0 - 1.0) * (y1 - 1.0) < 0.0 {
        let x = x0 + (x1 - x0) * (1.0 - y0) / (y1 - y0);
        visit(Piece { x0, y0: smaller(y0, 1.0), x1: x, y1: 1.0 });
        visit(Piece { x0: x, y0: 1.0, x1, y1: smaller(y1, 1.0) });
    } else if bounded {
        visit(Piece { x0, y0: smaller(y0, 1.0), x1, y1: smaller(y1, 1.0) });
    } else {
        visit(Piece { x0, y0, x1, y1 });
    }
}
