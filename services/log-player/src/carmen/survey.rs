//! What a log consists of, before any of it is read: how many lines of which kind, what its parameters are,
//! and so which laser is played.

use crate::log::{Fault, Log, Remark, beginning};
use crate::params::Laser;
use geometry::Pose2;
use std::collections::BTreeMap;

/// In what form a line holds a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// Ranges and two poses, no directions.
    Old,
    /// Ranges alone.
    OldRaw,
    /// Directions, ranges and two poses.
    Robot,
    /// Directions and ranges.
    Raw,
}

/// Lines that hold scans of a laser.
#[derive(Debug)]
pub(super) struct LaserLine {
    pub(super) keyword: &'static str,
    /// Which laser, by its number in today's logs: 1 looks ahead, 2 to the rear.
    pub(super) number: u32,
    pub(super) form: Form,
}

const fn laser(keyword: &'static str, number: u32, form: Form) -> LaserLine {
    LaserLine { keyword, number, form }
}

/// Every line that holds scans; of equals the first is played.
static LASERS: [LaserLine; 18] = [
    laser("ROBOTLASER1", 1, Form::Robot),
    laser("FLASER", 1, Form::Old),
    laser("ROBOTLASER0", 1, Form::Robot),
    laser("RAWLASER1", 1, Form::Raw),
    laser("RAWLASER0", 1, Form::Raw),
    laser("LASER1", 1, Form::OldRaw),
    laser("ROBOTLASER2", 2, Form::Robot),
    laser("RLASER", 2, Form::Old),
    laser("RAWLASER2", 2, Form::Raw),
    laser("LASER2", 2, Form::OldRaw),
    laser("ROBOTLASER3", 3, Form::Robot),
    laser("RAWLASER3", 3, Form::Raw),
    laser("LASER3", 3, Form::OldRaw),
    laser("ROBOTLASER4", 4, Form::Robot),
    laser("RAWLASER4", 4, Form::Raw),
    laser("LASER4", 4, Form::OldRaw),
    laser("RAWLASER5", 5, Form::Raw),
    laser("LASER5", 5, Form::OldRaw),
];

/// Lines that hold nothing a robot has sensed.
const IDLE: [&str; 13] = [
    "PARAM",
    "SYNC",
    "COMMENT",
    "NEFF",
    "ROBOTVELOCITY",
    "BASEVELOCITY",
    "VELOCITY",
    "VECTORMOVE",
    "FOLLOWTRAJECTORY",
    "SCANMARK",
    "POSITIONLASER",
    "GLOBALPOS",
    "MARKER",
];

/// Lines that are always read.
const READ: [&str; 3] = ["ODOM", "TRUEPOS", "PARAM"];

/// Kinds of lines that are told apart; a log of noise has more.
const MOST_KEYWORDS: usize = 200;

/// The lines of a log, counted, and its parameters.
#[derive(Debug, Default)]
pub(super) struct Survey<'a> {
    /// How many lines begin with a word, and the first of them.
    counts: BTreeMap<&'a str, (usize, usize)>,
    params: BTreeMap<&'a str, &'a str>,
}

impl<'a> Survey<'a> {
    pub(super) fn of(text: &'a str) -> Self {
        let mut survey = Self::default();
        for (index, line) in text.lines().enumerate() {
            let mut words = line.split_ascii_whitespace();
            let Some(keyword) = words.next().filter(|word| is_keyword(word)) else { continue };
            if survey.counts.len() < MOST_KEYWORDS || survey.counts.contains_key(keyword) {
                survey.counts.entry(keyword).or_insert((0, index + 1)).0 += 1;
            }
            if keyword == "PARAM"
                && let (Some(name), Some(value)) = (words.next(), words.next())
                && is_of_use(name)
            {
                survey.params.insert(name, value);
            }
        }
        survey
    }

    pub(super) fn has_lines(&self, keyword: &str) -> bool {
        self.counts.contains_key(keyword)
    }

    fn count(&self, keyword: &str) -> usize {
        self.counts.get(keyword).map_or(0, |(count, _)| *count)
    }

    /// The lines whose scans are played: of the laser asked for, or of the first there is. Those with poses
    /// say more than those without, and of them those of which there are most.
    pub(super) fn choose(&self, wanted: Laser) -> Option<&'static LaserLine> {
        let there = || LASERS.iter().filter(|laser| self.has_lines(laser.keyword));
        let number = wanted.number().or_else(|| there().map(|laser| laser.number).min())?;
        let has_poses = |laser: &LaserLine| matches!(laser.form, Form::Old | Form::Robot);
        let rank = |laser: &&LaserLine| (has_poses(laser), self.count(laser.keyword));
        // Of equals `max_by_key` takes the last.
        there().filter(|laser| laser.number == number).rev().max_by_key(rank)
    }

    /// Says which laser is played, and what is not read.
    pub(super) fn tell(&self, laser: Option<&LaserLine>, log: &mut Log) {
        let number = laser.map(|laser| laser.number);
        let (mut same, mut idle) = (Vec::new(), Vec::new());
        for (&keyword, &(lines, first)) in &self.counts {
            let known = LASERS.iter().find(|known| known.keyword == keyword);
            if READ.contains(&keyword) || laser.is_some_and(|laser| laser.keyword == keyword) {
                continue;
            }
            if IDLE.contains(&keyword) {
                idle.push((keyword.to_owned(), lines));
            } else if known.is_some_and(|known| Some(known.number) == number) {
                same.push((keyword.to_owned(), lines));
            } else {
                log.note(first, Fault::NotRead { keyword: beginning(keyword), lines });
            }
        }
        if let Some(laser) = laser {
            let (keyword, lines) = (laser.keyword, self.count(laser.keyword));
            log.remarks.push(Remark::Laser { keyword, lines, others: same });
        }
        if !idle.is_empty() {
            log.remarks.push(Remark::Idle(idle));
        }
    }

    /// Where a laser sits, as PARAM lines say; in the middle of the robot where they do not.
    pub(super) fn mount(&self, laser: &LaserLine) -> Pose2 {
        let name = side(laser.number);
        let metres = |what: &str| self.number(&format!("robot_{name}laser_{what}")).unwrap_or(0.0);
        let heading_rad = if laser.number == 2 { std::f64::consts::PI } else { 0.0 };
        Pose2::new(metres("offset"), metres("side_offset"), heading_rad)
    }

    /// From one beam to the next, in degrees, as PARAM lines say.
    pub(super) fn beam_step_deg(&self, laser: &LaserLine) -> Option<f64> {
        let by_number = self.number(&format!("laser_laser{}_resolution", laser.number));
        let by_side = || self.number(&format!("laser_{}_laser_resolution", side(laser.number)));
        by_number.or_else(by_side).filter(|step| (0.001..=45.0).contains(step))
    }

    /// The laser's maximum range, as PARAM lines say.
    pub(super) fn range_max_m(&self, laser: &LaserLine) -> Option<f64> {
        self.number(&format!("robot_{}_laser_max", side(laser.number))).filter(|range| *range > 0.0)
    }

    fn number(&self, name: &str) -> Option<f64> {
        self.params.get(name)?.parse().ok().filter(|number: &f64| number.is_finite())
    }
}

fn side(number: u32) -> &'static str {
    if number == 2 { "rear" } else { "front" }
}

fn is_of_use(name: &str) -> bool {
    name.starts_with("laser_") || name.starts_with("robot_")
}

/// Words in capitals, as all keywords of CARMEN are.
pub(super) fn is_keyword(word: &str) -> bool {
    word.bytes().all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_')
}
