//! Defuzzification over samples of the universe, taken in the middle of equal steps: what most programs of
//! the field do, for comparison with them, and for curves where speed counts more than the last digits.
//! Memberships are tabulated once.

use super::norms::{SNorm, TNorm, larger, smaller};
use super::system::Method;
use super::terms::Term;
use std::ops::Range;

#[derive(Debug, Clone)]
pub(crate) struct Sampled {
    activation: TNorm,
    accumulation: SNorm,
    places: Vec<f64>,
    rows: Vec<Row>,
    accumulated: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Row {
    degrees: Vec<f64>,
    /// Where the degrees are above zero.
    support: Range<usize>,
}

impl Sampled {
    pub(crate) fn new(
        entries: &[Term],
        (low, high): (f64, f64),
        resolution: usize,
        activation: TNorm,
        accumulation: SNorm,
    ) -> Self {
        let step = (high - low) / resolution as f64;
        let places: Vec<f64> = (0..resolution).map(|index| low + (index as f64 + 0.5) * step).collect();
        let row = |term: &Term| {
            let degrees: Vec<f64> = places.iter().map(|x| term.membership(*x)).collect();
            let first = degrees.iter().position(|degree| *degree > 0.0).unwrap_or(resolution);
            let last = degrees.iter().rposition(|degree| *degree > 0.0).map_or(first, |last| last + 1);
            Row { degrees, support: first..last }
        };
        let rows = entries.iter().map(row).collect();
        Self { activation, accumulation, accumulated: vec![0.0; resolution], places, rows }
    }

    pub(crate) fn defuzzify(&mut self, degrees: &[f64], method: Method) -> Option<f64> {
        self.accumulate(degrees);
        match method {
            Method::Bisector => self.bisector(),
            Method::MeanOfMaxima | Method::Leftmost | Method::Rightmost => self.maxima(method),
            _ => self.centroid(),
        }
    }

    fn accumulate(&mut self, degrees: &[f64]) {
        self.accumulated.fill(0.0);
        for (row, &degree) in self.rows.iter().zip(degrees) {
            if degree <= 0.0 {
                continue;
            }
            let all = self.accumulated[row.support.clone()].iter_mut().zip(&row.degrees[row.support.clone()]);
            match (self.activation, self.accumulation) {
                (TNorm::Minimum, SNorm::Maximum) => {
                    all.for_each(|(sum, y)| *sum = larger(*sum, smaller(degree, *y)))
                }
                (TNorm::Product, SNorm::Maximum) => all.for_each(|(sum, y)| *sum = larger(*sum, degree * y)),
                (act, sum_of) => {
                    all.for_each(|(sum, y)| *sum = sum_of.accumulate(*sum, act.apply(degree, *y)))
                }
            }
        }
    }

    fn centroid(&self) -> Option<f64> {
        let (mut area, mut moment) = (0.0, 0.0);
        for (x, y) in self.places.iter().zip(&self.accumulated) {
            area += y;
            moment += x * y;
        }
        (area > 0.0).then(|| moment / area)
    }

    fn bisector(&self) -> Option<f64> {
        let mut left = 0.5 * self.accumulated.iter().sum::<f64>();
        if left <= 0.0 {
            return None;
        }
        for (x, y) in self.places.iter().zip(&self.accumulated) {
            left -= y;
            if left <= 0.0 {
                return Some(*x);
            }
        }
        self.places.last().copied()
    }

    fn maxima(&self, method: Method) -> Option<f64> {
        let highest = self.accumulated.iter().copied().fold(0.0, larger);
        if highest <= 0.0 {
            return None;
        }
        let mut tops = self
            .places
            .iter()
            .zip(&self.accumulated)
            .filter(|(_, y)| **y >= highest - 1e-12)
            .map(|(x, _)| *x);
        match method {
            Method::Leftmost => tops.next(),
            Method::Rightmost => tops.next_back(),
            _ => {
                let (count, sum) = tops.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
                Some(sum / count)
            }
        }
    }
}
