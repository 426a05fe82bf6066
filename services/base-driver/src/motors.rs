//! What the motors do, as their encoders show it.

use crate::{Encoders, Params};
use messages::{Time, WheelSpeeds};

/// The shortest time over which speeds are taken, so that the encoders' own period does not show.
const LEAST_S: f64 = 0.015;
/// The longest time over which speeds are taken: over a longer pause only the mean is known.
const MOST_S: f64 = 0.12;
/// Faster than this no wheel of such a robot turns: a larger jump is an encoder that began anew.
pub(crate) const FASTEST_MPS: f64 = 5.0;
/// How long the wheels rest after the encoders have jumped.
const SETTLE_S: f64 = 0.2;
/// A wheel that is told at least this is watched for whether it turns.
const TOLD_MPS: f64 = 0.05;
/// A watched wheel that shows less than this share of what it is told, for [`FOLLOWS_WITHIN_S`], does not
/// turn, or nobody sees that it does.
const FOLLOWS_SHARE: f64 = 0.1;
const FOLLOWS_WITHIN_S: f64 = 0.5;
/// Speed that a wheel gains from one look to the next is a sign of life.
const COMES_MPS: f64 = 0.002;
/// A wheel that follows is behind what it is told by what it gains in this time, and a little.
const LAG_S: f64 = 0.1;
const LAG_MPS: f64 = 0.03;

/// What is known of the motors.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Motors {
    last: Option<Encoders>,
    rims: Option<WheelSpeeds>,
    settles_until: Option<Time>,
    /// Since when a wheel has not followed what it is told: left, right.
    stuck_since: [Option<Time>; 2],
    /// Which wheels do not follow at all, and in which direction they were told to turn.
    stuck: [Option<f64>; 2],
    /// Whether the encoders have jumped with the newest reading.
    pub(crate) jumped: bool,
}

impl Motors {
    /// Takes in a reading of the encoders, while the wheels are told `told`.
    pub(crate) fn look(&mut self, now: Time, encoders: Encoders, told: WheelSpeeds) {
        self.jumped = false;
        let last = *self.last.get_or_insert(encoders);
        let seconds = encoders.taken.seconds_since(last.taken);
        let left_m = encoders.travel.left_m - last.travel.left_m;
        let right_m = encoders.travel.right_m - last.travel.right_m;
        if left_m.abs().max(right_m.abs()) > FASTEST_MPS * seconds.max(LEAST_S) {
            (self.jumped, self.rims, self.last) = (true, None, Some(encoders));
            self.settles_until = Some(now.after(std::time::Duration::from_secs_f64(SETTLE_S)));
        } else if seconds > MOST_S || encoders.taken < last.taken {
            (self.rims, self.last) = (None, Some(encoders));
        } else if seconds >= LEAST_S {
            let rims = WheelSpeeds { left_mps: left_m / seconds, right_mps: right_m / seconds };
            let before = self.rims.replace(rims).unwrap_or(rims);
            self.last = Some(encoders);
            self.judge(now, 0, told.left_mps, before.left_mps, rims.left_mps);
            self.judge(now, 1, told.right_mps, before.right_mps, rims.right_mps);
        }
    }

    /// Forgets what it knew: the encoders are silent.
    pub(crate) fn lose_sight(&mut self) {
        (self.last, self.rims) = (None, None);
    }

    fn judge(&mut self, now: Time, side: usize, told_mps: f64, before_mps: f64, rim_mps: f64) {
        let sign = told_mps.signum();
        let turns = rim_mps * sign > FOLLOWS_SHARE * told_mps.abs();
        // A wheel that is to turn the other way takes its time.
        let comes = (rim_mps - before_mps) * sign > COMES_MPS;
        if told_mps.abs() < TOLD_MPS || turns || comes {
            self.stuck_since[side] = None;
            return;
        }
        let since = *self.stuck_since[side].get_or_insert(now);
        if now.seconds_since(since) > FOLLOWS_WITHIN_S {
            self.stuck[side] = Some(sign);
        }
    }

    /// Whether the encoders can be believed, and the wheels turn when they are told to. A wheel that did not
    /// may try again when it was asked for rest, or for the other direction.
    pub(crate) fn follow(&mut self, now: Time, wanted: WheelSpeeds) -> bool {
        for (side, wanted_mps) in [wanted.left_mps, wanted.right_mps].into_iter().enumerate() {
            if self.stuck[side].is_some_and(|sign| wanted_mps * sign <= 0.0) {
                (self.stuck[side], self.stuck_since[side]) = (None, None);
            }
        }
        let settles = self.settles_until.is_some_and(|until| now < until);
        !settles && self.stuck == [None; 2]
    }

    /// How fast the wheels turn; `None` when nobody knows.
    pub(crate) fn rims(&self) -> Option<WheelSpeeds> {
        self.rims
    }

    /// The speeds from which the wheels gain more: what they were told last, so long ago, unless the motors
    /// have not followed or have stopped by themselves since.
    pub(crate) fn begin_from(&self, params: &Params, told: Option<WheelSpeeds>, pause_s: f64) -> WheelSpeeds {
        let Some(told) = told else { return self.rims.unwrap_or(WheelSpeeds::ZERO) };
        let alone_s = (pause_s - f64::from(params.motor_watchdog_ms) * 1e-3).max(0.0);
        let lost_mps = params.deceleration_m_per_s2 * alone_s;
        let lag_mps = LAG_MPS + LAG_S * params.max_speed_up_m_per_s2;
        let from = |told_mps: f64, rim_mps: Option<f64>| {
            let shown_mps = rim_mps.map_or(f64::INFINITY, |rim| (rim * told_mps.signum()).max(0.0) + lag_mps);
            (told_mps.abs() - lost_mps).max(0.0).min(shown_mps).copysign(told_mps)
        };
        WheelSpeeds {
            left_mps: from(told.left_mps, self.rims.map(|rims| rims.left_mps)),
            right_mps: from(told.right_mps, self.rims.map(|rims| rims.right_mps)),
        }
    }
}
