//! The paper's detector: a sliding window whose newer half is compared with its older half (COF-102 to
//! COF-112, note 2.6).

use crate::Params;
use std::collections::VecDeque;

/// The window of one sensor.
#[derive(Debug, Clone, Default)]
pub(crate) struct Window {
    /// Distances, oldest first, and whether each was noise and is the last valid one instead.
    readings: VecDeque<(f64, bool)>,
    /// The newer half's mean when it fired.
    fired_m: Option<f64>,
    is_open: bool,
}

impl Window {
    /// Takes in a reading (`None`: nothing in range) with halves of `half` readings, and says whether the
    /// door begins to be beside the robot with this one.
    pub(crate) fn take(&mut self, reading_m: Option<f64>, half: usize, params: &Params) -> bool {
        let last_valid_m = self.readings.back().map(|&(m, _)| m);
        match reading_m.filter(|&m| m <= params.noise_m) {
            Some(reading_m) => self.readings.push_back((reading_m, false)),
            // Noise before the first valid reading says nothing.
            None => self.readings.extend(last_valid_m.map(|m| (m, true))),
        }
        while self.readings.len() > 2 * params.half_window_max as usize {
            self.readings.pop_front();
        }
        let half = half.max(1);
        let Some(begin) = self.readings.len().checked_sub(2 * half) else { return false };
        let mean_m = |from: usize| {
            self.readings.iter().skip(from).take(half).map(|&(m, _)| m).sum::<f64>() / half as f64
        };
        let noisy = |from: usize| {
            2 * self.readings.iter().skip(from).take(half).filter(|&&(_, noisy)| noisy).count() >= half
        };
        let (old_m, new_m) = (mean_m(begin), mean_m(begin + half));
        let (was_noisy, is_noisy) = (noisy(begin), noisy(begin + half));
        if let Some(fired_m) = self.fired_m {
            let fell = if self.is_open { !is_noisy } else { new_m < fired_m - params.unlock_m };
            if fell {
                self.fired_m = None;
            } else {
                self.fired_m = Some(fired_m.max(new_m));
            }
            return false;
        }
        let opens = is_noisy && !was_noisy;
        // Rounding must not decide whether 80 mm are more than 80 mm.
        let fires = opens || new_m - old_m > params.rise_m + 1e-6;
        if fires {
            self.fired_m = Some(new_m);
            self.is_open = opens;
        }
        fires
    }

    /// Whether it has fired and the mean has not fallen back since.
    pub(crate) fn is_locked(&self) -> bool {
        self.fired_m.is_some()
    }
}
