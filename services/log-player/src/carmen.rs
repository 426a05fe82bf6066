//! CARMEN logs: `ODOM x y theta tv rv accel time host logger-time` and `FLASER n r1 .. rn x y theta odom_x odom_y odom_theta time host
//! logger-time`, metres, radians and seconds. The pose of a `FLASER` line is, in a corrected log, where the laser really was; beams
//! run from -90 degrees counter-clockwise, 1 degree apart (180 or 181 of them) or half a degree (360 or 361).

use crate::log::{Entry, Fault, Log, Record, Words, beginning};
use crate::params::Timing;
use geometry::Pose2;
use std::f64::consts::{FRAC_PI_2, PI};

/// Reads the text of a log.
pub fn read(text: &str, timing: Timing, period_s: f64) -> Log {
    let mut log = Log::default();
    // Records, each with its own time stamp; the truth of a scan shares the scan's.
    let mut moments: Vec<Moment> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        match read_line(line) {
            Ok(Some(moment)) => moments.push(moment),
            Ok(None) => {}
            Err(fault) => log.note(index + 1, fault),
        }
    }
    let recorded = match timing {
        Timing::Recorded => true,
        Timing::Order => false,
        Timing::Auto => are_of_use(moments.iter().map(|(time, _)| *time)),
    };
    let first_s = moments.iter().find_map(|(time, _)| *time).unwrap_or_default();
    let mut at_s = 0.0_f64;
    for (index, (time, records)) in moments.into_iter().enumerate() {
        // Time never runs backwards; a line without a usable stamp comes with the line before.
        at_s = if recorded {
            time.map_or(at_s, |time| at_s.max(time - first_s))
        } else {
            index as f64 * period_s
        };
        log.entries.extend(records.into_iter().map(|record| Entry { at_s, record }));
    }
    log.settle(period_s);
    log
}

/// Whether time stamps tell the lines apart: stamps rounded to ten seconds, or to a day, do not.
fn are_of_use(stamps: impl Iterator<Item = Option<f64>>) -> bool {
    let (mut lines, mut forward, mut last) = (0_usize, 0_usize, f64::NEG_INFINITY);
    for stamp in stamps.map(|stamp| stamp.unwrap_or(f64::NEG_INFINITY)) {
        lines += 1;
        let step_s = stamp - last;
        forward += usize::from(step_s > 0.0 && (step_s < 60.0 || last == f64::NEG_INFINITY));
        last = stamp;
    }
    2 * forward > lines
}

/// What a line recorded, and its time stamp.
type Moment = (Option<f64>, Vec<Record>);

fn read_line(line: &str) -> Result<Option<Moment>, Fault> {
    let Some(keyword) = line.split_ascii_whitespace().next() else { return Ok(None) };
    match keyword {
        "ODOM" => {
            let words = Words::new("ODOM", line, 10)?;
            Ok(Some((Some(words.number(words.words.len() - 1)?), vec![Record::Odometry(words.pose(1)?)])))
        }
        "FLASER" => {
            let words = Words::new("FLASER", line, 3)?;
            let count = words.beams(1)?;
            words.need(2 + count + 9)?;
            let scan = Record::Scan {
                sensor: Pose2::IDENTITY,
                angle_min_rad: -FRAC_PI_2,
                angle_step_rad: beam_step_rad(count),
                ranges_m: words.ranges(2, count)?,
            };
            let truth = Record::Truth(words.pose(2 + count)?);
            Ok(Some((Some(words.number(words.words.len() - 1)?), vec![scan, truth])))
        }
        comment if comment.starts_with('#') => Ok(None),
        // Parameters, other sensors, and what corrections have left behind.
        other
            if other
                .bytes()
                .all(|byte| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_') =>
        {
            Ok(None)
        }
        word => Err(Fault::UnknownLine { word: beginning(word) }),
    }
}

fn beam_step_rad(count: usize) -> f64 {
    match count {
        180 | 181 => PI / 180.0,
        360 | 361 => PI / 360.0,
        _ => PI / (count.max(2) - 1) as f64,
    }
}
