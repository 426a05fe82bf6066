//! The process around `fuzzy_controller`.
use fuzzy_controller::{FuzzyController, Inputs, Params, RangeSource, Snapshot};
use messages::{DriveCommand, Odometry, Path, PoseEstimate, RangeScan, TofRanges, WheelSpeeds};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut command = node.reference::<DriveCommand>("drive/command")?;
        let mut path = node.reference::<Path>("plan/path")?;
        let mut pose = node.latest::<PoseEstimate>("location/pose")?;
        // What the parameters name must be there, the rest is not needed.
        let (mut ranges, mut scan) = match params.range_source {
            RangeSource::Tof => {
                (node.latest::<TofRanges>("tof/ranges")?, node.optional::<RangeScan>("laser/scan")?)
            }
            RangeSource::Scan => (node.optional("tof/ranges")?, node.latest("laser/scan")?),
            RangeSource::Both => (node.latest("tof/ranges")?, node.latest("laser/scan")?),
            RangeSource::None => (node.optional("tof/ranges")?, node.optional("laser/scan")?),
        };
        let mut odometry = node.optional::<Odometry>("wheels/odometry")?;
        let mut wheels = node.publisher::<WheelSpeeds>("wheels/desired")?;
        node.every(params.period());
        let mut kept = node.kept::<Snapshot>();
        let mut controller = FuzzyController::new(params)?;
        if let Some(snapshot) = kept.restore() {
            controller.restore(&snapshot);
        }
        let mut blocked = false;
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
            if outputs.blocked && !blocked {
                tracing::warn!(behaviour = ?outputs.behaviour, "avoids without progress: a new path is needed");
            }
            blocked = outputs.blocked;
            wheels.publish(&outputs.wheels);
            kept.save_now_and_then(now, || controller.snapshot());
        })
    })
}
