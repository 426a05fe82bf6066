//! The bank of hypotheses: a Gaussian mixture of fixed capacity.

use crate::hypothesis::{Comparison, Hypothesis, MotionNoise, RangeReading, offset};
use geometry::Pose2;
use nalgebra::Matrix3;

/// How many hypotheses live at once: six places with twelve headings each, beside those already held.
pub(crate) const CAPACITY: usize = 96;
/// How many headings are tried at a place: 30 degrees apart.
pub(crate) const HEADINGS: usize = 12;
/// Hypotheses e^-14 times as likely as the best are dropped.
const PRUNE: f64 = 14.0;
/// Hypotheses closer than this squared Mahalanobis distance, by their covariances' sum, become one.
const MERGE: f64 = 0.3;

/// Readings taken at one place share their errors, so they cannot vote again and again on which hypothesis is
/// right. A path or a turn this long makes them independent; without any motion they count this share.
const INDEPENDENT_M: f64 = 1.0;
const INDEPENDENT_RAD: f64 = 2.0;
const LEAST_NEWS: f64 = 0.1;

/// The mixture. Held in a vector whose capacity is reserved once.
#[derive(Debug, Clone)]
pub(crate) struct Bank {
    held: Vec<Hypothesis>,
    /// How much the next measurements may say about which hypothesis is right, from 0 to 1.
    news: f64,
}

/// What the mixture amounts to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub(crate) pose: Pose2,
    pub(crate) covariance: Matrix3<f64>,
}

impl Estimate {
    /// Standard deviation of the place in its worst direction.
    pub(crate) fn sigma_m(&self) -> f64 {
        let (a, b, c) = (self.covariance[(0, 0)], self.covariance[(0, 1)], self.covariance[(1, 1)]);
        (0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt()).max(0.0).sqrt()
    }

    /// Standard deviation of the heading.
    pub(crate) fn sigma_rad(&self) -> f64 {
        self.covariance[(2, 2)].max(0.0).sqrt()
    }
}

impl Bank {
    pub(crate) fn new() -> Self {
        Self { held: Vec::with_capacity(CAPACITY), news: LEAST_NEWS }
    }

    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    pub(crate) fn push(&mut self, hypothesis: Hypothesis) {
        if self.held.len() < CAPACITY {
            self.held.push(hypothesis);
        }
    }

    /// Every heading at a place of the antenna.
    pub(crate) fn scatter(
        &mut self,
        antenna_at: [f64; 2],
        antenna_m: [f64; 2],
        sigma_m: f64,
        log_weight: f64,
        wrong: f64,
    ) {
        for index in 0..HEADINGS {
            let heading_rad = (index as f64 / HEADINGS as f64) * std::f64::consts::TAU;
            let facing = Pose2::new(0.0, 0.0, heading_rad);
            let lever = facing.transform(geometry::Point2::new(antenna_m[0], antenna_m[1]));
            let pose = Pose2::new(antenna_at[0] - lever.x, antenna_at[1] - lever.y, heading_rad);
            // Neighbours are 30 degrees apart; 15 degrees of deviation each leave no gap.
            let sigma_rad = std::f64::consts::PI / HEADINGS as f64;
            self.push(Hypothesis::new(pose, sigma_m, sigma_rad, log_weight, wrong));
        }
    }

    /// Leaves room for newcomers: keeps the likeliest few.
    pub(crate) fn keep_best(&mut self, count: usize) {
        self.sort();
        self.held.truncate(count);
    }

    pub(crate) fn advance(&mut self, motion: Pose2, noise: MotionNoise) {
        let news = motion.x_m.hypot(motion.y_m) / INDEPENDENT_M + motion.heading_rad.abs() / INDEPENDENT_RAD;
        self.news = (self.news + news).min(1.0);
        for hypothesis in &mut self.held {
            hypothesis.advance(motion, noise);
        }
    }

    /// The readings of this moment have had their say.
    pub(crate) fn grow_stale(&mut self) {
        self.news = LEAST_NEWS;
    }

    pub(crate) fn blur(&mut self, sigma_m: f64, sigma_rad: f64) {
        for hypothesis in &mut self.held {
            hypothesis.blur(sigma_m, sigma_rad);
        }
    }

    /// Corrects every hypothesis by one range. `outlier` and `recovery` are the chances of an anchor's next
    /// reading to turn wrong and to turn right. Returns how probably the range is good in the eyes of the
    /// best hypothesis.
    pub(crate) fn hear(&mut self, reading: &RangeReading, outlier: f64, recovery: f64) -> f64 {
        let best = self.best_index();
        let mut verdict = 0.0;
        for (index, hypothesis) in self.held.iter_mut().enumerate() {
            let wrong = f64::from(hypothesis.wrong[reading.slot]);
            let prior = (1.0 - wrong) * (1.0 - outlier) + wrong * recovery;
            let share =
                hypothesis.correct(&hypothesis.compare_range(&RangeReading { prior, ..*reading }), self.news);
            hypothesis.wrong[reading.slot] = (1.0 - share) as f32;
            if index == best {
                verdict = share;
            }
        }
        verdict
    }

    /// Corrects every hypothesis by one scalar that `compare` derives from it; those for which it is `None`
    /// keep their pose, and pay for the measurement as if it were wrong. Returns the best hypothesis'
    /// verdict, if it had one.
    pub(crate) fn observe(
        &mut self,
        wrong_density: f64,
        mut compare: impl FnMut(&Hypothesis) -> Option<Comparison>,
    ) -> Option<f64> {
        let best = self.best_index();
        let mut verdict = None;
        for (index, hypothesis) in self.held.iter_mut().enumerate() {
            match compare(hypothesis) {
                Some(comparison) => {
                    let share = hypothesis.correct(&comparison, self.news);
                    if index == best {
                        verdict = Some(share);
                    }
                }
                None => hypothesis.log_weight += self.news * wrong_density.ln(),
            }
        }
        verdict
    }

    /// Drops the unlikely, joins the equal, and scales the weights so that the best has weight one.
    pub(crate) fn tidy(&mut self) {
        self.held.retain(|one| {
            one.log_weight.is_finite() && one.pose.is_finite() && one.covariance.iter().all(|v| v.is_finite())
        });
        self.sort();
        let Some(best) = self.held.first().map(|one| one.log_weight) else { return };
        self.held.retain(|one| one.log_weight >= best - PRUNE);
        for one in &mut self.held {
            one.log_weight -= best;
        }
        let mut index = 0;
        while index < self.held.len() {
            let mut other = index + 1;
            while other < self.held.len() {
                match join(&self.held[index], &self.held[other]) {
                    Some(joined) => {
                        self.held[index] = joined;
                        self.held.remove(other);
                    }
                    None => other += 1,
                }
            }
            index += 1;
        }
    }

    /// The likeliest hypothesis with those that overlap it, and the spread of the whole mixture around it.
    pub(crate) fn estimate(&self) -> Option<Estimate> {
        let best = self.held.get(self.best_index())?;
        let weight = |one: &Hypothesis| (one.log_weight - best.log_weight).exp();
        let near = self.held.iter().filter(|one| {
            let apart = offset(one.pose, best.pose);
            apart.x.hypot(apart.y) < 1.0 && apart.z.abs() < 0.6
        });
        let (mut total, mut shift) = (0.0, nalgebra::Vector3::zeros());
        for one in near {
            shift += offset(one.pose, best.pose) * weight(one);
            total += weight(one);
        }
        let shift = shift / total;
        let pose =
            Pose2::new(best.pose.x_m + shift.x, best.pose.y_m + shift.y, best.pose.heading_rad + shift.z);
        let (mut total, mut covariance) = (0.0, Matrix3::zeros());
        for one in &self.held {
            let apart = offset(one.pose, pose);
            covariance += (one.covariance + apart * apart.transpose()) * weight(one);
            total += weight(one);
        }
        Some(Estimate { pose, covariance: covariance / total })
    }

    pub(crate) fn best(&self) -> Option<&Hypothesis> {
        self.held.get(self.best_index())
    }

    fn best_index(&self) -> usize {
        let heaviest = self.held.iter().enumerate().max_by(|a, b| a.1.log_weight.total_cmp(&b.1.log_weight));
        heaviest.map_or(0, |(index, _)| index)
    }

    fn sort(&mut self) {
        // Unstable sorting needs no memory; equal weights keep an order that depends on nothing but the
        // input.
        self.held.sort_unstable_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    }
}

/// One Gaussian for two that overlap, with their common mean and spread; the heavier one's opinion of the
/// anchors.
fn join(heavy: &Hypothesis, light: &Hypothesis) -> Option<Hypothesis> {
    let apart = offset(light.pose, heavy.pose);
    // Far apart is the common case, and cheap to see.
    if apart.x.abs() > 2.0 || apart.y.abs() > 2.0 || apart.z.abs() > 1.0 {
        return None;
    }
    let distance = apart.dot(&((heavy.covariance + light.covariance).try_inverse()? * apart));
    if !(0.0..MERGE).contains(&distance) {
        return None;
    }
    let (a, b) = (heavy.log_weight.exp(), light.log_weight.exp());
    let share = b / (a + b);
    let mean = apart * share;
    let pose = Pose2::new(heavy.pose.x_m + mean.x, heavy.pose.y_m + mean.y, heavy.pose.heading_rad + mean.z);
    let rest = apart - mean;
    let covariance = (heavy.covariance + mean * mean.transpose()) * (1.0 - share)
        + (light.covariance + rest * rest.transpose()) * share;
    Some(Hypothesis { pose, covariance, log_weight: (a + b).ln(), wrong: heavy.wrong })
}
