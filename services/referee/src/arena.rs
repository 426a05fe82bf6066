//! What the way to a target in an arena is judged by: the columns of Table I, and what stands behind them
//! (NXT-102 to NXT-104).

use crate::{Inputs, Params, Ruling, shortest_m};
use geometry::{Point2, Polygon, Pose2, World, angle};
use messages::{
    JourneyStageName, JourneyStatus, LocationStateName, RunState, RunSummary, Stamped, Surroundings, Time,
    WorldTruth,
};

/// A heading that is said to be certain is wrong when it is farther off than this.
const WRONG_HEADING_RAD: f64 = 0.26;

/// A run so far.
#[derive(Debug, Clone)]
pub(crate) struct ArenaRun {
    surroundings: Surroundings,
    outline: Option<Polygon>,
    footprint: Option<Polygon>,
    began: Option<(Time, Point2<f64>)>,
    now_s: f64,
    pose: Option<Pose2>,
    first_contacts: Option<u64>,
    contacts: u64,
    least_room_m: f64,
    path_m: f64,
    localising_m: f64,
    target: Option<Point2<f64>>,
    shortest_m: f64,
    journey: JourneyStatus,
    /// Certain poses so far, wrong ones among them, and whether the first was right.
    judged: u64,
    wrong: u64,
    first_right: Option<(bool, u64)>,
    deadline_misses: u64,
}

impl ArenaRun {
    pub(crate) fn new(params: &Params, world: &World) -> Self {
        Self {
            surroundings: Surroundings::new(world),
            outline: world.floors.first().and_then(geometry::world::Floor::outline_polygon),
            footprint: Polygon::rectangle(params.body_length_m, params.body_width_m).ok(),
            began: None,
            now_s: 0.0,
            pose: None,
            first_contacts: None,
            contacts: 0,
            least_room_m: f64::INFINITY,
            path_m: 0.0,
            localising_m: 0.0,
            target: None,
            shortest_m: f64::NAN,
            journey: JourneyStatus::default(),
            judged: 0,
            wrong: 0,
            first_right: None,
            deadline_misses: 0,
        }
    }

    pub(crate) fn look(&mut self, params: &Params, now: Time, inputs: &Inputs<'_>) -> Ruling {
        if let Some(applied) = inputs.applied {
            self.deadline_misses = self.deadline_misses.max(applied.deadline_misses);
        }
        if let Some(truth) = inputs.truth {
            self.look_at_truth(params, now, truth);
        }
        if let Some(journey) = inputs.journey {
            self.look_at_journey(params, journey.message, inputs);
        }
        self.rule(params)
    }

    fn look_at_truth(&mut self, params: &Params, now: Time, truth: Stamped<'_, WorldTruth>) {
        let first = *self.first_contacts.get_or_insert(truth.contacts);
        self.contacts = self.contacts.max(truth.contacts.saturating_sub(first));
        let pose = Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        if !pose.is_finite() {
            return;
        }
        let (began, _) = *self.began.get_or_insert((now, pose.position()));
        self.now_s = now.seconds_since(began);
        if let Some(last) = self.pose.replace(pose) {
            let step_m = last.distance_m(pose);
            self.path_m += step_m;
            if self.journey.only_localising == 1 {
                self.localising_m += step_m;
            }
        }
        self.surroundings.show(truth.message, truth.elements);
        if let (Some(scene), Some(footprint)) = (self.surroundings.scene(truth.floor), &self.footprint) {
            let room_m = scene.clearance_m(footprint, pose, [0.0, params.body_height_m], None);
            self.least_room_m = self.least_room_m.min(room_m);
        }
    }

    fn look_at_journey(&mut self, params: &Params, journey: &JourneyStatus, inputs: &Inputs<'_>) {
        let target = Point2::new(journey.target_x_m, journey.target_y_m);
        if self.target.is_none() && target.x.is_finite() && target.y.is_finite() {
            self.target = Some(target);
            if let (Some((_, start)), Some(outline)) = (self.began, &self.outline) {
                self.shortest_m = shortest_m(outline, params.offset_m, start, target).unwrap_or(f64::NAN);
            }
        }
        // Each time that the robot says it knows its place, it is looked up.
        let is_news = journey.located > self.journey.located;
        self.journey = *journey;
        let certain = inputs.location.filter(|location| location.state == LocationStateName::Tracking);
        if let (true, Some(truth), Some(location)) = (is_news, self.pose, certain) {
            let place = Point2::new(location.x_m, location.y_m);
            let turn_rad = angle::difference(location.heading_rad, truth.heading_rad);
            let right = (place - truth.position()).norm() <= params.wrong_pose_m
                && turn_rad.abs() <= WRONG_HEADING_RAD;
            self.judged += 1;
            self.wrong += u64::from(!right);
            self.first_right.get_or_insert((right, journey.ambiguous + 1));
        }
    }

    fn error_m(&self) -> f64 {
        match (self.pose, self.target) {
            (Some(pose), Some(target)) => (pose.position() - target).norm(),
            _ => f64::NAN,
        }
    }

    fn rule(&self, params: &Params) -> Ruling {
        let error_m = self.error_m();
        let stage = self.journey.stage.get().unwrap_or(JourneyStageName::Waiting);
        let remark = self.journey.remark;
        if self.contacts > 0 {
            let at = self
                .pose
                .map_or(String::new(), |pose| format!(", at x {:.2} m, y {:.2} m", pose.x_m, pose.y_m));
            return (RunState::Failed, format!("touched a wall after {:.1} s{at} ({stage:?})", self.now_s));
        }
        match stage {
            JourneyStageName::Arrived if error_m <= params.max_target_error_m => {
                (RunState::Passed, format!("{:.1} cm from the target", 100.0 * error_m))
            }
            JourneyStageName::Arrived => {
                (RunState::Failed, format!("it believes to be there, {:.1} cm off", 100.0 * error_m))
            }
            JourneyStageName::Failed => (RunState::Failed, format!("gave up: {remark}")),
            _ if params.time_limit_s > 0.0 && self.now_s > params.time_limit_s => {
                (RunState::Failed, format!("not there after {:.0} s, {stage:?}", params.time_limit_s))
            }
            _ => (RunState::Running, format!("{stage:?}, {:.2} m from the target", error_m)),
        }
    }

    pub(crate) fn write(&self, summary: &mut RunSummary) {
        summary.push("completion time", self.now_s, "s");
        summary.push("distance from target", 100.0 * self.error_m(), "cm");
        summary.push("path length", 100.0 * self.path_m, "cm");
        summary.push("contacts", self.contacts as f64, "");
        summary.push("path without localising", 100.0 * (self.path_m - self.localising_m), "cm");
        summary.push("shortest path", 100.0 * self.shortest_m, "cm");
        summary.push("least clearance", 100.0 * self.least_room_m, "cm");
        summary.push("scans", self.journey.scans as f64, "");
        let (right, scans) = self
            .first_right
            .map_or((f64::NAN, f64::NAN), |(right, scans)| (f64::from(u8::from(right)), scans as f64));
        summary.push("first location right", right, "");
        summary.push("scans until the first location", scans, "");
        summary.push("ambiguous scans", self.journey.ambiguous as f64, "");
        summary.push("wrong locations", self.wrong as f64, "");
        summary.push("retreats", self.journey.retreats as f64, "");
        summary.push("paths planned", self.journey.plans as f64, "");
        summary.push("rounds", f64::from(self.journey.rounds), "");
        summary.push("missed deadlines", self.deadline_misses as f64, "");
    }
}
