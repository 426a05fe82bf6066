//! Plays a recorded drive onto the board: odometry, radio ranges, laser scans and, where it is known, the
//! truth.
//!
//! Everything is published in one frame, that of the true poses; a log is read whole before the first step,
//! and a step says what is due.

mod carmen;
mod load;
mod log;
mod params;
mod steps;

#[cfg(test)]
mod tests;

pub use carmen::read as read_carmen;
pub use load::{LoadError, check_files, load};
pub use log::{Entry, Fault, Log, PROBLEM_LIMIT, Problem, Record, Remark, Times};
pub use params::{AnchorPlace, Format, Laser, OdometryLines, Params, ParamsError, Pose, Scans, Timing};
pub use steps::read as read_steps;

use geometry::Pose2;
use messages::{
    ANCHOR_CAPACITY, AnchorRange, LocationStateName, Odometry, Parameters, PoseEstimate, RangeScan,
    TagRanges, Time, TruePose,
};
use std::time::Duration;

/// A message of the log.
#[derive(Debug, Clone, PartialEq)]
pub enum Due {
    /// For `wheels/odometry`.
    Odometry(Odometry),
    /// For `tag/ranges`.
    Tag(Box<TagRanges>),
    /// For `laser/scan`: the header and one range a beam.
    Scan(RangeScan, Vec<f32>),
    /// For `truth/pose`.
    Truth(TruePose),
}

/// The player.
#[derive(Debug, Clone)]
pub struct LogPlayer {
    /// What is played, in order.
    entries: Vec<Entry>,
    writer: Writer,
    due: Vec<Due>,
    next: usize,
    begun: Option<Time>,
    problems: Vec<Problem>,
    problem_count: usize,
    remarks: Vec<Remark>,
}

impl LogPlayer {
    /// A player of a log that is read already.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: &Params, log: Log) -> Result<Self, ParamsError> {
        params.check()?;
        let Log { mut entries, mut problems, mut problem_count, remarks, truth_is_of_scans } = log;
        leave_out(&mut entries, params, truth_is_of_scans);
        let last_truth = entries.iter().rposition(|entry| matches!(entry.record, Record::Truth(_)));
        let writer = Writer::new(params, last_truth);
        // A time beyond any clock cannot become a duration; such an entry never comes.
        entries.truncate(entries.partition_point(|entry| writer.at(entry).is_some()));
        for id in unknown_anchors(&entries, params) {
            problem_count += 1;
            problems.push(Problem { line: 0, fault: Fault::UnknownAnchor { id } });
        }
        Ok(Self { entries, writer, due: Vec::new(), next: 0, begun: None, problems, problem_count, remarks })
    }

    /// What is due since the last step, in order. The play begins with the first step.
    pub fn step(&mut self, now: Time) -> &[Due] {
        let begun = *self.begun.get_or_insert(now);
        self.due.clear();
        while let Some(entry) = self.entries.get_mut(self.next)
            && self.writer.at(entry).is_some_and(|at| begun.after(at) <= now)
        {
            self.due.push(self.writer.write(self.next, entry));
            self.next += 1;
        }
        &self.due
    }

    /// Whether everything was played.
    pub fn is_finished(&self) -> bool {
        self.next == self.entries.len()
    }

    /// How long the play takes in all.
    pub fn length(&self) -> Duration {
        self.entries.last().and_then(|entry| self.writer.at(entry)).unwrap_or_default()
    }

    /// What of the log could not be played, the first of it.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// How much of the log could not be played.
    pub fn problem_count(&self) -> usize {
        self.problem_count
    }

    /// How the log was read, where it leaves a choice.
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }
}

/// Takes away the scans that are not to be played and, where a log holds the truth of each scan beside it,
/// that. A truth that stands in for a localiser's pose comes at once with its scan.
fn leave_out(entries: &mut Vec<Entry>, params: &Params, truth_is_of_scans: bool) {
    let (mut number, mut plays, mut scan_s) = (0, true, 0.0);
    entries.retain_mut(|entry| match entry.record {
        Record::Scan { .. } => {
            plays = params.scans.plays(number);
            number += 1;
            scan_s = entry.at_s;
            plays
        }
        Record::Truth(_) if truth_is_of_scans => {
            if params.truth_as_location {
                entry.at_s = scan_s;
            }
            plays
        }
        _ => true,
    });
}

/// The anchors that were heard and have no place, the first of them.
fn unknown_anchors(entries: &[Entry], params: &Params) -> Vec<u32> {
    let mut unknown = Vec::new();
    for entry in entries {
        let Record::Ranges { heard, .. } = &entry.record else { continue };
        for &(id, _) in heard {
            let is_known = unknown.contains(&id) || params.anchors.iter().any(|anchor| anchor.id == id);
            if !is_known && unknown.len() < PROBLEM_LIMIT {
                unknown.push(id);
            }
        }
    }
    unknown
}

/// Where a localiser that knows the truth says that the robot is.
pub fn located(truth: &TruePose) -> PoseEstimate {
    PoseEstimate {
        x_m: truth.x_m,
        y_m: truth.y_m,
        heading_rad: truth.heading_rad,
        covariance: [0.0; 9],
        floor: truth.floor,
        state: LocationStateName::Tracking.into(),
        ..PoseEstimate::default()
    }
}

/// Turns records into messages, one after the other.
#[derive(Debug, Clone)]
struct Writer {
    params: Params,
    /// Which entry is the last true pose.
    last_truth: Option<usize>,
    last: Option<(f64, Pose2)>,
    left_travel_m: f64,
    right_travel_m: f64,
}

impl Writer {
    fn new(params: &Params, last_truth: Option<usize>) -> Self {
        Self { params: params.clone(), last_truth, last: None, left_travel_m: 0.0, right_travel_m: 0.0 }
    }

    /// The time since the beginning of the play at which an entry is due.
    fn at(&self, entry: &Entry) -> Option<Duration> {
        Duration::try_from_secs_f64(self.params.start_delay_s + entry.at_s / self.params.speed).ok()
    }

    /// The message of an entry, which is played once: what it holds moves on.
    fn write(&mut self, index: usize, entry: &mut Entry) -> Due {
        let at_s = entry.at_s;
        match &mut entry.record {
            Record::Odometry(pose) => Due::Odometry(self.odometry(at_s, *pose)),
            Record::Ranges { antenna_m, heard } => Due::Tag(Box::new(self.tag(*antenna_m, heard))),
            Record::Scan { sensor, angle_min_rad, angle_step_rad, range_max_m, ranges_m } => {
                let header = RangeScan {
                    sensor_x_m: sensor.x_m,
                    sensor_y_m: sensor.y_m,
                    sensor_heading_rad: sensor.heading_rad,
                    angle_min_rad: *angle_min_rad,
                    angle_step_rad: *angle_step_rad,
                    range_max_m: range_max_m.unwrap_or(self.params.range_max_m),
                };
                Due::Scan(header, std::mem::take(ranges_m))
            }
            Record::Truth(pose) => Due::Truth(TruePose {
                x_m: pose.x_m,
                y_m: pose.y_m,
                heading_rad: pose.heading_rad,
                floor: 0,
                is_last: u32::from(self.last_truth == Some(index)),
            }),
        }
    }

    /// Speeds and the wheels' paths are made up from the change of the pose, in the time of the log.
    fn odometry(&mut self, at_s: f64, pose: Pose2) -> Odometry {
        let (last_s, last) = self.last.replace((at_s, pose)).unwrap_or((at_s, pose));
        let motion = last.to(pose);
        let path_m = motion.x_m.hypot(motion.y_m).copysign(motion.x_m);
        let half_m = 0.5 * self.params.wheel_track_m * motion.heading_rad;
        self.left_travel_m += path_m - half_m;
        self.right_travel_m += path_m + half_m;
        let passed_s = at_s - last_s;
        let per_second = |change: f64| if passed_s > 0.0 { change / passed_s } else { 0.0 };
        Odometry {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            forward_mps: per_second(path_m),
            turn_rad_per_s: per_second(motion.heading_rad),
            left_travel_m: self.left_travel_m,
            right_travel_m: self.right_travel_m,
        }
    }

    fn tag(&self, antenna_m: [f64; 3], heard: &[(u32, f64)]) -> TagRanges {
        let mut tag = TagRanges {
            antenna_x_m: antenna_m[0],
            antenna_y_m: antenna_m[1],
            antenna_z_m: antenna_m[2],
            ..TagRanges::default()
        };
        for &(id, range_m) in heard {
            let Some([x_m, y_m, z_m]) = self.params.anchor_in_map(id) else { continue };
            let index = tag.anchor_count as usize;
            if index < ANCHOR_CAPACITY {
                tag.anchors[index] = AnchorRange { x_m, y_m, z_m, range_m, id, quality_percent: 100.0 };
                tag.anchor_count += 1;
            }
        }
        tag
    }
}
