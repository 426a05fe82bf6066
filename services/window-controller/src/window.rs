//! The choice among velocities: Fox, Burgard and Thrun 1997, "The dynamic window approach to collision
//! avoidance".

use crate::Params;
use geometry::Pose2;
use nalgebra::Point2;
use std::f64::consts::{PI, TAU};

/// How finely the window is searched: speeds forward, turning speeds (odd, so that the present one is among
/// them).
const FORWARD_STEPS: usize = 9;
const TURN_STEPS: usize = 17;
/// Slower turns are straight lines.
const STRAIGHT_RAD_PER_S: f64 = 1e-3;

/// A speed forward and a turning speed, counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Velocity {
    /// Forward.
    pub forward_mps: f64,
    /// Counter-clockwise.
    pub turn_rad_per_s: f64,
}

/// The hull as a rectangle around the turning centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hull {
    pub(crate) front_m: f64,
    pub(crate) rear_m: f64,
    pub(crate) side_m: f64,
}

impl Hull {
    fn holds(&self, x: f64, y: f64) -> bool {
        x > -self.rear_m && x < self.front_m && y.abs() < self.side_m
    }

    /// After how many seconds at this velocity the hull meets a point of the robot's frame; infinite if never
    /// within a full turn.
    pub(crate) fn time_to(&self, velocity: Velocity, point: Point2<f64>) -> f64 {
        let Velocity { forward_mps, turn_rad_per_s } = velocity;
        let (x, y) = (point.x, point.y);
        if turn_rad_per_s.abs() < STRAIGHT_RAD_PER_S {
            let way_m = if forward_mps >= 0.0 { x - self.front_m } else { -x - self.rear_m };
            let meets = y.abs() < self.side_m && way_m >= 0.0 && forward_mps != 0.0;
            return if meets { way_m / forward_mps.abs() } else { f64::INFINITY };
        }
        // Seen from the robot the point runs on a circle around the turn's centre (0, centre_y), against the
        // turn.
        let centre_y = forward_mps / turn_rad_per_s;
        let (from_y, radius2) = (y - centre_y, x * x + (y - centre_y).powi(2));
        let begin_rad = from_y.atan2(x);
        let mut nearest_rad = f64::INFINITY;
        let mut meet = |edge_x: f64, edge_y: f64| {
            let turned_rad = (begin_rad - (edge_y - centre_y).atan2(edge_x)) * turn_rad_per_s.signum();
            nearest_rad = nearest_rad.min(turned_rad.rem_euclid(TAU));
        };
        for edge_x in [self.front_m, -self.rear_m] {
            let rest = radius2 - edge_x * edge_x;
            if rest >= 0.0 {
                for edge_y in [centre_y + rest.sqrt(), centre_y - rest.sqrt()] {
                    if edge_y.abs() <= self.side_m {
                        meet(edge_x, edge_y);
                    }
                }
            }
        }
        for edge_y in [self.side_m, -self.side_m] {
            let rest = radius2 - (edge_y - centre_y).powi(2);
            if rest >= 0.0 {
                for edge_x in [rest.sqrt(), -rest.sqrt()] {
                    if (-self.rear_m..=self.front_m).contains(&edge_x) {
                        meet(edge_x, edge_y);
                    }
                }
            }
        }
        nearest_rad / turn_rad_per_s.abs()
    }
}

/// What the choice depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    /// The present velocity, around which the window lies.
    pub(crate) present: Velocity,
    /// How long the next velocity will last.
    pub(crate) elapsed_s: f64,
    /// Where to go, in the robot's frame.
    pub(crate) target: Point2<f64>,
    /// Obstacles in the robot's frame.
    pub(crate) points: &'a [Point2<f64>],
    /// No faster than this.
    pub(crate) limit_mps: f64,
}

/// The admissible velocity within the window that the objective likes best; `None` when none is.
pub(crate) fn choose(scene: &Scene<'_>, params: &Params) -> Option<Velocity> {
    let reach_mps = params.acceleration_m_per_s2 * scene.elapsed_s;
    let reach_rad_per_s = params.turn_acceleration_rad_per_s2 * scene.elapsed_s;
    let top_mps = scene.limit_mps.min(params.top_speed_mps).max(0.0);
    // Too fast for a lower limit: slow down as fast as the window allows.
    let high_mps =
        (scene.present.forward_mps + reach_mps).min(top_mps.max(scene.present.forward_mps - reach_mps));
    let high_mps = high_mps.max(0.0);
    let low_mps = (scene.present.forward_mps - reach_mps).clamp(0.0, high_mps);
    let mut scores = [[None; TURN_STEPS]; FORWARD_STEPS];
    let velocity = |row: usize, column: usize| {
        let forward_mps = low_mps + (high_mps - low_mps) * row as f64 / (FORWARD_STEPS - 1) as f64;
        let aside = 2.0 * column as f64 / (TURN_STEPS - 1) as f64 - 1.0;
        let turn_rad_per_s = scene.present.turn_rad_per_s + aside * reach_rad_per_s;
        Velocity { forward_mps, turn_rad_per_s }
    };
    for (row, line) in scores.iter_mut().enumerate() {
        for (column, score) in line.iter_mut().enumerate() {
            *score = objective(velocity(row, column), scene, params);
        }
    }
    let mut best: Option<(f64, Velocity)> = None;
    for row in 0..FORWARD_STEPS {
        for column in 0..TURN_STEPS {
            let Some(score) = smoothed(&scores, row, column) else { continue };
            if best.is_none_or(|(known, _)| score > known) {
                best = Some((score, velocity(row, column)));
            }
        }
    }
    best.map(|(_, velocity)| velocity)
}

/// Equation 2 of the paper before its smoothing; `None` for velocities that are not admissible (equation 1).
fn objective(velocity: Velocity, scene: &Scene<'_>, params: &Params) -> Option<f64> {
    let Velocity { forward_mps, turn_rad_per_s } = velocity;
    if turn_rad_per_s.abs() > params.top_turn_rad_per_s.max(scene.present.turn_rad_per_s.abs()) {
        return None;
    }
    let rim_mps = forward_mps + 0.5 * params.track_m * turn_rad_per_s.abs();
    if rim_mps > params.top_speed_mps.max(scene.present.forward_mps) + 1e-9 {
        return None;
    }
    let time_s = time_to_contact(velocity, scene, params);
    let way_m = forward_mps * time_s;
    if way_m < forward_mps * params.latency_s + forward_mps.powi(2) / (2.0 * params.brake_m_per_s2) {
        return None;
    }
    let turn_way_rad = turn_rad_per_s.abs() * time_s;
    let turn_brake = turn_rad_per_s.powi(2) / (2.0 * params.turn_acceleration_rad_per_s2);
    if turn_way_rad < turn_rad_per_s.abs() * params.latency_s + turn_brake {
        return None;
    }
    // Where the course leads; never beyond the target, or it would count as behind.
    let target_m = scene.target.coords.norm();
    let seconds =
        if forward_mps > 0.0 { params.horizon_s.min(0.7 * target_m / forward_mps) } else { params.horizon_s };
    let there = Pose2::IDENTITY.after_arc(forward_mps * seconds, turn_rad_per_s * seconds);
    let heading = 1.0 - there.bearing_rad(scene.target).abs() / PI;
    let clearance = if forward_mps > 0.0 { (way_m / params.front_trigger_m).min(1.0) } else { 1.0 };
    let speed = forward_mps / params.top_speed_mps;
    Some(
        params.heading_weight * heading
            + params.clearance_weight * clearance
            + params.velocity_weight * speed,
    )
}

fn time_to_contact(velocity: Velocity, scene: &Scene<'_>, params: &Params) -> f64 {
    let bare = Hull { front_m: params.hull_front_m, rear_m: params.hull_rear_m, side_m: params.hull_side_m };
    let share = velocity.forward_mps / params.top_speed_mps;
    let wide = Hull { side_m: bare.side_m + params.side_trigger_m * share, ..bare };
    let time = |point: &Point2<f64>| {
        if bare.holds(point.x, point.y) {
            // The robot cannot be where something is: an error of the memory, unless the robot would drive
            // into it.
            return if point.x > 0.5 * bare.front_m && velocity.forward_mps > 0.0 {
                0.0
            } else {
                f64::INFINITY
            };
        }
        // What is within the margin already forbids only what the bare hull would touch.
        let hull = if wide.holds(point.x, point.y) { bare } else { wide };
        hull.time_to(velocity, *point)
    };
    scene.points.iter().map(time).fold(f64::INFINITY, f64::min)
}

/// The mean over the neighbours that are admissible too (the paper's σ): keeps the robot off the rim of what
/// is possible.
fn smoothed(scores: &[[Option<f64>; TURN_STEPS]; FORWARD_STEPS], row: usize, column: usize) -> Option<f64> {
    let own = scores[row][column]?;
    let (mut sum, mut count) = (2.0 * own, 2.0);
    for near in [column.checked_sub(1), Some(column + 1)].into_iter().flatten() {
        if let Some(score) = scores[row].get(near) {
            // A forbidden neighbour counts as worthless.
            sum += score.unwrap_or(0.0);
            count += 1.0;
        }
    }
    Some(sum / count)
}
