//! The process around `tag_driver`.
use messages::{TagRanges, WorldTruth};
use std::process::ExitCode;
use tag_driver::{Device, Inputs, Params, TagDriver};

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut truth = match params.device {
            Device::Simulated => Some(node.reference::<WorldTruth>("world/truth")?),
        };
        let mut ranges = node.publisher::<TagRanges>("tag/ranges")?;
        node.every(params.period());
        let mut driver = TagDriver::new(params, node.seed())?;
        Ok(move |now| {
            let truth = truth.as_mut().and_then(|truth| truth.read());
            if let Some(heard) = driver.step(now, Inputs { truth }).ranges {
                ranges.publish(&heard);
            }
        })
    })
}
