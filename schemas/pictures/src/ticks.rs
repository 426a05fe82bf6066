//! Where the marks of an axis stand, and what is written beside them.

/// Round numbers (1, 2 or 5 times a power of ten apart) from `low` to `high`, at most `most` of them; `whole`
/// for counts, which have no halves. Empty when there is nothing between the two, or they are no numbers.
pub fn ticks(low: f64, high: f64, most: usize, whole: bool) -> Vec<f64> {
    let Some(step) = step(low, high, most, whole) else { return Vec::new() };
    // A hair beyond the ends, since 0.3 is not three times 0.1.
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    let count = (last - first + 1.0).max(0.0) as usize;
    // Not a sum of steps, so that zero is zero.
    (0..count.min(most)).map(|index| (first + index as f64) * step).collect()
}

/// The number beside a mark among others, with as many decimals as they need to differ.
pub fn tick_label(value: f64, all: &[f64]) -> String {
    let step = all.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() && step > 0.0 { step } else { value.abs().max(1.0) };
    let decimals = (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize;
    let label = format!("{value:.decimals$}");
    if label.trim_start_matches(['-', '0', '.']).is_empty() { label.replace('-', "") } else { label }
}

/// The distance between marks.
fn step(low: f64, high: f64, most: usize, whole: bool) -> Option<f64> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) || most == 0 {
        return None;
    }
    let intervals = most.saturating_sub(1).max(1) as f64;
    let least = span / intervals;
    let power = 10.0_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power);
    let step = step.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(10.0 * power);
    Some(if whole { step.max(1.0) } else { step })
}
