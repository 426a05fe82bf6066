//! The robot as chaos sees it: whom to hit, what the wheels are told, and who is back.

use super::plan::{Deed, Kind, any};
use super::witness::{Link, Stopping, Witness, Wound};
use crate::graph::{Checked, CheckedService, CheckedTopic};
use crate::supervise::{Phase, Supervisor};
use board::JoinError;
use board::tap::{Tap, TapPublisher, TapReader};
use geometry::World;
use messages::{AppliedWheels, Message as _, MissionStatus, Order, Time, TrueBody, View, WorldTruth};
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use rustix::process::{Pid, Signal, kill_process};
use std::sync::atomic::Ordering;
use std::time::Duration;

const WHEELS: &str = "wheels/applied";
const GUARD: &str = "safety/clearance";
/// The longest period of a driver that the promise knows.
const PERIOD_MAX: Duration = Duration::from_millis(20);
const ORDERS: &str = "mission/orders";
/// A successor that has not spoken by then does not count as healed.
const UNHEALED: Duration = Duration::from_secs(10);
/// Messages may still be on their way when a deadline is over.
const SETTLED: Duration = Duration::from_millis(150);

/// What became of a wound.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub(super) wound: Wound,
    /// What the wheels did.
    pub(super) stopping: Stopping,
}

#[derive(Debug)]
struct Victim {
    role: String,
    link: Link,
    topics: Vec<TapReader>,
}

/// The robot under test.
pub(super) struct Scene {
    victims: Vec<Victim>,
    witness: Witness,
    /// Messages that were lost before they could be judged, so far.
    lost: u64,
    wounds: Vec<Wound>,
    wheels: Option<TapReader>,
    truth: Option<TapReader>,
    mission: Option<TapReader>,
    orders: Option<TapPublisher>,
    rooms: Vec<(i32, String)>,
    rng: Pcg64,
    last_order: Option<Time>,
    status: Option<MissionStatus>,
    way_m: f64,
    world: Option<WorldTruth>,
    first_contacts: Option<u64>,
    /// Where the robot was when it touched something.
    contacts_at: Vec<String>,
    tap: Tap,
}

impl Scene {
    /// Looks at the graph: everybody may be hit but those who are spared, and those who are no part of the robot: its simulator and its referee.
    pub(super) fn new(graph: &Checked, spare: &[String], mut tap: Tap, seed: u64) -> Result<Self, String> {
        let of = |topic: &str| {
            let topic = graph.topics.iter().find(|known| known.name == topic);
            topic.and_then(|topic| topic.publisher.role())
        };
        if let Some(unknown) =
            spare.iter().find(|role| !graph.services.iter().any(|known| known.role == **role))
        {
            return Err(format!("--spare {unknown}: there is no such service"));
        }
        let outside = [of(&graph.view.truth), graph.finish.as_deref().and_then(of)];
        let spared = |role: &str| outside.contains(&Some(role)) || spare.iter().any(|spared| spared == role);
        let driver = of(WHEELS);
        // Whose words a service cannot do without.
        let needs = |reader: Option<&str>, role: &str| {
            let required = |topic: &&CheckedTopic| {
                topic.readers.iter().any(|known| Some(known.role.as_str()) == reader && known.required)
            };
            reader.is_some()
                && graph.topics.iter().filter(required).any(|topic| topic.publisher.role() == Some(role))
        };
        let guard = of(GUARD);
        let link = |role: &str| match role {
            role if Some(role) == driver => Link::Driver,
            role if needs(driver, role) => Link::Word,
            role if needs(guard, role) => Link::Readings,
            _ => Link::None,
        };
        let mut victims = Vec::new();
        for service in graph.services.iter().filter(|service| !spared(&service.role)) {
            let published =
                graph.topics.iter().filter(|topic| topic.publisher.role() == Some(service.role.as_str()));
            let topics: Result<Vec<TapReader>, JoinError> =
                published.map(|topic| tap.reader(&topic.name)).collect();
            victims.push(Victim {
                role: service.role.clone(),
                link: link(&service.role),
                topics: topics.map_err(|error| error.to_string())?,
            });
        }
        if victims.is_empty() {
            return Err("nobody is left to be hit".to_owned());
        }
        let world = graph.view.world.as_ref().and_then(|world| World::load(graph.folder.join(world)).ok());
        let rooms =
            world.iter().flat_map(|world| &world.doors).map(|door| (door.floor, door.room.clone())).collect();
        // A topic of another type is none of these.
        let reader = |topic: &str, name: &str| {
            let (_, found) = tap.manifest().topic(topic)?;
            (found.message.name == name).then(|| tap.reader(topic).ok())?
        };
        let wheels = reader(WHEELS, AppliedWheels::NAME);
        let truth = reader(&graph.view.truth, WorldTruth::NAME);
        let mission = reader(&graph.view.mission, MissionStatus::NAME);
        let orders = tap.publisher(ORDERS).ok();
        Ok(Self {
            victims,
            witness: Witness::new(period_of(
                graph.services.iter().find(|service| Some(service.role.as_str()) == driver),
            )),
            lost: 0,
            wounds: Vec::new(),
            wheels,
            truth,
            mission,
            orders,
            rooms,
            rng: Pcg64::seed_from_u64(seed),
            last_order: None,
            status: None,
            way_m: 0.0,
            world: None,
            first_contacts: None,
            contacts_at: Vec::new(),
            tap,
        })
    }

    /// How many may be hit.
    pub(super) fn victims(&self) -> usize {
        self.victims.len()
    }

    /// The victim of a wound that was to show that the wheels stop, and has shown nothing.
    pub(super) fn shown_nothing(&self, verdict: &Verdict) -> Option<usize> {
        let nothing = matches!(verdict.stopping, Stopping::Stood | Stopping::HealedFirst | Stopping::Unknown);
        let role = Some(&verdict.wound.role).filter(|_| verdict.wound.is_proof && nothing)?;
        self.victims.iter().position(|victim| victim.role == *role)
    }

    /// Those on whom the wheels depend.
    pub(super) fn chain(&self) -> Vec<usize> {
        let victims = self.victims.iter().enumerate();
        victims.filter(|(_, victim)| victim.link != Link::None).map(|(index, _)| index).collect()
    }

    /// Their names.
    pub(super) fn chain_roles(&self) -> Vec<String> {
        self.chain().into_iter().map(|index| self.victims[index].role.clone()).collect()
    }

    /// Whether the wheels turn, so that a wound would prove something.
    pub(super) fn drives(&self, now: Time) -> bool {
        self.witness.drives(now)
    }

    /// Their names.
    pub(super) fn victim_roles(&self) -> Vec<String> {
        self.victims.iter().map(|victim| victim.role.clone()).collect()
    }

    /// Does the deed; false while the victim has no process.
    pub(super) fn hit(&mut self, supervisor: &mut Supervisor, deed: &Deed, now: Time) -> bool {
        let Some(victim) = self.victims.get(deed.victim) else { return false };
        let role = victim.role.clone();
        let Some(service) = supervisor.services.iter().find(|service| service.service.role == role) else {
            return false;
        };
        let (Some(pid), Some(slot)) = (service.pid(), service.slot()) else { return false };
        // Who starts can be killed; to hang or to leave it must have begun.
        if deed.kind != Kind::Kill && service.phase != Phase::Running {
            return false;
        }
        let generation = supervisor
            .host
            .switchboard()
            .slot(slot)
            .map_or(0, |slot| slot.generation.load(Ordering::Acquire));
        let send = |signal| {
            if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
                let _ = kill_process(pid, signal);
            }
        };
        match deed.kind {
            Kind::Kill => send(Signal::KILL),
            Kind::Hang => send(Signal::STOP),
            Kind::Restart => _ = supervisor.restart(&role),
        }
        let mut alone = true;
        for open in self.wounds.iter_mut().filter(|wound| wound.healed.is_none()) {
            if open.role == role {
                open.overtaken.get_or_insert(now);
            }
            open.alone &= open.role == role;
            alone &= open.role == role;
        }
        self.wounds.push(Wound {
            kind: deed.kind,
            in_start_up: deed.in_start_up,
            is_proof: deed.while_driving,
            at: now,
            generation,
            link: victim.link,
            died: (deed.kind == Kind::Kill).then_some(now),
            healed: None,
            spoke: None,
            alone,
            stepped: None,
            overtaken: None,
            role,
        });
        true
    }

    /// Takes in what was said since the last look.
    pub(super) fn look(&mut self, supervisor: &Supervisor, now: Time) {
        for victim in &mut self.victims {
            for reader in &mut victim.topics {
                while let Some((envelope, _)) = reader.next() {
                    let stamp = Time::from_nanos(envelope.stamp_ns);
                    let newer = |wound: &&mut Wound| {
                        wound.role == victim.role && envelope.generation > wound.generation
                    };
                    for wound in self.wounds.iter_mut().filter(newer) {
                        wound.spoke.get_or_insert(stamp);
                    }
                }
            }
        }
        for wound in &mut self.wounds {
            let Some(service) = supervisor.services.iter().find(|service| service.service.role == wound.role)
            else {
                continue;
            };
            let slot = service.slot().and_then(|slot| supervisor.host.switchboard().slot(slot));
            let successor = slot.filter(|slot| slot.generation.load(Ordering::Acquire) > wound.generation);
            if successor.is_some() || slot.is_none() {
                wound.died.get_or_insert(now);
            }
            let steps = successor.map_or(0, |slot| slot.steps.load(Ordering::Relaxed));
            if steps > 0 {
                wound.healed.get_or_insert(now);
            }
            if steps >= 3 {
                wound.stepped.get_or_insert(now);
            }
        }
        while let Some((envelope, bytes)) = self.wheels.as_mut().and_then(TapReader::next) {
            if let Ok(view) = View::<AppliedWheels>::parse(bytes) {
                let stamp = Time::from_nanos(envelope.stamp_ns);
                self.witness.told(stamp, view.message.left_mps, view.message.right_mps);
            }
        }
        while let Some((envelope, bytes)) = self.truth.as_mut().and_then(TapReader::next) {
            if let Ok(view) = View::<WorldTruth>::parse(bytes) {
                let stamp = Time::from_nanos(envelope.stamp_ns);
                let WorldTruth { world_time_s, left_travel_m, right_travel_m, .. } = *view.message;
                self.witness.rims(stamp, world_time_s, left_travel_m, right_travel_m);
                self.first_contacts.get_or_insert(view.message.contacts);
                if self.world.is_some_and(|last| last.contacts < view.message.contacts) {
                    self.contacts_at.push(contact(view.message, view.elements, &self.wounds, now));
                }
                let step_m = self
                    .world
                    .map_or(0.0, |last| (view.message.x_m - last.x_m).hypot(view.message.y_m - last.y_m));
                // What cannot be is no way: a message of another world.
                self.way_m += if step_m < 0.5 { step_m } else { 0.0 };
                self.world = Some(*view.message);
            }
        }
        let lost = self.wheels.as_ref().map_or(0, TapReader::lost);
        if lost > self.lost {
            self.lost = lost;
            self.witness.gap(now);
        }
        while let Some((_, bytes)) = self.mission.as_mut().and_then(TapReader::next) {
            self.status = View::<MissionStatus>::parse(bytes).ok().map(|view| *view.message).or(self.status);
        }
    }

    /// Orders another coffee when none waits: a robot that stands still proves nothing.
    pub(super) fn keep_it_busy(&mut self, now: Time) {
        // A reader that has joined anew gets the last message from whoever published it.
        self.tap.wait(self.tap.bell().wrapping_sub(1), Duration::ZERO);
        let (Some(orders), Some(status), Some(world)) = (&self.orders, &self.status, &self.world) else {
            return;
        };
        if status.waiting > 0 || self.last_order.is_some_and(|last| now.since(last) < Duration::from_secs(2))
        {
            return;
        }
        let here: Vec<&String> =
            self.rooms.iter().filter(|(floor, _)| *floor == world.floor).map(|(_, room)| room).collect();
        let Some(room) = any(&mut self.rng, &here) else { return };
        let order = serde_json::json!({ "room": room });
        if let Ok(bytes) = Order::description().from_json(&order) {
            let _ = orders.publish(&bytes);
            self.last_order = Some(now);
        }
    }

    /// The wounds about which all is known.
    pub(super) fn close_wounds(&mut self, now: Time) -> Vec<Verdict> {
        let settled = |wound: &Wound| {
            let judged = now > self.witness.judged_at(wound).after(SETTLED);
            judged && wound.healed.is_some() || now.since(wound.at) > UNHEALED
        };
        let (closed, open) = std::mem::take(&mut self.wounds).into_iter().partition(settled);
        self.wounds = open;
        let verdict = |wound: Wound| Verdict { stopping: self.witness.judge(&wound), wound };
        Vec::into_iter(closed).map(verdict).collect()
    }

    /// Whether something is still to be seen.
    pub(super) fn has_open_wounds(&self) -> bool {
        !self.wounds.is_empty()
    }

    /// Those who have not come back.
    pub(super) fn give_up(&mut self) -> Vec<String> {
        std::mem::take(&mut self.wounds).into_iter().map(|wound| wound.role).collect()
    }

    /// How often the robot has touched something.
    pub(super) fn contacts(&self) -> Option<u64> {
        Some(self.world?.contacts.saturating_sub(self.first_contacts?))
    }

    /// Where, and how.
    pub(super) fn contacts_at(&mut self) -> Vec<String> {
        std::mem::take(&mut self.contacts_at)
    }

    /// How far the robot went.
    pub(super) fn way_m(&self) -> Option<f64> {
        self.world.map(|_| self.way_m)
    }

    /// Coffees delivered.
    pub(super) fn deliveries(&self) -> Option<u64> {
        self.status.map(|status| status.delivered)
    }
}

/// A contact in words: where the robot was, how fast, what was nearest, and who was down lately.
fn contact(truth: &WorldTruth, bodies: &[TrueBody], wounds: &[Wound], now: Time) -> String {
    let distance_m = |body: &TrueBody| (body.x_m - truth.x_m).hypot(body.y_m - truth.y_m);
    let here = bodies.iter().filter(|body| body.floor == truth.floor);
    let nearest = here.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
    let nearest = nearest.map_or("nothing".to_owned(), |body| {
        let kind = body.kind.get().map_or("body".to_owned(), |kind| format!("{kind:?}"));
        format!("{kind} at {:.2} m ({:.2}, {:.2})", distance_m(body), body.x_m, body.y_m)
    });
    let down: Vec<String> = wounds
        .iter()
        .map(|wound| format!("{} {:.0} ms before", wound.role, now.seconds_since(wound.at) * 1e3))
        .collect();
    format!(
        "contact at ({:.2}, {:.2}), heading {:.2}, wheels {:.2} and {:.2} m/s, world time {:.2} s; nearest: {nearest}; hit: {}",
        truth.x_m,
        truth.y_m,
        truth.heading_rad,
        truth.left_mps,
        truth.right_mps,
        truth.world_time_s,
        down.join(", ")
    )
}

/// That of the base driver, as far as the promise goes.
fn period_of(driver: Option<&CheckedService>) -> Duration {
    let period = driver.and_then(|driver| driver.parameters.get("period_ms")?.as_u64());
    period.map_or(PERIOD_MAX, Duration::from_millis).min(PERIOD_MAX)
}
