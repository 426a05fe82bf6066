//! Two motors, their wheels, and the ground.

use crate::Params;
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
}

impl Drive {
    /// Turns the wheels for one step towards what the motors were told, and says where that leads from `pose`.
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
            // Two draws a step whatever happens, so that a run's noise does not depend on when the robot stands.
            let noise: f64 = StandardNormal.sample(rng);
            way_m * (1.0 - params.slip_fraction) + params.way_noise_m * way_m.abs().sqrt() * noise
        };
        let (left_m, right_m) = (over_ground(self.rim.left_mps), over_ground(self.rim.right_mps));
        self.ground = WheelSpeeds { left_mps: left_m / seconds, right_mps: right_m / seconds };
        pose.after_arc(0.5 * (left_m + right_m), (right_m - left_m) / params.wheel_track_m)
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
