//! The process around `tof_driver`.
use messages::{TofRanges, WorldTruth};
use std::process::ExitCode;
use tof_driver::{Device, Inputs, Params, TofDriver};

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut truth = match params.device {
            Device::Simulated => Some(node.reference::<WorldTruth>("world/truth")?),
        };
        let mut ranges = node.publisher::<TofRanges>("tof/ranges")?;
        node.every(params.period());
        let mut driver = TofDriver::new(params, node.seed())?;
        Ok(move |now| {
            let truth = truth.as_mut().and_then(|truth| truth.read());
            if let Some(frame) = driver.step(now, Inputs { truth }).ranges {
                ranges.publish(&frame);
            }
        })
    })
}
