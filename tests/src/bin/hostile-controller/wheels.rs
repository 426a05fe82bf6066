//! What it asks of the wheels.

use crate::params::{Mode, Params};
use messages::WheelSpeeds;

/// Full speed this way for so long, then that way.
const TURNABOUT_S: f64 = 0.6;
/// Commands in a step of a flood.
const FLOOD: usize = 100;

/// The commands, one step after the other.
pub(crate) struct Wheels {
    mode: Mode,
    fastest_mps: f64,
    steady: WheelSpeeds,
    random: u64,
    until_s: f64,
    now: WheelSpeeds,
    steps: u64,
}

impl Wheels {
    pub(crate) fn new(params: &Params, seed: u64) -> Self {
        Self {
            mode: params.mode,
            fastest_mps: params.fastest_mps(),
            steady: speeds(params.left_mps, params.right_mps),
            random: seed,
            until_s: 0.0,
            now: WheelSpeeds::ZERO,
            steps: 0,
        }
    }

    /// What it asks `since_s` after it has begun, instead of `decent`.
    pub(crate) fn commands(&mut self, since_s: f64, decent: WheelSpeeds) -> Vec<WheelSpeeds> {
        self.steps += 1;
        let fast = self.fastest_mps;
        let is_first_half = (since_s / TURNABOUT_S).floor() % 2.0 == 0.0;
        let either =
            |first: WheelSpeeds, second: WheelSpeeds| vec![if is_first_half { first } else { second }];
        match self.mode {
            Mode::MaxBackwards => vec![speeds(-fast, -fast)],
            Mode::Spin => vec![speeds(-fast, fast)],
            Mode::SpinRight => vec![speeds(fast, -fast)],
            Mode::Steady => vec![self.steady],
            Mode::Oscillate => either(speeds(fast, fast), speeds(-fast, -fast)),
            Mode::Waggle => either(speeds(0.2 * fast, fast), speeds(fast, 0.2 * fast)),
            Mode::Shake => either(speeds(-fast, fast), speeds(fast, -fast)),
            Mode::Zigzag => vec![self.zigzag(since_s, -1.0)],
            Mode::Wander => vec![self.zigzag(since_s, -0.2)],
            Mode::Nan => vec![speeds(f64::NAN, fast)],
            Mode::Infinite => vec![speeds(f64::INFINITY, f64::NEG_INFINITY)],
            Mode::Huge => vec![speeds(1e300, 1e300)],
            Mode::Askew => vec![speeds(decent.left_mps + 0.05, decent.right_mps - 0.02)],
            Mode::Flood => vec![speeds(fast, fast); FLOOD],
            Mode::Stale if self.steps % 6 >= 3 => Vec::new(),
            Mode::Silent => Vec::new(),
            _ => vec![speeds(fast, fast)],
        }
    }

    /// Two random speeds, from `least` of the fastest on, for a tenth of a second to a second and a half.
    fn zigzag(&mut self, since_s: f64, least: f64) -> WheelSpeeds {
        if since_s >= self.until_s {
            let fast = self.fastest_mps;
            let (left, right) = (self.share(), self.share());
            self.now = speeds(fast * (least + (1.0 - least) * left), fast * (least + (1.0 - least) * right));
            self.until_s = since_s + 0.1 + 1.4 * self.share();
        }
        self.now
    }

    /// From 0 to 1. SplitMix64 (Steele, Lea, Flood 2014).
    fn share(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = (self.random ^ (self.random >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn speeds(left_mps: f64, right_mps: f64) -> WheelSpeeds {
    WheelSpeeds { left_mps, right_mps }
}
