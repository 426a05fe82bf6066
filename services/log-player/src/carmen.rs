//! CARMEN logs (Montemerlo, Roy, Thrun 2003; the lines as its logger writes them), in metres, radians and
//! seconds. Each line ends with `time host logger-time`; what stands before:
//!
//! - `ODOM x y theta tv rv accel`: the odometry;
//! - `FLASER n r1 .. rn x y theta odom_x odom_y odom_theta` and `RLASER`: a scan ahead or to the rear, the
//!   laser's pose and the robot's;
//! - `ROBOTLASER1 type start fov step max accuracy remission n r1 .. rn m s1 .. sm`, then the laser's pose,
//!   the robot's, and five numbers of the robot; `ROBOTLASER2` to the rear. Older ones have no `remission`,
//!   or no strengths;
//! - `RAWLASER1` to `RAWLASER5` likewise without poses, `LASER3` to `LASER5` as the first two without;
//! - `TRUEPOS x y theta odom_x odom_y odom_theta`: where a simulated robot really was;
//! - `PARAM name value`: where lasers sit, and what a beam's width is.
//!
//! In a corrected log the pose of a scan is where the robot really was. One laser is played, of the lines
//! that say most of it.

mod clock;
mod lines;
mod pieces;
mod survey;

use crate::log::{Entry, Fault, Log, MOST_RECORDS, Record, Remark};
use crate::params::{Params, Timing};
use clock::Stamps;
use geometry::Pose2;
use lines::{Line, Scan, Version};
use survey::{LaserLine, Survey};

/// Poses on which a laser keeps its place on the robot agree to this, in metres and radians.
const MOUNT_TOLERANCE: f64 = 0.02;
/// No laser sits farther from the middle of a robot that drives in buildings, in metres.
const MOUNT_MAX_M: f64 = 2.0;

/// Reads the text of a log.
pub fn read(text: &str, timing: Timing, period_s: f64) -> Log {
    read_as(text, &Params { timing, period_s, ..Params::default() })
}

/// A line that is played.
#[derive(Debug)]
struct Moment {
    /// Counted from 1.
    line: usize,
    stamps: Stamps,
    what: Line,
}

/// Reads the text of a log as the parameters say.
pub(crate) fn read_as(text: &str, params: &Params) -> Log {
    let text = text.trim_start_matches('\u{feff}');
    let mut log = Log::default();
    let survey = Survey::of(text);
    let laser = survey.choose(params.laser);
    survey.tell(laser, &mut log);
    if let (None, Some(number)) = (laser, params.laser.number()) {
        log.note(0, Fault::NoSuchLaser { number });
    }
    let version = laser.and_then(|laser| Version::of(text, laser));
    let mut moments: Vec<Moment> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if moments.len() >= MOST_RECORDS {
            log.note(index + 1, Fault::TooMany);
            break;
        }
        match lines::read(line, laser, version, &survey, params, &mut log.remarks) {
            Ok(Some((stamps, what))) => moments.push(Moment { line: index + 1, stamps, what }),
            Ok(None) => {}
            Err(fault) => log.note(index + 1, fault),
        }
    }
    if let Some(laser) = laser {
        settle_poses(&mut moments, laser, &survey, &mut log);
        pieces::settle(&mut moments, params.odometry, &mut log);
    }
    let stamps: Vec<_> =
        moments.iter().map(|moment| (moment.line, moment.what.kind(), moment.stamps)).collect();
    let times = clock::times(&stamps, params.timing, params.period_s, &mut log);
    drop(stamps);
    let has_truth = survey.has_lines("TRUEPOS");
    log.truth_is_of_scans = !has_truth;
    log.entries.reserve(moments.len());
    for (moment, at_s) in moments.into_iter().zip(times) {
        let mut push = |record| log.entries.push(Entry { at_s, record });
        match moment.what {
            Line::Odometry(pose) => push(Record::Odometry(pose)),
            Line::Truth(pose) => push(Record::Truth(pose)),
            Line::Scan(scan) => {
                let Scan { laser, robot, odometry, angle_min_rad, angle_step_rad, range_max_m, ranges_m } =
                    *scan;
                // The odometry of a moment comes before what was seen there.
                odometry.into_iter().for_each(|pose| push(Record::Odometry(pose)));
                push(Record::Scan { sensor: laser, angle_min_rad, angle_step_rad, range_max_m, ranges_m });
                robot.filter(|_| !has_truth).into_iter().for_each(|pose| push(Record::Truth(pose)));
            }
        }
    }
    log.settle(params.period_s);
    log
}

/// From the poses of laser and robot in the map to the laser's place on the robot, and the robot's in the
/// map.
fn settle_poses(moments: &mut [Moment], laser: &LaserLine, survey: &Survey<'_>, log: &mut Log) {
    let scans = || {
        moments.iter().filter_map(|moment| match &moment.what {
            Line::Scan(scan) => Some(scan),
            Line::Odometry(_) | Line::Truth(_) => None,
        })
    };
    let mounts = || scans().filter_map(|scan| Some(scan.robot?.to(scan.laser)));
    let first = mounts().next();
    let is_fixed = |first: Pose2| {
        first.x_m.hypot(first.y_m) <= MOUNT_MAX_M
            && mounts().all(|mount| {
                let change = first.to(mount);
                [change.x_m, change.y_m, change.heading_rad].iter().all(|part| part.abs() <= MOUNT_TOLERANCE)
            })
    };
    let fixed = first.filter(|first| is_fixed(*first));
    if first.is_some() && fixed.is_none() {
        log.remarks.push(Remark::CorrectedPoses);
    }
    // Of poses with a rounded difference none is moved.
    let fixed = fixed.map(|mount| if is_nothing(mount) { Pose2::IDENTITY } else { mount });
    let mount = fixed.unwrap_or_else(|| survey.mount(laser));
    let has_odometry = survey.has_lines("ODOM");
    let from_scans = first.is_some() && !has_odometry;
    if from_scans {
        log.remarks.push(Remark::OdometryOfScans { keyword: laser.keyword });
    }
    for moment in moments {
        let Line::Scan(scan) = &mut moment.what else { continue };
        if let Some(robot) = scan.robot {
            scan.odometry = from_scans.then_some(robot);
            scan.robot = Some(if fixed.is_some() { robot } else { scan.laser.compose(mount.inverse()) });
        }
        scan.laser = mount;
    }
}

fn is_nothing(mount: Pose2) -> bool {
    [mount.x_m, mount.y_m, mount.heading_rad].iter().all(|part| part.abs() < 1e-6)
}
