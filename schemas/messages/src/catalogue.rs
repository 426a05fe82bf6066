//! Every message type there is, described: for tools and tests that treat them all alike.

use crate::{Description, Message};

/// The descriptions of all messages of this crate, in order of their names.
pub fn catalogue() -> Vec<Description> {
    macro_rules! all {
        ($($message:ident),* $(,)?) => { vec![$(crate::$message::description()),*] };
    }
    all![
        AnchorRange,
        AppliedWheels,
        Clearance,
        CurrentState,
        DoorSighting,
        DriveCommand,
        ElevatorCall,
        ElevatorState,
        HeadingCorrection,
        Health,
        JourneyStatus,
        Metric,
        MissionStatus,
        MotionCommand,
        MotionReport,
        NearPoint,
        OccupancyMap,
        Odometry,
        Order,
        OrderReport,
        Particle,
        ParticleCloud,
        Path,
        PlanRequest,
        PoseCluster,
        PoseEstimate,
        RangeScan,
        RunSummary,
        SonarAhead,
        SonarCommand,
        TagRanges,
        TofRanges,
        TrueBody,
        TruePose,
        WallSurvey,
        Waypoint,
        WheelSpeeds,
        WorldTruth,
    ]
}

#[cfg(test)]
mod tests {
    /// The names of the structs that derive `Message`, read from the sources.
    fn declared() -> Vec<String> {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut names = Vec::new();
        for file in std::fs::read_dir(folder).unwrap() {
            let path = file.unwrap().path();
            if path.is_dir()
                || path.file_name().is_some_and(|name| name == "tests.rs" || name == "catalogue.rs")
            {
                continue;
            }
            let text = std::fs::read_to_string(path).unwrap();
            let mut derives = false;
            for line in text.lines() {
                derives |= line.starts_with("#[derive(") && line.contains(" Message)");
                if let Some(rest) = line.strip_prefix("pub struct ")
                    && std::mem::take(&mut derives)
                {
                    names.push(rest.split(|c: char| !c.is_alphanumeric()).next().unwrap().to_owned());
                }
            }
        }
        names.sort();
        names
    }

    #[test]
    fn the_catalogue_is_complete() {
        let listed: Vec<String> =
            super::catalogue().into_iter().map(|description| description.name).collect();
        assert_eq!(listed, declared());
    }
}
