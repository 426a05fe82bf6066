//! Noticing that the robot does not get on, and what is done about it: wait, back off and plan anew, ask for
//! help.

use crate::params::Params;
use geometry::{Pose2, angle};
use messages::Time;

/// Moving less than this is standing.
const PROGRESS_M: f64 = 0.05;
/// Turning less than this is standing.
const PROGRESS_RAD: f64 = 0.15;
/// After this much way the failures before are forgotten.
const RECOVERED_M: f64 = 1.0;
/// A stop is worth a word after this time.
const WORTH_A_WORD_S: f64 = 2.0;

/// What to do instead of the mission's wish.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Remedy {
    /// Nothing.
    None,
    /// Back off.
    BackOff,
    /// Ask for a new path.
    Replan,
    /// Stand and call for help.
    Fault,
}

/// Watches the progress of one robot.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watch {
    /// Place and time of the last progress.
    progress: Option<(Pose2, Time)>,
    /// Where the last failure happened.
    failed_at: Option<Pose2>,
    failures: u32,
    backing_off_since: Option<Time>,
    fault_since: Option<Time>,
    blocked: bool,
    why: String,
}

impl Watch {
    /// Begins anew: the mission has moved on, or stands because it wants to.
    pub(crate) fn content(&mut self, now: Time, pose: Pose2) {
        self.progress = Some((pose, now));
        self.blocked = false;
        self.backing_off_since = None;
    }

    /// Why the robot does not get on, if it does not.
    pub(crate) fn blocked(&self) -> Option<&str> {
        self.blocked.then_some(self.why.as_str())
    }

    /// Whether help is needed.
    pub(crate) fn is_fault(&self) -> bool {
        self.fault_since.is_some()
    }

    /// Something failed at once, without waiting.
    pub(crate) fn fail(&mut self, now: Time, pose: Pose2, why: &str, params: &Params) -> Remedy {
        self.failures += 1;
        self.failed_at = Some(pose);
        self.blocked = true;
        self.why = format!("{why}, attempt {} of {}", self.failures, params.max_failures);
        self.progress = Some((pose, now));
        if self.failures >= params.max_failures {
            self.why = format!("{why}: human help is needed");
            self.fault_since = Some(now);
            return Remedy::Fault;
        }
        Remedy::None
    }

    /// Judges a step in which the robot should move; `why` says what hinders it, should it not.
    pub(crate) fn judge(&mut self, now: Time, pose: Pose2, why: &str, params: &Params) -> Remedy {
        if let Some(since) = self.fault_since {
            let again = params.fault_retry_s > 0.0 && now.seconds_since(since) >= params.fault_retry_s;
            if !again {
                return Remedy::Fault;
            }
            *self = Self { progress: Some((pose, now)), ..Self::default() };
            return Remedy::Replan;
        }
        if let Some(since) = self.backing_off_since {
            if now.seconds_since(since) < params.back_off_s {
                return Remedy::BackOff;
            }
            self.backing_off_since = None;
            self.progress = Some((pose, now));
            return Remedy::Replan;
        }
        let (place, since) = *self.progress.get_or_insert((pose, now));
        let turned_rad = angle::difference(pose.heading_rad, place.heading_rad).abs();
        if pose.distance_m(place) >= PROGRESS_M || turned_rad >= PROGRESS_RAD {
            self.content(now, pose);
            if self.failed_at.is_some_and(|failed| failed.distance_m(pose) > RECOVERED_M) {
                (self.failures, self.failed_at) = (0, None);
            }
            return Remedy::None;
        }
        let stands_s = now.seconds_since(since);
        if stands_s >= params.blocked_after_s {
            let remedy = self.fail(now, pose, why, params);
            if remedy == Remedy::Fault {
                return remedy;
            }
            self.backing_off_since = Some(now);
            return Remedy::BackOff;
        }
        if stands_s >= WORTH_A_WORD_S && !self.blocked {
            self.blocked = true;
            self.why = why.to_owned();
        }
        Remedy::None
    }
}

impl Watch {
    /// How long the robot has stood.
    pub(crate) fn stands_s(&self, now: Time) -> f64 {
        self.progress.map_or(0.0, |(_, since)| now.seconds_since(since))
    }
}
