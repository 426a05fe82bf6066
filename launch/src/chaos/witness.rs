//! Sees what becomes of a wound: what the wheels are told, what their rims do in truth, and when the successor speaks. Moments come from the messages' stamps, so
//! a late look at them makes no verdict.
//!
//! The deadlines are the promise's own, as the README's table states them, and never the graph's: a graph could be made to promise less. Whatever cannot be judged is
//! said to be so, and is no proof.

use super::plan::Kind;
use messages::Time;
use std::collections::VecDeque;
use std::time::Duration;

/// A wheel slower than this stands.
const STANDS_MPS: f64 = 2e-3;
/// A robot that is slower than this when somebody is hit proves nothing.
const DRIVES_MPS: f64 = 0.05;
/// Commands and speeds are remembered for so long: longer than any deadline.
const MEMORY: Duration = Duration::from_secs(8);
/// Without a GO or a command the wheels are told to stand within this time, and a period of the driver.
const TOLD: Duration = Duration::from_millis(100);
/// Without the sensor behind the GO: within this time.
const TOLD_UNSEEN: Duration = Duration::from_millis(200);
/// The motors stop by themselves when nobody has told them anything for so long.
const WATCHDOG: Duration = Duration::from_millis(100);
/// Between two looks at the rims, and between a command and its effect.
const SEEN: Duration = Duration::from_millis(60);
/// The motors of any of these robots brake at least so hard; a rim that takes longer to stand does not brake.
const BRAKES_M_PER_S2: f64 = 0.4;

/// What a service has to do with the wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Link {
    /// The driver needs its word: the guard, the controller.
    Word,
    /// The guard needs its readings.
    Readings,
    /// The driver itself.
    Driver,
    /// The robot may drive on without it.
    None,
}

impl Link {
    /// When the wheels must have been told to stand, counted from the wound.
    fn told_within(self, period: Duration) -> Option<Duration> {
        match self {
            Self::Word => Some(TOLD + period),
            Self::Readings => Some(TOLD_UNSEEN),
            // It cannot tell them anything any more.
            Self::Driver | Self::None => None,
        }
    }

    /// When the rims begin to slow down at the latest.
    fn slows_within(self, period: Duration) -> Option<Duration> {
        let told = self.told_within(period);
        told.or((self == Self::Driver).then_some(WATCHDOG)).map(|limit| limit + SEEN)
    }
}

/// Somebody was hit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wound {
    pub(super) role: String,
    pub(super) kind: Kind,
    pub(super) in_start_up: bool,
    /// It is to show that the wheels stop.
    pub(super) is_proof: bool,
    pub(super) at: Time,
    /// The generation that was hit: a newer one is the successor's.
    pub(super) generation: u32,
    pub(super) link: Link,
    /// When it was dead: at once for a kill, later for one that hangs or leaves.
    pub(super) died: Option<Time>,
    /// When the successor was seen to take steps.
    pub(super) healed: Option<Time>,
    /// The successor's first message.
    pub(super) spoke: Option<Time>,
    /// When it had taken three steps: who has said nothing by then has nothing to say at present.
    pub(super) stepped: Option<Time>,
    /// Nobody else was down meanwhile, from whom it may have needed something to say anything.
    pub(super) alone: bool,
    /// When a later deed hit the same role before this wound was healed.
    pub(super) overtaken: Option<Time>,
}

impl Wound {
    /// From death to the successor's first message, or to its third step where it has nothing to say.
    pub(super) fn heal(&self) -> Option<Duration> {
        let died = self.died?;
        let back = match (self.spoke, self.stepped) {
            (Some(spoke), Some(stepped)) => spoke.min(stepped),
            (spoke, stepped) => spoke.or(stepped)?,
        };
        self.overtaken.is_none().then_some(back.since(died))
    }
}

/// Speeds of both wheels at a moment: what they were told, or what their rims do.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Speeds {
    at: Time,
    /// The faster wheel's; infinite for what is no number.
    fastest_mps: f64,
}

/// Whether the wheels did what the promise says.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Stopping {
    /// The robot may drive on without this service.
    NotAsked,
    /// The robot stood already.
    Stood,
    /// The successor was there before the wheels had to stop.
    HealedFirst,
    /// As promised.
    InTime,
    /// Not as promised: in words.
    Broken(String),
    /// Messages are missing, so nobody knows.
    Unknown,
}

/// What was seen of the wheels lately.
#[derive(Debug, Default)]
pub(super) struct Witness {
    told: VecDeque<Speeds>,
    rims: VecDeque<Speeds>,
    /// The world's time and the ways of both rims at the last look.
    last: Option<[f64; 3]>,
    /// Moments at which messages were missed.
    gaps: VecDeque<Time>,
    period: Duration,
}

impl Witness {
    /// For a driver with this period.
    pub(super) fn new(period: Duration) -> Self {
        Self { period, ..Self::default() }
    }

    /// The base driver has told the wheels this.
    pub(super) fn told(&mut self, at: Time, left_mps: f64, right_mps: f64) {
        keep(&mut self.told, at, left_mps, right_mps);
    }

    /// The rims have gone so far at this moment of the world's time. Their speed is what they went since the last look: over the ground it shivers with the slip.
    pub(super) fn rims(&mut self, at: Time, world_s: f64, left_m: f64, right_m: f64) {
        let Some([last_s, last_left_m, last_right_m]) = self.last.replace([world_s, left_m, right_m]) else {
            return;
        };
        let passed_s = world_s - last_s;
        // A world that began anew says nothing of what was before.
        if passed_s > 0.0 && passed_s < 1.0 {
            keep(&mut self.rims, at, (left_m - last_left_m) / passed_s, (right_m - last_right_m) / passed_s);
        }
    }

    /// Messages were lost shortly before this moment.
    pub(super) fn gap(&mut self, at: Time) {
        self.gaps.push_back(at);
        while self.gaps.front().is_some_and(|gap| at.since(*gap) > MEMORY) {
            self.gaps.pop_front();
        }
    }

    /// How fast the rims were at this moment, as far as is known.
    fn rims_at(&self, at: Time) -> Option<f64> {
        let before = self.rims.iter().rev().find(|rims| rims.at <= at)?;
        (at.since(before.at) <= 2 * SEEN).then_some(before.fastest_mps)
    }

    /// When all about a wound is over: the rims stand by then, or never.
    pub(super) fn judged_at(&self, wound: &Wound) -> Time {
        let speed_mps = self.rims_at(wound.at).filter(|speed| speed.is_finite()).unwrap_or(0.0);
        let braking = Duration::from_secs_f64((speed_mps / BRAKES_M_PER_S2).min(5.0));
        wound.at.after(wound.link.slows_within(self.period).unwrap_or_default() + braking + SEEN)
    }

    /// Whether the rims turn at this moment, so that a wound would prove something.
    pub(super) fn drives(&self, now: Time) -> bool {
        self.rims_at(now).is_some_and(|speed_mps| speed_mps >= DRIVES_MPS)
    }

    /// What the wheels did after a wound.
    pub(super) fn judge(&self, wound: &Wound) -> Stopping {
        let Some(slows) = wound.link.slows_within(self.period) else { return Stopping::NotAsked };
        let Some(speed_mps) = self.rims_at(wound.at) else { return Stopping::Unknown };
        if speed_mps < DRIVES_MPS {
            return Stopping::Stood;
        }
        // From then on somebody else is responsible: the successor, or the later deed.
        let until = [wound.spoke, wound.overtaken].into_iter().flatten().min();
        let deadline = wound.at.after(wound.link.told_within(self.period).unwrap_or(slows));
        if until.is_some_and(|until| until <= deadline) {
            return Stopping::HealedFirst;
        }
        let in_charge = |at: Time| until.is_none_or(|until| at < until);
        let end = self.judged_at(wound);
        if self.gaps.iter().any(|gap| *gap >= wound.at && *gap <= end.after(MEMORY / 8)) {
            return Stopping::Unknown;
        }
        if let Some(limit) = wound.link.told_within(self.period) {
            let late = self.told.iter().find(|told| {
                told.fastest_mps > STANDS_MPS && told.at > wound.at.after(limit) && in_charge(told.at)
            });
            if let Some(late) = late {
                let late_ms = late.at.since(wound.at).as_millis();
                let limit_ms = limit.as_millis();
                return Stopping::Broken(format!(
                    "wheels told to turn {late_ms} ms later, beyond {limit_ms} ms"
                ));
            }
        }
        let slowing = wound.at.after(slows);
        let after: Vec<&Speeds> =
            self.rims.iter().filter(|rims| rims.at >= slowing && in_charge(rims.at)).collect();
        for pair in after.windows(2) {
            // Nobody tells them to, so no rim gains speed.
            if pair[1].fastest_mps > pair[0].fastest_mps + STANDS_MPS {
                let ms = pair[1].at.since(wound.at).as_millis();
                let [before, now] = [pair[0].fastest_mps, pair[1].fastest_mps];
                return Stopping::Broken(format!(
                    "rims gained speed {ms} ms later, from {before:.3} to {now:.3} m/s"
                ));
            }
        }
        for rims in after {
            let braked_s = rims.at.since(slowing).as_secs_f64();
            let most_mps = (speed_mps - BRAKES_M_PER_S2 * braked_s).max(0.0) + STANDS_MPS;
            if rims.fastest_mps > most_mps {
                let ms = rims.at.since(wound.at).as_millis();
                return Stopping::Broken(format!(
                    "rims at {:.3} m/s {ms} ms later, not above {most_mps:.3} m/s when they brake from {speed_mps:.3}",
                    rims.fastest_mps
                ));
            }
        }
        Stopping::InTime
    }
}

fn keep(seen: &mut VecDeque<Speeds>, at: Time, left_mps: f64, right_mps: f64) {
    // What is no number is no standing wheel.
    let speed = |mps: f64| if mps.is_finite() { mps.abs() } else { f64::INFINITY };
    seen.push_back(Speeds { at, fastest_mps: speed(left_mps).max(speed(right_mps)) });
    while seen.front().is_some_and(|first| at.since(first.at) > MEMORY) {
        seen.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn wound(link: Link, healed_ms: Option<u64>) -> Wound {
        Wound {
            role: "controller".to_owned(),
            kind: Kind::Kill,
            in_start_up: false,
            is_proof: false,
            at: at(1000),
            generation: 1,
            link,
            died: Some(at(1000)),
            healed: healed_ms.map(at),
            spoke: healed_ms.map(at),
            alone: true,
            stepped: None,
            overtaken: None,
        }
    }

    /// Rims that drive at 0.3 m/s until they begin to brake with this deceleration.
    fn driving(brake_from_ms: u64, brake_m_per_s2: f64) -> Witness {
        moving(|ms| (0.3 - brake_m_per_s2 * ms.saturating_sub(brake_from_ms) as f64 * 1e-3).max(0.0))
    }

    /// A robot that turns on the spot with this speed of its rims, seen every 20 ms.
    fn moving(speed_mps: impl Fn(u64) -> f64) -> Witness {
        let mut witness = Witness::new(Duration::from_millis(20));
        let mut way_m = 0.0;
        for ms in (500..4000).step_by(20) {
            witness.rims(at(ms), ms as f64 * 1e-3, way_m, -way_m);
            way_m += 0.02 * speed_mps(ms + 20);
        }
        witness
    }

    #[track_caller]
    fn check(witness: &Witness, wound: &Wound, expected: &str) {
        let judged = match witness.judge(wound) {
            Stopping::Broken(words) => words,
            other => format!("{other:?}"),
        };
        assert!(judged.contains(expected), "{judged}");
    }

    #[test]
    fn wheels_turn_until_the_deadline_and_not_beyond() {
        let mut witness = driving(1060, 0.8);
        witness.told(at(1100), 0.3, 0.3);
        witness.told(at(1120), 0.3, 0.3);
        check(&witness, &wound(Link::Word, None), "InTime");
        witness.told(at(1121), 0.0, 0.3);
        check(&witness, &wound(Link::Word, None), "told to turn 121 ms later, beyond 120 ms");
        check(&witness, &wound(Link::Readings, None), "InTime");
        witness.told(at(1201), 0.3, 0.3);
        check(&witness, &wound(Link::Readings, None), "told to turn 201 ms later, beyond 200 ms");
        check(&witness, &wound(Link::None, None), "NotAsked");
        let mut nonsense = driving(1060, 0.8);
        nonsense.told(at(1121), f64::NAN, 0.0);
        check(&nonsense, &wound(Link::Word, None), "told to turn 121 ms later");
    }

    #[test]
    fn who_has_a_successor_may_drive() {
        let mut witness = driving(4000, 0.8);
        witness.told(at(1200), 0.3, 0.3);
        check(&witness, &wound(Link::Word, Some(1150)), "InTime");
        witness.told(at(1130), 0.3, 0.3);
        check(&witness, &wound(Link::Word, Some(1150)), "told to turn 1");
        check(&witness, &wound(Link::Word, Some(1090)), "HealedFirst");
    }

    #[test]
    fn a_dead_driver_is_judged_by_the_rims() {
        check(&driving(1100, 0.8), &wound(Link::Driver, None), "InTime");
        // The motors' watchdog of a second.
        check(&driving(2000, 0.8), &wound(Link::Driver, None), "rims at 0.300 m/s");
        // Motors that do not brake.
        check(&driving(1100, 0.1), &wound(Link::Driver, None), "rims at 0.2");
        // The successor drives on before anything could be seen.
        check(&driving(4000, 0.8), &wound(Link::Driver, Some(1120)), "HealedFirst");
    }

    #[test]
    fn rims_that_gain_speed_are_not_braking() {
        let witness = moving(|ms| if ms > 1200 { 0.3 } else { 0.1 });
        check(&witness, &wound(Link::Word, None), "rims gained speed 220 ms later");
    }

    #[test]
    fn a_robot_that_stands_proves_nothing_and_what_was_not_seen_is_not_known() {
        let standing = moving(|_| 0.01);
        check(&standing, &wound(Link::Driver, None), "Stood");
        check(&Witness::default(), &wound(Link::Driver, None), "Unknown");
        let mut lossy = driving(1060, 0.8);
        lossy.gap(at(1300));
        check(&lossy, &wound(Link::Word, None), "Unknown");
    }

    #[test]
    fn a_successor_that_was_hit_itself_says_nothing_about_healing() {
        let mut wound = wound(Link::Word, Some(1050));
        assert_eq!(wound.heal(), Some(Duration::from_millis(50)));
        wound.stepped = Some(at(1030));
        assert_eq!(wound.heal(), Some(Duration::from_millis(30)));
        wound.overtaken = Some(at(1040));
        assert_eq!(wound.heal(), None);
    }
}
