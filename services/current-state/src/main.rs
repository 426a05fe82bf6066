//! The process around `current_state`.
use current_state::{CurrentStateService, Inputs, Params};
use messages::{Clearance, CurrentState, DriveCommand, HeadingCorrection, MissionStatus, PoseEstimate};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut location = node.latest::<PoseEstimate>("location/pose")?;
        let mut correction = node.optional_reference::<HeadingCorrection>("heading/correction")?;
        let mut mission = node.optional_reference::<MissionStatus>("mission/status")?;
        let mut command = node.optional_reference::<DriveCommand>("drive/command")?;
        let mut clearance = node.optional_reference::<Clearance>("safety/clearance")?;
        let mut state = node.publisher::<CurrentState>("state/current")?;
        node.wake_on(&location);
        node.wake_on(&correction);
        node.wake_on(&mission);
        node.wake_on(&command);
        node.wake_on(&clearance);
        node.every(params.period());
        let mut current = CurrentStateService::new(params)?;
        Ok(move |now| {
            let inputs = Inputs {
                location: location.read(),
                correction: correction.read(),
                mission: mission.read(),
                command: command.read(),
                clearance: clearance.read(),
            };
            if let Some(message) = current.step(now, inputs).state {
                state.publish(&message);
            }
        })
    })
}
