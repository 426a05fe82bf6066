//! The process around `particle_localiser`.
use messages::{Odometry, ParticleCloud, PoseEstimate, RangeScan};
use particle_localiser::{Inputs, Map, Params, ParticleLocaliser, Sensor, Snapshot};
use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let topic = match params.sensor {
            Sensor::Laser => "laser/scan",
            Sensor::Sonar => "sonar/scan",
        };
        let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
        let mut scans = node.queue::<RangeScan>(topic)?;
        let mut pose = node.publisher::<PoseEstimate>("location/pose")?;
        let mut particles = node.publisher::<ParticleCloud>("location/particles")?;
        node.wake_on(&odometry);
        node.wake_on(&scans);
        node.every(Duration::from_millis(100));
        let map = Map::load(&params)?;
        let mut kept = node.kept::<Option<Snapshot>>();
        let mut localiser = ParticleLocaliser::new(params, map, node.seed())?;
        if let Some(snapshot) = kept.restore().flatten() {
            localiser.restore(&snapshot);
        }
        Ok(move |now| {
            let mut inputs = Inputs { odometry: odometry.read(), scan: scans.next() };
            loop {
                let outputs = localiser.step(now, inputs);
                if let Some((header, elements)) = outputs.cloud {
                    particles.publish_with(&header, elements);
                }
                let estimate = outputs.pose;
                inputs = Inputs { odometry: None, scan: scans.next() };
                if inputs.scan.is_none() {
                    pose.publish(&estimate);
                    break;
                }
            }
            if localiser.last_update().is_some() {
                kept.save_now_and_then(now, || localiser.snapshot());
            }
        })
    })
}
