//! People who walk about.

use crate::{Params, obstacles::Footprint};
use geometry::{Pose2, world::Walker};

/// So near a squeezing person comes, and no nearer.
const SQUEEZE_M: f64 = 0.12;
/// The distance at which people step back from a robot that moves.
const STEP_BACK_M: f64 = 0.25;

/// One person.
#[derive(Debug, Clone)]
pub(crate) struct Person {
    walker: Walker,
    has_set_out: bool,
    walked_s: f64,
    waited_s: f64,
    pub(crate) pose: Pose2,
}

/// The robot as people see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RobotSeen {
    pub(crate) floor: i32,
    pub(crate) pose: Pose2,
    pub(crate) stands: bool,
    pub(crate) footprint: Footprint,
}

impl Person {
    pub(crate) fn new(walker: Walker) -> Self {
        let pose = walker.pose(0.0);
        Self { walker, has_set_out: false, walked_s: 0.0, waited_s: 0.0, pose }
    }

    /// Whether they have set out, how far they are, and how long they have waited.
    pub(crate) fn kept(&self) -> (bool, f64, f64) {
        (self.has_set_out, self.walked_s, self.waited_s)
    }

    /// Goes on from there.
    pub(crate) fn go_on(&mut self, (has_set_out, walked_s, waited_s): (bool, f64, f64)) {
        if walked_s.is_finite() && waited_s.is_finite() {
            (self.has_set_out, self.walked_s, self.waited_s) = (has_set_out, walked_s, waited_s);
            self.pose = self.walker.pose(walked_s);
        }
    }

    pub(crate) fn floor(&self) -> i32 {
        self.walker.floor
    }

    /// Whether the robot's body touches the person.
    pub(crate) fn is_touched(&self, footprint: &Footprint, pose: Pose2) -> bool {
        footprint.distance_m(pose, self.pose.position()) < self.walker.radius_m
    }

    /// One step along the path, unless the robot is in the way. A person approaches the robot's body up to
    /// `walkers_wait_m`, waits there, steps back the way it came when the robot comes nearer, and squeezes
    /// past when the robot has stood there for a while.
    pub(crate) fn walk(&mut self, params: &Params, now_s: f64, seconds: f64, robot: &RobotSeen) {
        let here = robot.floor == self.walker.floor;
        if !self.has_set_out {
            let distance_m = if here { self.pose.distance_m(robot.pose) } else { f64::INFINITY };
            self.has_set_out = self.walker.starts.goes_off(now_s, distance_m);
            if !self.has_set_out {
                return;
            }
        }
        let next = self.walker.pose(self.walked_s + seconds);
        if here && params.walkers_wait {
            let gap_m =
                |pose: Pose2| robot.footprint.distance_m(robot.pose, pose.position()) - self.walker.radius_m;
            let (now_m, next_m) = (gap_m(self.pose), gap_m(next));
            let approaches = next_m < now_m;
            if !robot.stands && now_m < STEP_BACK_M && approaches {
                let back_s = (self.walked_s - seconds).max(0.0);
                let back = self.walker.pose(back_s);
                if gap_m(back) > now_m {
                    (self.walked_s, self.pose) = (back_s, back);
                    return;
                }
            }
            let patient = self.waited_s < params.walkers_patience_s || !robot.stands;
            let limit_m = if patient { params.walkers_wait_m } else { SQUEEZE_M };
            if approaches && next_m < limit_m {
                self.waited_s += seconds;
                return;
            }
            // Patience lasts until the robot is left behind.
            if next_m > params.walkers_wait_m {
                self.waited_s = 0.0;
            }
        }
        self.walked_s += seconds;
        self.pose = next;
    }
}
