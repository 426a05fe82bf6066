//! Faults at logical moments: services that are killed or hang because the graph, an experiment or a test says so, the same in every run.
//!
//! A fault strikes between two instants. The process is really killed; what it takes to clean up after it and to start it again happens while logical time
//! stands still, so the successor joins at the same logical moment in every run.

use crate::conductor::Conductor;
use crate::graph::{Fault, FaultKind};
use crate::prompter::Prompter;
use crate::supervise::Supervisor;
use messages::Time;
use std::collections::HashMap;
use std::time::Duration;

/// From a service's death to its successor's first step, in logical time, where the fault does not say otherwise.
pub(crate) const DOWN: Duration = Duration::from_millis(100);
/// Deaths with less than this between them are deaths in a row.
const SOUND_AFTER: Duration = Duration::from_secs(1);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Deed {
    Kill { down: Duration },
    Stop { lasting: Option<Duration> },
    Start,
}

/// What is planned.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    /// In the order of time; of the same moment in the order of the graph file.
    planned: Vec<(Time, String, Deed)>,
    /// When a service came back last, and its deaths in a row.
    lives: HashMap<String, (Time, u32)>,
}

impl Faults {
    /// Those of a graph.
    pub(crate) fn new(faults: &[Fault]) -> Self {
        let mut new = Self::default();
        for fault in faults {
            let deed = match fault.kind {
                FaultKind::Kill { down } => Deed::Kill { down: down.unwrap_or(DOWN) },
                FaultKind::Stop { lasting } => Deed::Stop { lasting },
            };
            new.plan(Time::ZERO.after(fault.at), &fault.role, deed);
        }
        new
    }

    /// When the next one strikes.
    pub(crate) fn next(&self) -> Option<Time> {
        self.planned.first().map(|(at, ..)| *at)
    }

    /// Kills a service before the next instant.
    pub(crate) fn kill_now(&mut self, now: Time, role: &str) {
        self.plan(now, role, Deed::Kill { down: DOWN });
    }

    fn plan(&mut self, at: Time, role: &str, deed: Deed) {
        let place = self.planned.partition_point(|(known, ..)| *known <= at);
        self.planned.insert(place, (at, role.to_owned(), deed));
    }

    /// Lets the next one strike.
    ///
    /// # Errors
    /// When a service does not come back.
    pub(crate) fn perform_next(
        &mut self,
        supervisor: &mut Supervisor,
        conductor: &mut Conductor,
        prompter: &Prompter<'_>,
    ) -> Result<(), String> {
        if self.planned.is_empty() {
            return Ok(());
        }
        let (at, role, deed) = self.planned.remove(0);
        conductor.rest_at(&supervisor.host, at);
        let at_s = at.as_secs_f64();
        let Some(service) = supervisor.services.iter().find(|service| service.service.role == role) else {
            return Ok(());
        };
        let (launch, lives) = (service.service.launch.clone(), service.slot().is_some());
        match deed {
            // It is dead already.
            Deed::Kill { .. } | Deed::Stop { .. } if !lives => {}
            Deed::Kill { down } => {
                conductor.dismiss(&role);
                supervisor.end_at_once(&role);
                let (since, deaths) = self.lives.get(&role).copied().unwrap_or((Time::ZERO, 0));
                let deaths = if at.since(since) >= SOUND_AFTER { 1 } else { deaths + 1 };
                self.lives.insert(role.clone(), (since, deaths));
                let pause = match launch.restart {
                    None => None,
                    Some(policy) => policy.pause_after(deaths),
                };
                match pause {
                    Some(pause) => {
                        supervisor.note(&role, format!("killed at {at_s:.3} s, as planned"), false);
                        self.plan(at.after(down + pause), &role, Deed::Start);
                    }
                    None => supervisor.note(&role, format!("killed at {at_s:.3} s, for good"), false),
                }
            }
            Deed::Stop { lasting } => {
                // As in host time: who is silent for longer than this counts as hanging, and is killed.
                let limit = launch.hang_after;
                let end = lasting.filter(|&lasting| lasting <= limit);
                supervisor.note(&role, format!("stopped at {at_s:.3} s, as planned"), false);
                conductor.suspend(&role, end.map_or(Time::from_nanos(u64::MAX), |end| at.after(end)));
                if end.is_none() {
                    self.plan(at.after(limit), &role, Deed::Kill { down: DOWN });
                }
            }
            Deed::Start => {
                supervisor.begin_again(&role)?;
                prompter.repeat();
                let deaths = self.lives.get(&role).map_or(0, |&(_, deaths)| deaths);
                self.lives.insert(role.clone(), (at, deaths));
                let service = supervisor.services.iter().find(|service| service.service.role == role);
                if let Some(slot) = service.and_then(|service| service.slot()) {
                    conductor.admit(&role, slot, launch.compute.unwrap_or_default());
                }
                supervisor.note(&role, format!("back at {at_s:.3} s"), false);
            }
        }
        Ok(())
    }
}
