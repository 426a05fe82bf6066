//! Odometry of logs whose poses were corrected later: after each scan it begins anew at the scan's corrected
//! pose, so that only the ways between two scans are what the robot's wheels said.

use super::{Moment, lines::Line};
use crate::log::{Log, Remark};
use crate::params::OdometryLines;
use geometry::Pose2;

/// Poses that differ by no more are the same one, written twice.
const SAME: f64 = 1e-9;
/// After so many of all scans the odometry begins at the scan's pose, if it was corrected with it.
const NEARLY_ALL: f64 = 0.9;

/// Leaves of the odometry what is asked for, and says what it is.
pub(super) fn settle(moments: &mut [Moment], wanted: OdometryLines, log: &mut Log) {
    match wanted {
        OdometryLines::Recorded => {
            let (repeats, scans) = begun_at_scans(moments);
            if scans > 1 && repeats as f64 >= NEARLY_ALL * scans as f64 {
                log.remarks.push(Remark::OdometryAtScans { repeats, scans });
            }
        }
        OdometryLines::BetweenScans => {
            let steps = chain(moments);
            log.remarks.push(Remark::OdometryBetweenScans { steps });
        }
    }
}

/// How often the first odometry after a scan is that scan's pose, and of how many times.
fn begun_at_scans(moments: &[Moment]) -> (usize, usize) {
    let (mut scanned, mut repeats, mut scans) = (None, 0, 0);
    for moment in moments {
        match &moment.what {
            Line::Scan(scan) => scanned = scan.robot,
            Line::Odometry(pose) => {
                if let Some(robot) = scanned.take() {
                    scans += 1;
                    let moved =
                        [pose.x_m - robot.x_m, pose.y_m - robot.y_m, pose.heading_rad - robot.heading_rad];
                    repeats += usize::from(moved.iter().all(|part| part.abs() <= SAME));
                }
            }
            Line::Truth(_) => {}
        }
    }
    (repeats, scans)
}

/// Puts the ways between two scans one to the other's end; so many steps to a scan's pose are left out.
fn chain(moments: &mut [Moment]) -> usize {
    // In the log, and in the odometry that is made of it.
    let (mut last, mut here): (Option<Pose2>, Option<Pose2>) = (None, None);
    let mut left_out = 0;
    for moment in moments {
        match &mut moment.what {
            Line::Scan(scan) => {
                let Some(robot) = scan.robot else { continue };
                left_out += usize::from(last.is_some());
                last = Some(robot);
                here = here.or(last);
            }
            Line::Odometry(pose) => {
                let step = last.replace(*pose).map_or(Pose2::IDENTITY, |last| last.to(*pose));
                *pose = here.map_or(*pose, |here| here.compose(step));
                here = Some(*pose);
            }
            Line::Truth(_) => {}
        }
    }
    left_out
}
