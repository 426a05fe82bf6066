//! Has the robot been carried away? A slow and a fast average of how well the scans fit (Thrun et al. 2005,
//! table 8.3).

use crate::params::Recovery;
use serde::{Deserialize, Serialize};

/// The two averages.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Averages {
    slow: f64,
    fast: f64,
    /// How often an average was taken.
    count: u32,
}

impl Averages {
    /// Takes in how well a scan fits the belief: 0 not at all, 1 perfectly.
    pub fn add(&mut self, fit: f64, recovery: &Recovery) {
        if !fit.is_finite() {
            return;
        }
        self.count = self.count.saturating_add(1);
        // While there are few, both are plain means.
        let share = |rate: f64| rate.max(1.0 / f64::from(self.count));
        self.slow += share(recovery.slow_rate) * (fit - self.slow);
        self.fast += share(recovery.fast_rate) * (fit - self.fast);
    }

    /// Share of the particles that should be scattered anew, 0 to the limit.
    pub fn scatter_share(&self, recovery: &Recovery) -> f64 {
        if self.slow <= 0.0 || self.count < 2 {
            return 0.0;
        }
        let drop = 1.0 - self.fast / self.slow - recovery.tolerance;
        drop.clamp(0.0, recovery.most_scattered)
    }

    pub(crate) fn numbers(&self) -> [f64; 2] {
        [self.slow, self.fast]
    }

    /// The slow average: how well scans fit in the long run.
    pub fn usual(&self) -> f64 {
        self.slow
    }

    /// The fast average: how well the last scans fit.
    pub fn fit(&self) -> f64 {
        self.fast
    }
}
