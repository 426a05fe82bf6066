//! The process around `proximity_guard`.
use board::News;
use messages::{Clearance, Odometry, RangeScan, SonarAhead};
use proximity_guard::{Inputs, Params, ProximityGuard};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut ahead = node.latest::<SonarAhead>("sonar/ahead")?;
        let mut scan = node.optional_reference::<RangeScan>("sonar/raw")?;
        let mut odometry = node.optional_reference::<Odometry>("wheels/odometry")?;
        let mut clearance = node.publisher::<Clearance>("safety/clearance")?;
        node.wake_on(&ahead);
        node.every(params.period());
        let mut guard = ProximityGuard::new(params)?;
        let mut news = News::new();
        Ok(move |now| {
            let outputs =
                guard.step(now, Inputs { ahead: ahead.read(), scan: scan.read(), odometry: odometry.read() });
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
            clearance.publish(&outputs.clearance);
        })
    })
}
