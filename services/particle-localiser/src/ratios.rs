//! Likelihoods relative to the best one, of points that are whole numbers: two short tables in the place of
//! an exponential a particle.

/// Likelihood ratios to a power, by points.
#[derive(Debug)]
pub(crate) struct Ratios {
    best: u32,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// A step of points is a factor: `high[d / 256] * low[d % 256]` for `d` points less than the best.
    Factors { high: Vec<f64>, low: Vec<f64> },
    /// Likelihoods grow with the points themselves, beginning at `least`.
    Linear { least: f64, scale: f64, exponent: f64 },
}

const LOW: u32 = 256;

impl Ratios {
    /// How many nats a point is worth.
    pub(crate) fn of_logs(best: u32, nats_per_point: f64) -> Self {
        let power = |points: u32| (-nats_per_point * f64::from(points)).exp();
        let low = (0..LOW).map(power).collect();
        let high = (0..=best / LOW).map(|part| power(part * LOW)).collect();
        Self { best, kind: Kind::Factors { high, low } }
    }

    /// The likelihood is `least` plus the points, to the power `exponent`.
    pub(crate) fn of_sums(best: u32, least: f64, exponent: f64) -> Self {
        Self { best, kind: Kind::Linear { least, scale: 1.0 / (least + f64::from(best)), exponent } }
    }

    /// The ratio of a particle with so many points, 1 for the best.
    #[inline(always)]
    pub(crate) fn of(&self, points: u32) -> f64 {
        match &self.kind {
            Kind::Factors { high, low } => {
                let less = self.best.saturating_sub(points);
                high[(less / LOW) as usize] * low[(less % LOW) as usize]
            }
            Kind::Linear { least, scale, exponent } => {
                let ratio = (least + f64::from(points)) * scale;
                if *exponent == 1.0 { ratio } else { ratio.powf(*exponent) }
            }
        }
    }
}
