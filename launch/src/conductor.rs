//! Lockstep: logical time, and whose turn it is.
//!
//! An instant consists of rounds. In round 0 the services whose timers are due take a step. In round r+1 those take a step that are woken by a
//! topic published in round r. When none is left, time jumps to the next timer. Hardware simulators call these delta cycles.
//! A step at (time, round) sees exactly what was published before (time, round); the readers see to that. With one publisher a topic,
//! every run with one seed leaves the same messages, whatever the operating system did meanwhile.

use crate::prompter::Prompter;
use board::clock;
use board::host::Host;
use board::switchboard::{self, SlotState};
use messages::Time;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Rounds after which an instant counts as one that never settles.
const ROUNDS_MAX: u32 = 1000;
/// How long the conductor sleeps before it looks whether somebody has died.
const PATIENCE: Duration = Duration::from_millis(100);
/// How long a service may take for a turn, in time of its own.
const TURN_LIMIT: Duration = Duration::from_secs(60);

/// What ends a run in logical time before its end.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Discord {
    /// Services wake each other in one instant for ever.
    #[error("at {at_s} s the services {} wake each other without end: one of them must wait for a timer", roles.join(", "))]
    NeverSettles {
        /// The instant, in seconds.
        at_s: String,
        /// The services of the last round.
        roles: Vec<String>,
    },
    /// A service died in its turn.
    #[error("`{role}` died in its turn at {at_s} s")]
    Died {
        /// The service.
        role: String,
        /// The instant, in seconds.
        at_s: String,
    },
    /// A service does not end its turn.
    #[error(
        "`{role}` does not end its turn at {at_s} s: it has had {own_s} s, without waiting for a processor"
    )]
    Silent {
        /// The service.
        role: String,
        /// The instant, in seconds.
        at_s: String,
        /// How long it had, in seconds of its own time.
        own_s: u64,
    },
    /// The end was asked for while somebody was in its turn.
    #[error("interrupted")]
    Interrupted,
    /// The recording that is played cannot be read any further.
    #[error("{0}")]
    Prompter(String),
    /// No service has a timer, and nobody publishes: nothing will ever happen again.
    #[error("after {at_s} s no timer is left: nothing will ever happen again")]
    Over {
        /// The instant, in seconds.
        at_s: String,
    },
}

/// Who knows what the conductor cannot see.
pub(crate) trait Attendant {
    /// Whether a service's process lives.
    fn lives(&mut self, role: &str) -> bool;
    /// Whether the end of the run was asked for.
    fn wants_to_end(&mut self) -> bool;
    /// How long a service has been in its turn (the one with this number) without waiting for a processor; by the clock it is `waited`.
    fn own_time(&mut self, role: &str, turn: u64, waited: Duration) -> Duration;
}

/// Gives the turns.
#[derive(Debug)]
pub(crate) struct Conductor {
    players: Vec<Player>,
    topics: u32,
    /// Messages on each topic at the last look.
    counts: Vec<u64>,
    now: Time,
    begun: bool,
    /// Turns given so far.
    pub(crate) turns: u64,
    /// Instants so far.
    pub(crate) instants: u64,
}

#[derive(Debug, Clone)]
struct Player {
    role: String,
    slot: u32,
    /// How long its computer takes for a step.
    compute_ns: u64,
    /// It has taken a step that is being computed until then: only then are its messages seen.
    computes_until_ns: Option<u64>,
    /// It gets no turn before: it hangs.
    hangs_until_ns: u64,
    /// A topic that it waits for has a new message.
    is_woken: bool,
}

impl Player {
    /// Whether it takes a turn now: a step, or the end of one.
    fn is_due(&self, now_ns: u64, next_timer_ns: impl FnOnce() -> u64) -> bool {
        match self.computes_until_ns {
            _ if self.hangs_until_ns > now_ns => false,
            Some(until_ns) => until_ns <= now_ns,
            None => self.is_woken || next_timer_ns() <= now_ns,
        }
    }
}

impl Conductor {
    /// A conductor for these services, which have joined the board: role, slot, and how long a step takes.
    pub(crate) fn new(host: &Host, services: impl IntoIterator<Item = (String, u32, Duration)>) -> Self {
        let topics = host.manifest().topics.len() as u32;
        let mut conductor = Self {
            players: Vec::new(),
            topics,
            counts: vec![0; topics as usize],
            now: Time::ZERO,
            begun: false,
            turns: 0,
            instants: 0,
        };
        for (role, slot, compute) in services {
            conductor.admit(&role, slot, compute);
        }
        conductor
    }

    /// The logical moment.
    pub(crate) fn now(&self) -> Time {
        self.now
    }

    /// Begins at this moment instead of zero.
    pub(crate) fn begin_at(&mut self, now: Time) {
        self.now = now;
    }

    /// Moves on to a moment at which nothing happens: between the last instant and the next.
    pub(crate) fn rest_at(&mut self, host: &Host, now: Time) {
        self.now = self.now.max(now);
        host.switchboard().header().logical_ns.store(self.now.as_nanos(), Ordering::Release);
    }

    /// Lets a service that has joined the board take turns.
    pub(crate) fn admit(&mut self, role: &str, slot: u32, compute: Duration) {
        self.dismiss(role);
        self.players.push(Player {
            role: role.to_owned(),
            slot,
            compute_ns: u64::try_from(compute.as_nanos()).unwrap_or(u64::MAX),
            computes_until_ns: None,
            hangs_until_ns: 0,
            is_woken: false,
        });
    }

    /// Gives a service no more turns: it is dead.
    pub(crate) fn dismiss(&mut self, role: &str) {
        self.players.retain(|player| player.role != role);
    }

    /// Gives a service no turns before this moment.
    pub(crate) fn suspend(&mut self, role: &str, until: Time) {
        for player in self.players.iter_mut().filter(|player| player.role == role) {
            player.hangs_until_ns = until.as_nanos();
        }
    }

    /// When the next instant is, as far as the services' timers know.
    pub(crate) fn next_instant(&mut self, host: &Host) -> Option<Time> {
        self.note_woken(host);
        if !self.begun {
            return Some(self.now);
        }
        let now_ns = self.now.as_nanos();
        let due = |player: &Player| {
            let due_ns = match player.computes_until_ns {
                Some(until_ns) => until_ns,
                // A message from outside waits for the next instant, whoever's it is.
                None if player.is_woken && player.hangs_until_ns > now_ns => player.hangs_until_ns,
                None => self.timer_ns(host, player),
            };
            due_ns.max(player.hangs_until_ns)
        };
        match self.players.iter().map(due).min().unwrap_or(u64::MAX) {
            u64::MAX => None,
            due_ns => Some(Time::from_nanos(due_ns.max(now_ns))),
        }
    }

    /// The next instant of services without timers that were woken from outside: at once.
    pub(crate) fn instant_of_the_woken(&self) -> Option<Time> {
        let now_ns = self.now.as_nanos();
        let waits = |player: &Player| player.is_woken && player.hangs_until_ns <= now_ns;
        self.players.iter().any(waits).then(|| Time::from_nanos(now_ns + 1))
    }

    /// Plays the instant at this moment. `after_round` sees the board when a round has ended; the attendant is asked while
    /// somebody takes long over its turn; the prompter says the words of those who are not there.
    ///
    /// # Errors
    /// When the run cannot go on.
    pub(crate) fn play_instant(
        &mut self,
        host: &Host,
        at: Time,
        prompter: &mut Prompter<'_>,
        after_round: &mut dyn FnMut(Time, u32),
        attendant: &mut dyn Attendant,
    ) -> Result<(), Discord> {
        let board = host.switchboard();
        self.note_woken(host);
        self.now = self.now.max(at);
        self.begun = true;
        self.instants += 1;
        let now_ns = self.now.as_nanos();
        board.header().logical_ns.store(now_ns, Ordering::Release);
        for round in 0..ROUNDS_MAX {
            let called: Vec<usize> = (0..self.players.len())
                .filter(|&index| {
                    let player = &self.players[index];
                    // A timer falls due in round 0, or when a step has been computed meanwhile.
                    let looks = round == 0 || player.compute_ns > 0;
                    player.is_due(now_ns, || if looks { self.timer_ns(host, player) } else { u64::MAX })
                })
                .collect();
            if called.is_empty() && !prompter.has_more_at(self.now, round) {
                return Ok(());
            }
            self.give_turns(host, round, &called, attendant)?;
            for &index in &called {
                let player = &mut self.players[index];
                if player.computes_until_ns.take().is_none() {
                    player.is_woken = false;
                    player.computes_until_ns =
                        (player.compute_ns > 0).then(|| now_ns.saturating_add(player.compute_ns));
                }
            }
            prompter.say(self.now, round).map_err(Discord::Prompter)?;
            after_round(self.now, round);
            self.note_woken(host);
            if round + 1 == ROUNDS_MAX {
                let roles = called.iter().map(|&index| self.players[index].role.clone()).collect();
                return Err(Discord::NeverSettles { at_s: seconds(self.now), roles });
            }
        }
        Ok(())
    }

    fn timer_ns(&self, host: &Host, player: &Player) -> u64 {
        host.switchboard().slot(player.slot).map_or(u64::MAX, |slot| slot.next_due_ns.load(Ordering::Acquire))
    }

    /// Notes who is woken by what was published since the last look.
    fn note_woken(&mut self, host: &Host) {
        for topic in 0..self.topics {
            let Some(entry) = host.switchboard().topic(topic) else { continue };
            let count = entry.count.load(Ordering::Acquire);
            if count == std::mem::replace(&mut self.counts[topic as usize], count) {
                continue;
            }
            for player in &mut self.players {
                player.is_woken |= entry.wakes(player.slot);
            }
        }
    }

    fn give_turns(
        &mut self,
        host: &Host,
        round: u32,
        called: &[usize],
        attendant: &mut dyn Attendant,
    ) -> Result<(), Discord> {
        if called.is_empty() {
            return Ok(());
        }
        let board = host.switchboard();
        let header = board.header();
        header.round.store(round, Ordering::Release);
        header.outstanding.store(called.len() as u32, Ordering::Release);
        self.turns += called.len() as u64;
        for &index in called {
            if let Some(slot) = board.slot(self.players[index].slot) {
                slot.turn.fetch_add(1, Ordering::AcqRel);
                slot.ring();
            }
        }
        let mut began = None;
        loop {
            let heard = header.conductor_bell.load(Ordering::SeqCst);
            if header.outstanding.load(Ordering::Acquire) == 0 {
                return Ok(());
            }
            switchboard::wait(&header.conductor_bell, &header.conductor_sleeps, heard, Some(PATIENCE));
            if header.outstanding.load(Ordering::Acquire) == 0 {
                return Ok(());
            }
            if attendant.wants_to_end() {
                return Err(Discord::Interrupted);
            }
            // Rung by a joining service, or patience is at an end: is anybody missing?
            let now = clock::monotonic();
            let began = *began.get_or_insert(now);
            for &index in called {
                let player = &self.players[index];
                let Some(slot) = board.slot(player.slot) else { continue };
                let ended = slot.done.load(Ordering::Acquire) == slot.turn.load(Ordering::Acquire);
                if ended {
                    continue;
                }
                let at_s = seconds(self.now);
                if slot.state() != SlotState::Running || !attendant.lives(&player.role) {
                    return Err(Discord::Died { role: player.role.clone(), at_s });
                }
                // By its own time, as in host time: a machine with too much else to do is no hanging service.
                let own = attendant.own_time(&player.role, self.turns, now.since(began));
                if own > TURN_LIMIT {
                    return Err(Discord::Silent { role: player.role.clone(), at_s, own_s: own.as_secs() });
                }
            }
        }
    }
}

fn seconds(time: Time) -> String {
    format!("{:.6}", time.as_secs_f64())
}
