//! The process around `collision_avoidance`.
use board::News;
use collision_avoidance::{CollisionAvoidance, Inputs, Params, Sensor, Snapshot};
use messages::{Clearance, Odometry, PoseEstimate, RangeScan, TofRanges};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        // One of the two sensors is needed, and the other is not even looked at.
        let (mut ranges, mut scan) = match params.sensor {
            Sensor::Tof => (Some(node.latest::<TofRanges>("tof/ranges")?), None),
            Sensor::Laser => (None, Some(node.latest::<RangeScan>("laser/scan")?)),
        };
        let mut odometry = node.optional_reference::<Odometry>("wheels/odometry")?;
        let mut pose = node.optional_reference::<PoseEstimate>("location/pose")?;
        let mut clearance = node.publisher::<Clearance>("safety/clearance")?;
        if let Some(ranges) = &ranges {
            node.wake_on(ranges);
        }
        if let Some(scan) = &scan {
            node.wake_on(scan);
        }
        node.every(params.period());
        let mut kept = node.kept::<Snapshot>();
        let mut guard = CollisionAvoidance::new(params)?;
        if let Some(snapshot) = kept.restore() {
            guard.restore(&snapshot);
        }
        let mut news = News::new();
        Ok(move |now| {
            let inputs = Inputs {
                ranges: ranges.as_mut().and_then(|ranges| ranges.read()),
                scan: scan.as_mut().and_then(|scan| scan.read()),
                odometry: odometry.read(),
                pose: pose.read(),
            };
            let outputs = guard.step(now, inputs);
            let said = &outputs.clearance;
            if news.is_news(now, (said.signal, said.reason)) {
                tracing::info!(
                    front_m = said.front_m,
                    right_m = said.right_m,
                    left_m = said.left_m,
                    "{:?}: {:?}",
                    said.signal,
                    said.reason
                );
            }
            clearance.publish_with(&outputs.clearance, outputs.near);
            kept.save_now_and_then(now, || guard.snapshot());
        })
    })
}
