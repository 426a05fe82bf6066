//! When each line is played. Stamps may be useless, and the clock may have been set while the log was made.

use crate::log::{Fault, Log, Remark, Times};
use crate::params::Timing;

/// The two time stamps of a line, in seconds; NaN for an invalid one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stamps {
    /// When the logger wrote the line.
    pub(super) logger: f64,
    /// When the message was made.
    pub(super) message: f64,
}

/// Kinds of lines; each has an order of its own.
const KINDS: usize = 3;

/// Steps below this are steps of a drive; longer ones are told.
const LONGEST_STEP_S: f64 = 60.0;
/// A longer silence means that the clock was set.
const LONGEST_PAUSE_S: f64 = 86_400.0;
/// Stamps up to this are invalid, unless the log begins with them.
const NONE_S: f64 = 1e-6;
/// Lines may be written in another order than they were made, by so much.
const DISORDER_S: f64 = 1.0;

/// A line's number, kind and stamps.
type Stamped = (usize, usize, Stamps);

/// The time at which each line is played, from the beginning of the play.
pub(super) fn times(lines: &[Stamped], timing: Timing, period_s: f64, log: &mut Log) -> Vec<f64> {
    let logger = |stamps: Stamps| stamps.logger;
    let message = |stamps: Stamps| stamps.message;
    let [by_logger, by_message] = [Use::of(lines, logger), Use::of(lines, message)];
    let is_recorded = timing == Timing::Recorded;
    if lines.is_empty() {
        return Vec::new();
    }
    if timing == Timing::Order || !(by_logger.is_some() || by_message.is_some() || is_recorded) {
        if timing != Timing::Order {
            log.remarks.push(Remark::Times(by_logger.as_order(period_s)));
        }
        return (0..lines.len()).map(|index| index as f64 * period_s).collect();
    }
    if by_logger.is_some() || !by_message.is_some() {
        log.remarks.push(Remark::Times(Times::Logger));
        Play::new(period_s, by_logger).run(lines, logger, log)
    } else {
        log.remarks.push(Remark::Times(Times::Messages));
        Play::new(period_s, by_message).run(lines, message, log)
    }
}

/// Whether time stamps tell the lines apart: those rounded to ten seconds, or to a day, do not.
#[derive(Debug, Default)]
struct Use {
    steps: usize,
    /// Those that lead forward by less than a minute.
    forward: usize,
    /// The usual step of each kind.
    usual_s: [Option<f64>; KINDS],
}

impl Use {
    fn of(lines: &[Stamped], stamp: impl Fn(Stamps) -> f64) -> Self {
        let mut last = [f64::NAN; KINDS];
        let mut steps: [Vec<f64>; KINDS] = Default::default();
        let mut found = Self::default();
        let mut begun = false;
        for &(_, kind, stamps) in lines {
            let now = stamp(stamps);
            if is_missing(now, &mut begun) {
                continue;
            }
            let step_s = now - last[kind];
            if !last[kind].is_nan() || now.is_nan() {
                found.steps += 1;
                if step_s > 0.0 && step_s < LONGEST_STEP_S {
                    steps[kind].push(step_s);
                }
            }
            last[kind] = now;
        }
        found.forward = steps.iter().map(Vec::len).sum();
        for (steps, usual_s) in steps.iter_mut().zip(&mut found.usual_s) {
            let middle = steps.len() / 2;
            *usual_s = (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1);
        }
        found
    }

    /// A single line of each kind cannot be told apart by its stamp, and needs not to be.
    fn is_some(&self) -> bool {
        2 * self.forward > self.steps || self.steps == 0
    }

    fn as_order(&self, period_s: f64) -> Times {
        Times::Order { forward: self.forward, steps: self.steps, period_s }
    }
}

/// Whether a stamp is missing: programs that put lines into a log afterwards, as those that correct its poses
/// do, stamp them with zero, or with what memory held, which as a number is next to it. A log may begin at
/// zero.
fn is_missing(stamp: f64, begun: &mut bool) -> bool {
    *begun |= stamp > NONE_S;
    *begun && stamp.abs() <= NONE_S
}

/// The play as it goes on.
struct Play {
    period_s: f64,
    found: Use,
    /// From the stamps of each kind to times of the play: two computers may have two clocks.
    offsets_s: [Option<f64>; KINDS],
    /// When the last line of each kind was played.
    last_s: [Option<f64>; KINDS],
    /// When the last line of any was.
    newest_s: Option<f64>,
    /// By how much the clock is set off from what it was at first.
    set_by_s: f64,
}

impl Play {
    fn new(period_s: f64, found: Use) -> Self {
        Self {
            period_s,
            found,
            offsets_s: [None; KINDS],
            last_s: [None; KINDS],
            newest_s: None,
            set_by_s: 0.0,
        }
    }

    fn run(mut self, lines: &[Stamped], stamp: impl Fn(Stamps) -> f64, log: &mut Log) -> Vec<f64> {
        let mut times = Vec::with_capacity(lines.len());
        let mut begun = false;
        for (index, &(line, kind, stamps)) in lines.iter().enumerate() {
            let now = stamp(stamps);
            // A line without a usable stamp comes with the line before.
            if is_missing(now, &mut begun) || now.is_nan() {
                times.push(self.newest_s.unwrap_or(0.0));
                continue;
            }
            // A clock that was set stays so; a single stamp that is far off was garbled.
            let stays = || {
                let more = lines[index + 1..].iter().filter(|line| line.1 == kind);
                let next = more.map(|line| stamp(line.2)).find(|next| !next.is_nan() && next.abs() > NONE_S);
                next.is_none_or(|next| (-DISORDER_S..LONGEST_STEP_S).contains(&(next - now)))
            };
            let at_s = self.advance(kind, now, stays, |fault| log.note(line, fault)).max(0.0);
            self.last_s[kind] = Some(at_s);
            self.newest_s = Some(self.newest_s.map_or(at_s, |newest_s| newest_s.max(at_s)));
            times.push(at_s);
        }
        times
    }

    /// When a line of this kind and stamp is played.
    fn advance(
        &mut self,
        kind: usize,
        now: f64,
        stays: impl Fn() -> bool,
        mut tell: impl FnMut(Fault),
    ) -> f64 {
        let known = self.offsets_s[kind].or_else(|| self.offsets_s.iter().copied().flatten().next());
        let offset_s = known.unwrap_or(-now);
        let at_s = now + offset_s;
        self.offsets_s[kind] = Some(offset_s);
        let Some(before_s) = self.last_s[kind].or(self.newest_s) else { return at_s };
        let step_s = at_s - before_s;
        let is_first = self.last_s[kind].is_none();
        // A clock that comes back to what it was.
        let comes_back = self.set_by_s < -LONGEST_STEP_S && (self.set_by_s + step_s).abs() < LONGEST_STEP_S;
        if (LONGEST_STEP_S..LONGEST_PAUSE_S).contains(&step_s) && !is_first && !comes_back && stays() {
            let silence_s = at_s - self.newest_s.unwrap_or(before_s);
            if silence_s >= LONGEST_STEP_S {
                tell(Fault::Pause { pause_s: tidy(silence_s) });
            }
            return at_s;
        }
        if (-DISORDER_S..LONGEST_STEP_S).contains(&step_s) {
            // Within a kind time never runs backwards.
            return at_s.max(self.last_s[kind].unwrap_or(f64::NEG_INFINITY));
        }
        let usual_s = self.found.usual_s[kind].unwrap_or(self.period_s);
        tell(Fault::ClockJump { step_s: tidy(step_s), usual_s: tidy(usual_s) });
        let next_s = if is_first { before_s } else { before_s + usual_s };
        // The clock of the others was set with it, unless this kind was never on theirs.
        self.set_by_s += if is_first { 0.0 } else { at_s - next_s };
        for (other, offset_s) in self.offsets_s.iter_mut().enumerate() {
            if !is_first || other == kind {
                *offset_s = offset_s.map(|offset_s| offset_s + next_s - at_s);
            }
        }
        next_s
    }
}

/// A time as it is told: to the millisecond.
fn tidy(seconds: f64) -> f64 {
    (seconds * 1e3).round() / 1e3
}
