//! Places that explain a set of ranges without any knowledge of before: where circles around anchors cross.

use crate::hypothesis::RangeReading;

/// How many places are offered at once.
pub(crate) const PLACE_LIMIT: usize = 6;
/// Places nearer to each other than this are one.
const APART_M: f64 = 0.8;

/// A place of the antenna on the floor plan.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Place {
    pub(crate) at_m: [f64; 2],
    /// Logarithm of how well it explains the ranges.
    pub(crate) score: f64,
    /// How many ranges it explains.
    pub(crate) explained: usize,
}

/// The best places, best first.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Places {
    list: [Place; PLACE_LIMIT],
    count: usize,
}

impl Places {
    /// All crossings of two circles, polished by the ranges that agree, judged by all ranges.
    pub(crate) fn find(readings: &[RangeReading]) -> Self {
        let mut places = Self::default();
        for (index, one) in readings.iter().enumerate() {
            for other in &readings[index + 1..] {
                for at_m in crossings(one, other).into_iter().flatten() {
                    places.offer(judge(polish(at_m, readings), readings));
                }
            }
        }
        places
    }

    pub(crate) fn as_slice(&self) -> &[Place] {
        &self.list[..self.count]
    }

    fn offer(&mut self, place: Place) {
        if !place.score.is_finite() {
            return;
        }
        let same = |one: &Place| (one.at_m[0] - place.at_m[0]).hypot(one.at_m[1] - place.at_m[1]) < APART_M;
        if let Some(known) = self.list[..self.count].iter_mut().find(|one| same(one)) {
            if place.score > known.score {
                *known = place;
            }
        } else if self.count < PLACE_LIMIT {
            self.list[self.count] = place;
            self.count += 1;
        } else if place.score > self.list[PLACE_LIMIT - 1].score {
            self.list[PLACE_LIMIT - 1] = place;
        }
        self.list[..self.count].sort_unstable_by(|a, b| b.score.total_cmp(&a.score));
    }
}

/// Where two circles cross. Circles that miss each other by a little are met halfway.
fn crossings(one: &RangeReading, other: &RangeReading) -> [Option<[f64; 2]>; 2] {
    let (dx_m, dy_m) = (other.anchor_m[0] - one.anchor_m[0], other.anchor_m[1] - one.anchor_m[1]);
    let base_m = dx_m.hypot(dy_m);
    let (a_m, b_m) = (one.flat_m(), other.flat_m());
    if base_m < 0.1 || base_m > a_m + b_m + 1.0 || (a_m - b_m).abs() > base_m + 1.0 {
        return [None; 2];
    }
    let along_m = (a_m * a_m - b_m * b_m + base_m * base_m) / (2.0 * base_m);
    let across_m = (a_m * a_m - along_m * along_m).max(0.0).sqrt();
    let (ux, uy) = (dx_m / base_m, dy_m / base_m);
    let foot = [one.anchor_m[0] + along_m * ux, one.anchor_m[1] + along_m * uy];
    [
        Some([foot[0] - across_m * uy, foot[1] + across_m * ux]),
        Some([foot[0] + across_m * uy, foot[1] - across_m * ux]),
    ]
}

fn residual(at_m: [f64; 2], reading: &RangeReading) -> (f64, [f64; 2]) {
    let away = [at_m[0] - reading.anchor_m[0], at_m[1] - reading.anchor_m[1]];
    let distance_m = (away[0].hypot(away[1])).hypot(reading.rise_m).max(0.1);
    (reading.range_m - distance_m, [away[0] / distance_m, away[1] / distance_m])
}

/// Gauss-Newton with Cauchy weights, which give an outlier next to no say (Zhang 1997).
fn polish(mut at_m: [f64; 2], readings: &[RangeReading]) -> [f64; 2] {
    for _ in 0..5 {
        let (mut xx, mut xy, mut yy, mut bx, mut by) = (1e-6, 0.0, 1e-6, 0.0, 0.0);
        for reading in readings {
            let (error_m, slope) = residual(at_m, reading);
            let weight = 1.0 / (1.0 + error_m * error_m / (4.0 * reading.variance));
            xx += weight * slope[0] * slope[0];
            xy += weight * slope[0] * slope[1];
            yy += weight * slope[1] * slope[1];
            bx += weight * slope[0] * error_m;
            by += weight * slope[1] * error_m;
        }
        let determinant = xx * yy - xy * xy;
        if determinant < 1e-9 {
            break;
        }
        let step = [(yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant];
        // Far steps leave the region in which the slopes mean something.
        let shorten = (1.0 / step[0].hypot(step[1]).max(1e-9)).min(1.0);
        at_m = [at_m[0] + shorten * step[0], at_m[1] + shorten * step[1]];
    }
    at_m
}

fn judge(at_m: [f64; 2], readings: &[RangeReading]) -> Place {
    let mut place = Place { at_m, score: 0.0, explained: 0 };
    for reading in readings {
        let (error_m, _) = residual(at_m, reading);
        let variance = 2.0 * reading.variance;
        let good =
            0.8 * (-0.5 * error_m * error_m / variance).exp() / (std::f64::consts::TAU * variance).sqrt();
        let wrong = 0.2 * reading.wrong_density;
        place.score += (good + wrong).ln();
        place.explained += usize::from(good > wrong);
    }
    place
}
