//! Why a robot stands although it should not: what the driver of the wheels and the guard say on their topics, as an event for the operator.

use board::tap::{Tap, TapReader};
use messages::{AppliedWheels, Clearance, DriveReasonName, GuardReasonName, Time};
use std::time::Duration;

const WHEELS: &str = "wheels/applied";
const GUARD: &str = "safety/clearance";
/// A moment's hindrance is no news: a service that was started again, a message that came late.
const LASTS: Duration = Duration::from_secs(2);

/// Reads both topics, as far as the board has them.
#[derive(Debug, Default)]
pub(crate) struct Standstill {
    wheels: Option<TapReader>,
    guard: Option<TapReader>,
    present: [Option<&'static str>; 2],
    judge: Judge,
}

impl Standstill {
    /// Joins them.
    pub(crate) fn new(tap: &Tap) -> Self {
        let reader = |topic: &str| tap.manifest().topic(topic).and_then(|_| tap.reader(topic).ok());
        Self { wheels: reader(WHEELS), guard: reader(GUARD), ..Self::default() }
    }

    /// Takes in what was said; an event when a fault lasts, and when it is over: in words, and whether it is trouble.
    pub(crate) fn look(&mut self, now: Time) -> Option<(String, bool)> {
        if let Some(wheels) = self.wheels.as_mut().and_then(TapReader::newest::<AppliedWheels>) {
            self.present[0] =
                wheels.reason.get().map_or(Some("the driver gives a reason without a meaning"), of_driver);
        }
        if let Some(clearance) = self.guard.as_mut().and_then(TapReader::newest::<Clearance>) {
            self.present[1] =
                clearance.reason.get().map_or(Some("the guard gives a reason without a meaning"), of_guard);
        }
        let [driver, guard] = self.present;
        self.judge.look(now, guard.or(driver))
    }
}

fn of_driver(reason: DriveReasonName) -> Option<&'static str> {
    match reason {
        DriveReasonName::StaleGuard => Some("the guard has not said GO in time"),
        DriveReasonName::StaleCommand => Some("no command has come in time"),
        DriveReasonName::InvalidCommand => {
            Some("what the wheels are to do is no number, or beyond their limits")
        }
        DriveReasonName::InvalidGuard => Some("what the guard says has no meaning"),
        DriveReasonName::DeviceFault => Some("the motor controller does not answer"),
        _ => None,
    }
}

fn of_guard(reason: GuardReasonName) -> Option<&'static str> {
    match reason {
        GuardReasonName::SensorFault => Some("a distance sensor cannot be trusted"),
        GuardReasonName::Stale => Some("no reading of a distance sensor has come in time"),
        _ => None,
    }
}

/// Tells what lasts from what passes.
#[derive(Debug, Default)]
struct Judge {
    fault: Option<(&'static str, Time)>,
    said: bool,
}

impl Judge {
    fn look(&mut self, now: Time, fault: Option<&'static str>) -> Option<(String, bool)> {
        let Some(fault) = fault else {
            self.fault = None;
            return std::mem::take(&mut self.said)
                .then(|| ("what kept the wheels from turning is over".to_owned(), false));
        };
        let since = match self.fault {
            Some((known, since)) if known == fault => since,
            _ => {
                self.fault = Some((fault, now));
                self.said = false;
                now
            }
        };
        if self.said || now.since(since) < LASTS {
            return None;
        }
        self.said = true;
        Some((format!("the wheels stand: {fault}"), true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lasts_is_said_once_and_so_is_its_end() {
        let mut judge = Judge::default();
        let at = |ms: u64| Time::from_nanos(ms * 1_000_000);
        assert_eq!(judge.look(at(0), Some("a")), None);
        assert_eq!(judge.look(at(1000), None), None);
        assert_eq!(judge.look(at(2000), Some("a")), None);
        assert_eq!(judge.look(at(3999), Some("a")), None);
        assert_eq!(judge.look(at(4000), Some("a")), Some(("the wheels stand: a".to_owned(), true)));
        assert_eq!(judge.look(at(9000), Some("a")), None);
        assert_eq!(judge.look(at(9100), Some("b")), None);
        assert_eq!(judge.look(at(11_100), Some("b")), Some(("the wheels stand: b".to_owned(), true)));
        assert_eq!(
            judge.look(at(12_000), None),
            Some(("what kept the wheels from turning is over".to_owned(), false))
        );
        assert_eq!(judge.look(at(13_000), None), None);
    }
}
