//! The process around `scan_conditioner`.
use messages::{RangeScan, SonarCommand, WallSurvey};
use scan_conditioner::{Inputs, Params, ScanConditioner};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut raw = node.latest::<RangeScan>("sonar/raw")?;
        let mut command = node.reference::<SonarCommand>("sonar/command")?;
        let mut survey = node.publisher::<WallSurvey>("sonar/survey")?;
        let mut scan = node.publisher::<RangeScan>("sonar/scan")?;
        node.wake_on(&raw);
        let mut conditioner = ScanConditioner::new(params)?;
        Ok(move |now| {
            let outputs = conditioner.step(now, Inputs { raw: raw.read(), command: command.read() });
            if let Some((header, kept)) = outputs.scan {
                scan.publish_with(&header, kept);
            }
            outputs.survey.inspect(|message| survey.publish(message));
        })
    })
}
