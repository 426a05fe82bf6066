//! Sees what becomes of a wound: whether the wheels stand in time, and when the successor speaks. Moments come from the messages' stamps, so a late look
//! at them makes no verdict.

use super::plan::Kind;
use messages::Time;
use std::collections::VecDeque;
use std::time::Duration;

/// Wheels slower than this stand; the rim's true speed shivers a little with the ground.
const STANDS_MPS: f64 = 1e-3;
/// Commands and speeds are remembered for so long: longer than any deadline.
const MEMORY: Duration = Duration::from_secs(5);

/// Deadlines of the robot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Deadlines {
    /// From a death in the chain to wheels that are told to stand: the base driver's deadline and its period.
    pub(super) told: Duration,
}

/// Somebody was hit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wound {
    pub(super) role: String,
    pub(super) kind: Kind,
    pub(super) in_start_up: bool,
    pub(super) at: Time,
    /// The generation that was hit: a newer one is the successor's.
    pub(super) generation: u32,
    /// Its death stops the wheels.
    pub(super) in_chain: bool,
    /// It said something often enough that its successor's first message tells when it is back.
    pub(super) speaks: bool,
    /// When it was dead: at once for a kill, later for one that hangs or leaves.
    pub(super) died: Option<Time>,
    /// When the successor was seen to take steps.
    pub(super) healed: Option<Time>,
    /// The successor's first message.
    pub(super) spoke: Option<Time>,
    /// Nobody else was down meanwhile, from whom it may have needed something to say anything.
    pub(super) alone: bool,
    /// A later wound has hit the successor before it spoke.
    pub(super) overtaken: bool,
}

impl Wound {
    /// From death to the successor's first message.
    pub(super) fn heal(&self) -> Option<Duration> {
        let died = self.died?;
        (!self.overtaken).then_some(self.spoke?.since(died))
    }
}

/// A command that the wheels were given.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Told {
    at: Time,
    turning: bool,
}

/// What was seen of the wheels lately.
#[derive(Debug, Default)]
pub(super) struct Witness {
    told: VecDeque<Told>,
}

impl Witness {
    /// The base driver has told the wheels this.
    pub(super) fn told(&mut self, at: Time, left_mps: f64, right_mps: f64) {
        // What is no number is no standing wheel.
        let turning = !(left_mps.abs() <= STANDS_MPS && right_mps.abs() <= STANDS_MPS);
        self.told.push_back(Told { at, turning });
        while self.told.front().is_some_and(|told| at.since(told.at) > MEMORY) {
            self.told.pop_front();
        }
    }

    /// How late the wheels were told to turn, when they were: after the deadline, before the successor has spoken.
    pub(super) fn too_late(&self, wound: &Wound, deadlines: Deadlines) -> Option<Duration> {
        if !wound.in_chain {
            return None;
        }
        let must_stand = wound.at.after(deadlines.told);
        self.told
            .iter()
            .filter(|told| told.turning && told.at > must_stand)
            .find(|told| wound.spoke.is_none_or(|spoke| told.at < spoke))
            .map(|told| told.at.since(wound.at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEADLINES: Deadlines = Deadlines { told: Duration::from_millis(120) };

    fn at(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn wound(healed_ms: Option<u64>) -> Wound {
        Wound {
            role: "controller".to_owned(),
            kind: Kind::Kill,
            in_start_up: false,
            at: at(1000),
            generation: 1,
            in_chain: true,
            speaks: true,
            died: Some(at(1000)),
            healed: healed_ms.map(at),
            spoke: healed_ms.map(at),
            alone: true,
            overtaken: false,
        }
    }

    #[track_caller]
    fn check(told: &[(u64, f64)], healed_ms: Option<u64>, expected_ms: Option<u64>) {
        let mut witness = Witness::default();
        told.iter().for_each(|&(ms, speed)| witness.told(at(ms), speed, speed));
        let late = witness.too_late(&wound(healed_ms), DEADLINES);
        assert_eq!(late.map(|late| late.as_millis() as u64), expected_ms);
    }

    #[test]
    fn wheels_turn_until_the_deadline_and_not_beyond() {
        check(&[(1100, 0.3), (1120, 0.3)], None, None);
        check(&[(1100, 0.3), (1121, 0.3)], None, Some(121));
        check(&[(1121, 0.0)], None, None);
        check(&[(1121, f64::NAN)], None, Some(121));
    }

    #[test]
    fn who_has_a_successor_may_drive() {
        check(&[(1200, 0.3)], Some(1150), None);
        check(&[(1130, 0.3), (1200, 0.3)], Some(1150), Some(130));
    }

    #[test]
    fn a_successor_that_was_hit_itself_says_nothing_about_healing() {
        let mut wound = wound(Some(1050));
        assert_eq!(wound.heal(), Some(Duration::from_millis(50)));
        wound.overtaken = true;
        assert_eq!(wound.heal(), None);
    }
}
