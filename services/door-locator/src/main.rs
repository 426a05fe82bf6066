//! The process around `door_locator`.
use door_locator::{DoorLocator, Inputs, Params};
use messages::{DoorSighting, MissionStatus, Odometry, PoseEstimate, TofRanges};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut ranges = node.latest::<TofRanges>("tof/ranges")?;
        let mut location = node.reference::<PoseEstimate>("location/pose")?;
        let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
        let mut mission = node.optional_reference::<MissionStatus>("mission/status")?;
        let mut door = node.publisher::<DoorSighting>("door/sighting")?;
        node.wake_on(&ranges);
        let mut locator = DoorLocator::new(params)?;
        Ok(move |now| {
            let inputs = Inputs {
                ranges: ranges.read(),
                location: location.read(),
                odometry: odometry.read(),
                mission: mission.read(),
            };
            if let Some(sighting) = locator.step(now, inputs).sighting {
                door.publish(&sighting);
            }
        })
    })
}
