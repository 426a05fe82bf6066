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
        let mut odometry = node.queue::<Odometry>("wheels/odometry")?;
        let mut scans = node.queue::<RangeScan>(topic)?;
        let mut pose = node.publisher::<PoseEstimate>("location/pose")?;
        let mut particles = node.publisher::<ParticleCloud>("location/particles")?;
        node.wake_on(&odometry);
        node.wake_on(&scans);
        node.every(Duration::from_millis(100));
        Map::check(&params)?;
        node.declared()?;
        let map = Map::load(&params)?;
        let mut kept = node.kept::<Option<Snapshot>>();
        let mut localiser = ParticleLocaliser::new(params, map, node.seed())?;
        if let Some(snapshot) = kept.restore().flatten() {
            localiser.restore(&snapshot);
        }
        Ok(move |now| {
            // In the order of their publication: which odometry belongs to a scan must not depend on when
            // this process is woken.
            let (mut way, mut scan) = (odometry.next(), scans.next());
            loop {
                let is_scan = match (&way, &scan) {
                    (Some(way), Some(scan)) => scan.stamp < way.stamp,
                    (way, _) => way.is_none(),
                };
                let inputs = match is_scan {
                    true => Inputs { odometry: None, scan },
                    false => Inputs { odometry: way, scan: None },
                };
                let outputs = localiser.step(now, inputs);
                if let Some((header, elements)) = outputs.cloud {
                    particles.publish_with(&header, elements);
                }
                let estimate = outputs.pose;
                (way, scan) = match is_scan {
                    true => (way, scans.next()),
                    false => (odometry.next(), scan),
                };
                if way.is_none() && scan.is_none() {
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
