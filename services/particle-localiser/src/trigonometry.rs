//! Sine and cosine in single precision as plain arithmetic, which the compiler computes for eight particles
//! at once, with the same bits on every machine.

use std::f32::consts::{FRAC_2_PI, TAU};

/// Added and taken away again it rounds a number below 2^22 to a whole one; its last bits are then that
/// number's.
const ROUNDER: f32 = 12_582_912.0;

/// Sine and cosine of an angle within ±1000 rad, good to 1e-6.
#[inline(always)]
pub(crate) fn sin_cos(angle_rad: f32) -> (f32, f32) {
    let shifted = angle_rad * FRAC_2_PI + ROUNDER;
    let quarter = shifted.to_bits();
    let quarters = shifted - ROUNDER;
    // π/2 in two parts: the first has few bits, so that the product is exact.
    let r = (angle_rad - quarters * 1.570_312_5) - quarters * 4.838_268e-4;
    let square = r * r;
    // Taylor's series to x^9 and x^8: within ±π/4 the rest is below 3e-8.
    let sine = r + r
        * square
        * (-1.666_666_7e-1 + square * (8.333_333e-3 + square * (-1.984_127e-4 + square * 2.755_732e-6)));
    let cosine = 1.0 - 0.5 * square
        + square * square * (4.166_666_8e-2 + square * (-1.388_888_9e-3 + square * 2.480_158_8e-5));
    let odd = quarter & 1 == 1;
    let (s, c) = if odd { (cosine, sine) } else { (sine, cosine) };
    let sine_sign = (quarter & 2) << 30;
    let cosine_sign = ((quarter.wrapping_add(1)) & 2) << 30;
    (f32::from_bits(s.to_bits() ^ sine_sign), f32::from_bits(c.to_bits() ^ cosine_sign))
}

/// A direction in about [-π, π].
#[inline(always)]
pub(crate) fn wrap(angle_rad: f32) -> f32 {
    let turns = (angle_rad * (1.0 / TAU) + ROUNDER) - ROUNDER;
    angle_rad - turns * TAU
}
