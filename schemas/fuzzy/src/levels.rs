//! The exact centroid of clipped terms under the maximum (or the plain sum), in closed form.
//!
//! A term `f` clipped at `c` has the area `∫₀ᶜ L(s) ds`, where `L(s)` is the length of the places with
//! `f > s`. For straight flanks `L` is a straight line between the heights of the corners, so area and first
//! moment are polynomials of `c` there. The maximum over several clipped terms follows by inclusion and
//! exclusion: the minimum over a set of clipped terms is the minimum of the terms clipped at the smallest
//! degree of the set, a function of straight lines again. So all geometry is done once, and a step only
//! evaluates a few cubic polynomials: no loop over the universe.

use super::norms::{larger, smaller};
use super::terms::Piece;
use std::collections::BTreeMap;

/// Overlaps of more terms than this at one place need too many sets; such systems take the walk over pieces
/// instead.
const MOST_OVERLAPPING: usize = 6;
const MOST_SETS: usize = 600;
/// Heights nearer to each other than this are one.
const SAME_HEIGHT: f64 = 1e-13;

#[derive(Debug, Clone)]
pub(crate) struct Levels {
    centre: f64,
    /// The degrees of the entries, then those of the sets of overlapping ones.
    degrees: Vec<f64>,
    entries: usize,
    /// Set after set: its degree is the smaller of these two earlier ones.
    joins: Vec<(u16, u16)>,
    slices: Vec<Slice>,
}

/// What a set contributes between two heights: polynomials of the height above the lower one, with the set's
/// sign.
#[derive(Debug, Clone, Copy)]
struct Slice {
    area: [f64; 2],
    moment: [f64; 3],
    low: f64,
    height: f64,
    source: u32,
}

impl Levels {
    /// Prepares entries given by their straight parts over the universe, from `low` to `high`. With
    /// `overlaps` they accumulate by the maximum, otherwise by the sum. `None` if too many of them overlap at
    /// one place.
    pub(crate) fn new(entries: &[Vec<Piece>], low: f64, high: f64, overlaps: bool) -> Option<Self> {
        let mut sets: BTreeMap<(usize, Vec<u16>), Vec<Piece>> = BTreeMap::new();
        for cell in cells(entries, overlaps)? {
            let chosen = 1_usize..(1 << cell.len());
            for members in chosen.filter(|members| overlaps || members.is_power_of_two()) {
                let inside =
                    || cell.iter().enumerate().filter(|(bit, _)| members >> bit & 1 == 1).map(|(_, m)| m);
                let (_, mut lowest) = *inside().next()?;
                for (_, piece) in inside() {
                    lowest.y0 = smaller(lowest.y0, piece.y0);
                    lowest.y1 = smaller(lowest.y1, piece.y1);
                }
                let names: Vec<u16> = inside().map(|(entry, _)| *entry).collect();
                push_merged(sets.entry((names.len(), names)).or_default(), lowest);
            }
            if sets.len() > MOST_SETS {
                return None;
            }
        }
        let centre = 0.5 * (low + high);
        let mut levels = Self {
            centre,
            degrees: vec![0.0; entries.len()],
            entries: entries.len(),
            joins: vec![],
            slices: vec![],
        };
        let mut places: BTreeMap<Vec<u16>, u16> = BTreeMap::new();
        for ((size, names), pieces) in sets {
            let place = if size == 1 {
                names[0]
            } else {
                levels.joins.push((*places.get(&names[..size - 1])?, names[size - 1]));
                levels.degrees.push(0.0);
                u16::try_from(levels.degrees.len() - 1).ok()?
            };
            let sign = if size % 2 == 1 { 1.0 } else { -1.0 };
            levels.slices.extend(slices(&pieces, centre, sign, u32::from(place)));
            places.insert(names, place);
        }
        Some(levels)
    }

    /// The centroid for the entries' degrees; `None` if there is no area.
    #[inline]
    pub(crate) fn centroid(&mut self, degrees: &[f64]) -> Option<f64> {
        self.degrees[..self.entries].copy_from_slice(degrees);
        for (index, (left, right)) in self.joins.iter().enumerate() {
            let both = smaller(self.degrees[usize::from(*left)], self.degrees[usize::from(*right)]);
            self.degrees[self.entries + index] = both;
        }
        let (mut area, mut moment) = (0.0, 0.0);
        for slice in &self.slices {
            let above = larger(smaller(self.degrees[slice.source as usize] - slice.low, slice.height), 0.0);
            area += above * (slice.area[0] + above * slice.area[1]);
            moment += above * (slice.moment[0] + above * (slice.moment[1] + above * slice.moment[2]));
        }
        (area > 0.0).then(|| self.centre + moment / area)
    }
}

type Cell = Vec<(u16, Piece)>;

/// The universe cut where a term bends or, if `overlaps`, two terms cross: in each cell the terms above zero.
fn cells(entries: &[Vec<Piece>], overlaps: bool) -> Option<Vec<Cell>> {
    let ends = entries.iter().flatten().flat_map(|piece| [piece.x0, piece.x1]);
    let coarse = cut(entries, sorted(ends))?;
    if !overlaps {
        return Some(coarse);
    }
    let mut places: Vec<f64> = Vec::new();
    for cell in &coarse {
        if cell.len() > MOST_OVERLAPPING {
            return None;
        }
        for (index, (_, a)) in cell.iter().enumerate() {
            places.extend([a.x0, a.x1]);
            for (_, b) in &cell[index + 1..] {
                let (before, after) = (a.y0 - b.y0, a.y1 - b.y1);
                if before * after < 0.0 {
                    places.push(a.x0 + (a.x1 - a.x0) * (before / (before - after)));
                }
            }
        }
    }
    cut(entries, sorted(places.into_iter()))
}

fn sorted(places: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut places: Vec<f64> = places.collect();
    places.sort_by(f64::total_cmp);
    places.dedup_by(|after, before| *after <= *before);
    places
}

fn cut(entries: &[Vec<Piece>], places: Vec<f64>) -> Option<Vec<Cell>> {
    let mut cells = Vec::new();
    for ends in places.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let mut cell = Vec::new();
        for (entry, pieces) in entries.iter().enumerate() {
            if let Some(piece) = pieces.iter().find(|piece| piece.x0 <= middle && middle <= piece.x1) {
                let part = Piece { x0: ends[0], y0: piece.at(ends[0]), x1: ends[1], y1: piece.at(ends[1]) };
                if part.y0 + part.y1 > 0.0 {
                    cell.push((u16::try_from(entry).ok()?, part));
                }
            }
        }
        cells.push(cell);
    }
    Some(cells)
}

/// Appends a piece, or prolongs the last one if both lie on one line.
fn push_merged(pieces: &mut Vec<Piece>, next: Piece) {
    let slope = |piece: &Piece| (piece.y1 - piece.y0) / (piece.x1 - piece.x0);
    if let Some(last) = pieces.last_mut() {
        let joined = last.x1 >= next.x0 && (last.y1 - next.y0).abs() <= SAME_HEIGHT;
        if joined && (slope(last) - slope(&next)).abs() <= 1e-9 * (1.0 + slope(last).abs()) {
            (last.x1, last.y1) = (next.x1, next.y1);
            return;
        }
    }
    pieces.push(next);
}

/// Area and moment about `centre` of a function of straight pieces, by bands between the heights of its
/// corners.
fn slices(pieces: &[Piece], centre: f64, sign: f64, source: u32) -> Vec<Slice> {
    let mut heights: Vec<f64> =
        [0.0].into_iter().chain(pieces.iter().flat_map(|piece| [piece.y0, piece.y1])).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|after, before| *after - *before <= SAME_HEIGHT);
    let mut all = Vec::new();
    for band in heights.windows(2) {
        let (low, height) = (band[0], band[1] - band[0]);
        // Length of the places above a height, and the moment of these places: polynomials of that height
        // over `low`.
        let (mut length, mut first) = ([0.0; 2], [0.0; 3]);
        for piece in pieces {
            let (x0, x1) = (piece.x0 - centre, piece.x1 - centre);
            if smaller(piece.y0, piece.y1) >= band[1] - 2.0 * SAME_HEIGHT {
                length[0] += x1 - x0;
                first[0] += 0.5 * (x1 * x1 - x0 * x0);
            } else if larger(piece.y0, piece.y1) >= band[1] - 2.0 * SAME_HEIGHT {
                let run = (x1 - x0) / (piece.y1 - piece.y0);
                let crossing = x0 + (low - piece.y0) * run;
                // A rising piece lies above from the crossing to its end, a falling one from its start to the
                // crossing.
                let (side, end) = if piece.y1 > piece.y0 { (1.0, x1) } else { (-1.0, x0) };
                length[0] += side * (end - crossing);
                length[1] -= side * run;
                first[0] += side * 0.5 * (end * end - crossing * crossing);
                first[1] -= side * crossing * run;
                first[2] -= side * 0.5 * run * run;
            }
        }
        let area = [sign * length[0], sign * length[1] / 2.0];
        let moment = [sign * first[0], sign * first[1] / 2.0, sign * first[2] / 3.0];
        all.push(Slice { area, moment, low, height, source });
    }
    all
}
