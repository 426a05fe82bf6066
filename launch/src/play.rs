//! The loop of a run in logical time: instant after instant, with what was planned between them.

use crate::conductor::{Conductor, Discord};
use crate::faults::Faults;
use crate::graph::Checked;
use crate::lockstep::{Outcome, Pace};
use crate::monitor::Monitor;
use crate::observer::Observer;
use crate::prompter::Prompter;
use crate::steering::{Order, Steering};
use crate::supervise::{Phase, Supervisor};
use crate::up::{Display, Signals};
use board::{clock, gate};
use messages::Time;
use std::time::Duration;

/// Between two looks at signals, deaths and the screen.
const GLANCE: Duration = Duration::from_millis(20);
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
    began: Time,
    next_glance: Time,
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
            faults: Faults::new(&graph.faults),
            steering: pace.steered.then(Steering::new),
            began,
            next_glance: began.after(GLANCE),
        })
    }

    /// Plays until the referee, the limit or a person ends the run.
    ///
    /// # Errors
    /// When a service dies unplanned, or anything else makes the run worthless.
    pub(crate) fn play(
        &mut self,
        pace: &Pace,
        signals: &Signals,
        display: &mut dyn Display,
    ) -> Result<Outcome, Failure> {
        let limit = pace.until.unwrap_or(NEVER);
        let mut interrupted = false;
        while self.observer.verdict().is_none() && self.conductor.now() < limit {
            let now = clock::monotonic();
            if now >= self.next_glance {
                self.glance(now, display)?;
                if signals.count() > 0 || display.wants_to_leave() {
                    interrupted = true;
                    break;
                }
            }
            let next = self.next()?;
            if let Some(steering) = &self.steering
                && next.at() > steering.target()
            {
                if !self.rest(signals)? {
                    break;
                }
                continue;
            }
            match next {
                Next::Instant(at) => self.play_instant(at)?,
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
            if let Some(speed) = pace.speed {
                self.keep_pace(speed);
            }
        }
        // What came from outside after the last instant belongs to the run.
        self.prompter.say_between(self.conductor.now().after(Duration::from_nanos(1)))?;
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
        Ok(match (instant, fault) {
            // A fault strikes before the instant at its moment.
            (Some(instant), Some(fault)) if fault <= instant => Next::Fault(fault),
            (None, Some(fault)) => Next::Fault(fault),
            (Some(instant), _) => Next::Instant(instant),
            (None, None) => Next::Nothing,
        })
    }

    fn play_instant(&mut self, at: Time) -> Result<(), Failure> {
        let mut seen = Ok(());
        let observer = &mut *self.observer;
        let mut look = |_, _| {
            if seen.is_ok() {
                seen = observer.look();
            }
        };
        let services = &self.supervisor.services;
        let mut lives = |role: &str| {
            let service = services.iter().find(|service| service.service.role == role);
            service.and_then(|service| service.pid()).is_some_and(board::switchboard::process_lives)
        };
        let host = &self.supervisor.host;
        let played = self.conductor.play_instant(host, at, &mut self.prompter, &mut look, &mut lives);
        seen?;
        Ok(played?)
    }

    /// Looks at processes and the screen: between many instants, since it costs as much as one.
    fn glance(&mut self, now: Time, display: &mut dyn Display) -> Result<(), Failure> {
        self.next_glance = now.after(GLANCE);
        self.observer.tick(now)?;
        self.supervisor.tick();
        self.monitor.update(self.supervisor);
        display.show(self.supervisor, &mut self.monitor);
        self.refuse_deaths()
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
    fn rest(&mut self, signals: &Signals) -> Result<bool, Failure> {
        let Some(steering) = &mut self.steering else { return Ok(true) };
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
                self.faults.kill_now(now, &role);
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

    fn keep_pace(&self, speed: f64) {
        let ahead = self.conductor.now().as_secs_f64() / speed - clock::monotonic().seconds_since(self.began);
        if ahead > 0.0 {
            clock::sleep(Duration::from_secs_f64(ahead.min(0.02)));
        }
    }

    fn outcome(&self, interrupted: bool) -> Outcome {
        Outcome {
            verdict: self.observer.verdict(),
            summary: self.observer.summary().copied(),
            digest: self.observer.digest(),
            end: self.conductor.now(),
            wall_s: clock::monotonic().seconds_since(self.began),
            turns: self.conductor.turns,
            restarts: self.supervisor.services.iter().map(|service| service.restarts).sum(),
            interrupted,
        }
    }
}
