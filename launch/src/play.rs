//! The loop of a run in logical time: instant after instant, with what was planned between them.

use crate::conductor::{Attendant, Conductor, Discord};
use crate::control::Tempo;
use crate::desk::Desk;
use crate::faults::Faults;
use crate::graph::Checked;
use crate::monitor::Monitor;
use crate::observer::Observer;
use crate::prompter::Prompter;
use crate::run::{Outcome, Pace};
use crate::steering::{Order, Steering};
use crate::supervise::{Phase, Pulse, Supervised, Supervisor, vitals};
use board::{clock, gate};
use messages::Time;
use std::collections::HashMap;
use std::time::Duration;

/// Between two looks at signals, deaths and the screen.
const GLANCE: Duration = Duration::from_millis(20);
/// A turn of this length is spoken of.
const LONG_TURN: Duration = Duration::from_secs(5);
const NEVER: Time = Time::from_nanos(u64::MAX);

type Failure = Box<dyn std::error::Error>;

/// Everything that takes part in a run.
pub(crate) struct Stage<'a> {
    pub(crate) supervisor: &'a mut Supervisor,
    pub(crate) observer: &'a mut Observer,
    pub(crate) prompter: Prompter<'a>,
    monitor: Monitor,
    conductor: Conductor,
    faults: Faults,
    steering: Option<Steering>,
    desk: Desk<'a>,
    tempo: Option<Tempo>,
    /// The moment in both times from which the pace counts, and the change of it that began there.
    paced_from: (Time, Time, u32),
    /// While it stands still: the moment up to which it is still to go.
    step_to: Option<Time>,
    began: Time,
    next_glance: Time,
    turn: LongTurn,
}

/// A turn that takes long.
#[derive(Debug, Default)]
struct LongTurn {
    number: u64,
    pulses: HashMap<String, Pulse>,
    is_said: bool,
}

/// What the conductor asks while somebody is in its turn.
struct Watch<'a, 'b> {
    services: &'a [Supervised],
    desk: &'a Desk<'b>,
    now: Time,
    turn: &'a mut LongTurn,
}

impl Attendant for Watch<'_, '_> {
    fn lives(&mut self, role: &str) -> bool {
        let service = self.services.iter().find(|service| service.service.role == role);
        service.and_then(Supervised::pid).is_some_and(board::switchboard::process_lives)
    }

    fn wants_to_end(&mut self) -> bool {
        self.desk.signals.count() > 0
    }

    fn own_time(&mut self, role: &str, turn: u64, waited: Duration) -> Duration {
        if self.turn.number != turn {
            *self.turn = LongTurn { number: turn, ..LongTurn::default() };
        }
        if waited > LONG_TURN && !std::mem::replace(&mut self.turn.is_said, true) {
            let (at_s, waited_s) = (self.now.as_secs_f64(), waited.as_secs());
            self.desk.console.error(&format!(
                "`{role}` has been in one turn for {waited_s} s (after {at_s:.3} s of logical time); Ctrl-C ends the run"
            ));
        }
        let pid = self.services.iter().find(|service| service.service.role == role).and_then(Supervised::pid);
        let Some(pid) = pid else { return waited };
        let pulse = self.turn.pulses.entry(role.to_owned()).or_default();
        // No heartbeat is expected within a turn.
        pulse.look(clock::monotonic(), 0, || vitals(pid)).own
    }
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Next {
    /// The services' next instant.
    Instant(Time),
    /// Something that was planned for a service.
    Fault(Time),
    /// Nothing will ever happen again.
    Nothing,
}

impl Next {
    fn at(self) -> Time {
        match self {
            Self::Instant(at) | Self::Fault(at) => at,
            Self::Nothing => NEVER,
        }
    }
}

impl<'a> Stage<'a> {
    /// A stage for services that have joined the board.
    ///
    /// # Errors
    /// When the board takes no more processes.
    pub(crate) fn new(
        graph: &Checked,
        supervisor: &'a mut Supervisor,
        observer: &'a mut Observer,
        prompter: Prompter<'a>,
        pace: &Pace,
        desk: Desk<'a>,
    ) -> Result<Self, Failure> {
        let players = supervisor.services.iter().filter_map(|service| {
            let compute = service.service.launch.compute.unwrap_or_default();
            Some((service.service.role.clone(), service.slot()?, compute))
        });
        let mut conductor = Conductor::new(&supervisor.host, players);
        conductor.begin_at(pace.begin);
        let monitor = Monitor::new(supervisor, None)?;
        let began = clock::monotonic();
        Ok(Self {
            supervisor,
            observer,
            prompter,
            monitor,
            conductor,
            faults: Faults::new(graph.faults.iter().chain(&pace.faults)),
            steering: pace.steered.then(Steering::new),
            desk,
            tempo: Some(Tempo::new(pace.speed)),
            paced_from: (began, pace.begin, 0),
            step_to: None,
            began,
            next_glance: began.after(GLANCE),
            turn: LongTurn::default(),
        })
    }

    /// Plays until the referee, the limit or a person ends the run.
    ///
    /// # Errors
    /// When a service dies unplanned, or anything else makes the run worthless.
    pub(crate) fn play(&mut self, pace: &Pace) -> Result<Outcome, Failure> {
        let limit = pace.until.unwrap_or(NEVER);
        let mut interrupted = false;
        while self.observer.verdict().is_none() && self.conductor.now() < limit {
            let now = clock::monotonic();
            if now >= self.next_glance {
                self.glance(now)?;
                if self.desk.signals.count() > 0 {
                    interrupted = true;
                    break;
                }
            }
            if self.stands_still(now) {
                continue;
            }
            let next = self.next()?;
            if pace.last.is_some_and(|last| next.at() > last) {
                break;
            }
            if let Some(steering) = &self.steering
                && next.at() > steering.target()
            {
                if !self.rest()? {
                    break;
                }
                continue;
            }
            match next {
                Next::Instant(at) => {
                    if !self.play_instant(at)? {
                        interrupted = true;
                        break;
                    }
                }
                Next::Fault(_) => {
                    self.faults.perform_next(self.supervisor, &mut self.conductor, &self.prompter)?;
                }
                Next::Nothing if self.has_said_all(pace) => break,
                Next::Nothing => {
                    return Err(
                        Discord::Over { at_s: format!("{:.6}", self.conductor.now().as_secs_f64()) }.into()
                    );
                }
            }
            gate::let_in(self.supervisor.host.switchboard());
        }
        // What came from outside after the last instant belongs to the run.
        let end = pace.last.unwrap_or(self.conductor.now()).max(self.conductor.now());
        self.conductor.rest_at(&self.supervisor.host, end);
        self.prompter.say_between(end.after(Duration::from_nanos(1)))?;
        self.observer.look()?;
        if let Some(steering) = &mut self.steering {
            steering.say_end();
        }
        Ok(self.outcome(interrupted))
    }

    fn next(&mut self) -> Result<Next, Failure> {
        let host = &self.supervisor.host;
        let mut instant = self.conductor.next_instant(host);
        let (fault, script) = (self.faults.next(), self.prompter.next());
        if script.is_some() {
            self.prompter.say_between(instant.unwrap_or(NEVER).min(fault.unwrap_or(NEVER)))?;
            instant = self.conductor.next_instant(host);
            instant = [instant, self.prompter.next()].into_iter().flatten().min();
        }
        let instant = instant.or_else(|| self.conductor.instant_of_the_woken());
        Ok(match (instant, fault) {
            // A fault strikes before the instant at its moment.
            (Some(instant), Some(fault)) if fault <= instant => Next::Fault(fault),
            (None, Some(fault)) => Next::Fault(fault),
            (Some(instant), _) => Next::Instant(instant),
            (None, None) => Next::Nothing,
        })
    }

    /// False when the end was asked for while a service was in its turn.
    fn play_instant(&mut self, at: Time) -> Result<bool, Failure> {
        let mut seen = Ok(());
        let observer = &mut *self.observer;
        let mut look = |_, _| {
            if seen.is_ok() {
                seen = observer.look();
            }
        };
        let host = &self.supervisor.host;
        let mut watch = Watch {
            services: &self.supervisor.services,
            desk: &self.desk,
            now: self.conductor.now(),
            turn: &mut self.turn,
        };
        let played = self.conductor.play_instant(host, at, &mut self.prompter, &mut look, &mut watch);
        seen?;
        match played {
            Err(Discord::Interrupted) => Ok(false),
            played => Ok(played.map(|()| true)?),
        }
    }

    /// Looks at processes, at who asks, and says how everything stands: between many instants, since it costs as much as one.
    fn glance(&mut self, now: Time) -> Result<(), Failure> {
        self.next_glance = now.after(GLANCE);
        self.observer.tick(now)?;
        self.supervisor.tick();
        self.monitor.update(self.supervisor);
        self.desk.serve(now, self.supervisor, &self.monitor, None, &mut self.tempo);
        if let Some(why) = self.supervisor.lost() {
            return Err(why.into());
        }
        self.refuse_deaths()
    }

    /// The end has come: nobody is shown or told anything any more.
    pub(crate) fn close(&mut self) {
        self.desk.close(self.supervisor, &self.monitor, self.tempo);
    }

    /// Whether logical time is to stand still at present, because of its pace or a pause; then a moment of the world's time is over.
    fn stands_still(&mut self, now: Time) -> bool {
        let is_paused = self.is_paused();
        let rest = if is_paused { Some(GLANCE) } else { self.ahead(now) };
        let Some(rest) = rest else { return false };
        // Who wants to say something from outside may, as at any rest.
        let board = self.supervisor.host.switchboard();
        gate::open(board);
        clock::sleep(rest.min(GLANCE));
        gate::close(board);
        true
    }

    /// Whether a person has stopped logical time, and no step is left to be played.
    fn is_paused(&mut self) -> bool {
        let Some(tempo) = self.tempo.as_mut().filter(|tempo| tempo.paused) else {
            self.step_to = None;
            return false;
        };
        let now = self.conductor.now();
        if tempo.step_ns > 0 {
            let from = self.step_to.unwrap_or(now);
            self.step_to = Some(from.after(Duration::from_nanos(std::mem::take(&mut tempo.step_ns))));
        }
        if self.step_to.is_some_and(|to| now < to) {
            return false;
        }
        self.step_to = None;
        // The pace counts from where it goes on.
        tempo.changes = tempo.changes.wrapping_add(1);
        true
    }

    /// A death that nobody planned makes the run another one each time.
    fn refuse_deaths(&self) -> Result<(), Failure> {
        match self.supervisor.failed() {
            Some(service) => Err(Discord::Died {
                role: service.service.role.clone(),
                at_s: format!("{:.6}", self.conductor.now().as_secs_f64()),
            }
            .into()),
            None => Ok(()),
        }
    }

    /// Rests at the moment that was asked for until more is; false when the run is to end.
    fn rest(&mut self) -> Result<bool, Failure> {
        let Some(steering) = &mut self.steering else { return Ok(true) };
        let signals = self.desk.signals;
        let board = self.supervisor.host.switchboard();
        self.conductor.rest_at(&self.supervisor.host, steering.target());
        gate::open(board);
        let now = self.conductor.now();
        let order = steering.next_order(now, || signals.count() > 0);
        gate::close(board);
        match order {
            Order::Advance(_) => {}
            Order::Look => {
                self.observer.look()?;
                self.observer.flush()?;
            }
            Order::Kill(role) => {
                if !self.supervisor.services.iter().any(|service| service.service.role == role) {
                    return Err(format!("there is no service `{role}`").into());
                }
                self.faults.kill_now(steering.target(), &role);
            }
            Order::End => return Ok(false),
        }
        self.supervisor.tick();
        self.refuse_deaths()?;
        Ok(true)
    }

    fn has_said_all(&self, pace: &Pace) -> bool {
        let finished = self.supervisor.services.iter().any(|service| service.phase == Phase::Finished);
        // A run without a referee ends when its players have left, and a recording when all is said.
        finished || pace.script.is_some()
    }

    /// How far logical time is ahead of the pace that was asked for.
    fn ahead(&mut self, now: Time) -> Option<Duration> {
        let Some(Tempo { speed: Some(speed), changes, .. }) = self.tempo else { return None };
        let logical = self.conductor.now();
        if self.paced_from.2 != changes {
            self.paced_from = (now, logical, changes);
        }
        let (from, logical_from, _) = self.paced_from;
        let ahead_s = logical.seconds_since(logical_from) / speed - now.seconds_since(from);
        (ahead_s > 0.0).then(|| Duration::from_secs_f64(ahead_s.min(1.0)))
    }

    fn outcome(&self, interrupted: bool) -> Outcome {
        Outcome {
            verdict: self.observer.verdict(),
            summary: self.observer.summary().copied(),
            digest: self.observer.digest(),
            end: self.conductor.now(),
            wall_s: clock::monotonic().seconds_since(self.began),
            turns: self.conductor.turns,
            ordered: self.faults.ordered.clone(),
            restarts: self.supervisor.services.iter().map(|service| service.restarts).sum(),
            interrupted,
            unclean: Vec::new(),
        }
    }
}
