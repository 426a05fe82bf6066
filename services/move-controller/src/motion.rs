//! One motion from its beginning to its end.

use crate::{Ahead, Params};
use geometry::angle;
use messages::{MotionCommand, MotionKindName, MotionStateName, Odometry, Time, WheelSpeeds};

/// Longer ways and turns are no sensible orders.
const FARTHEST_M: f64 = 100.0;
const MOST_RAD: f64 = 7.0;
/// Wheels slower than this stand.
const STANDS_MPS: f64 = 1e-3;
/// A retreat shorter than this is left out.
const NO_RETREAT_M: f64 = 0.002;

/// Where a motion is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Phase {
    Running,
    /// Back from a wall, so far.
    Retreating {
        by_m: f64,
    },
    Ended(MotionStateName),
}

/// One motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    pub(crate) id: u64,
    pub(crate) phase: Phase,
    pub(crate) travelled_m: f64,
    pub(crate) turned_rad: f64,
    pub(crate) retreated_m: f64,
    kind: MotionKindName,
    /// How far, ahead or around.
    wanted: f64,
    retreat_m: f64,
    /// Whether the way is done, and only the wheels have to come to rest.
    is_there: bool,
    /// Since when the wheels have not done what they were told.
    hindered: Option<Time>,
}

impl Motion {
    /// The motion of an order, unless it makes no sense.
    pub(crate) fn new(command: &MotionCommand) -> Option<Self> {
        let kind = command.kind.get().ok()?;
        let wanted = match kind {
            MotionKindName::Stop => 0.0,
            MotionKindName::Move => Some(command.distance_m).filter(|way_m| way_m.abs() <= FARTHEST_M)?,
            MotionKindName::Turn => Some(command.turn_rad).filter(|turn_rad| turn_rad.abs() <= MOST_RAD)?,
        };
        Some(Self {
            id: command.command_id,
            phase: Phase::Running,
            travelled_m: 0.0,
            turned_rad: 0.0,
            retreated_m: 0.0,
            kind,
            wanted,
            retreat_m: if command.retreat_m > 0.0 { command.retreat_m } else { 0.0 },
            is_there: false,
            hindered: None,
        })
    }

    /// Counts how far the wheels have gone.
    pub(crate) fn follow(&mut self, last: &Odometry, now: &Odometry) {
        let way_m = 0.5 * (now.left_travel_m - last.left_travel_m + now.right_travel_m - last.right_travel_m);
        self.turned_rad += angle::difference(now.heading_rad, last.heading_rad);
        match self.phase {
            Phase::Retreating { .. } => self.retreated_m -= way_m,
            _ => self.travelled_m += way_m,
        }
    }

    /// What the wheels shall do now.
    pub(crate) fn steer(
        &mut self,
        now: Time,
        params: &Params,
        ahead: Ahead,
        odometry: &Odometry,
    ) -> WheelSpeeds {
        let half_track_m = 0.5 * params.wheel_track_m;
        let rim_mps = odometry.forward_mps.abs() + half_track_m * odometry.turn_rad_per_s.abs();
        let stands = rim_mps < STANDS_MPS;
        if let Phase::Ended(_) = self.phase {
            return WheelSpeeds::ZERO;
        }
        if let Phase::Retreating { by_m } = self.phase {
            let left_m = by_m - self.retreated_m;
            if left_m <= NO_RETREAT_M || self.is_stuck(now, params, stands) {
                self.phase = if stands { Phase::Ended(MotionStateName::NearWall) } else { self.phase };
                return WheelSpeeds::ZERO;
            }
            let speed_mps = -params.retreat_speed_mps.min(params.braking_mps(left_m));
            return WheelSpeeds { left_mps: speed_mps, right_mps: speed_mps };
        }
        let left = match self.kind {
            MotionKindName::Stop => 0.0,
            MotionKindName::Move => self.wanted - self.travelled_m,
            MotionKindName::Turn => self.wanted - self.turned_rad,
        };
        let tolerance =
            if self.kind == MotionKindName::Turn { params.turn_tolerance_rad } else { params.tolerance_m };
        // Never back over the goal: the overshoot is known, and smaller than what the wheels cannot see.
        self.is_there |= left * self.wanted.signum() <= tolerance;
        if self.is_there {
            self.phase = if stands { Phase::Ended(MotionStateName::Done) } else { self.phase };
            return WheelSpeeds::ZERO;
        }
        let is_forward = self.kind == MotionKindName::Move && self.wanted > 0.0;
        if ahead == Ahead::TooNear && (is_forward || self.is_stuck(now, params, stands)) {
            self.hindered = None;
            // The way that was just driven is free.
            let free_m = self.retreat_m + self.travelled_m.max(0.0);
            self.phase = Phase::Retreating { by_m: params.retreat_m.min(free_m) };
            return WheelSpeeds::ZERO;
        }
        if ahead != Ahead::TooNear && self.is_stuck(now, params, stands) {
            self.phase = Phase::Ended(MotionStateName::Blocked);
            return WheelSpeeds::ZERO;
        }
        match self.kind {
            MotionKindName::Stop => WheelSpeeds::ZERO,
            MotionKindName::Turn => {
                let rate = params.turn_rate_rad_per_s.min(params.braking_rad_per_s(left.abs()));
                let rim_mps = rate.copysign(left) * half_track_m;
                WheelSpeeds { left_mps: -rim_mps, right_mps: rim_mps }
            }
            MotionKindName::Move => {
                let cruise_mps =
                    if is_forward { params.approach_mps(ahead) } else { params.retreat_speed_mps };
                let speed_mps = cruise_mps.min(params.braking_mps(left.abs())).copysign(left);
                WheelSpeeds { left_mps: speed_mps, right_mps: speed_mps }
            }
        }
    }

    /// Whether the wheels have stood for too long.
    fn is_stuck(&mut self, now: Time, params: &Params, stands: bool) -> bool {
        if !stands {
            self.hindered = None;
            return false;
        }
        now.seconds_since(*self.hindered.get_or_insert(now)) > params.patience_s
    }
}
