//! The process around `referee`.
use messages::{
    AppliedWheels, Clearance, JourneyStatus, MissionStatus, PoseEstimate, RunSummary, TruePose, WorldTruth,
};
use referee::{Inputs, Mode, Params, Referee};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut truth = node.optional::<WorldTruth>("world/truth")?;
        let mut mission = node.optional_reference::<MissionStatus>("mission/status")?;
        let mut journey = node.optional_reference::<JourneyStatus>("journey/status")?;
        let mut location = node.optional::<PoseEstimate>("location/pose")?;
        let mut applied = node.optional::<AppliedWheels>("wheels/applied")?;
        let mut clearance = node.optional::<Clearance>("safety/clearance")?;
        let mut true_poses = node.optional_queue::<TruePose>("truth/pose")?;
        let mut summary = node.publisher::<RunSummary>("run/summary")?;
        if params.mode == Mode::Localisation {
            node.wake_on(&location);
        }
        node.every(params.sample_period());
        let mut referee = Referee::new(params)?;
        Ok(move |now| {
            let mut said = None;
            while let Some(pose) = true_poses.next() {
                said =
                    referee.step(now, Inputs { true_pose: Some(pose), ..Inputs::default() }).summary.or(said);
            }
            let inputs = Inputs {
                truth: truth.read(),
                mission: mission.read(),
                journey: journey.read(),
                location: location.read(),
                applied: applied.read(),
                clearance: clearance.read(),
                true_pose: None,
            };
            if let Some(standing) = referee.step(now, inputs).summary.or(said) {
                summary.publish(&standing);
            }
        })
    })
}
