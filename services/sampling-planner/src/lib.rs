//! Plans paths over waypoints drawn at random inside the floor shrunk by half the robot: as few waypoints as
//! possible, then as short as possible (the NXT paper's Algorithm 1, NXT-070 to NXT-081). It takes the place
//! of `grid-planner` in a graph: the same topics, the same meaning of requests and answers, and obstacles
//! that the time-of-flight sensors see are kept away from.

mod floors;
mod lattice;
mod obstacles;
mod params;
mod route;
mod search;
mod space;
#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError};
pub use route::{Question, Router, length_m};
pub use search::Search;
pub use space::{Space, View};

use floors::Floor;
use geometry::{Point2, Pose2, Segment, World};
use messages::{
    Once, Parameters, Path, PlanRequest, PlanState, PlanStateName, PoseEstimate, Stamped, Time, TofRanges,
    Waypoint,
};
use obstacles::{GRAIN_M, Obstacles};
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// What the planner reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The path that is wanted.
    pub request: Option<Stamped<'a, PlanRequest>>,
    /// Where the robot is.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
    /// What the sensors see; without them the map is all.
    pub ranges: Option<Stamped<'a, TofRanges>>,
}

/// What the planner says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs<'a> {
    /// A path to publish: the header and its waypoints; `None` when the last one still holds.
    pub path: Option<(Path, &'a [Waypoint])>,
}

/// The request being served.
#[derive(Debug, Clone, Copy)]
struct Active {
    request: PlanRequest,
    state: PlanStateName,
    revision: u64,
    planned: Time,
    /// The piece of the path on which the robot is.
    piece: usize,
    /// Draws already made for the next answer, when it was not found within one step.
    unfinished: Option<u32>,
}

/// Where the robot is: the floor, and the pose there.
type Whereabouts = (i32, Pose2);

/// The planner.
#[derive(Debug)]
pub struct SamplingPlanner {
    params: Params,
    floors: Vec<Floor>,
    router: Router,
    rng: Pcg64,
    obstacles: Obstacles,
    /// The floor on which the obstacles are.
    obstacles_floor: Option<i32>,
    ranges_seen: Once,
    active: Option<Active>,
}

impl SamplingPlanner {
    /// Reads the world that the parameters name; without one there is no floor, and every request is answered
    /// by `NoStart`.
    ///
    /// # Errors
    /// When a parameter or the file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::in_world(params, &world, seed)
    }

    /// A planner in a world that is read already.
    ///
    /// # Errors
    /// When a parameter cannot be used.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        Ok(Self {
            floors: floors::floors(world, params.robot_radius_m),
            params,
            router: Router::default(),
            rng: Pcg64::seed_from_u64(seed),
            obstacles: Obstacles::default(),
            obstacles_floor: None,
            ranges_seen: Once::default(),
            active: None,
        })
    }

    /// Takes note of new readings, and plans when a request is new, its path is blocked, or the robot has
    /// strayed.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        let pose = inputs.pose.and_then(|pose| {
            let fresh = pose.fresh(now, self.params.input_max_age())?;
            Some((fresh.floor, fresh.pose().ok()?))
        });
        self.observe(now, pose, inputs.ranges);
        let Some(request) = inputs.request.map(|request| *request).filter(|request| request.request_id != 0)
        else {
            return Outputs { path: None };
        };
        let due = match &self.active {
            Some(active) if same(&active.request, &request) => self.is_due(now, active, pose),
            _ => true,
        };
        if due {
            return self.plan(now, request, pose);
        }
        self.follow(pose);
        Outputs { path: None }
    }

    /// The configuration space of a floor.
    pub fn space(&self, floor: i32) -> Option<&Space> {
        self.floor(floor).map(|floor| &floor.space)
    }

    /// Where observed obstacles are, on the robot's floor.
    pub fn obstacles(&self) -> &[Point2<f64>] {
        self.obstacles.places()
    }

    fn floor(&self, number: i32) -> Option<&Floor> {
        self.floors.iter().find(|floor| floor.number == number)
    }

    fn observe(&mut self, now: Time, pose: Option<Whereabouts>, ranges: Option<Stamped<'_, TofRanges>>) {
        let rules = self.params.rules();
        if let Some((floor, _)) = pose
            && self.obstacles_floor != Some(floor)
        {
            self.obstacles.clear();
            self.obstacles_floor = Some(floor);
        }
        self.obstacles.fade(&rules, now);
        let news = ranges
            .and_then(|ranges| ranges.fresh(now, self.params.input_max_age()))
            .filter(|ranges| self.ranges_seen.is_new(ranges));
        if let (Some(ranges), Some((number, pose))) = (news, pose)
            && let Some(floor) = self.floors.iter().find(|floor| floor.number == number)
        {
            self.ranges_seen.take(ranges);
            self.obstacles.observe(floor, &rules, now, pose, ranges.message);
        }
    }

    /// Whether the path of a request that was answered before has to be planned again.
    fn is_due(&self, now: Time, active: &Active, pose: Option<Whereabouts>) -> bool {
        if active.unfinished.is_some() {
            return true;
        }
        if active.state == PlanStateName::NoStart {
            return pose
                .is_some_and(|(floor, _)| floor == active.request.floor && self.floor(floor).is_some());
        }
        if now.seconds_since(active.planned) < self.params.replan_interval_s {
            return false;
        }
        if active.state != PlanStateName::Found {
            return true;
        }
        let Some((_, pose)) = pose.filter(|(floor, _)| *floor == active.request.floor) else { return false };
        let to_goal_m = (pose.x_m - active.request.goal_x_m).hypot(pose.y_m - active.request.goal_y_m);
        if to_goal_m <= active.request.tolerance_m {
            return false;
        }
        let waypoints = self.router.waypoints();
        let Some((piece, away_m)) = nearest_piece(waypoints, active.piece, pose) else { return true };
        away_m > self.params.stray_m || self.is_blocked(&waypoints[piece + 1..], pose)
    }

    /// Whether an observed obstacle is too near to the way ahead. One that is too near already is no reason
    /// as long as the way does not come nearer to it.
    fn is_blocked(&self, ahead: &[Waypoint], pose: Pose2) -> bool {
        // The grain: an obstacle moves by as much without moving.
        let near_m = self.params.obstacle_distance_m() - 0.5 * GRAIN_M;
        let from = pose.position();
        let begins = std::iter::once(from).chain(ahead.iter().map(place));
        let ways: Vec<Segment> = begins.zip(ahead).map(|(from, to)| Segment::new(from, place(to))).collect();
        self.obstacles.places().iter().any(|obstacle| {
            let allowed_m = near_m.min((obstacle - from).norm() - 0.5 * GRAIN_M);
            ways.iter().any(|way| way.distance_m(*obstacle) < allowed_m)
        })
    }

    /// Moves along the path with the robot.
    fn follow(&mut self, pose: Option<Whereabouts>) {
        if let (Some(active), Some((_, pose))) = (&mut self.active, pose)
            && active.state == PlanStateName::Found
            && let Some((piece, _)) = nearest_piece(self.router.waypoints(), active.piece, pose)
        {
            active.piece = piece;
        }
    }

    fn plan(&mut self, now: Time, request: PlanRequest, pose: Option<Whereabouts>) -> Outputs<'_> {
        let before = self.active.filter(|active| same(&active.request, &request));
        let first = before.and_then(|before| before.unfinished).unwrap_or(0);
        let Some(state) = self.search(&request, pose, first) else {
            let unfinished = Some(self.router.tries());
            let blank = Active {
                request,
                state: PlanStateName::Idle,
                revision: 0,
                planned: now,
                piece: 0,
                unfinished: None,
            };
            self.active = Some(Active { unfinished, ..before.unwrap_or(blank) });
            return Outputs { path: None };
        };
        // A goal that stays out of reach is said once.
        let news = state == PlanStateName::Found || before.is_none_or(|before| before.state != state);
        let revision = before.map_or(0, |before| before.revision) + u64::from(news);
        self.active = Some(Active { request, state, revision, planned: now, piece: 0, unfinished: None });
        let waypoints = if state == PlanStateName::Found { self.router.waypoints() } else { &[] };
        let path = Path {
            request_id: request.request_id,
            revision,
            length_m: length_m(waypoints),
            expanded: self.router.expanded(),
            floor: request.floor,
            state: PlanState::from(state),
        };
        Outputs { path: news.then_some((path, waypoints)) }
    }

    /// One step's part of the search, from draw number `first` on; `None` when it has to go on.
    fn search(
        &mut self,
        request: &PlanRequest,
        pose: Option<Whereabouts>,
        first: u32,
    ) -> Option<PlanStateName> {
        let numbers = [request.goal_x_m, request.goal_y_m, request.tolerance_m];
        if numbers.iter().any(|number| !number.is_finite()) {
            return Some(PlanStateName::InvalidGoal);
        }
        let floor = self.floors.iter().find(|floor| floor.number == request.floor);
        let start = pose.filter(|(floor, _)| *floor == request.floor);
        let (Some(floor), Some((_, pose))) = (floor, start) else { return Some(PlanStateName::NoStart) };
        let question = Question {
            start: pose.position(),
            goal: Point2::new(request.goal_x_m, request.goal_y_m),
            tolerance_m: request.tolerance_m.clamp(0.0, 2.0),
            escape_m: self.params.escape_m,
            samples: [self.params.samples, self.params.samples_max],
            tries_max: self.params.tries_max,
            literal: self.params.literal,
        };
        let obstacles = self.obstacles.places();
        let view = View::new(&floor.space, obstacles, self.params.obstacle_distance_m());
        self.router.plan_some(&view, &question, first, self.params.samples_max, &mut self.rng)
    }
}

/// Whether two requests are one, bit by bit, so that a request with NaN is not new for ever.
fn same(a: &PlanRequest, b: &PlanRequest) -> bool {
    let bits =
        |request: &PlanRequest| [request.goal_x_m, request.goal_y_m, request.tolerance_m].map(f64::to_bits);
    (a.request_id, a.floor, bits(a)) == (b.request_id, b.floor, bits(b))
}

fn place(waypoint: &Waypoint) -> Point2<f64> {
    Point2::new(waypoint.x_m, waypoint.y_m)
}

/// The piece of the path nearest to the robot, not before `from`, and how far away it is; `None` for no path.
fn nearest_piece(waypoints: &[Waypoint], from: usize, pose: Pose2) -> Option<(usize, f64)> {
    let pieces = waypoints.windows(2).enumerate().skip(from);
    pieces
        .map(|(piece, ends)| {
            (piece, Segment::new(place(&ends[0]), place(&ends[1])).distance_m(pose.position()))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
