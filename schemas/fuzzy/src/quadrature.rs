//! The centroid of curves: adaptive Gauss-Kronrod quadrature (7 and 15 points; Piessens et al. 1983,
//! QUADPACK), divided at the places where a term bends, until the two rules agree to 1e-12 of the universe.
//!
//! A kink between an interval's end and its outermost node would go unseen, so an interval with a kink
//! (another term on top, or clipped at one end only) is halved until it is too short to matter. So the
//! centroid is exact to about 1e-10 of the universe; only a term that surfaces and dives again between two
//! nodes may be missed, which costs 1e-5 at the very worst.

use super::norms::{SNorm, TNorm};
use super::terms::Term;

const AGREEMENT: f64 = 1e-12;
const MOST_PARTS: usize = 128;
/// An interval is not halved more often than this, and not for a kink below this part of the universe.
const DEEPEST: u32 = 40;
const SHALLOWEST: u32 = 2;
const KINK: f64 = 1e-6;

const NODES: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_56,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];
/// The weights of the nodes 1, 3, 5 and 7.
const GAUSS: [f64; 4] =
    [0.129_484_966_168_869_7, 0.279_705_391_489_276_64, 0.381_830_050_505_118_9, 0.417_959_183_673_469_4];

#[derive(Debug, Clone)]
pub(crate) struct Quadrature {
    activation: TNorm,
    accumulation: SNorm,
    entries: Vec<Term>,
    /// The ends of the universe and the joints between them, ascending.
    splits: Vec<f64>,
    stack: Vec<(f64, f64, u32)>,
}

impl Quadrature {
    pub(crate) fn new(
        entries: Vec<Term>,
        (low, high): (f64, f64),
        activation: TNorm,
        accumulation: SNorm,
    ) -> Self {
        let inside = entries.iter().flat_map(Term::joints).filter(|x| *x > low && *x < high);
        let mut splits: Vec<f64> = [low, high].into_iter().chain(inside).collect();
        splits.sort_by(f64::total_cmp);
        splits.dedup_by(|after, before| *after <= *before);
        Self { activation, accumulation, entries, splits, stack: Vec::with_capacity(MOST_PARTS) }
    }

    pub(crate) fn centroid(&mut self, degrees: &[f64]) -> Option<f64> {
        let (low, high) = (*self.splits.first()?, *self.splits.last()?);
        let centre = 0.5 * (low + high);
        let tolerance = AGREEMENT * (high - low);
        let (mut area, mut moment) = (0.0, 0.0);
        let mut stack = std::mem::take(&mut self.stack);
        for ends in self.splits.windows(2) {
            stack.push((ends[0], ends[1], 0));
            while let Some((a, b, depth)) = stack.pop() {
                let (part, first, error) = self.part(degrees, a, b, centre);
                let inset = 1e-9 * (b - a);
                let smooth = b - a <= KINK * (high - low)
                    || self.height(degrees, a + inset).1 == self.height(degrees, b - inset).1;
                if (error <= tolerance && smooth && depth >= SHALLOWEST) || depth >= DEEPEST {
                    area += part;
                    moment += first;
                } else {
                    let middle = 0.5 * (a + b);
                    stack.push((middle, b, depth + 1));
                    stack.push((a, middle, depth + 1));
                }
            }
        }
        self.stack = stack;
        (area > 0.0).then(|| centre + moment / area)
    }

    /// Area, first moment about `centre` and the disagreement of the two rules, over `a..b`.
    fn part(&self, degrees: &[f64], a: f64, b: f64, centre: f64) -> (f64, f64, f64) {
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
        let (mut kronrod, mut gauss, mut first) = (0.0, 0.0, 0.0);
        for (index, node) in NODES.iter().enumerate() {
            for side in [-1.0, 1.0] {
                if index == 7 && side > 0.0 {
                    continue;
                }
                let x = middle + side * half * node;
                let (y, _) = self.height(degrees, x);
                kronrod += KRONROD[index] * y;
                first += KRONROD[index] * y * (x - centre);
                if index % 2 == 1 {
                    gauss += GAUSS[index / 2] * y;
                }
            }
        }
        (kronrod * half, first * half, ((kronrod - gauss) * half).abs())
    }

    /// The accumulated height at `x`, and a mark that changes where it has a kink.
    fn height(&self, degrees: &[f64], x: f64) -> (f64, u64) {
        let (mut sum, mut mark) = (0.0, 0_u64);
        for (entry, (term, &degree)) in self.entries.iter().zip(degrees).enumerate() {
            if degree <= 0.0 {
                continue;
            }
            let membership = term.membership(x);
            let height = self.activation.apply(degree, membership);
            let clipped = u64::from(membership > degree);
            if self.accumulation != SNorm::Maximum {
                mark = mark.rotate_left(1) ^ clipped;
            } else if height > sum {
                mark = 2 * entry as u64 + clipped + 1;
            }
            sum = self.accumulation.accumulate(sum, height);
        }
        if self.accumulation == SNorm::BoundedSum && sum >= 1.0 {
            mark ^= 1 << 63;
        }
        (sum, mark)
    }
}
