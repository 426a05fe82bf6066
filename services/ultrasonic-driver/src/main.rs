//! The process around `ultrasonic_driver`.
use messages::{RangeScan, SonarAhead, SonarCommand, WorldTruth};
use std::process::ExitCode;
use ultrasonic_driver::{Device, Inputs, Params, UltrasonicDriver};

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut command = node.optional_reference::<SonarCommand>("sonar/command")?;
        let mut truth = match params.device {
            Device::Simulated => Some(node.reference::<WorldTruth>("world/truth")?),
        };
        let mut raw = node.publisher::<RangeScan>("sonar/raw")?;
        let mut ahead = node.publisher::<SonarAhead>("sonar/ahead")?;
        node.every(params.period());
        let mut driver = UltrasonicDriver::new(params, node.seed())?;
        Ok(move |now| {
            let truth = truth.as_mut().and_then(|truth| truth.read());
            let outputs = driver.step(now, Inputs { command: command.read(), truth });
            if let Some((header, ranges)) = outputs.scan {
                raw.publish_with(&header, ranges);
            }
            outputs.ahead.inspect(|message| ahead.publish(message));
        })
    })
}
