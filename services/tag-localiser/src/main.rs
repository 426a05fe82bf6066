//! The process around `tag_localiser`.
use geometry::World;
use messages::{HeadingCorrection, Odometry, PoseEstimate, TagRanges, TofRanges};
use std::process::ExitCode;
use std::time::Duration;
use tag_localiser::{HallwayWalls, Inputs, Params, Snapshot, TagLocaliser};

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
        let mut tags = node.queue::<TagRanges>("tag/ranges")?;
        let mut ranges = node.optional::<TofRanges>("tof/ranges")?;
        let mut heading = node.optional_reference::<HeadingCorrection>("heading/correction")?;
        let mut pose = node.publisher::<PoseEstimate>("location/pose")?;
        node.wake_on(&odometry);
        node.wake_on(&tags);
        node.every(Duration::from_millis(100));
        let walls = match params.world.as_str() {
            "" => HallwayWalls::default(),
            file => HallwayWalls::of(&World::load(file)?),
        };
        let mut kept = node.kept::<Snapshot>();
        let mut localiser = TagLocaliser::new(params, walls)?;
        if let Some(snapshot) = kept.restore() {
            localiser.restore(&snapshot);
        }
        Ok(move |now| {
            let mut outputs = localiser.step(
                now,
                Inputs {
                    odometry: odometry.read(),
                    tag: tags.next(),
                    ranges: ranges.read(),
                    heading: heading.read(),
                },
            );
            while let Some(tag) = tags.next() {
                outputs = localiser.step(now, Inputs { tag: Some(tag), ..Inputs::default() });
            }
            pose.publish(&outputs.pose);
            if let Some(snapshot) = localiser.snapshot() {
                kept.save_now_and_then(now, || snapshot);
            }
        })
    })
}
