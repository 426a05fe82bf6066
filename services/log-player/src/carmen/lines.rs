//! One line.

use super::clock::Stamps;
use super::survey::{Form, LaserLine, Survey, is_keyword};
use crate::log::{Fault, Remark, Words, beginning};
use crate::params::Params;
use geometry::Pose2;
use std::f64::consts::{FRAC_PI_2, TAU};

/// What a line holds that is played.
#[derive(Debug)]
pub(super) enum Line {
    Odometry(Pose2),
    Truth(Pose2),
    Scan(Box<Scan>),
}

/// A scan, first with poses in the map.
#[derive(Debug)]
pub(super) struct Scan {
    /// The laser's pose.
    pub(super) laser: Pose2,
    /// The robot's pose, where the line holds one.
    pub(super) robot: Option<Pose2>,
    /// The odometry, where no other line holds it.
    pub(super) odometry: Option<Pose2>,
    pub(super) angle_min_rad: f64,
    pub(super) angle_step_rad: f64,
    pub(super) range_max_m: Option<f64>,
    pub(super) ranges_m: Vec<f32>,
}

impl Line {
    /// A number for each kind of line: each kind has an order of its own.
    pub(super) fn kind(&self) -> usize {
        match self {
            Self::Odometry(_) => 0,
            Self::Truth(_) => 1,
            Self::Scan(_) => 2,
        }
    }
}

/// `time host logger-time`.
const TAIL: usize = 3;

/// Reads a line; `None` for one that is not played.
pub(super) fn read(
    line: &str,
    laser: Option<&'static LaserLine>,
    version: Option<Version>,
    survey: &Survey<'_>,
    params: &Params,
    remarks: &mut Vec<Remark>,
) -> Result<Option<(Stamps, Line)>, Fault> {
    let Some(keyword) = line.split_ascii_whitespace().next() else { return Ok(None) };
    let played = match (keyword, laser) {
        ("ODOM", _) => {
            let words = Words::exactly("ODOM", line, 7 + TAIL)?;
            (stamps(&words)?, Line::Odometry(words.pose(1)?))
        }
        ("TRUEPOS", _) => {
            let words = Words::exactly("TRUEPOS", line, 7 + TAIL)?;
            (stamps(&words)?, Line::Truth(words.pose(1)?))
        }
        (_, Some(laser)) if laser.keyword == keyword => {
            let words = Words::new(laser.keyword, line);
            (stamps(&words)?, Line::Scan(Box::new(scan(&words, laser, version, survey, params, remarks)?)))
        }
        // Told once a kind.
        (keyword, _) if keyword.starts_with('#') || is_keyword(keyword) => return Ok(None),
        (word, _) => return Err(Fault::UnknownLine { word: beginning(word) }),
    };
    Ok(Some(played))
}

fn stamps(words: &Words<'_>) -> Result<Stamps, Fault> {
    let count = words.words.len();
    let logger = words.number(count.saturating_sub(1))?;
    // The message's own stamp may be garbled where the logger's is not.
    Ok(Stamps { logger, message: words.number(count.saturating_sub(TAIL)).unwrap_or(f64::NAN) })
}

fn scan(
    words: &Words<'_>,
    laser: &'static LaserLine,
    version: Option<Version>,
    survey: &Survey<'_>,
    params: &Params,
    remarks: &mut Vec<Remark>,
) -> Result<Scan, Fault> {
    match laser.form {
        Form::Old | Form::OldRaw => {
            let beams = words.beams(1)?;
            let poses = 6 * usize::from(laser.form == Form::Old);
            words.need(2 + beams + poses + TAIL)?;
            let step_rad = guessed_step_rad(laser, beams, survey, params, remarks);
            let scan = Scan {
                laser: Pose2::IDENTITY,
                robot: None,
                odometry: None,
                angle_min_rad: first_beam_rad(beams, step_rad),
                angle_step_rad: step_rad,
                range_max_m: survey.range_max_m(laser),
                ranges_m: words.ranges(2, beams)?,
            };
            if laser.form == Form::OldRaw { Ok(scan) } else { with_poses(scan, words, 2 + beams) }
        }
        Form::Robot | Form::Raw => {
            let layout = version.and_then(|version| version.layout(words, laser.form == Form::Robot));
            let (keyword, count) = (words.keyword, words.words.len());
            let layout = layout.ok_or(Fault::NoVersion { keyword, words: count })?;
            let (angle_min_rad, step_rad) = (words.number(2)?, words.number(4)?);
            let fov_rad = words.number(3)?;
            let last = layout.beams.saturating_sub(1) as f64;
            // Some drivers leave the step out; the field of view says it too.
            let angle_step_rad = if step_rad == 0.0 && last > 0.0 { fov_rad / last } else { step_rad };
            let span_rad = (angle_step_rad * last).abs();
            if angle_min_rad.abs() > TAU || span_rad > TAU + 0.1 || (last > 0.0 && span_rad == 0.0) {
                let (start_rad, step_rad) = (angle_min_rad, angle_step_rad);
                return Err(Fault::NoDirections { keyword: laser.keyword, start_rad, step_rad });
            }
            let scan = Scan {
                laser: Pose2::IDENTITY,
                robot: None,
                odometry: None,
                angle_min_rad,
                angle_step_rad,
                range_max_m: Some(words.number(5)?).filter(|range| *range > 0.0),
                ranges_m: words.ranges(layout.ranges_at, layout.beams)?,
            };
            match layout.poses_at {
                Some(at) => with_poses(scan, words, at),
                None => Ok(scan),
            }
        }
    }
}

fn with_poses(scan: Scan, words: &Words<'_>, at: usize) -> Result<Scan, Fault> {
    Ok(Scan { laser: words.pose(at)?, robot: Some(words.pose(at + 3)?), ..scan })
}

/// How a CARMEN writes lines that hold directions: the older ones leave things out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Version {
    /// Numbers before the count of beams, with the remission mode or without.
    settings: usize,
    /// Whether the strengths of the echoes follow, with their count.
    has_strengths: bool,
    /// Numbers of the robot after the poses.
    tail: usize,
}

/// Lines that are looked at to tell the version of a log.
const SAMPLE: usize = 25;

impl Version {
    /// Every version there is, the most usual first.
    fn all(has_poses: bool) -> impl Iterator<Item = Self> {
        let tails: &[usize] = if has_poses { &[5, 4] } else { &[0] };
        let strengths = [true, false].into_iter();
        strengths.flat_map(move |has_strengths| {
            let settings = [7, 6].into_iter();
            settings.flat_map(move |settings| {
                tails.iter().map(move |&tail| Self { settings, has_strengths, tail })
            })
        })
    }

    /// The one that fits most of a log's first lines. A single line may fit two, where a count of beams lies.
    pub(super) fn of(text: &str, laser: &'static LaserLine) -> Option<Self> {
        let lines = text.lines().filter(|line| line.split_ascii_whitespace().next() == Some(laser.keyword));
        let sample: Vec<Words<'_>> = lines.take(SAMPLE).map(|line| Words::new(laser.keyword, line)).collect();
        let has_poses = laser.form == Form::Robot;
        let fits =
            |version: &Self| sample.iter().filter(|words| version.layout(words, has_poses).is_some()).count();
        let versions: Vec<(usize, Self)> =
            Self::all(has_poses).map(|version| (fits(&version), version)).collect();
        // Of equals `max_by_key` takes the last.
        versions
            .into_iter()
            .rev()
            .filter(|(fits, _)| *fits > 0)
            .max_by_key(|(fits, _)| *fits)
            .map(|(_, version)| version)
    }

    fn layout(self, words: &Words<'_>, has_poses: bool) -> Option<Layout> {
        let beams = words.count(self.settings + 1).filter(|&beams| beams > 0)?;
        let ranges_at = self.settings + 2;
        let end = ranges_at + beams;
        let strengths = if self.has_strengths { 1 + words.count(end)? } else { 0 };
        let poses = if has_poses { 6 + self.tail } else { 0 };
        let is_whole = end + strengths + poses + TAIL == words.words.len();
        is_whole.then(|| Layout { ranges_at, beams, poses_at: has_poses.then_some(end + strengths) })
    }
}

/// Where things stand in a line that holds directions.
#[derive(Debug)]
struct Layout {
    ranges_at: usize,
    beams: usize,
    poses_at: Option<usize>,
}

/// Direction of the first beam: the last of 180 or 360 beams is left out, so that the first looks exactly to
/// the right.
fn first_beam_rad(beams: usize, step_rad: f64) -> f64 {
    let spans_half_a_turn = (beams as f64 * step_rad - std::f64::consts::PI).abs() < 1.5 * step_rad;
    if spans_half_a_turn { -FRAC_PI_2 } else { -0.5 * step_rad * (beams.max(1) - 1) as f64 }
}

/// From one beam to the next of a scan that does not say it: as the parameters say, or the log's, or as the
/// instruments have it that give so many beams. A guess is told, once a count.
fn guessed_step_rad(
    laser: &'static LaserLine,
    beams: usize,
    survey: &Survey<'_>,
    params: &Params,
    remarks: &mut Vec<Remark>,
) -> f64 {
    let between = (beams.max(2) - 1) as f64;
    if params.laser_fov_rad > 0.0 {
        return params.laser_fov_rad / between;
    }
    let from_log = survey.beam_step_deg(laser);
    let (step_deg, how) = match (beams, from_log) {
        // Every SICK that CARMEN knew.
        (180 | 181, _) => return 1.0_f64.to_radians(),
        (360 | 361, _) => return 0.5_f64.to_radians(),
        (_, Some(step_deg)) => (step_deg, "as a PARAM line says"),
        (400 | 401, _) => (0.25, "as of a SICK that looks 100 degrees wide"),
        (540 | 541, _) => (0.5, "as of an instrument that looks 270 degrees wide"),
        (1080 | 1081, _) => (0.25, "as of an instrument that looks 270 degrees wide"),
        (682 | 683 | 726 | 768 | 769, _) => (360.0 / 1024.0, "as of a Hokuyo"),
        _ => (180.0 / between, "as 180 degrees in all; say it by `laser_fov_rad`"),
    };
    let keyword = laser.keyword;
    let is_told = |remark: &Remark| matches!(remark, Remark::Beams { beams: known, .. } if *known == beams);
    let told = remarks.iter().filter(|remark| matches!(remark, Remark::Beams { .. })).count();
    if !remarks.iter().any(is_told) && told < crate::log::PROBLEM_LIMIT {
        remarks.push(Remark::Beams { keyword, beams, step_deg, how });
    }
    step_deg.to_radians()
}
