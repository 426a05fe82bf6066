//! Two motors, their wheels, and the ground.

use crate::{MotionErrors, Params};
use geometry::Pose2;
use messages::WheelSpeeds;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// What the drive has done since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Drive {
    /// Speed of the wheels' rims, as the motors turn them.
    pub(crate) rim: WheelSpeeds,
    /// Speed of the wheels over ground.
    pub(crate) ground: WheelSpeeds,
    /// What the encoders have counted.
    pub(crate) left_travel_m: f64,
    pub(crate) right_travel_m: f64,
    motion: Motion,
}

/// What a motion, from standing to standing, errs by.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Motion {
    /// Whether the wheels turn.
    goes_on: bool,
    /// The absolute errors, and the share of them that is still to come.
    error_m: f64,
    error_rad: f64,
    to_come: f64,
    /// By how much every way and every turn is longer.
    way_share: f64,
    turn_share: f64,
}

/// An absolute error comes with the first of the way, as the backlash of gears does: all of it within these.
const WITHIN_M: f64 = 0.02;
const WITHIN_RAD: f64 = 0.1;

impl Motion {
    /// One step of the wheels over ground, ahead and around, with the errors.
    fn err(&mut self, params: &Params, way_m: f64, turn_rad: f64, rng: &mut impl Rng) -> [f64; 2] {
        if way_m == 0.0 && turn_rad == 0.0 {
            *self = Self::default();
            return [way_m, turn_rad];
        }
        if !std::mem::replace(&mut self.goes_on, true) {
            let mut normal = || -> f64 { StandardNormal.sample(rng) };
            let (first, second) = (normal(), normal());
            self.to_come = 1.0;
            let is_way = way_m.abs() > 0.5 * params.wheel_track_m * turn_rad.abs();
            match params.motion_errors {
                MotionErrors::None => {}
                MotionErrors::Absolute if is_way => self.error_m = params.motion_error_m * first,
                MotionErrors::Absolute => self.error_rad = params.motion_error_rad * first,
                MotionErrors::Proportional if is_way => {
                    self.way_share = params.way_error_fraction * first;
                    self.error_rad = params.turn_error_fraction * second;
                }
                MotionErrors::Proportional => self.turn_share = params.turn_error_fraction * first,
            }
        }
        let share = (way_m.abs() / WITHIN_M + turn_rad.abs() / WITHIN_RAD).min(self.to_come);
        self.to_come -= share;
        [
            way_m * (1.0 + self.way_share) + share * self.error_m,
            turn_rad * (1.0 + self.turn_share) + share * self.error_rad,
        ]
    }
}

impl Drive {
    /// Turns the wheels for one step towards what the motors were told, and says where that leads from
    /// `pose`.
    pub(crate) fn turn(
        &mut self,
        params: &Params,
        told: WheelSpeeds,
        pose: Pose2,
        seconds: f64,
        rng: &mut impl Rng,
    ) -> Pose2 {
        let change_mps = params.wheel_acceleration_m_per_s2 * seconds;
        self.rim.left_mps = towards(self.rim.left_mps, told.left_mps * params.left_gain, change_mps);
        self.rim.right_mps = towards(self.rim.right_mps, told.right_mps * params.right_gain, change_mps);
        let mut over_ground = |rim_mps: f64| {
            let way_m = rim_mps * seconds;
            // Two draws a step whatever happens, so that a run's noise does not depend on when the robot
            // stands.
            let noise: f64 = StandardNormal.sample(rng);
            way_m * (1.0 - params.slip_fraction) + params.way_noise_m * way_m.abs().sqrt() * noise
        };
        let (left_m, right_m) = (over_ground(self.rim.left_mps), over_ground(self.rim.right_mps));
        self.ground = WheelSpeeds { left_mps: left_m / seconds, right_mps: right_m / seconds };
        let (way_m, turn_rad) = (0.5 * (left_m + right_m), (right_m - left_m) / params.wheel_track_m);
        let [way_m, turn_rad] = match params.motion_errors {
            MotionErrors::None => [way_m, turn_rad],
            _ => self.motion.err(params, way_m, turn_rad, rng),
        };
        pose.after_arc(way_m, turn_rad)
    }

    /// The motion went ahead: the encoders count it.
    pub(crate) fn count(&mut self, seconds: f64) {
        self.left_travel_m += self.rim.left_mps * seconds;
        self.right_travel_m += self.rim.right_mps * seconds;
    }

    /// Something was in the way: the motors stall.
    pub(crate) fn stall(&mut self) {
        (self.rim, self.ground) = (WheelSpeeds::ZERO, WheelSpeeds::ZERO);
    }
}

fn towards(present: f64, wanted: f64, change: f64) -> f64 {
    present + (wanted - present).clamp(-change, change)
}
