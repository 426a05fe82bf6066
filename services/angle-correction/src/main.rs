//! The process around `angle_correction`.
use angle_correction::{AngleCorrection, Inputs, Params};
use messages::{Clearance, HeadingCorrection, Odometry, PoseEstimate, TofRanges};
use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut ranges = node.latest::<TofRanges>("tof/ranges")?;
        let mut location = node.reference::<PoseEstimate>("location/pose")?;
        let mut clearance = node.optional_reference::<Clearance>("safety/clearance")?;
        let mut odometry = node.optional_reference::<Odometry>("wheels/odometry")?;
        let mut correction = node.publisher::<HeadingCorrection>("heading/correction")?;
        node.wake_on(&ranges);
        node.wake_on(&location);
        // In silence it says that nothing is measured any more.
        node.every(Duration::from_millis(100));
        let mut angle = AngleCorrection::new(params)?;
        Ok(move |now| {
            let inputs = Inputs {
                ranges: ranges.read(),
                location: location.read(),
                clearance: clearance.read(),
                odometry: odometry.read(),
            };
            if let Some(message) = angle.step(now, inputs).correction {
                correction.publish(&message);
            }
        })
    })
}
