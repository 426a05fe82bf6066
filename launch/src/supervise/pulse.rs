//! Whether a service hangs: by its heartbeat, and by what the machine gave it.
//!
//! A heartbeat that is silent says that a service hangs only if the service could have given it. On a machine with too much to do a sound service waits for a
//! processor for seconds, and to kill it then would make things worse. So the time that counts is the service's own: the processor time that it used
//! since its last heartbeat, and the time in which it did not even want a processor (stopped, or asleep on something that never comes). The time in which it
//! waited for a processor, or for the disk, counts for nothing.

use messages::Time;
use std::time::Duration;

/// A look that comes later than this says nothing about what was in between.
pub(crate) const LOOK_MAX: Duration = Duration::from_millis(250);

/// What the kernel says of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Vitals {
    /// Processor time used so far, of all its threads.
    pub(crate) used: Duration,
    /// What its threads are about at this moment.
    pub(crate) doing: Doing,
}

/// What a process is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Doing {
    /// A thread runs, or waits for a processor.
    Runs,
    /// All threads sleep, and one of them in the middle of a disk's work.
    WaitsForDisk,
    /// All threads sleep, or are stopped.
    Rests,
}

/// The silence of one process.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Pulse {
    heartbeat_ns: u64,
    last: Option<(Time, Duration)>,
    own: Duration,
    silent_since: Option<Time>,
}

/// How long a process has been silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Silence {
    /// In its own time.
    pub(crate) own: Duration,
    /// By the clock.
    pub(crate) all: Duration,
}

impl Pulse {
    /// Takes a look. Whatever the heartbeat says, it is a sign of life if it has changed. `vitals` is asked only when it has not.
    pub(crate) fn look(
        &mut self,
        now: Time,
        heartbeat_ns: u64,
        vitals: impl FnOnce() -> Option<Vitals>,
    ) -> Silence {
        if self.silent_since.is_none() || heartbeat_ns != self.heartbeat_ns {
            *self = Self { heartbeat_ns, last: None, own: Duration::ZERO, silent_since: Some(now) };
            return Silence { own: Duration::ZERO, all: Duration::ZERO };
        }
        if let Some(vitals) = vitals() {
            if let Some((then, used)) = self.last {
                let passed = now.since(then).min(LOOK_MAX);
                let worked = vitals.used.saturating_sub(used).min(passed);
                self.own += match vitals.doing {
                    Doing::Rests => passed,
                    Doing::Runs | Doing::WaitsForDisk => worked,
                };
            }
            self.last = Some((now, vitals.used));
        }
        Silence { own: self.own, all: now.since(self.silent_since.unwrap_or(now)) }
    }

    /// Forgets what was, since the process has not been looked at for a while.
    pub(crate) fn begin_anew(&mut self) {
        *self = Self::default();
    }
}

/// Asks the kernel about a process; `None` when it is gone.
pub(crate) fn vitals(pid: u32) -> Option<Vitals> {
    let (_, ticks) = parse(&std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)?;
    let mut doing = Doing::Rests;
    for task in std::fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten() {
        let Ok(stat) = std::fs::read_to_string(task.path().join("stat")) else { continue };
        doing = match (parse(&stat), doing) {
            (Some(('R', _)), _) | (_, Doing::Runs) => Doing::Runs,
            (Some(('D', _)), _) | (_, Doing::WaitsForDisk) => Doing::WaitsForDisk,
            _ => Doing::Rests,
        };
    }
    Some(Vitals { used: Duration::from_millis(10 * ticks), doing })
}

/// State and ticks of processor time (10 ms each) of a line of `/proc/../stat`, whose second field may hold anything.
fn parse(stat: &str) -> Option<(char, u64)> {
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let state = fields.first()?.chars().next()?;
    let ticks = |index: usize| fields.get(index).and_then(|field| field.parse::<u64>().ok());
    Some((state, ticks(11)? + ticks(12)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks every 100 ms for two seconds, with so much processor time used in each; the silence at the end.
    #[track_caller]
    fn check(doing: Doing, used_ms: u64, expected_ms: u64) {
        let mut pulse = Pulse::default();
        let mut silence = None;
        for look in 0..=20_u64 {
            let now = Time::from_nanos(1_000_000_000 + look * 100_000_000);
            let vitals = Vitals { used: Duration::from_millis(look * used_ms), doing };
            silence = Some(pulse.look(now, 7, || Some(vitals)));
        }
        let silence = silence.unwrap();
        // The first look has nothing to compare with.
        assert_eq!(silence.own.as_millis() as u64, expected_ms);
        assert_eq!(silence.all, Duration::from_secs(2));
    }

    #[test]
    fn only_a_services_own_time_counts() {
        // Stopped, or asleep for ever.
        check(Doing::Rests, 0, 1900);
        // In a loop without end, alone on its processor and with a tenth of it.
        check(Doing::Runs, 100, 1900);
        check(Doing::Runs, 10, 190);
        // Without a processor, and on a disk that does not answer.
        check(Doing::Runs, 0, 0);
        check(Doing::WaitsForDisk, 0, 0);
    }

    #[test]
    fn any_change_of_the_heartbeat_is_a_sign_of_life() {
        let mut pulse = Pulse::default();
        let vitals = || Some(Vitals { used: Duration::ZERO, doing: Doing::Rests });
        for (look, heartbeat) in [5, 5, 5, u64::MAX, 0, 0].into_iter().enumerate() {
            let now = Time::from_nanos(1_000_000_000 + look as u64 * 100_000_000);
            let silence = pulse.look(now, heartbeat, vitals);
            assert!(silence.own <= Duration::from_millis(200), "{look}: {silence:?}");
        }
    }

    #[test]
    fn a_look_that_came_late_counts_for_little() {
        let mut pulse = Pulse::default();
        let vitals = || Some(Vitals { used: Duration::ZERO, doing: Doing::Rests });
        for second in [1, 2, 9] {
            pulse.look(Time::from_nanos(second * 1_000_000_000), 7, vitals);
        }
        assert_eq!(pulse.own, LOOK_MAX);
    }

    #[test]
    fn the_kernels_words() {
        assert_eq!(parse("12 (a) b) S 1 2 3 4 5 6 7 8 9 10 250 50 0 0"), Some(('S', 300)));
        assert_eq!(parse("12 (short) R 1"), None);
        assert!(vitals(std::process::id()).is_some());
        assert_eq!(vitals(u32::MAX), None);
    }
}
