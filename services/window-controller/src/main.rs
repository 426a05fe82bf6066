//! The process around `window_controller`.
use messages::{DriveCommand, Odometry, Path, PoseEstimate, RangeScan, TofRanges, WheelSpeeds};
use std::process::ExitCode;
use window_controller::{Inputs, Params, WindowController};

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut command = node.reference::<DriveCommand>("drive/command")?;
        let mut path = node.reference::<Path>("plan/path")?;
        let mut pose = node.latest::<PoseEstimate>("location/pose")?;
        let mut ranges = node.latest::<TofRanges>("tof/ranges")?;
        let mut scan = node.optional::<RangeScan>("laser/scan")?;
        let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
        let mut wheels = node.publisher::<WheelSpeeds>("wheels/desired")?;
        node.every(params.period());
        let mut controller = WindowController::new(params)?;
        Ok(move |now| {
            let outputs = controller.step(
                now,
                &Inputs {
                    command: command.read(),
                    path: path.read(),
                    pose: pose.read(),
                    ranges: ranges.read(),
                    scan: scan.read(),
                    odometry: odometry.read(),
                },
            );
            wheels.publish(&outputs.wheels);
        })
    })
}
