//! Errors of a localisation: poses against the truth of the same moment, and their quantiles.

use geometry::{Pose2, angle};
use messages::{Once, PoseEstimate, Stamped, Time};
use std::collections::VecDeque;

/// Quantiles are exact to this.
const BIN_M: f64 = 0.001;
/// Errors beyond this fall into the last bin.
const BINS: usize = 20_000;
/// So many true places are remembered, and so many poses wait for the truth of their moment.
const REMEMBERED: usize = 64;
/// Truths farther apart than this are not joined by a straight line.
const LONGEST_GAP_S: f64 = 1.0;

/// Counts errors by size.
#[derive(Debug, Clone)]
pub(crate) struct Errors {
    bins: Vec<u32>,
    pub(crate) count: u64,
    sum_m: f64,
    pub(crate) max_m: f64,
}

impl Errors {
    pub(crate) fn new() -> Self {
        Self { bins: vec![0; BINS], count: 0, sum_m: 0.0, max_m: 0.0 }
    }

    pub(crate) fn add(&mut self, error_m: f64) {
        let bin = ((error_m / BIN_M) as usize).min(BINS - 1);
        self.bins[bin] += 1;
        self.count += 1;
        self.sum_m += error_m;
        self.max_m = self.max_m.max(error_m);
    }

    pub(crate) fn mean_m(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.sum_m / self.count as f64 }
    }

    /// The error that this share of all stays at or below; NaN without any.
    pub(crate) fn quantile_m(&self, share: f64) -> f64 {
        if self.count == 0 {
            return f64::NAN;
        }
        let rank = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let reached = |bin: &u32| {
            seen += u64::from(*bin);
            seen >= rank
        };
        let bin = self.bins.iter().position(reached).unwrap_or(BINS - 1);
        ((bin as f64 + 1.0) * BIN_M).min(self.max_m)
    }
}

/// Matches poses with the truth of the moment at which they were published.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    pub(crate) errors: Errors,
    /// Errors of headings, in degrees.
    pub(crate) turns: Errors,
    /// Whether poses between two truths count; otherwise only the newest before each truth.
    between: bool,
    pub(crate) accepted: u64,
    pub(crate) rejected: u64,
    pub(crate) wrong_floor: u64,
    truths: VecDeque<(Time, Pose2, i32)>,
    waiting: VecDeque<(Time, Pose2, i32)>,
    newest_pose: Once,
}

impl Comparison {
    pub(crate) fn new(between: bool) -> Self {
        Self {
            errors: Errors::new(),
            turns: Errors::new(),
            between,
            accepted: 0,
            rejected: 0,
            wrong_floor: 0,
            truths: VecDeque::with_capacity(REMEMBERED + 1),
            waiting: VecDeque::with_capacity(REMEMBERED + 1),
            newest_pose: Once::default(),
        }
    }

    /// The truth at a moment. Invalid places, and moments that do not come after the last, are left out.
    pub(crate) fn truth(&mut self, stamp: Time, place: Pose2, floor: i32) {
        let is_newer = self.truths.back().is_none_or(|(last, ..)| stamp > *last);
        if is_newer && place.is_finite() {
            self.truths.push_back((stamp, place, floor));
            if self.truths.len() > REMEMBERED {
                self.truths.pop_front();
            }
        }
    }

    /// A pose; each is counted once.
    pub(crate) fn pose(&mut self, estimate: Stamped<'_, PoseEstimate>) {
        let Some(estimate) = self.newest_pose.take(estimate) else { return };
        (self.accepted, self.rejected) = (estimate.accepted, estimate.rejected);
        if let Ok(pose) = estimate.pose() {
            self.waiting.push_back((estimate.stamp, pose, estimate.floor));
            if self.waiting.len() > REMEMBERED {
                self.waiting.pop_front();
            }
        }
    }

    /// Judges the poses whose moment the truth has reached; all that wait when the truth has ended.
    pub(crate) fn settle(&mut self, truth_ended: bool) {
        if !self.between {
            return self.settle_each_truth(truth_ended);
        }
        while let Some(&(stamp, place, floor)) = self.waiting.front() {
            let Some(&(newest, ..)) = self.truths.back() else { return };
            if stamp > newest && !truth_ended {
                return;
            }
            self.waiting.pop_front();
            if let Some(truth) = self.truth_at(stamp) {
                self.judge((place, floor), truth);
            }
        }
    }

    fn judge(&mut self, (place, floor): (Pose2, i32), (truth, true_floor): (Pose2, i32)) {
        if floor != true_floor {
            self.wrong_floor += 1;
            return;
        }
        let turn_rad = angle::difference(place.heading_rad, truth.heading_rad);
        self.errors.add(place.distance_m(truth));
        self.turns.add(turn_rad.abs().to_degrees());
    }

    /// Each truth against the newest pose before it, as soon as a later pose shows that there will be no
    /// newer one.
    fn settle_each_truth(&mut self, truth_ended: bool) {
        while let Some(&(moment, truth, true_floor)) = self.truths.front() {
            if !truth_ended && self.waiting.back().is_none_or(|(stamp, ..)| *stamp <= moment) {
                return;
            }
            self.truths.pop_front();
            let before = self.waiting.iter().take_while(|(stamp, ..)| *stamp <= moment).count();
            let newest = self.waiting.drain(..before).next_back().map(|(_, place, floor)| (place, floor));
            if let Some(pose) = newest {
                self.judge(pose, (truth, true_floor));
            }
        }
    }

    /// Between the two truths around a moment, along a straight line.
    fn truth_at(&self, stamp: Time) -> Option<(Pose2, i32)> {
        let after = self.truths.iter().position(|(moment, ..)| *moment >= stamp);
        let Some(after) = after else {
            // Just after the last truth, as the poses that answer a log's last readings are.
            let &(moment, place, floor) = self.truths.back()?;
            return (stamp.seconds_since(moment) < 0.1).then_some((place, floor));
        };
        let (next_moment, next, floor) = self.truths[after];
        if next_moment == stamp {
            return Some((next, floor));
        }
        let &(last_moment, last, _) = self.truths.get(after.checked_sub(1)?)?;
        let gap_s = next_moment.seconds_since(last_moment);
        let share = stamp.seconds_since(last_moment) / gap_s;
        let turn_rad = angle::difference(next.heading_rad, last.heading_rad);
        let between = |from: f64, to: f64| from + (to - from) * share;
        (gap_s <= LONGEST_GAP_S).then(|| {
            let heading_rad = angle::wrap(last.heading_rad + turn_rad * share);
            (Pose2::new(between(last.x_m, next.x_m), between(last.y_m, next.y_m), heading_rad), floor)
        })
    }
}
