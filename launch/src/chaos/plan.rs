//! What is done to whom, and when: drawn from a seed, without a look at the clock.

use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use std::collections::VecDeque;
use std::time::Duration;

/// Between two wounds.
const PAUSE_S: std::ops::Range<f64> = 0.1..0.8;
/// Between two wounds that are to show that the wheels stop: so long a robot takes to heal and to get under way.
const BETWEEN_PROOFS_S: f64 = 2.0;
/// How often a wound that was to show something, and showed nothing, is inflicted again.
const TRIES_MAX: u32 = 12;
/// After a wound, a moment at which the successor is just starting.
const START_UP_S: std::ops::Range<f64> = 0.0..0.06;
/// How many of the wounds hit the successor in its start-up window.
const IN_START_UP: f64 = 0.15;
/// How many are stops (the process hangs) and how many restarts; the rest are kills.
const HANGS: f64 = 0.08;
const RESTARTS: f64 = 0.12;

/// What is done to a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    /// Signal 9.
    Kill,
    /// SIGSTOP: it hangs until the launcher notices.
    Hang,
    /// It is asked to leave, and started again.
    Restart,
}

/// One deed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Deed {
    /// After the one before.
    pub(super) after: Duration,
    /// Which of the services.
    pub(super) victim: usize,
    /// What.
    pub(super) kind: Kind,
    /// It hits a successor that has just been started.
    pub(super) in_start_up: bool,
    /// It is to show that the wheels stop, so it waits for wheels that turn.
    pub(super) while_driving: bool,
}

/// The deeds of a seed, one after the other.
#[derive(Debug)]
pub(super) struct Plan {
    rng: Pcg64,
    victims: usize,
    last: Option<usize>,
    /// On whom the wheels depend: each hangs once at the beginning, since a successor is there before the wheels have to stop.
    first: VecDeque<usize>,
    /// How often nothing was seen.
    tries: u32,
}

impl Plan {
    /// For so many services, at least one, of which the wheels depend on these.
    pub(super) fn new(seed: u64, victims: usize, chain: impl IntoIterator<Item = usize>) -> Self {
        let first = chain.into_iter().collect();
        Self { rng: Pcg64::seed_from_u64(seed), victims: victims.max(1), last: None, first, tries: 0 }
    }

    /// Lets one on whom the wheels depend hang once more, since nothing was seen the last time; a few times at the most.
    pub(super) fn prove_again(&mut self, victim: usize) {
        if self.tries < TRIES_MAX {
            self.tries += 1;
            self.first.push_back(victim);
        }
    }

    /// The next deed.
    pub(super) fn next(&mut self) -> Deed {
        if let Some(victim) = self.first.pop_front() {
            let after = Duration::from_secs_f64(BETWEEN_PROOFS_S);
            return Deed { after, victim, kind: Kind::Hang, in_start_up: false, while_driving: true };
        }
        let again = self.last.filter(|_| self.rng.random_bool(IN_START_UP));
        let pause = if again.is_some() { START_UP_S } else { PAUSE_S };
        let after = Duration::from_secs_f64(self.rng.random_range(pause));
        let victim = again.unwrap_or_else(|| self.rng.random_range(0..self.victims));
        let kind = match self.rng.random::<f64>() {
            // Who has just been started is killed: asking it to leave, or stopping it, is the other deeds' business.
            _ if again.is_some() => Kind::Kill,
            draw if draw < HANGS => Kind::Hang,
            draw if draw < HANGS + RESTARTS => Kind::Restart,
            _ => Kind::Kill,
        };
        // Not a third time at once: a service that dies over and over waits longer every time, as it should.
        self.last = (again.is_none() && kind == Kind::Kill).then_some(victim);
        Deed { after, victim, kind, in_start_up: again.is_some(), while_driving: false }
    }
}

/// Anything of a list.
pub(super) fn any<'a, T>(rng: &mut impl Rng, list: &'a [T]) -> Option<&'a T> {
    (!list.is_empty()).then(|| &list[rng.random_range(0..list.len())])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_plan() {
        let deeds = |seed| {
            let mut plan = Plan::new(seed, 11, [3, 1]);
            (0..200).map(|_| plan.next()).collect::<Vec<_>>()
        };
        assert_eq!(deeds(1), deeds(1));
        assert_ne!(deeds(1), deeds(2));
    }

    #[test]
    fn those_on_whom_the_wheels_depend_hang_first() {
        let mut plan = Plan::new(1, 5, [3, 1]);
        let [first, second, third] = [plan.next(), plan.next(), plan.next()];
        assert_eq!((first.victim, first.kind, first.while_driving), (3, Kind::Hang, true));
        assert_eq!((second.victim, second.kind, second.while_driving), (1, Kind::Hang, true));
        assert!(!third.while_driving);
        (0..100).for_each(|_| plan.prove_again(3));
        let again = std::iter::repeat_with(|| plan.next()).take_while(|deed| deed.while_driving);
        assert_eq!(again.filter(|deed| deed.victim == 3).count(), TRIES_MAX as usize);
    }

    #[test]
    fn everybody_is_hit_in_every_way() {
        let mut plan = Plan::new(7, 5, []);
        let deeds: Vec<Deed> = (0..2000).map(|_| plan.next()).collect();
        for kind in [Kind::Kill, Kind::Hang, Kind::Restart] {
            assert!((0..5).all(|victim| deeds.iter().any(|deed| deed.victim == victim && deed.kind == kind)));
        }
        let in_start_up = deeds.iter().filter(|deed| deed.in_start_up).count();
        assert!((100..400).contains(&in_start_up), "{in_start_up}");
        assert!(deeds.iter().all(|deed| deed.after.as_secs_f64() < PAUSE_S.end));
    }
}
