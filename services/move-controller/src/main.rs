//! The process around `move_controller`.
use messages::{Clearance, MotionCommand, MotionReport, Odometry, WheelSpeeds};
use move_controller::{Inputs, MoveController, Params};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut command = node.reference::<MotionCommand>("motion/command")?;
        let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
        let mut clearance = node.latest::<Clearance>("safety/clearance")?;
        let mut desired = node.publisher::<WheelSpeeds>("wheels/desired")?;
        let mut report = node.publisher::<MotionReport>("motion/report")?;
        node.wake_on(&command);
        node.every(params.period());
        let mut controller = MoveController::new(params)?;
        Ok(move |now| {
            let inputs =
                Inputs { command: command.read(), odometry: odometry.read(), clearance: clearance.read() };
            let outputs = controller.step(now, inputs);
            desired.publish(&outputs.desired);
            report.publish(&outputs.report);
        })
    })
}
