//! What the launcher sees of the running services: their health, their use of the machine, and the referee's word.

use crate::control::{self, ServiceStatus, Status, Tempo};
use crate::graph::Checked;
use crate::record::Recording;
use crate::standstill::Standstill;
use crate::supervise::Supervisor;
use board::tap::{Tap, TapReader};
use board::{JoinError, clock};
use messages::{Health, RunSummary, Time, health_topic};
use std::collections::HashMap;
use std::sync::atomic::Ordering;
use std::time::Duration;

const SAMPLE_PERIOD: Duration = Duration::from_secs(1);

/// Looks at the board and at the processes.
pub(crate) struct Monitor {
    /// Holds the place on the board.
    _tap: Tap,
    health: HashMap<String, (TapReader, Health)>,
    finish: Option<TapReader>,
    samples: HashMap<String, Sample>,
    sampled: Option<Time>,
    summary: Option<RunSummary>,
    standstill: Standstill,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sample {
    pid: u32,
    steps: u64,
    cpu_s: f64,
    rate_hz: f64,
    cpu_percent: f64,
    memory_kib: u64,
}

impl Monitor {
    /// Joins the board beside the services.
    ///
    /// # Errors
    /// When the board takes no more processes.
    pub(crate) fn new(supervisor: &Supervisor, finish: Option<&str>) -> Result<Self, JoinError> {
        let tap = Tap::join(supervisor.host.place().clone(), "launch")?;
        let mut health = HashMap::new();
        for service in &supervisor.services {
            let role = service.service.role.clone();
            let reader = tap.reader(&health_topic(&role))?;
            health.insert(role, (reader, Health::default()));
        }
        let finish = finish.map(|topic| tap.reader(topic)).transpose()?;
        let standstill = Standstill::new(&tap);
        let samples = HashMap::new();
        Ok(Self { _tap: tap, health, finish, samples, sampled: None, summary: None, standstill })
    }

    /// Takes in what came since the last look.
    pub(crate) fn update(&mut self, supervisor: &Supervisor) {
        for (reader, health) in self.health.values_mut() {
            if let Some(newest) = reader.newest::<Health>() {
                *health = newest;
            }
        }
        if let Some(summary) = self.finish.as_mut().and_then(TapReader::newest::<RunSummary>) {
            self.summary = Some(summary);
        }
        let now = clock::monotonic();
        if self.sampled.is_none_or(|last| now.since(last) >= SAMPLE_PERIOD) {
            self.sample(supervisor, now);
        }
    }

    /// What keeps the wheels from turning, when it lasts or is over: an event, and whether it is trouble.
    pub(crate) fn standstill(&mut self, now: Time) -> Option<(String, bool)> {
        self.standstill.look(now)
    }

    /// The referee's last word.
    pub(crate) fn summary(&self) -> Option<&RunSummary> {
        self.summary.as_ref()
    }

    fn sample(&mut self, supervisor: &Supervisor, now: Time) {
        let passed_s = self.sampled.map_or(0.0, |last| now.seconds_since(last));
        self.sampled = Some(now);
        for service in &supervisor.services {
            let (Some(pid), Some(slot)) = (service.pid(), service.slot()) else { continue };
            let Some(slot) = supervisor.host.switchboard().slot(slot) else { continue };
            let steps = slot.steps.load(Ordering::Relaxed);
            let cpu_s = cpu_seconds(pid);
            let sample = self.samples.entry(service.service.role.clone()).or_default();
            if sample.pid == pid && passed_s > 0.0 {
                sample.rate_hz = steps.saturating_sub(sample.steps) as f64 / passed_s;
                sample.cpu_percent = (cpu_s - sample.cpu_s).max(0.0) / passed_s * 100.0;
            }
            (sample.pid, sample.steps, sample.cpu_s) = (pid, steps, cpu_s);
            sample.memory_kib = own_memory_kib(pid);
        }
    }

    /// How everything stands.
    pub(crate) fn status(
        &self,
        supervisor: &Supervisor,
        graph: &Checked,
        recording: Option<&Recording>,
        tempo: Option<Tempo>,
    ) -> Status {
        let services = supervisor.services.iter().map(|service| {
            let role = &service.service.role;
            let health = self.health.get(role).map(|(_, health)| *health).unwrap_or_default();
            let sample = self.samples.get(role).copied().unwrap_or_default();
            ServiceStatus {
                role: role.clone(),
                run: service.service.run.clone(),
                state: control::phase_name(service.phase).to_owned(),
                pid: service.pid(),
                restarts: service.restarts,
                rate_hz: sample.rate_hz,
                cpu_percent: sample.cpu_percent,
                memory_kib: sample.memory_kib,
                step_p50_us: health.step_p50_ns as f64 / 1e3,
                step_p99_us: health.step_p99_ns as f64 / 1e3,
                step_max_us: health.step_max_ns as f64 / 1e3,
                late_steps: health.late_steps,
                lost_messages: health.lost_messages,
                invalid_messages: health.invalid_messages,
                swap: service.swap_state().cloned(),
            }
        });
        let is_lockstep = supervisor.host.is_lockstep();
        Status {
            board: supervisor.host.place().name().to_owned(),
            graph: std::path::absolute(&graph.file)
                .unwrap_or_else(|_| graph.file.clone())
                .display()
                .to_string(),
            launcher_pid: std::process::id(),
            uptime_s: clock::monotonic().seconds_since(supervisor.began),
            overrides: supervisor.overrides.clone(),
            logs: supervisor.logs().path().display().to_string(),
            mode: if is_lockstep { "lockstep" } else { "live" }.to_owned(),
            folder: graph.folder.display().to_string(),
            view: graph.view.clone(),
            recording: recording.map(|recording| recording.file().display().to_string()),
            tempo,
            logical_s: is_lockstep.then(|| board::tap::now(supervisor.host.switchboard()).as_secs_f64()),
            services: services.collect(),
            events: supervisor.events.iter().map(Into::into).collect(),
        }
    }
}

fn cpu_seconds(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The second field may hold spaces; times are the 14th and 15th, in ticks of 10 ms.
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |index: usize| fields.get(index).and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

fn own_memory_kib(pid: u32) -> u64 {
    let statm = std::fs::read_to_string(format!("/proc/{pid}/statm")).unwrap_or_default();
    let pages: Vec<u64> = statm.split_whitespace().filter_map(|field| field.parse().ok()).collect();
    let (resident, shared) = (pages.get(1).copied().unwrap_or(0), pages.get(2).copied().unwrap_or(0));
    resident.saturating_sub(shared) * 4
}
