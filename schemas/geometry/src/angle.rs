//! Angles in radians, counter-clockwise positive.

use std::f64::consts::{PI, TAU};

/// The same direction in (-π, π]. A value that is not finite is returned as NaN.
pub fn wrap(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let turned = angle_rad.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// The turn that leads from `from_rad` to `to_rad` the short way, in (-π, π].
pub fn difference(to_rad: f64, from_rad: f64) -> f64 {
    wrap(to_rad - from_rad)
}

/// The weighted mean direction; `None` when the directions cancel out or no weight is left.
pub fn mean(weighted: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let (mut sine, mut cosine, mut total) = (0.0, 0.0, 0.0);
    for (angle_rad, weight) in weighted {
        sine += weight * angle_rad.sin();
        cosine += weight * angle_rad.cos();
        total += weight;
    }
    (total > 0.0 && sine.hypot(cosine) > 1e-12 * total).then(|| sine.atan2(cosine))
}
