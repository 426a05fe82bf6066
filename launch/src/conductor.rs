//! Lockstep: logical time, and whose turn it is.
//!
//! An instant consists of rounds. In round 0 the services whose timers are due take a step. In round r+1 those take a step that are woken by a
//! topic published in round r. When none is left, time jumps to the next timer. Hardware simulators call these delta cycles.
//! A step at (time, round) sees exactly what was published before (time, round); the readers see to that. With one publisher a topic,
//! every run with one seed leaves the same messages, whatever the operating system did meanwhile.

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
/// How long a service may take for a turn.
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
    #[error("`{role}` does not end its turn at {at_s} s")]
    Silent {
        /// The service.
        role: String,
        /// The instant, in seconds.
        at_s: String,
    },
    /// No service has a timer, and nobody publishes: nothing will ever happen again.
    #[error("after {at_s} s no timer is left: nothing will ever happen again")]
    Over {
        /// The instant, in seconds.
        at_s: String,
    },
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
}

impl Conductor {
    /// A conductor for the services on this board, which have joined.
    pub(crate) fn new(host: &Host) -> Self {
        let topics = host.manifest().topics.len() as u32;
        let players = board::host::services(host.switchboard())
            .into_iter()
            .map(|(slot, role, _)| Player { role, slot })
            .collect();
        Self {
            players,
            topics,
            counts: vec![0; topics as usize],
            now: Time::ZERO,
            begun: false,
            turns: 0,
            instants: 0,
        }
    }

    /// The logical moment.
    pub(crate) fn now(&self) -> Time {
        self.now
    }

    /// Plays the next instant. `after_round` sees the board when a round has ended; `lives` says whether a service's process lives.
    ///
    /// # Errors
    /// When the run cannot go on.
    pub(crate) fn play_instant(
        &mut self,
        host: &Host,
        after_round: &mut dyn FnMut(Time, u32),
        lives: &mut dyn FnMut(&str) -> bool,
    ) -> Result<(), Discord> {
        let board = host.switchboard();
        // What came from outside between two instants wakes its readers in round 0.
        let mut woken = self.take_woken(host);
        let next = self.players.iter().map(|player| self.due_ns(host, player)).min().unwrap_or(u64::MAX);
        if next == u64::MAX && woken.is_empty() {
            return Err(Discord::Over { at_s: seconds(self.now) });
        }
        if self.begun && next != u64::MAX {
            self.now = Time::from_nanos(next.max(self.now.as_nanos()));
        }
        self.begun = true;
        self.instants += 1;
        board.header().logical_ns.store(self.now.as_nanos(), Ordering::Release);
        for round in 0..ROUNDS_MAX {
            let now_ns = self.now.as_nanos();
            let called: Vec<usize> = (0..self.players.len())
                .filter(|&index| {
                    let player = &self.players[index];
                    woken.contains(&player.slot) || (round == 0 && self.due_ns(host, player) <= now_ns)
                })
                .collect();
            if called.is_empty() {
                return Ok(());
            }
            self.give_turns(host, round, &called, lives)?;
            after_round(self.now, round);
            woken = self.take_woken(host);
            if round + 1 == ROUNDS_MAX {
                let roles = called.iter().map(|&index| self.players[index].role.clone()).collect();
                return Err(Discord::NeverSettles { at_s: seconds(self.now), roles });
            }
        }
        Ok(())
    }

    fn due_ns(&self, host: &Host, player: &Player) -> u64 {
        host.switchboard().slot(player.slot).map_or(u64::MAX, |slot| slot.next_due_ns.load(Ordering::Acquire))
    }

    /// The slots that are woken by what was published since the last look.
    fn take_woken(&mut self, host: &Host) -> Vec<u32> {
        let mut woken = Vec::new();
        for topic in 0..self.topics {
            let Some(entry) = host.switchboard().topic(topic) else { continue };
            let count = entry.count.load(Ordering::Acquire);
            if count == std::mem::replace(&mut self.counts[topic as usize], count) {
                continue;
            }
            for player in &self.players {
                if entry.wakes(player.slot) && !woken.contains(&player.slot) {
                    woken.push(player.slot);
                }
            }
        }
        woken
    }

    fn give_turns(
        &mut self,
        host: &Host,
        round: u32,
        called: &[usize],
        lives: &mut dyn FnMut(&str) -> bool,
    ) -> Result<(), Discord> {
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
                if slot.state() != SlotState::Running || !lives(&player.role) {
                    return Err(Discord::Died { role: player.role.clone(), at_s });
                }
                if now.since(began) > TURN_LIMIT {
                    return Err(Discord::Silent { role: player.role.clone(), at_s });
                }
            }
        }
    }
}

fn seconds(time: Time) -> String {
    format!("{:.6}", time.as_secs_f64())
}
