//! Logs in steps: MRPT's pairs of an action and its observations, written as text.
//!
//! `ODOM step dx dy dphi`: the motion since the step before, in the robot's frame. `LASER step aperture x y
//! phi n r_0 .. r_n-1`: the sensor in the robot's frame, beams from minus to plus half the aperture. `BEACON
//! step id range x y z`: the antenna in the robot's frame, its height above the floor. Metres and radians;
//! `#` begins a comment. A beam may be infinite, where nothing was seen, or NaN, where nothing was read.

use crate::log::{Entry, Fault, Log, MOST_RECORDS, Record, Words, beginning};
use geometry::Pose2;

/// Reads the text of a log and, beside it, of the true poses.
pub fn read(text: &str, truth: &str, truth_step_offset: u32, period_s: f64) -> Log {
    let mut reader = Reader { log: Log::default(), pose: Pose2::IDENTITY, step: 0.0, period_s };
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        if reader.log.entries.len() >= MOST_RECORDS {
            reader.log.note(index + 1, Fault::TooMany);
            break;
        }
        if let Err(fault) = reader.line(line) {
            reader.log.note(index + 1, fault);
        }
    }
    for (index, line) in truth.trim_start_matches('\u{feff}').lines().enumerate() {
        if reader.log.entries.len() >= 2 * MOST_RECORDS {
            reader.log.note(index + 1, Fault::TooMany);
            break;
        }
        if let Err(fault) = reader.truth(line, f64::from(truth_step_offset)) {
            reader.log.note(index + 1, fault);
        }
    }
    reader.log.settle(period_s);
    reader.log
}

/// The line up to a word that begins with `#`; within a word it means nothing, as in `1.#INF`.
fn without_comment(line: &str) -> &str {
    let begins = |at: usize| line[..at].chars().next_back().is_none_or(char::is_whitespace);
    let comment = line.match_indices('#').map(|(at, _)| at).find(|&at| begins(at));
    &line[..comment.unwrap_or(line.len())]
}

struct Reader {
    log: Log,
    pose: Pose2,
    step: f64,
    period_s: f64,
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), Fault> {
        let line = without_comment(line);
        match line.split_ascii_whitespace().next() {
            None => Ok(()),
            Some("ODOM") => self.odometry(&Words::exactly("ODOM", line, 5)?),
            Some("LASER") => self.scan(&Words::new("LASER", line)),
            Some("BEACON") => self.range(&Words::exactly("BEACON", line, 7)?),
            Some(word) => Err(Fault::UnknownLine { word: beginning(word) }),
        }
    }

    /// The step of a line, which cannot be earlier than that of the line before.
    fn begin(&mut self, words: &Words<'_>) -> Result<f64, Fault> {
        let step = words.number(1)?;
        // A step far ahead is a garbled number, not a gap in the log.
        if step < self.step || step > self.step + 10_000.0 || step.fract() != 0.0 {
            return Err(Fault::OutOfOrder { keyword: words.keyword, step, last: self.step });
        }
        Ok(step)
    }

    fn push(&mut self, step: f64, record: Record) {
        self.step = step;
        self.log.entries.push(Entry { at_s: step * self.period_s, record });
    }

    fn odometry(&mut self, words: &Words<'_>) -> Result<(), Fault> {
        let step = self.begin(words)?;
        self.pose = self.pose.compose(words.pose(2)?);
        self.push(step, Record::Odometry(self.pose));
        Ok(())
    }

    fn scan(&mut self, words: &Words<'_>) -> Result<(), Fault> {
        let step = self.begin(words)?;
        let (aperture_rad, sensor, count) = (words.number(2)?, words.pose(3)?, words.beams(6)?);
        words.need(7 + count)?;
        let ranges_m = words.ranges(7, count)?;
        let range_max_m = None;
        let angle_step_rad = aperture_rad / (count.max(2) - 1) as f64;
        self.push(
            step,
            Record::Scan {
                sensor,
                angle_min_rad: -0.5 * aperture_rad,
                angle_step_rad,
                range_max_m,
                ranges_m,
            },
        );
        Ok(())
    }

    fn range(&mut self, words: &Words<'_>) -> Result<(), Fault> {
        let step = self.begin(words)?;
        let (id, range_m) = (words.number(2)?, words.number(3)?);
        let antenna = [words.number(4)?, words.number(5)?, words.number(6)?];
        if !(0.0..=f64::from(u32::MAX)).contains(&id) || id.fract() != 0.0 {
            return Err(Fault::NotANumber { keyword: "BEACON", word: beginning(words.words[2]) });
        }
        // Beacons of one step that share an antenna were heard at once.
        if step == self.step
            && let Some(Entry { record: Record::Ranges { antenna_m, heard }, .. }) =
                self.log.entries.last_mut()
            && *antenna_m == antenna
        {
            heard.push((id as u32, range_m));
        } else {
            self.push(step, Record::Ranges { antenna_m: antenna, heard: vec![(id as u32, range_m)] });
        }
        Ok(())
    }

    fn truth(&mut self, line: &str, offset: f64) -> Result<(), Fault> {
        if line.trim().is_empty() || line.starts_with(['#', '%']) {
            return Ok(());
        }
        let words = Words::new("truth", line);
        let (row, pose) = (words.number(0)?, words.pose(1)?);
        let at_s = (row + offset) * self.period_s;
        // The log may have been cut off; its truth ends with it.
        if row < 0.0 || row + offset > self.step {
            return Ok(());
        }
        self.log.entries.push(Entry { at_s, record: Record::Truth(pose) });
        Ok(())
    }
}
