//! What samples say: means with their uncertainty, rates with theirs, what a change has changed, quantiles.

use std::f64::consts::FRAC_2_PI;

/// The normal distribution's two-sided 95 % quantile.
const Z_95: f64 = 1.959_963_984_540_054;

/// A sample in four numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Summary {
    /// How many values.
    pub(crate) count: usize,
    /// Their mean.
    pub(crate) mean: f64,
    /// Their standard deviation (n - 1); NaN for a single value.
    pub(crate) deviation: f64,
    /// The 95 % interval of the mean reaches so far to each side (Student's t); NaN for a single value.
    pub(crate) margin: f64,
}

impl Summary {
    /// The ends of the 95 % interval of the mean; `None` for a single value.
    pub(crate) fn interval(&self) -> Option<[f64; 2]> {
        (!self.margin.is_nan()).then_some([self.mean - self.margin, self.mean + self.margin])
    }

    /// Whether the interval leaves out 0: of a difference, that there is one.
    pub(crate) fn is_apart_from_zero(&self) -> bool {
        self.interval().is_some_and(|[low, high]| low > 0.0 || high < 0.0)
    }
}

/// Mean, standard deviation and 95 % interval; `None` without values.
pub(crate) fn summary(values: &[f64]) -> Option<Summary> {
    let count = values.len();
    if count == 0 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / count as f64;
    if count == 1 {
        return Some(Summary { count, mean, deviation: f64::NAN, margin: f64::NAN });
    }
    let freedom = count - 1;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let deviation = (squares / freedom as f64).sqrt();
    let margin = student_quantile(freedom) * deviation / (count as f64).sqrt();
    Some(Summary { count, mean, deviation, margin })
}

/// The 95 % interval of a rate by Wilson (1927): sound also for no or all successes, where the textbook's
/// interval has no width.
pub(crate) fn wilson(successes: usize, count: usize) -> Option<(f64, f64)> {
    if count == 0 {
        return None;
    }
    let (n, rate) = (count as f64, successes as f64 / count as f64);
    let scale = 1.0 + Z_95 * Z_95 / n;
    let middle = (rate + Z_95 * Z_95 / (2.0 * n)) / scale;
    let reach = Z_95 / scale * (rate * (1.0 - rate) / n + Z_95 * Z_95 / (4.0 * n * n)).sqrt();
    let low = if successes == 0 { 0.0 } else { middle - reach };
    let high = if successes == count { 1.0 } else { middle + reach };
    Some((low.max(0.0), high.min(1.0)))
}

/// Within ± this lie 95 % of Student's distribution with so many degrees of freedom.
pub(crate) fn student_quantile(freedom: usize) -> f64 {
    if freedom == 0 {
        return f64::NAN;
    }
    // One degree has the longest tails, and its quantile is 12.7.
    let (mut low, mut high) = (0.0_f64, 16.0_f64);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if student_within(middle, freedom) < 0.95 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The share of Student's distribution within ±t: Abramowitz and Stegun 26.7.3 (odd) and 26.7.4 (even).
fn student_within(t: f64, freedom: usize) -> f64 {
    let angle = (t / (freedom as f64).sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let odd = freedom % 2 == 1;
    let (mut term, first) = if odd { (cosine, 3) } else { (1.0, 2) };
    let mut sum = if freedom == 1 { 0.0 } else { term };
    for power in (first..freedom - usize::from(freedom > 1)).step_by(2) {
        let power = power as f64;
        // Odd: 2/3, 4/5, ..; even: 1/2, 3/4, ..: the same quotient counted from another beginning.
        term *= cosine * cosine * (power - 1.0) / power;
        sum += term;
    }
    if odd { FRAC_2_PI * (angle + sine * sum) } else { sine * sum }
}

/// How likely pairs of runs are to pass so unevenly when it makes no difference which of the two it is:
/// McNemar's test, exact and two-sided, of the pairs in which only the one or only the other passed. 1
/// without such pairs.
pub(crate) fn mcnemar(only_one: usize, only_other: usize) -> f64 {
    let (less, all) = (only_one.min(only_other), only_one + only_other);
    // Of all ways in which as many coins can fall, those at least as uneven to one side; by logarithms, since
    // 2^1100 is no number.
    let half_power = -(all as f64) * std::f64::consts::LN_2;
    let (mut ways_ln, mut tail) = (0.0_f64, 0.0_f64);
    for count in 0..=less {
        if count > 0 {
            ways_ln += ((all - count + 1) as f64 / count as f64).ln();
        }
        tail += (ways_ln + half_power).exp();
    }
    (2.0 * tail).min(1.0)
}

/// The values in order, for [`quantile`].
pub(crate) fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// The value below which a share of the sorted values lies, linear between neighbours (Hyndman and Fan 1996,
/// type 7); `None` without values.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = place.floor();
    let (low, high) = (sorted[below as usize], sorted[(below as usize + 1).min(last)]);
    Some(low + (place - below) * (high - low))
}

#[cfg(test)]
mod tests;
