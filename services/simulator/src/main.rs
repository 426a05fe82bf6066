//! The process around `simulator`.
use messages::{AppliedWheels, ElevatorCall, ElevatorState, WorldTruth};
use simulator::{Inputs, Params, Simulator};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut applied = node.optional_reference::<AppliedWheels>("wheels/applied")?;
        let mut call = node.optional_reference::<ElevatorCall>("elevator/call")?;
        let mut truth = node.publisher::<WorldTruth>("world/truth")?;
        let mut elevator = node.publisher::<ElevatorState>("elevator/state")?;
        node.every(params.period());
        let mut simulator = Simulator::new(params, node.seed())?;
        Ok(move |now| {
            let outputs = simulator.step(now, Inputs { applied: applied.read(), call: call.read() });
            truth.publish_with(outputs.truth, outputs.bodies);
            if let Some(state) = outputs.elevator {
                elevator.publish(&state);
            }
        })
    })
}
