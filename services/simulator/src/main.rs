//! The process around `simulator`.
use messages::{AppliedWheels, ElevatorCall, ElevatorState, WorldTruth};
use simulator::{Inputs, Params, Simulator, Snapshot};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut applied = node.optional_reference::<AppliedWheels>("wheels/applied")?;
        let mut call = node.optional_reference::<ElevatorCall>("elevator/call")?;
        let mut truth = node.publisher::<WorldTruth>("world/truth")?;
        let mut elevator = node.publisher::<ElevatorState>("elevator/state")?;
        node.every(params.period());
        let mut kept = node.kept::<Snapshot>();
        let mut simulator = Simulator::new(params, node.seed())?;
        if let Some(snapshot) = kept.restore() {
            simulator.restore(&snapshot);
        }
        Ok(move |now| {
            let outputs = simulator.step(now, Inputs { applied: applied.read(), call: call.read() });
            truth.publish_with(outputs.truth, outputs.bodies);
            if let Some(state) = outputs.elevator {
                elevator.publish(&state);
            }
            kept.save_now_and_then(now, || simulator.snapshot());
        })
    })
}
