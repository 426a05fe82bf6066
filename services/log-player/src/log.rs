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
        /// Ranges from here on mean "nothing seen", where the log says so.
        range_max_m: Option<f64>,
        /// One range a beam: infinite where nothing was seen, NaN where nothing was read.
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
    /// How it was read, where the log leaves a choice, and what of it nobody asks for.
    pub remarks: Vec<Remark>,
    /// Whether each true pose belongs to the scan before it, and goes with it.
    pub truth_is_of_scans: bool,
}

/// How many problems are told one by one.
pub const PROBLEM_LIMIT: usize = 20;
/// More numbers than any scanner gives in one line.
pub(crate) const RANGE_LIMIT: usize = 10_000;

/// More lines are not played at once: nine hours have a million at thirty a second.
pub(crate) const MOST_RECORDS: usize = 1_000_000;

/// Something that could not be played, or not as it was recorded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}{fault}", in_line(*.line))]
pub struct Problem {
    /// The line, counted from 1; 0 for what is wrong with no line in particular.
    pub line: usize,
    /// What is wrong.
    pub fault: Fault,
}

fn in_line(line: usize) -> String {
    if line == 0 { String::new() } else { format!("line {line}: ") }
}

/// What can be wrong with a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// A word that no line of this format begins with.
    #[error("`{word}` begins no line of this format; it is left out")]
    UnknownLine {
        /// The first word, or its beginning.
        word: String,
    },
    /// Another count of words than the line has: it was cut off or garbled, or its count of beams lies.
    #[error(
        "{keyword} needs {wanted} words, and there are {words}: the line is cut off or garbled, and left out"
    )]
    WordCount {
        /// The first word.
        keyword: &'static str,
        /// Words there are.
        words: usize,
        /// Words needed.
        wanted: usize,
    },
    /// No finite number where one belongs.
    #[error("{keyword}: `{word}` is not a number; the line is left out")]
    NotANumber {
        /// The first word.
        keyword: &'static str,
        /// The word, or its beginning.
        word: String,
    },
    /// A count of beams that cannot be.
    #[error("{keyword}: {count} beams are none, or more than {RANGE_LIMIT}; the line is left out")]
    BeamCount {
        /// The first word.
        keyword: &'static str,
        /// The count.
        count: f64,
    },
    /// A step that does not follow.
    #[error("{keyword} of step {step} after step {last}; the line is left out")]
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
    /// A line whose words do not fit the way in which the others of its kind are written.
    #[error(
        "{keyword} of {words} words does not fit its count of beams: the line is cut off or garbled, and left out"
    )]
    NoVersion {
        /// The first word.
        keyword: &'static str,
        /// Words there are.
        words: usize,
    },
    /// Beams without directions.
    #[error(
        "{keyword}: from {start_rad} rad on every {step_rad} rad: no laser looks so; the line is left out"
    )]
    NoDirections {
        /// The first word.
        keyword: &'static str,
        /// Direction of the first beam.
        start_rad: f64,
        /// From one beam to the next.
        step_rad: f64,
    },
    /// What a sensor said, in lines that are not read.
    #[error("{lines} lines {keyword} are not read")]
    NotRead {
        /// The first word, or its beginning.
        keyword: String,
        /// How many lines begin so.
        lines: usize,
    },
    /// The clock was set.
    #[error("the clock jumps by {step_s} s; the play goes on after the usual {usual_s} s")]
    ClockJump {
        /// How far, in seconds.
        step_s: f64,
        /// The usual time between two lines of this kind.
        usual_s: f64,
    },
    /// Nothing was recorded for a while.
    #[error("nothing was recorded for {pause_s} s before this line; the play is silent for as long")]
    Pause {
        /// How long.
        pause_s: f64,
    },
    /// Scans of a laser that the log does not hold.
    #[error("the log holds no scans of laser {number}, which `laser` asks for")]
    NoSuchLaser {
        /// The laser.
        number: u32,
    },
    /// More than is played.
    #[error("the log holds more than {MOST_RECORDS} records; the rest is not played: cut it into pieces")]
    TooMany,
    /// A range to an anchor of which no place is known.
    #[error("anchor {id} is not among the parameter `anchors`; its ranges are left out")]
    UnknownAnchor {
        /// Its number.
        id: u32,
    },
}

/// How a log was read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Remark {
    /// Which times it is played by.
    #[error("it is played by {0}")]
    Times(Times),
    /// Which lines give the scans.
    #[error("its scans are those of {lines} lines {keyword}{}", not_read(.others))]
    Laser {
        /// The first word of the lines.
        keyword: &'static str,
        /// How many there are.
        lines: usize,
        /// Other lines of lasers that are not read, and how many of each.
        others: Vec<(String, usize)>,
    },
    /// Where beams look that do not say it.
    #[error(
        "{keyword} of {beams} beams does not say where they look; taken as {step_deg:.4} degrees a beam, {how}"
    )]
    Beams {
        /// The first word of the lines.
        keyword: &'static str,
        /// The count of beams.
        beams: usize,
        /// From one beam to the next, in degrees.
        step_deg: f64,
        /// Why, in words.
        how: &'static str,
    },
    /// Where the sensor sits.
    #[error(
        "the laser's pose in the log is another one than the robot's in each line, so it was corrected later; where it sits on the robot is taken from PARAM lines"
    )]
    CorrectedPoses,
    /// The odometry is not in lines of its own.
    #[error("it has no lines ODOM; the odometry is taken from {keyword}")]
    OdometryOfScans {
        /// The first word of the lines.
        keyword: &'static str,
    },
    /// The odometry begins anew at the pose of each scan, or nearly each.
    #[error(
        "after {repeats} of {scans} scans the odometry begins anew at the scan's pose: if those poses were corrected later, it knows the truth, and only `odometry = \"between-scans\"` plays what the robot's own wheels said"
    )]
    OdometryAtScans {
        /// So often.
        repeats: usize,
        /// Of so many times.
        scans: usize,
    },
    /// What of the odometry is left out.
    #[error(
        "of the odometry only the ways between two scans are played; {steps} steps to a scan's pose are left out"
    )]
    OdometryBetweenScans {
        /// How many.
        steps: usize,
    },
    /// Lines that hold nothing to be played.
    #[error("{} hold nothing to be played", counted(.0))]
    Idle(Vec<(String, usize)>),
}

/// By what a log is played.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Times {
    /// The logger's stamps, at the end of each line.
    #[error("the logger's time stamps")]
    Logger,
    /// The messages' own stamps.
    #[error("the messages' own time stamps, as those of the logger do not tell the lines apart")]
    Messages,
    /// The order of the lines.
    #[error(
        "the order of its lines, one each {period_s} s, as its time stamps do not tell them apart ({forward} of {steps} steps lead forward by less than a minute)"
    )]
    Order {
        /// Steps from one line to the next of its kind that can be used.
        forward: usize,
        /// All steps.
        steps: usize,
        /// Time a line.
        period_s: f64,
    },
}

impl Remark {
    /// Whether somebody should look at it: the log may be meant otherwise.
    pub fn is_doubtful(&self) -> bool {
        matches!(self, Self::Times(Times::Order { .. }) | Self::Beams { .. } | Self::CorrectedPoses)
    }
}

fn counted(lines: &[(String, usize)]) -> String {
    let lines: Vec<_> = lines.iter().map(|(keyword, count)| format!("{count} lines {keyword}")).collect();
    lines.join(", ")
}

fn not_read(lines: &[(String, usize)]) -> String {
    if lines.is_empty() { String::new() } else { format!("; not read: {}", counted(lines)) }
}

impl Log {
    /// Remembers a problem, unless there are too many already.
    pub(crate) fn note(&mut self, line: usize, fault: Fault) {
        self.problem_count += 1;
        if self.problems.len() < PROBLEM_LIMIT {
            self.problems.push(Problem { line, fault });
        }
    }

    /// Puts the entries into the order of time. The truth of a moment comes halfway to the next one, so that
    /// every service has had its turn with the moment's readings before it is judged, and none has seen later
    /// ones.
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
    /// The words of a line, the keyword included.
    pub(crate) fn new(keyword: &'static str, line: &'a str) -> Self {
        Self { keyword, words: line.split_ascii_whitespace().collect() }
    }

    /// The words of a line that has exactly `wanted` of them.
    pub(crate) fn exactly(keyword: &'static str, line: &'a str, wanted: usize) -> Result<Self, Fault> {
        let words = Self::new(keyword, line);
        words.need(wanted)?;
        Ok(words)
    }

    pub(crate) fn need(&self, wanted: usize) -> Result<(), Fault> {
        let words = self.words.len();
        if words == wanted { Ok(()) } else { Err(Fault::WordCount { keyword: self.keyword, words, wanted }) }
    }

    fn word(&self, index: usize) -> Result<&'a str, Fault> {
        let (keyword, words) = (self.keyword, self.words.len());
        self.words.get(index).copied().ok_or(Fault::WordCount { keyword, words, wanted: index + 1 })
    }

    pub(crate) fn number(&self, index: usize) -> Result<f64, Fault> {
        let word = self.word(index)?;
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| Fault::NotANumber { keyword: self.keyword, word: beginning(word) })
    }

    pub(crate) fn pose(&self, index: usize) -> Result<Pose2, Fault> {
        Ok(Pose2::new(self.number(index)?, self.number(index + 1)?, self.number(index + 2)?))
    }

    /// A count, if the word is one, of at most `RANGE_LIMIT`.
    pub(crate) fn count(&self, index: usize) -> Option<usize> {
        let count = self.number(index).ok()?;
        ((0.0..=RANGE_LIMIT as f64).contains(&count) && count.fract() == 0.0).then_some(count as usize)
    }

    /// The count of beams at `index`.
    pub(crate) fn beams(&self, index: usize) -> Result<usize, Fault> {
        let count = self.number(index)?;
        let beams = self.count(index).filter(|&beams| beams > 0);
        beams.ok_or(Fault::BeamCount { keyword: self.keyword, count })
    }

    /// Ranges. What is not finite is a reading too: infinite where nothing was seen, NaN where nothing was
    /// read.
    pub(crate) fn ranges(&self, from: usize, count: usize) -> Result<Vec<f32>, Fault> {
        let range = |index| {
            let word = self.word(index)?;
            let range_m = word.parse::<f32>().ok().or_else(|| spelt_by_windows(word));
            range_m.ok_or_else(|| Fault::NotANumber { keyword: self.keyword, word: beginning(word) })
        };
        (from..from + count).map(range).collect()
    }
}

/// Numbers that are not finite, as C wrote them there: `1.#INF`, `-1.#IND`, `1.#QNAN`.
fn spelt_by_windows(word: &str) -> Option<f32> {
    let (sign, word) = word.strip_prefix('-').map_or((1.0, word), |word| (-1.0, word));
    match word.strip_prefix("1.#")?.trim_end_matches('0') {
        "INF" => Some(sign * f32::INFINITY),
        "IND" | "QNAN" | "SNAN" => Some(f32::NAN),
        _ => None,
    }
}

/// As much of a word as an error message should hold.
pub(crate) fn beginning(word: &str) -> String {
    word.chars().take(24).collect()
}
