//! How many particles are enough (Fox 2003, "Adapting the sample size in particle filters through
//! KLD-sampling").

/// Particles with which the belief's distance from the true one over `bins` occupied bins stays below `error`
/// with the probability that belongs to the upper normal quantile `quantile` (equation 7 there).
pub fn enough(bins: usize, error: f64, quantile: f64) -> usize {
    if bins <= 1 {
        return 1;
    }
    let k = bins as f64 - 1.0;
    let part = 2.0 / (9.0 * k);
    let cube = 1.0 - part + part.sqrt() * quantile;
    (k / (2.0 * error) * cube * cube * cube).ceil() as usize
}
