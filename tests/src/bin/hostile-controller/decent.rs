//! The controllers that drive decently, before.

use crate::params::{Decency, Params};
use board::{JoinError, Latest, Node};
use messages::{
    Clearance, DriveCommand, MotionCommand, MotionReport, Odometry, Path, PoseEstimate, RangeScan, Time,
    TofRanges, WheelSpeeds,
};

/// One of them, with its ports.
pub(crate) enum Decent {
    None,
    Fuzzy(Box<Fuzzy>),
    Motion(Box<Motion>),
}

pub(crate) struct Fuzzy {
    controller: fuzzy_controller::FuzzyController,
    command: Latest<DriveCommand>,
    path: Latest<Path>,
    pose: Latest<PoseEstimate>,
    ranges: Latest<TofRanges>,
    scan: Latest<RangeScan>,
    odometry: Latest<Odometry>,
}

pub(crate) struct Motion {
    controller: move_controller::MoveController,
    command: Latest<MotionCommand>,
    odometry: Latest<Odometry>,
    clearance: Latest<Clearance>,
}

impl Decent {
    pub(crate) fn open(node: &mut Node, params: &Params) -> Result<Self, board::SetupError> {
        Ok(match params.decent {
            Decency::None => Self::None,
            Decency::Fuzzy => Self::Fuzzy(Box::new(Fuzzy::open(node, params)?)),
            Decency::Motion => Self::Motion(Box::new(Motion::open(node, params)?)),
        })
    }

    pub(crate) fn step(&mut self, now: Time) -> (WheelSpeeds, Option<MotionReport>) {
        match self {
            Self::None => (WheelSpeeds::ZERO, None),
            Self::Fuzzy(fuzzy) => (fuzzy.step(now), None),
            Self::Motion(motion) => motion.step(now),
        }
    }
}

impl Fuzzy {
    fn open(node: &mut Node, params: &Params) -> Result<Self, board::SetupError> {
        Ok(Self {
            controller: fuzzy_controller::FuzzyController::new(params.fuzzy.clone())?,
            command: node.reference("drive/command")?,
            path: node.reference("plan/path")?,
            pose: node.latest("location/pose")?,
            ranges: node.latest("tof/ranges")?,
            scan: node.optional("laser/scan")?,
            odometry: node.optional("wheels/odometry")?,
        })
    }

    fn step(&mut self, now: Time) -> WheelSpeeds {
        let inputs = fuzzy_controller::Inputs {
            command: self.command.read(),
            path: self.path.read(),
            pose: self.pose.read(),
            ranges: self.ranges.read(),
            scan: self.scan.read(),
            odometry: self.odometry.read(),
        };
        self.controller.step(now, &inputs).wheels
    }
}

impl Motion {
    fn open(node: &mut Node, params: &Params) -> Result<Self, board::SetupError> {
        let (command, odometry, clearance): (_, _, Result<_, JoinError>) = (
            node.reference("motion/command")?,
            node.latest("wheels/odometry")?,
            node.latest("safety/clearance"),
        );
        let controller = move_controller::MoveController::new(params.motion.clone())?;
        Ok(Self { controller, command, odometry, clearance: clearance? })
    }

    fn step(&mut self, now: Time) -> (WheelSpeeds, Option<MotionReport>) {
        let inputs = move_controller::Inputs {
            command: self.command.read(),
            odometry: self.odometry.read(),
            clearance: self.clearance.read(),
        };
        let outputs = self.controller.step(now, inputs);
        (outputs.desired, Some(outputs.report))
    }
}
