//! What comes next: the flow of Fig. 8 (NXT-095), one task after the other.

use crate::route::{Leg, Route, View, route};
use crate::{Belief, Executive, Inputs, resolve};
use geometry::{Point2, Pose2, angle};
use messages::{
    FixedText, JourneyStageName, MotionCommand, MotionKindName, MotionStateName, PlanRequest, PlanStateName,
    SonarCommand, SonarModeName, Time,
};
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

/// What the robot is about, and what it waits for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Task {
    /// For the sensors.
    Waiting,
    /// For the survey that answers the sensor's order.
    Surveying,
    /// For the end of a motion; more motions follow.
    Moving { stage: JourneyStageName, rest: VecDeque<Motion>, then: Then },
    /// For the survey that answers the sensor's order; the localiser had taken in so many scans before.
    Measuring { scans: u64 },
    /// For the localiser to take in the scan that was sent then.
    Locating { scans: u64, since: Time },
    /// For the path that answers the request.
    Planning,
    /// For nothing.
    Ended { arrived: bool },
}

/// One motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Motion {
    Turn(f64),
    Move(f64),
    /// Turns to a place of the map and drives there, as far as the certainty of the pose allows.
    Towards(Point2<f64>),
}

/// What follows motions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Then {
    /// A scan to localise by, with the first window there.
    Measure { window_rad: f64 },
    /// A new look around.
    Survey,
    /// The end of the path: a new look around, and it counts as an arrival.
    Arrive,
}

/// How a way to a place begins.
#[derive(Debug, Clone, Copy, PartialEq)]
enum NextLeg {
    /// With a leg that is not the last.
    First(Leg),
    /// It is the way to the place itself.
    Straight,
    /// It does not: there is no room.
    Nowhere,
}

/// What is counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Count {
    pub(crate) scans: u64,
    pub(crate) located: u64,
    pub(crate) ambiguous: u64,
    pub(crate) retreats: u64,
    pub(crate) plans: u64,
    pub(crate) places: u32,
    pub(crate) rounds: u32,
}

/// A turn to the wall that is smaller is not worth its own error.
const NO_TURN_RAD: f64 = 0.03;
/// A place is reached where the robot is no farther.
const REACHED_M: f64 = 0.004;
/// Ways to tell places apart are looked for along the belief's best place; they may be so wrong.
const STEP_M: f64 = 0.02;
/// So often in a row the robot looks again instead of driving a way that is not certain.
const MOST_LOOKS: u32 = 2;
/// A place that takes more motions to be looked at is given up, for another look around.
const MOST_DETOURS: u32 = 12;

impl Executive {
    /// Goes on to the next task if the present one is done. Returns whether it was.
    pub(crate) fn advance(&mut self, now: Time, inputs: &Inputs<'_>) -> bool {
        match std::mem::replace(&mut self.task, Task::Waiting) {
            Task::Waiting => {
                // The wheels are ready when the controller answers.
                if self.target.is_none() || inputs.report.is_none() {
                    return false;
                }
                self.survey(now);
                true
            }
            Task::Surveying => match self.answer(inputs) {
                Some(nearest) => self.align(now, nearest),
                None => self.keep(now, Task::Surveying),
            },
            Task::Moving { stage, rest, then } => self.go_on(now, inputs, stage, rest, then),
            Task::Measuring { scans } => match self.answer(inputs) {
                Some(_) => {
                    self.task = Task::Locating { scans, since: now };
                    true
                }
                None => self.keep(now, Task::Measuring { scans }),
            },
            Task::Locating { scans, since } => self.locate(now, scans, since),
            Task::Planning => self.take_path(now, inputs),
            Task::Ended { arrived } => {
                self.task = Task::Ended { arrived };
                false
            }
        }
    }

    /// Keeps waiting, but not for ever.
    fn keep(&mut self, now: Time, task: Task) -> bool {
        let since = *self.waits_since.get_or_insert(now);
        if now.seconds_since(since) <= self.params.patience_s {
            self.task = task;
            return false;
        }
        match task {
            Task::Planning => self.end(false, "the planner does not answer"),
            Task::Locating { .. } => self.end(false, "the localiser does not answer"),
            // An order may be lost with a service that was restarted: it is given again.
            _ => self.survey(now),
        }
    }

    pub(crate) fn end(&mut self, arrived: bool, why: &str) -> bool {
        self.remark = FixedText::truncated(why);
        self.only_localising = false;
        self.order(MotionKindName::Stop, 0.0);
        self.task = Task::Ended { arrived };
        true
    }

    /// What the survey that answers the newest order says.
    fn answer(&self, inputs: &Inputs<'_>) -> Option<Option<(f64, f64)>> {
        let survey = inputs.survey.filter(|survey| survey.command_id == self.sonar.command_id)?;
        Some(survey.nearest())
    }

    fn scan(&mut self, now: Time, measure: bool, window_rad: f64) {
        self.waits_since = Some(now);
        self.count.scans += 1;
        self.sonar = SonarCommand {
            command_id: self.next_id(),
            window_rad,
            mode: SonarModeName::Ultrascan.into(),
            measure: measure.into(),
        };
    }

    fn survey(&mut self, now: Time) -> bool {
        if self.count.scans >= self.params.max_scans.into() {
            return self.end(false, "too many scans");
        }
        self.scan(now, false, 0.0);
        self.task = Task::Surveying;
        true
    }

    /// Turns to the nearest wall, then measures (NXT-040). Where the body has no room for that turn, a
    /// smaller one brings another window in front of the wall; where there is none for that either, the
    /// windows are turned.
    fn align(&mut self, now: Time, nearest: Option<(f64, f64)>) -> bool {
        let Some((bearing_rad, range_m)) = nearest else { return self.measure(now, 0.0) };
        if !self.params.turn_to_wall || bearing_rad.abs() < NO_TURN_RAD {
            return self.measure(now, bearing_rad);
        }
        let mut turns: Vec<f64> = (0..4)
            .filter(|quarter| *quarter != 0 || range_m >= self.params.face_wall_from_m)
            .map(|quarter| angle::wrap(bearing_rad - f64::from(quarter) * FRAC_PI_2))
            .collect();
        // To the wall itself if possible, then the smallest.
        let faces_first = range_m >= self.params.face_wall_from_m;
        turns[usize::from(faces_first)..].sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        self.seen_at = self.belief.map_or(Pose2::IDENTITY, |belief| belief.pose);
        // A scan alone shows edges of walls farther away than they are: weak echoes are late.
        let margin_m = self.wanted_room_m();
        let views = self.views();
        let room_m = |view: &View<'_>, turn_rad: f64| view.arena.turning_room_m(view.pose, turn_rad);
        let has_room = |turn_rad: &f64| views.iter().all(|view| room_m(view, *turn_rad) >= margin_m);
        match turns.into_iter().find(has_room) {
            Some(turn_rad) => {
                let window_rad = angle::difference(bearing_rad, turn_rad);
                self.only_localising = true;
                self.task = Task::Moving {
                    stage: JourneyStageName::Aligning,
                    rest: VecDeque::from([Motion::Turn(turn_rad)]),
                    then: Then::Measure { window_rad },
                };
                self.begin(now)
            }
            None => self.measure(now, bearing_rad),
        }
    }

    fn measure(&mut self, now: Time, window_rad: f64) -> bool {
        let scans = self.belief.map_or(0, |belief| belief.scans);
        self.scan(now, true, window_rad);
        self.task = Task::Measuring { scans };
        true
    }

    /// Waits until the localiser has taken in the scan, then decides whether the place is known.
    fn locate(&mut self, now: Time, scans: u64, since: Time) -> bool {
        let is_new = self.belief.is_some_and(|belief| belief.scans > scans);
        // A cloud of that very moment may have been shown before the scan was weighed.
        let is_shown = self.cloud.last().is_some_and(|cloud| cloud.stamp > since);
        if !(is_new && is_shown) {
            return self.keep(now, Task::Locating { scans, since });
        }
        self.only_localising = false;
        self.detours = 0;
        self.seen_at = self.belief.map_or(Pose2::IDENTITY, |belief| belief.pose);
        self.placed_at = self.seen_at;
        if self.place().is_none() {
            self.count.ambiguous += 1;
            return self.resolve(now);
        }
        self.count.located += 1;
        if std::mem::take(&mut self.at_end) {
            self.count.rounds += 1;
        }
        if self.to_target_m() <= self.params.close_enough_m {
            return self.end(true, "");
        }
        if self.count.rounds >= self.params.max_rounds {
            return self.end(true, "as near as it gets");
        }
        self.plan(now)
    }

    /// Drives to where the places that look alike differ; towards open space if there is no such way.
    fn resolve(&mut self, now: Time) -> bool {
        self.at_end = false;
        let way = resolve::way(&self.arena, &self.places, &mut self.rng);
        let from = self.places.hypotheses.first().map(|place| place.pose);
        let mut rest: VecDeque<Motion> = VecDeque::new();
        if let (Some(from), false) = (from, way.is_empty()) {
            rest.extend(way.into_iter().map(|seen| Motion::Towards(from.transform(seen))));
        } else if let Some((turn_rad, way_m)) = self.open_space() {
            rest.extend([Motion::Turn(turn_rad), Motion::Move(way_m)]);
        }
        self.only_localising = true;
        self.task = Task::Moving { stage: JourneyStageName::Resolving, rest, then: Then::Survey };
        self.begin(now)
    }

    /// The direction in which the body can drive farthest, and how far it should.
    fn open_space(&self) -> Option<(f64, f64)> {
        let seen = self.seen.as_ref()?;
        let margin_m = self.params.turn_margin_m;
        let way_m = |turn_rad: f64| {
            let heading = Pose2::new(0.0, 0.0, turn_rad);
            let steps = (1..=5).map(|step| f64::from(step) * STEP_M / 0.1 * self.params.open_space_m);
            let free = steps.take_while(|way_m| seen.driving_room_m(heading, *way_m) >= margin_m);
            free.last().unwrap_or(0.0)
        };
        let turns = (0..24).map(|index| angle::wrap(f64::from(index) * std::f64::consts::TAU / 24.0));
        let turns = turns.filter(|turn_rad| seen.turning_room_m(Pose2::IDENTITY, *turn_rad) >= margin_m);
        let best = turns.map(|turn_rad| (turn_rad, way_m(turn_rad)));
        best.filter(|(_, way_m)| *way_m > 0.0).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn plan(&mut self, now: Time) -> bool {
        let Some(target) = self.target else { return self.end(false, "there is no target") };
        self.waits_since = Some(now);
        self.count.plans += 1;
        self.request = PlanRequest {
            request_id: self.next_id(),
            goal_x_m: target.x,
            goal_y_m: target.y,
            tolerance_m: self.params.goal_tolerance_m,
            floor: self.floor,
            reserved: 0,
        };
        self.task = Task::Planning;
        true
    }

    fn take_path(&mut self, now: Time, inputs: &Inputs<'_>) -> bool {
        let answer = inputs.path.filter(|path| path.request_id == self.request.request_id);
        let Some(path) = answer else { return self.keep(now, Task::Planning) };
        if path.state.get() != Ok(PlanStateName::Found) {
            return match path.state.get() {
                // The pose may be wrong: another look, from elsewhere.
                Ok(PlanStateName::Unreachable | PlanStateName::NoStart) if self.count.plans < 20 => {
                    self.count.ambiguous += 1;
                    self.resolve(now)
                }
                _ => self.end(false, "there is no path"),
            };
        }
        let is_finite = |place: &Point2<f64>| place.x.is_finite() && place.y.is_finite();
        let places = path.elements.iter().map(|waypoint| Point2::new(waypoint.x_m, waypoint.y_m));
        let mut rest: VecDeque<Motion> = places.filter(is_finite).skip(1).map(Motion::Towards).collect();
        // Whatever the planner rounds, the aim itself is meant.
        rest.pop_back();
        rest.push_back(Motion::Towards(self.aim(path.elements)));
        self.task = Task::Moving { stage: JourneyStageName::Driving, rest, then: Then::Arrive };
        self.begin(now)
    }

    /// Where the robot tries to arrive: at the target, or a little farther from the walls.
    fn aim(&self, path: &[messages::Waypoint]) -> Point2<f64> {
        let end = path.last().map_or(Point2::origin(), |end| Point2::new(end.x_m, end.y_m));
        let target = self.target.unwrap_or(end);
        self.arena.shifted(target, self.params.aim_clearance_m, self.params.aim_shift_m)
    }

    /// Begins the first of the motions.
    fn begin(&mut self, now: Time) -> bool {
        let Task::Moving { stage, rest, then } = std::mem::replace(&mut self.task, Task::Waiting) else {
            return false;
        };
        self.next_motion(now, stage, rest, then)
    }

    fn go_on(
        &mut self,
        now: Time,
        inputs: &Inputs<'_>,
        stage: JourneyStageName,
        rest: VecDeque<Motion>,
        then: Then,
    ) -> bool {
        let report = inputs.report.filter(|report| report.command_id == self.motion.command_id);
        match report.and_then(|report| report.state.get().ok()) {
            Some(MotionStateName::Done) => self.next_motion(now, stage, rest, then),
            Some(MotionStateName::NearWall) => {
                self.count.retreats += 1;
                self.survey(now)
            }
            Some(MotionStateName::Blocked | MotionStateName::Refused) => self.survey(now),
            Some(MotionStateName::Running | MotionStateName::Idle) | None => {
                self.task = Task::Moving { stage, rest, then };
                false
            }
        }
    }

    fn next_motion(
        &mut self,
        now: Time,
        stage: JourneyStageName,
        mut rest: VecDeque<Motion>,
        mut then: Then,
    ) -> bool {
        while let Some(motion) = rest.pop_front() {
            match motion {
                Motion::Turn(turn_rad) => self.order(MotionKindName::Turn, turn_rad),
                Motion::Move(way_m) => self.order(MotionKindName::Move, way_m),
                Motion::Towards(place) => {
                    let Some(belief) = self.belief else { return self.survey(now) };
                    let left_m = (place - belief.pose.position()).norm();
                    if left_m <= REACHED_M {
                        continue;
                    }
                    let (way_m, is_last) = match self.next_leg(belief.pose, place) {
                        NextLeg::First(Leg::Turn(turn_rad)) => {
                            rest.push_front(motion);
                            self.detours += 1;
                            self.order(MotionKindName::Turn, turn_rad);
                            self.task = Task::Moving { stage, rest, then };
                            return false;
                        }
                        NextLeg::First(Leg::Move(way_m)) => (way_m, false),
                        NextLeg::Straight => (left_m, true),
                        NextLeg::Nowhere => return self.survey(now),
                    };
                    let mut certain_m = f64::INFINITY;
                    if way_m > 0.0 {
                        certain_m = self.certain_way_m(&belief, way_m);
                    }
                    if certain_m < way_m - REACHED_M {
                        if certain_m < self.params.shortest_way_m && self.looks < MOST_LOOKS {
                            // Standing still is safe, and another look tells more.
                            self.looks += 1;
                            return self.survey(now);
                        }
                        rest.clear();
                        then = Then::Survey;
                    } else if !is_last {
                        rest.push_front(motion);
                        self.detours += 1;
                    }
                    self.looks = 0;
                    self.order(MotionKindName::Move, way_m.min(certain_m.max(self.params.shortest_way_m)));
                }
            }
            self.task = Task::Moving { stage, rest, then };
            return false;
        }
        match then {
            Then::Measure { window_rad } => self.measure(now, window_rad),
            Then::Survey => self.survey(now),
            Then::Arrive => {
                self.at_end = true;
                self.survey(now)
            }
        }
    }

    /// What the robot knows of its surroundings: the map where its place is certain, or is one of a few; else
    /// the last scan.
    fn views(&self) -> Vec<View<'_>> {
        if let Some(belief) = self.place() {
            return vec![View { arena: &self.arena, pose: belief.pose }];
        }
        let moved = |from: Pose2| from.to(self.belief.map_or(from, |belief| belief.pose));
        if self.places.sigma_m.is_some() {
            let moved = moved(self.placed_at);
            let view =
                |place: &resolve::Hypothesis| View { arena: &self.arena, pose: place.pose.compose(moved) };
            return self.places.hypotheses.iter().map(view).collect();
        }
        self.seen.iter().map(|arena| View { arena, pose: moved(self.seen_at) }).collect()
    }

    /// Room that is wanted around the body: more where less is known.
    fn wanted_room_m(&self) -> f64 {
        let error_m = match (self.place(), self.places.sigma_m) {
            (Some(belief), _) => belief.sigma_m,
            (None, Some(sigma_m)) => sigma_m,
            (None, None) => self.params.scan_margin_m,
        };
        self.params.turn_margin_m + error_m
    }

    /// What the body has to do before it can drive straight to a place, or because it cannot get there.
    fn next_leg(&self, pose: Pose2, place: Point2<f64>) -> NextLeg {
        let seen = pose.inverse_transform(place);
        let tolerance_rad = self.params.heading_tolerance_rad;
        let is_turn = |leg: &Leg| matches!(leg, Leg::Turn(turn_rad) if turn_rad.abs() >= tolerance_rad);
        if self.detours >= MOST_DETOURS {
            return NextLeg::Nowhere;
        }
        match route(&self.views(), self.wanted_room_m(), seen) {
            Route::There(legs) => match legs[..] {
                [Leg::Move(_)] | [] => NextLeg::Straight,
                [turn @ Leg::Turn(_), Leg::Move(_)] if !is_turn(&turn) => NextLeg::Straight,
                [leg, ..] => NextLeg::First(leg),
            },
            Route::Away(legs) => legs.first().map_or(NextLeg::Nowhere, |leg| NextLeg::First(*leg)),
        }
    }

    /// How far the body may drive before the error of its pose could bring it too near to a wall. What is so
    /// near already does not count until the body comes nearer.
    fn certain_way_m(&self, belief: &Belief, way_m: f64) -> f64 {
        let front_m = 0.5 * self.params.body_length_m;
        let spare_m = |at_m: f64| {
            let pose = belief.pose.compose(Pose2::new(at_m, 0.0, 0.0));
            let error_m = belief.sigma_m + belief.sigma_rad * (at_m + front_m);
            self.arena.room_m(pose) - self.params.way_margin_m - self.params.way_sigmas * error_m
        };
        // However far a message says that it is.
        let steps = (way_m / STEP_M).ceil().clamp(1.0, 500.0) as u32;
        let mut last_m = spare_m(0.0).min(0.0);
        for step in 1..=steps {
            let at_m = way_m * f64::from(step) / f64::from(steps);
            let here_m = spare_m(at_m);
            if here_m < last_m {
                return way_m * f64::from(step - 1) / f64::from(steps);
            }
            last_m = here_m.min(0.0);
        }
        f64::INFINITY
    }

    /// A number for an order: above those of an earlier process, whose last answers may still be there.
    fn next_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }

    fn order(&mut self, kind: MotionKindName, amount: f64) {
        let is_way = kind == MotionKindName::Move;
        let most_m = self.params.retreat_m;
        // The way that it has driven is free as well; the controller adds it.
        let margin_m = self.params.turn_margin_m;
        let behind_m = |view: &View<'_>| view.arena.retreat_m(view.pose, most_m, margin_m);
        let retreat_m = self.views().iter().map(behind_m).fold(most_m, f64::min);
        self.motion = MotionCommand {
            command_id: self.next_id(),
            distance_m: if is_way { amount } else { 0.0 },
            turn_rad: if kind == MotionKindName::Turn { amount } else { 0.0 },
            retreat_m,
            kind: kind.into(),
            reserved: 0,
        };
    }
}
