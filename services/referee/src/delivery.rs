//! What a delivery is judged by.

use crate::{Inputs, Params, errors::Comparison};
use geometry::{Point2, Polygon, Pose2, Surface, World};
use messages::{
    AppliedWheels, Clearance, DeliveryStatusName, MissionStatus, RoomName, RunState, RunSummary, Stamped,
    Surroundings, Time, WorldTruth,
};

/// Wheels slower than this stand.
const STANDS_MPS: f64 = 0.02;
/// A robot at a door stands no farther from its wall than the hallway is wide.
const ACROSS_M: f64 = 1.7;

/// A run so far.
#[derive(Debug, Clone)]
pub(crate) struct Delivery {
    world: World,
    surroundings: Surroundings,
    footprint: Option<Polygon>,
    began: Option<Time>,
    now_s: f64,
    first_contacts: Option<u64>,
    contacts: u64,
    nearest: Option<Nearness>,
    touched: Option<Nearness>,
    last_place: Option<(Point2<f64>, i32)>,
    path_m: f64,
    guard_changes: (u64, u64),
    deadline_misses: u64,
    delivered: u64,
    /// An order is under way, or waits.
    is_busy: bool,
    standing: Option<Halt>,
    halts: Vec<Halt>,
    fault_since: Option<Time>,
    fault: String,
    pub(crate) comparison: Comparison,
}

/// The robot stands at a door.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Halt {
    order_id: u64,
    room: RoomName,
    error_m: f64,
}

/// How near the robot was to what, and where it stood then.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Nearness {
    distance_m: f64,
    surface: Surface,
    pose: Pose2,
    at_s: f64,
}

/// How a run stands, and why.
pub(crate) type Ruling = (RunState, String);

impl Delivery {
    pub(crate) fn new(params: &Params, world: World) -> Self {
        Self {
            surroundings: Surroundings::new(&world),
            world,
            footprint: Polygon::rectangle(params.body_length_m, params.body_width_m).ok(),
            began: None,
            now_s: 0.0,
            first_contacts: None,
            contacts: 0,
            nearest: None,
            touched: None,
            last_place: None,
            path_m: 0.0,
            guard_changes: (0, 0),
            deadline_misses: 0,
            delivered: 0,
            is_busy: false,
            standing: None,
            halts: Vec::new(),
            fault_since: None,
            fault: String::new(),
            comparison: Comparison::new(params.between_truths),
        }
    }

    pub(crate) fn look(&mut self, params: &Params, now: Time, inputs: &Inputs<'_>) -> Ruling {
        if let Some(truth) = inputs.truth {
            let began = *self.began.get_or_insert(now);
            self.now_s = now.seconds_since(began);
            self.look_at_truth(params, truth);
        }
        if let Some(location) = inputs.location {
            self.comparison.pose(location);
        }
        self.comparison.settle(false);
        if let Some(clearance) = inputs.clearance {
            self.count_stops(clearance.message);
        }
        if let Some(applied) = inputs.applied {
            let AppliedWheels { deadline_misses, .. } = *applied.message;
            self.deadline_misses = self.deadline_misses.max(deadline_misses);
        }
        if let (Some(mission), Some(truth)) = (inputs.mission, inputs.truth) {
            self.look_at_mission(now, mission.message, truth.message);
        }
        self.rule(params, now)
    }

    fn look_at_truth(&mut self, params: &Params, truth: Stamped<'_, WorldTruth>) {
        // A simulator that begins anew counts from zero again.
        let first = self.first_contacts.get_or_insert(truth.contacts);
        *first = (*first).min(truth.contacts);
        self.contacts = self.contacts.max(truth.contacts - *first);
        let pose = Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        if !pose.is_finite() {
            return;
        }
        let place = pose.position();
        self.comparison.truth(truth.stamp, pose, truth.floor);
        if let Some((last, floor)) = self.last_place.replace((place, truth.floor))
            && floor == truth.floor
        {
            self.path_m += (place - last).norm();
        }
        self.surroundings.show(truth.message, truth.elements);
        if let (Some(scene), Some(footprint)) = (self.surroundings.scene(truth.floor), &self.footprint) {
            let nearest = scene.clearance(footprint, pose, [0.0, params.body_height_m], None);
            let now = nearest.map(|nearest| Nearness {
                distance_m: nearest.distance_m,
                surface: nearest.surface,
                pose,
                at_s: self.now_s,
            });
            if let Some(now) = now
                && self.nearest.is_none_or(|least| now.distance_m < least.distance_m)
            {
                self.nearest = Some(now);
            }
            if self.contacts > 0 && self.touched.is_none() {
                self.touched = now;
            }
        }
    }

    /// The guard begins with a stop, so every second change of its signal is another one. A guard that was
    /// restarted counts anew.
    fn count_stops(&mut self, clearance: &Clearance) {
        let (total, last) = self.guard_changes;
        let more = clearance.changes.checked_sub(last).unwrap_or(clearance.changes);
        self.guard_changes = (total.saturating_add(more), clearance.changes);
    }

    fn look_at_mission(&mut self, now: Time, mission: &MissionStatus, truth: &WorldTruth) {
        let status = mission.status.get().unwrap_or(DeliveryStatusName::Fault);
        if status == DeliveryStatusName::Fault {
            if self.fault_since.is_none() {
                self.fault = mission.remark.to_string();
            }
            self.fault_since.get_or_insert(now);
        } else {
            self.fault_since = None;
        }
        let stands = truth.left_mps.abs() < STANDS_MPS && truth.right_mps.abs() < STANDS_MPS;
        if status == DeliveryStatusName::AtDoor && stands {
            // The last look before the coffee is taken counts.
            let error_m = self.halt_error_m(mission.room.as_str(), truth);
            self.standing = Some(Halt { order_id: mission.order_id, room: mission.room, error_m });
        }
        let under_way = mission.order_id != 0
            && !matches!(status, DeliveryStatusName::Delivered | DeliveryStatusName::Returning);
        self.is_busy = mission.waiting > 0 || under_way;
        if mission.delivered > self.delivered {
            self.delivered = mission.delivered;
            self.halts.extend(self.standing.take());
        }
    }

    /// Distance from the door's centre line along the wall; infinite when the robot is not at that door at
    /// all.
    fn halt_error_m(&self, room: &str, truth: &WorldTruth) -> f64 {
        let geometry = self.world.door(room).filter(|door| door.floor == truth.floor);
        let Some(geometry) = geometry.and_then(|door| self.world.door_geometry(door)) else {
            return f64::INFINITY;
        };
        let offset = Point2::new(truth.x_m, truth.y_m) - geometry.gap.midpoint();
        let across_m = -offset.dot(&geometry.into);
        let along_m = (offset + geometry.into * across_m).norm();
        if (0.0..=ACROSS_M).contains(&across_m) { along_m } else { f64::INFINITY }
    }

    fn rule(&self, params: &Params, now: Time) -> Ruling {
        if self.contacts > 0 {
            let what = self.touched.map_or("touched something".to_owned(), |touched| self.name(touched));
            return (RunState::Failed, what);
        }
        let faulty_s = self.fault_since.map_or(0.0, |since| now.seconds_since(since));
        if self.fault_since.is_some() && faulty_s >= params.fault_limit_s {
            return (
                RunState::Failed,
                format!("the mission reports a fault for {faulty_s:.0} s: {}", self.fault),
            );
        }
        if let Some(halt) =
            self.halts.iter().find(|halt| halt.error_m.is_nan() || halt.error_m > params.max_halt_error_m)
        {
            let (room, error_m) = (halt.room, halt.error_m);
            return (RunState::Failed, format!("halted {error_m:.2} m beside the door of {room}"));
        }
        if self.delivered > self.halts.len() as u64 {
            return (
                RunState::Failed,
                "a delivery is reported, but the robot did not stand at the door".to_owned(),
            );
        }
        // Whoever has ordered meanwhile gets a coffee too.
        if self.delivered >= params.deliveries.into() && !self.is_busy {
            let rooms: Vec<_> = self.halts.iter().map(|halt| halt.room.to_string()).collect();
            return (RunState::Passed, format!("delivered to {}", rooms.join(", ")));
        }
        if params.time_limit_s > 0.0 && self.now_s > params.time_limit_s {
            return (RunState::Failed, format!("not done after {:.0} s", params.time_limit_s));
        }
        let more = if self.is_busy && self.delivered >= params.deliveries.into() {
            ", and more are ordered"
        } else {
            ""
        };
        (RunState::Running, format!("{} of {} delivered{more}", self.delivered, params.deliveries))
    }

    /// What was touched, when, and where the robot was, in words.
    fn name(&self, nearness: Nearness) -> String {
        let Nearness { surface, pose, at_s, .. } = nearness;
        let what = match surface {
            Surface::Furniture(index) => match self.world.furniture.get(index as usize) {
                Some(item) => format!("a {}", in_words(&format!("{:?}", item.kind))),
                None => "a piece of furniture".to_owned(),
            },
            Surface::Door(index) => match self.world.doors.get(index as usize) {
                Some(door) => format!("the door of {}", door.room),
                None => "a door".to_owned(),
            },
            Surface::Wall(_) => "a wall".to_owned(),
            Surface::Floor => "the floor".to_owned(),
            Surface::Elevator(_) => "the door of an elevator".to_owned(),
            Surface::Walker(_) => "a person".to_owned(),
            Surface::Robot(_) => "a robot".to_owned(),
        };
        format!("touched {what} after {at_s:.1} s, at x {:.2} m, y {:.2} m", pose.x_m, pose.y_m)
    }

    pub(crate) fn write(&self, summary: &mut RunSummary) {
        let worst_halt_m = self.halts.iter().map(|halt| halt.error_m).reduce(f64::max).unwrap_or(f64::NAN);
        summary.push("deliveries", self.delivered as f64, "");
        summary.push("halt distance from door centre", worst_halt_m, "m");
        summary.push("contacts", self.contacts as f64, "");
        let least_clearance_m = self.nearest.map_or(f64::INFINITY, |nearest| nearest.distance_m);
        summary.push("least clearance", least_clearance_m, "m");
        summary.push("stops by the guard", (self.guard_changes.0 / 2) as f64, "");
        summary.push("missed deadlines", self.deadline_misses as f64, "");
        summary.push("path length", self.path_m, "m");
        summary.push("time", self.now_s, "s");
        summary.push("localisation error, mean", self.comparison.errors.mean_m(), "m");
        summary.push("localisation error, 95 %", self.comparison.errors.quantile_m(0.95), "m");
    }
}

/// `MailCart` as people write it.
fn in_words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}
