//! What a log holds, whatever its format.

use geometry::Pose2;

/// One thing that was recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// Pose in the odometry frame.
    Odometry(Pose2),
    /// A laser scan.
    Scan {
        /// The sensor in the robot's frame.
        sensor: Pose2,
        /// Direction of the first beam from the sensor's axis.
        angle_min_rad: f64,
        /// From one beam to the next, counter-clockwise.
        angle_step_rad: f64,
        /// One range a beam.
        ranges_m: Vec<f32>,
    },
    /// Ranges to radio anchors, heard at once.
    Ranges {
        /// The antenna in the robot's frame; its height above the floor last.
        antenna_m: [f64; 3],
        /// Number of the anchor, and distance.
        heard: Vec<(u32, f64)>,
    },
    /// Where the robot really was, in the map.
    Truth(Pose2),
}

/// A record and when it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Seconds since the log began.
    pub at_s: f64,
    /// What was recorded.
    pub record: Record,
}

/// What could be read of a log, in the order of time, and what could not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Log {
    /// What was whole.
    pub entries: Vec<Entry>,
    /// What was not: the first `PROBLEM_LIMIT` of it.
    pub problems: Vec<Problem>,
    /// How many problems there were in all.
    pub problem_count: usize,
}

/// How many problems are told one by one.
pub const PROBLEM_LIMIT: usize = 20;
/// More numbers than any scanner gives in one line.
pub(crate) const RANGE_LIMIT: usize = 10_000;

/// A line that was left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}; what is whole is played")]
pub struct Problem {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub fault: Fault,
}

/// What can be wrong with a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// A word that no line of this format begins with.
    #[error("`{word}` begins no line of this format")]
    UnknownLine {
        /// The first word, or its beginning.
        word: String,
    },
    /// Fewer words than the line needs: it was cut off.
    #[error("{keyword} needs {wanted} words, and there are {words}: the line is cut off or garbled")]
    TooShort {
        /// The first word.
        keyword: &'static str,
        /// Words there are.
        words: usize,
        /// Words needed.
        wanted: usize,
    },
    /// No finite number where one belongs.
    #[error("{keyword}: `{word}` is not a number")]
    NotANumber {
        /// The first word.
        keyword: &'static str,
        /// The word, or its beginning.
        word: String,
    },
    /// A count of beams that cannot be.
    #[error("{keyword}: {count} beams are none, or more than {RANGE_LIMIT}")]
    BeamCount {
        /// The first word.
        keyword: &'static str,
        /// The count.
        count: f64,
    },
    /// A step that does not follow.
    #[error("{keyword} of step {step} after step {last}")]
    OutOfOrder {
        /// The first word.
        keyword: &'static str,
        /// The step.
        step: f64,
        /// The step before.
        last: f64,
    },
    /// The compressed file ends early or is damaged.
    #[error("the compressed file is damaged from here on: {cause}")]
    Damaged {
        /// What the decompressor said.
        cause: String,
    },
    /// A range to an anchor of which no place is known.
    #[error("anchor {id} is not among the parameter `anchors`; its ranges are left out")]
    UnknownAnchor {
        /// Its number.
        id: u32,
    },
}

impl Log {
    /// Remembers a problem, unless there are too many already.
    pub(crate) fn note(&mut self, line: usize, fault: Fault) {
        self.problem_count += 1;
        if self.problems.len() < PROBLEM_LIMIT {
            self.problems.push(Problem { line, fault });
        }
    }

    /// Puts the entries into the order of time. The truth of a moment comes halfway to the next one, so that every service has had
    /// its turn with the moment's readings before it is judged, and none has seen later ones.
    pub(crate) fn settle(&mut self, period_s: f64) {
        self.entries.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        let readings = self.entries.iter().filter(|entry| !matches!(entry.record, Record::Truth(_)));
        let times: Vec<f64> = readings.map(|entry| entry.at_s).collect();
        for entry in &mut self.entries {
            if matches!(entry.record, Record::Truth(_)) {
                let next = times.partition_point(|time| *time <= entry.at_s);
                let next_s = times.get(next).copied().unwrap_or(entry.at_s + period_s);
                entry.at_s += 0.5 * (next_s - entry.at_s);
            }
        }
        self.entries.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    }
}

/// The words of a line, read as numbers.
#[derive(Debug)]
pub(crate) struct Words<'a> {
    pub(crate) keyword: &'static str,
    pub(crate) words: Vec<&'a str>,
}

impl<'a> Words<'a> {
    /// The words of a line of which `wanted` are needed, the keyword included.
    pub(crate) fn new(keyword: &'static str, line: &'a str, wanted: usize) -> Result<Self, Fault> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let one = Self { keyword, words };
        one.need(wanted)?;
        Ok(one)
    }

    pub(crate) fn need(&self, wanted: usize) -> Result<(), Fault> {
        let words = self.words.len();
        if words < wanted { Err(Fault::TooShort { keyword: self.keyword, words, wanted }) } else { Ok(()) }
    }

    pub(crate) fn number(&self, index: usize) -> Result<f64, Fault> {
        let keyword = self.keyword;
        let too_short = Fault::TooShort { keyword, words: self.words.len(), wanted: index + 1 };
        let word = self.words.get(index).ok_or(too_short)?;
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| Fault::NotANumber { keyword, word: beginning(word) })
    }

    pub(crate) fn pose(&self, index: usize) -> Result<Pose2, Fault> {
        Ok(Pose2::new(self.number(index)?, self.number(index + 1)?, self.number(index + 2)?))
    }

    /// The count of beams at `index`.
    pub(crate) fn beams(&self, index: usize) -> Result<usize, Fault> {
        let count = self.number(index)?;
        if count >= 1.0 && count <= RANGE_LIMIT as f64 && count.fract() == 0.0 {
            Ok(count as usize)
        } else {
            Err(Fault::BeamCount { keyword: self.keyword, count })
        }
    }

    pub(crate) fn ranges(&self, from: usize, count: usize) -> Result<Vec<f32>, Fault> {
        (from..from + count).map(|index| self.number(index).map(|range_m| range_m as f32)).collect()
    }
}

/// As much of a word as an error message should hold.
pub(crate) fn beginning(word: &str) -> String {
    word.chars().take(24).collect()
}
