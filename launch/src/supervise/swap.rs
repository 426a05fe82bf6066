//! One service for another while the robot runs: the newcomer starts beside the old one, mute; when it is ready the messages of the newcomer count, and
//! the old one leaves. A shadow stays mute: it publishes on topics beside those of the graph, where it can be compared.

use super::process::{Process, death};
use super::{Phase, START_LIMIT, Supervised, Supervisor, health_of};
use crate::graph::{CheckedService, CheckedTopic, Overrides};
use board::clock;
use board::host::{shadow_role, shadow_topic};
use board::manifest::Topic;
use board::switchboard::SlotState;
use messages::Time;
use rustix::process::Signal;
use serde::{Deserialize, Serialize};
use std::process::ExitStatus;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A newcomer that has steps to show but nothing to say is taken for ready after this time: a planner speaks when it is asked.
const SILENT_READY: Duration = Duration::from_millis(500);
/// For so long a newcomer may take to say something on each topic on which the old one speaks; then it gets the topic all the same.
const TAKE_OVER_LIMIT: Duration = Duration::from_millis(500);
/// A newcomer that dies so soon after it has taken over gives the role back.
const PROBATION: Duration = Duration::from_secs(10);
/// Who was silent on a topic for longer than this speaks seldom there; such a topic is not waited for.
const SPEAKS_WITHIN: Duration = Duration::from_millis(300);

/// Another service for a role, as the command has checked it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct SwapRequest {
    /// The newcomer, with its role.
    pub(crate) service: CheckedService,
    /// The topics of the graph with it.
    pub(crate) topics: Vec<CheckedTopic>,
    /// What differs from the graph's file once it has taken over.
    pub(crate) overrides: Overrides,
    /// It stays mute, and is compared.
    pub(crate) shadow: bool,
    /// It runs beside the old one for so long at least.
    pub(crate) warm_up: Duration,
}

/// How a swap stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SwapState {
    /// The newcomer warms up.
    WarmingUp {
        /// Its binary.
        run: String,
    },
    /// The newcomer is there for comparison.
    Shadow {
        /// Its binary.
        run: String,
        /// Whether it takes steps already.
        ready: bool,
    },
    /// The newcomer has taken over.
    Done {
        /// Its binary.
        run: String,
        /// From the request to the hand-over.
        took_ms: f64,
        /// From the last message of the old one to the first of the new one, the longest of its topics; `None` while it has said nothing.
        gap_ms: Option<f64>,
    },
    /// It came to nothing, and the old one goes on.
    Failed {
        /// Why.
        why: String,
    },
}

/// A process beside the one that plays the role.
#[derive(Debug)]
pub(crate) struct Newcomer {
    request: SwapRequest,
    process: Process,
    asked: Time,
    /// It goes back to a predecessor, which is not to be kept as another one.
    is_way_back: bool,
    /// Set when it may take over, topic by topic, each with its next message.
    taking_over: Option<TakingOver>,
}

#[derive(Debug)]
struct TakingOver {
    since: Time,
    topics: Vec<Taken>,
}

/// A topic on which the old one speaks often.
#[derive(Debug)]
struct Taken {
    topic: u32,
    /// The last message of the old one.
    last: Time,
    /// From that to the first message of the new one.
    gap_ms: Option<f64>,
}

/// What a role was before a swap.
#[derive(Debug)]
pub(crate) struct Predecessor {
    service: CheckedService,
    overrides: Overrides,
    /// When another one took its place.
    replaced: Time,
}

impl Supervised {
    /// The process beside it.
    pub(super) fn newcomer_process(&self) -> Option<&Process> {
        self.newcomer.as_ref().map(|newcomer| &newcomer.process)
    }

    /// Whether something is about to happen that is not announced by a descriptor.
    pub(super) fn awaits_newcomer(&self) -> bool {
        let swaps = |newcomer: &Newcomer| !newcomer.request.shadow || newcomer.process.ready.is_none();
        self.newcomer.as_ref().is_some_and(swaps)
    }

    /// How its last swap stands.
    pub(crate) fn swap_state(&self) -> Option<&SwapState> {
        self.swap.as_ref()
    }
}

impl Supervisor {
    /// Starts a newcomer beside the service whose role it is to play.
    ///
    /// # Errors
    /// When it cannot be: in words for the operator.
    pub(crate) fn swap(&mut self, request: SwapRequest) -> Result<(), String> {
        let role = request.service.role.clone();
        let index = self.index_of(&role)?;
        self.bring_in(index, request, false)
    }

    /// Ends the shadow or the newcomer of a role, or else brings back what played it before the last swap.
    ///
    /// # Errors
    /// When there is nothing to go back to.
    pub(crate) fn swap_back(&mut self, role: &str) -> Result<(), String> {
        let index = self.index_of(role)?;
        if self.services[index].newcomer.is_some() {
            self.note(role, "the newcomer is sent away", false);
            self.dismiss(index);
            self.services[index].swap = None;
            return Ok(());
        }
        let Some(predecessor) = self.services[index].predecessors.last() else {
            return Err(format!("`{role}` was not swapped; there is nothing to go back to"));
        };
        let request = SwapRequest {
            service: predecessor.service.clone(),
            topics: Vec::new(),
            overrides: predecessor.overrides.clone(),
            shadow: false,
            warm_up: Duration::ZERO,
        };
        self.bring_in(index, request, true)
    }

    fn index_of(&self, role: &str) -> Result<usize, String> {
        self.services.iter().position(|service| service.service.role == role).ok_or_else(|| {
            let known: Vec<&str> =
                self.services.iter().map(|service| service.service.role.as_str()).collect();
            format!("there is no service `{role}`; there are {}", known.join(", "))
        })
    }

    fn bring_in(&mut self, index: usize, request: SwapRequest, is_way_back: bool) -> Result<(), String> {
        let role = request.service.role.clone();
        let service = &self.services[index];
        if service.newcomer.is_some() {
            return Err(format!(
                "a newcomer for `{role}` is there already; `launch swap --back {role}` sends it away"
            ));
        }
        if self.host.is_lockstep() {
            return Err("in logical time nothing is swapped: begin the run with --swap".to_owned());
        }
        let runs = service.phase == Phase::Running;
        if request.shadow && !runs {
            return Err(format!("`{role}` does not run at present, so there is nothing to compare with"));
        }
        let run = request.service.run.clone();
        let topics = self.topics_for(&request);
        self.host.add_topics(topics).map_err(|error| format!("the board takes no more topics: {error}"))?;
        if !runs {
            self.replace(index, request, is_way_back);
            return Ok(());
        }
        let speaker = if request.shadow { shadow_role(&role) } else { role.clone() };
        let slot = self.host.prepare(&speaker, request.shadow).ok_or("the board has no place left")?;
        let log = self.log_file(&if request.shadow { speaker } else { role.clone() });
        let process = Process::spawn(self.surroundings(&log), &request.service, slot, request.shadow)
            .map_err(|error| format!("`{run}` cannot be started: {error}"))?;
        self.note(
            &role,
            format!("`{run}` starts beside it{}", if request.shadow { " as a shadow" } else { "" }),
            false,
        );
        let service = &mut self.services[index];
        service.swap = Some(if request.shadow {
            SwapState::Shadow { run, ready: false }
        } else {
            SwapState::WarmingUp { run }
        });
        service.newcomer =
            Some(Newcomer { request, process, asked: clock::monotonic(), is_way_back, taking_over: None });
        Ok(())
    }

    /// Puts a service in the place of one that does not run, and starts it.
    fn replace(&mut self, index: usize, request: SwapRequest, is_way_back: bool) {
        let now = clock::monotonic();
        let (role, run) = (request.service.role.clone(), request.service.run.clone());
        let overrides = std::mem::replace(&mut self.overrides, request.overrides);
        let service = &mut self.services[index];
        let former = std::mem::replace(&mut service.service, request.service);
        let text = format!("`{run}` takes the place of `{}`, which does not run", former.run);
        if is_way_back {
            service.predecessors.pop();
        } else {
            service.predecessors.push(Predecessor { service: former, overrides, replaced: now });
        }
        service.failures = 0;
        service.swap = Some(SwapState::Done { run, took_ms: 0.0, gap_ms: None });
        match &service.process {
            // One that is still starting, or hangs, makes way and is followed.
            Some(process) => process.ask_to_leave(),
            None => service.restart_at = Some(now),
        }
        service.phase = Phase::Waiting;
        self.note(&role, text, false);
    }

    /// Whether a service has taken a role over only just now.
    pub(super) fn is_on_probation(&self, index: usize, now: Time) -> bool {
        let last = self.services[index].predecessors.last();
        last.is_some_and(|predecessor| now.since(predecessor.replaced) < PROBATION)
    }

    /// A newcomer that cannot go on gives the role back to its predecessor; false when there is none.
    pub(super) fn give_back(&mut self, index: usize, how: &str, now: Time) -> bool {
        let Some(predecessor) = self.services[index].predecessors.pop() else { return false };
        let role = predecessor.service.role.clone();
        let back = predecessor.service.run.clone();
        self.overrides = predecessor.overrides;
        let service = &mut self.services[index];
        let failed = std::mem::replace(&mut service.service, predecessor.service);
        let why = format!("`{}` {how} after it had taken over; `{back}` has the role again", failed.run);
        service.swap = Some(SwapState::Failed { why: why.clone() });
        service.failures = 0;
        service.phase = Phase::Waiting;
        service.restart_at = Some(now);
        self.note(&role, why, true);
        true
    }

    /// Topics that the newcomer needs and the board does not have yet: its own, which nobody knew, and those of a shadow.
    fn topics_for(&self, request: &SwapRequest) -> Vec<Topic> {
        let role = &request.service.role;
        let missing = |name: &str| self.host.manifest().topic(name).is_none();
        let mut topics: Vec<Topic> =
            request.topics.iter().filter(|topic| missing(&topic.name)).map(super::topic_of).collect();
        if request.shadow {
            let publishes = |topic: &&CheckedTopic| topic.publisher.role() == Some(role.as_str());
            let beside = |topic: &CheckedTopic| Topic {
                name: shadow_topic(&topic.name),
                publisher: Some(shadow_role(role)),
                readers: Vec::new(),
                ..super::topic_of(topic)
            };
            topics.extend(request.topics.iter().filter(publishes).map(beside));
            topics.push(health_of(&shadow_role(role)));
            topics.retain(|topic| missing(&topic.name));
        }
        topics
    }

    /// Looks after the newcomer of a role: whether it is ready, or has died.
    pub(super) fn tend_newcomer(&mut self, index: usize, now: Time) {
        let Some(newcomer) = &mut self.services[index].newcomer else { return };
        if let Some(status) = newcomer.process.ended() {
            self.strays.expect();
            let why = format!("`{}` {}", newcomer.request.service.run, death(status));
            self.fail_newcomer(index, &why);
            self.clean();
            return;
        }
        let Some(slot) = self.host.switchboard().slot(newcomer.process.slot) else { return };
        let running = slot.state() == SlotState::Running && slot.steps.load(Ordering::Relaxed) >= 2;
        if !running {
            if now.since(newcomer.asked) > START_LIMIT {
                self.fail_newcomer(index, "the newcomer did not join the board");
            }
            return;
        }
        let ready = *newcomer.process.ready.get_or_insert(now);
        if newcomer.request.shadow {
            let run = newcomer.request.service.run.clone();
            self.services[index].swap = Some(SwapState::Shadow { run, ready: true });
            return;
        }
        if newcomer.taking_over.is_some() {
            self.watch_take_over(index, now);
            return;
        }
        let has_something_to_say = slot.muted.load(Ordering::Relaxed) > 0 || now.since(ready) > SILENT_READY;
        if has_something_to_say && now.since(newcomer.asked) >= newcomer.request.warm_up {
            slot.may_take_over.store(1, Ordering::Release);
            let role = newcomer.request.service.role.clone();
            let topics = self.spoken_topics(&role, now);
            if let Some(newcomer) = &mut self.services[index].newcomer {
                newcomer.taking_over = Some(TakingOver { since: now, topics });
            }
        }
    }

    /// The topics on which a role speaks often, with when it last did.
    fn spoken_topics(&self, role: &str, now: Time) -> Vec<Taken> {
        let health = messages::health_topic(role);
        let topics = self.host.manifest().topics.iter().zip(0_u32..);
        let taken = |topic: u32| {
            let entry = self.host.switchboard().topic(topic)?;
            let last = Time::from_nanos(entry.last_stamp_ns.load(Ordering::Relaxed));
            (now.since(last) < SPEAKS_WITHIN).then_some(Taken { topic, last, gap_ms: None })
        };
        topics
            .filter(|(topic, _)| topic.publisher.as_deref() == Some(role) && topic.name != health)
            .filter_map(|(_, index)| taken(index))
            .collect()
    }

    /// Sees which topics the newcomer has taken, and ends the swap when it has all of them.
    fn watch_take_over(&mut self, index: usize, now: Time) {
        let switchboard = self.host.switchboard();
        let Some(newcomer) = &mut self.services[index].newcomer else { return };
        let generation =
            switchboard.slot(newcomer.process.slot).map_or(0, |slot| slot.generation.load(Ordering::Acquire));
        let Some(taking) = &mut newcomer.taking_over else { return };
        for taken in taking.topics.iter_mut().filter(|taken| taken.gap_ms.is_none()) {
            let Some(entry) = switchboard.topic(taken.topic) else { continue };
            let is_taken = entry.generation.load(Ordering::Acquire) == generation;
            let stamp = Time::from_nanos(entry.last_stamp_ns.load(Ordering::Relaxed));
            if !is_taken {
                taken.last = stamp;
            } else if stamp > taken.last {
                taken.gap_ms = Some(stamp.seconds_since(taken.last) * 1e3);
            }
        }
        if taking.topics.iter().all(|taken| taken.gap_ms.is_some())
            || now.since(taking.since) > TAKE_OVER_LIMIT
        {
            self.finish_swap(index, now);
        }
    }

    /// The newcomer plays the role; the old one is asked to leave.
    fn finish_swap(&mut self, index: usize, now: Time) {
        let Some(newcomer) = self.services[index].newcomer.take() else { return };
        let role = newcomer.request.service.role.clone();
        let run = newcomer.request.service.run.clone();
        // The topics on which nothing was said meanwhile, and its health.
        self.host.hand_over(&role, newcomer.process.slot);
        let topics = newcomer.taking_over.map_or_else(Vec::new, |taking| taking.topics);
        let gap_ms = topics.iter().filter_map(|taken| taken.gap_ms).reduce(f64::max);
        let took_ms = now.seconds_since(newcomer.asked) * 1e3;
        let overrides = std::mem::replace(&mut self.overrides, newcomer.request.overrides);
        let service = &mut self.services[index];
        let old = service.process.replace(newcomer.process);
        let former = std::mem::replace(&mut service.service, newcomer.request.service);
        if newcomer.is_way_back {
            service.predecessors.pop();
        } else {
            let service_before = former.clone();
            service.predecessors.push(Predecessor { service: service_before, overrides, replaced: now });
        }
        service.phase = Phase::Running;
        service.pulse.begin_anew();
        service.said = None;
        service.failures = 0;
        service.swap = Some(SwapState::Done { run: run.clone(), took_ms, gap_ms });
        if let Some(old) = old {
            old.ask_to_leave();
            self.leaving.push((old, now.after(former.launch.stop_after)));
        }
        self.note(
            &role,
            format!("`{run}` has taken over from `{}` after {took_ms:.0} ms", former.run),
            false,
        );
    }

    /// When the one that plays the role dies while its successor stands by, the successor takes over at once; one that is not ready yet is sent away. Whether somebody
    /// plays the role now.
    pub(super) fn stands_in(&mut self, index: usize, status: ExitStatus, now: Time) -> bool {
        let Some(newcomer) = &self.services[index].newcomer else { return false };
        if newcomer.request.shadow {
            return false;
        }
        let role = newcomer.request.service.role.clone();
        if newcomer.process.ready.is_some() {
            self.note(&role, format!("{}; the newcomer stands by", death(status)), true);
            self.finish_swap(index, now);
            self.clean();
            return true;
        }
        // Its generation is older than that of a successor started now.
        self.fail_newcomer(index, &format!("`{role}` {} while the newcomer warmed up", death(status)));
        false
    }

    fn fail_newcomer(&mut self, index: usize, why: &str) {
        self.dismiss(index);
        let service = &mut self.services[index];
        service.swap = Some(SwapState::Failed { why: why.to_owned() });
        let role = service.service.role.clone();
        self.note(&role, format!("no swap: {why}"), true);
    }

    /// Ends the newcomer of a role.
    pub(super) fn dismiss(&mut self, index: usize) {
        let Some(newcomer) = self.services[index].newcomer.take() else { return };
        newcomer.process.ask_to_leave();
        let limit = newcomer.request.service.launch.stop_after;
        self.leaving.push((newcomer.process, clock::monotonic().after(limit)));
    }

    /// Looks after those who leave.
    pub(super) fn see_off(&mut self, now: Time) {
        let mut gone = Vec::new();
        for (index, (process, limit)) in self.leaving.iter_mut().enumerate() {
            if process.ended().is_some() {
                gone.push(index);
            } else if now > *limit {
                process.signal(Signal::KILL);
            }
        }
        for index in gone.into_iter().rev() {
            let (process, _) = self.leaving.swap_remove(index);
            self.strays.expect();
            self.host.switchboard().release(process.slot);
            self.clean();
        }
    }
}
