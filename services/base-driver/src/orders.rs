//! What was ordered, for a robot whose sensor looks ahead only: it turns and drives as far as the service
//! that gave the order has looked, and no farther, whatever the controller makes of the order.

use geometry::{Pose2, angle};
use messages::{MotionCommand, MotionKindName};

/// How far a motion may lead beyond what was ordered, and beside it: a centimetre and two degrees.
const BEYOND_M: f64 = 0.010;
const BEYOND_RAD: f64 = 0.035;

/// The order that is being carried out, and how far it has led.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Orders {
    command: MotionCommand,
    begin: Option<Pose2>,
    last: Pose2,
    turned_rad: f64,
}

impl Orders {
    /// Takes in the newest order, with the robot at `here` in the frame of odometry.
    pub(crate) fn follow(&mut self, command: Option<&MotionCommand>, here: Pose2) {
        if let Some(command) = command.filter(|command| command.command_id != self.command.command_id) {
            *self = Self { command: *command, begin: Some(here), last: here, turned_rad: 0.0 };
        }
        self.turned_rad += angle::difference(here.heading_rad, self.last.heading_rad);
        self.last = here;
    }

    /// Whether the robot may come to these places, given as seen from where it is now: nowhere without an
    /// order.
    pub(crate) fn allows(&self, places: &[Pose2]) -> bool {
        let Some(begin) = self.begin else { return false };
        let [[back_m, ahead_m], [right_rad, left_rad]] = self.reach();
        places.iter().all(|place| {
            let there = begin.to(self.last.compose(*place));
            let turned_rad = self.turned_rad + place.heading_rad;
            (back_m - BEYOND_M..=ahead_m + BEYOND_M).contains(&there.x_m)
                && there.y_m.abs() <= BEYOND_M
                && (right_rad - BEYOND_RAD..=left_rad + BEYOND_RAD).contains(&turned_rad)
        })
    }

    /// How far back and ahead, and how far to the right and to the left; nothing for an order without a
    /// meaning.
    fn reach(&self) -> [[f64; 2]; 2] {
        // What is not finite is no order.
        let sound = |amount: f64| if amount.is_finite() { amount } else { 0.0 };
        let retreat_m = sound(self.command.retreat_m).max(0.0);
        match self.command.kind.get() {
            Ok(MotionKindName::Move) => {
                let way_m = sound(self.command.distance_m);
                [[way_m.min(-retreat_m), way_m.max(0.0)], [0.0; 2]]
            }
            Ok(MotionKindName::Turn) => {
                let turn_rad = sound(self.command.turn_rad);
                [[0.0; 2], [turn_rad.min(0.0), turn_rad.max(0.0)]]
            }
            Ok(MotionKindName::Stop) | Err(_) => [[0.0; 2]; 2],
        }
    }
}
