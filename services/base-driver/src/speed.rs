//! How fast the robot may be, from how far it can see.

use crate::Params;
use geometry::Hull;
use messages::{Clearance, WheelSpeeds};

/// So near to a corner of the hull may be what no sensor has seen.
const ASIDE_M: f64 = 0.03;

/// The speed from which a robot that first goes on for `reaction_s` and then loses `deceleration` stops
/// within `way_m`: v·t + v²/2a = way (note 2.5).
pub(crate) fn fastest_mps(way_m: f64, reaction_s: f64, deceleration_m_per_s2: f64) -> f64 {
    let lost_mps = deceleration_m_per_s2 * reaction_s;
    (lost_mps * lost_mps + 2.0 * deceleration_m_per_s2 * way_m.max(0.0)).sqrt() - lost_mps
}

/// The way in which a robot of that speed stops: the other way around.
pub(crate) fn stopping_way_m(speed_mps: f64, reaction_s: f64, deceleration_m_per_s2: f64) -> f64 {
    speed_mps * reaction_s + speed_mps * speed_mps / (2.0 * deceleration_m_per_s2)
}

impl Params {
    /// So old can the newest reading be while the wheels still turn: as old as the guard lets it be behind a
    /// GO, and as old as the driver lets the GO be, one step later.
    pub(crate) fn reaction_s(&self, max_age_ms: u32) -> f64 {
        f64::from(max_age_ms.saturating_add(self.guard_deadline_ms).saturating_add(self.period_ms)) * 1e-3
    }
}

/// How fast the guard's word allows the hull to be ahead; `None` when it names no way in which the robot
/// could stop.
pub(crate) fn ahead_mps(params: &Params, clearance: &Clearance, way_m: f32) -> Option<f64> {
    let reaction_s = params.reaction_s(clearance.max_age_ms);
    let speed_mps = fastest_mps(f64::from(way_m).min(1e6), reaction_s, params.deceleration_m_per_s2);
    (way_m > 0.0 && clearance.front_radius_m > 0.0 && speed_mps > 0.0).then_some(speed_mps)
}

/// How fast the robot may be ahead in such a curve: before it stands, the corner of its front that goes aside
/// has come aside by no more than `ASIDE_M`. The sensors in front look ahead, and those at the side see a
/// thing only when that corner is beside it already. (A turn on the spot shows them nothing new, and need not
/// be slower for that.)
pub(crate) fn curving_mps(
    wanted: WheelSpeeds,
    hull: &Hull,
    track_m: f64,
    reaction_s: f64,
    deceleration_m_per_s2: f64,
) -> f64 {
    let forward_mps = 0.5 * (wanted.left_mps + wanted.right_mps);
    let turn_rad_per_s = (wanted.right_mps - wanted.left_mps) / track_m;
    // The corner on the inner side of the curve.
    let aside_mps = turn_rad_per_s.abs() * hull.front_m;
    let along_mps = forward_mps - turn_rad_per_s.abs() * hull.side_m;
    let share = aside_mps / aside_mps.hypot(along_mps);
    if share > 0.0 {
        fastest_mps((ASIDE_M / share).min(1e6), reaction_s, deceleration_m_per_s2)
    } else {
        f64::INFINITY
    }
}

/// The wanted motion, slower: no corner of the hull faster than `corner_mps`, the robot no faster ahead than
/// `ahead_mps` and back than `back_mps`, and no wheel faster than `wheel_mps`. Both wheels alike, so that the
/// curve stays the same.
pub(crate) fn slowed(
    wanted: WheelSpeeds,
    hull: &Hull,
    track_m: f64,
    [corner_mps, ahead_mps, back_mps, wheel_mps]: [f64; 4],
) -> WheelSpeeds {
    let forward_mps = 0.5 * (wanted.left_mps + wanted.right_mps);
    let turn_rad_per_s = (wanted.right_mps - wanted.left_mps) / track_m;
    let share =
        |speed_mps: f64, limit_mps: f64| if speed_mps > limit_mps { limit_mps / speed_mps } else { 1.0 };
    let shares = [
        share(hull.fastest_corner_mps(forward_mps, turn_rad_per_s), corner_mps),
        share(forward_mps, ahead_mps),
        share(-forward_mps, back_mps),
        share(wanted.left_mps.abs().max(wanted.right_mps.abs()), wheel_mps),
    ];
    scaled(wanted, shares.into_iter().fold(1.0, f64::min))
}

/// So much of a motion.
pub(crate) fn scaled(speeds: WheelSpeeds, share: f64) -> WheelSpeeds {
    WheelSpeeds { left_mps: share * speeds.left_mps, right_mps: share * speeds.right_mps }
}
