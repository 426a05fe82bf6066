//! Plans paths on the inflated grid of a floor: A* over eight neighbours, straightened to any angle, to the
//! right in hallways by cost (COF-006, ASN-130..134). Obstacles that the time-of-flight sensors see enter the
//! grid; a path that they block is planned anew.

mod field;
mod floors;
mod grid;
mod lane;
mod line;
mod overlay;
mod params;
mod queue;
mod route;
mod search;
mod smooth;
#[cfg(test)]
mod tests;

pub use field::{Costs, Field};
pub use grid::{DIRECTIONS, Grid};
pub use params::{Algorithm, Params, ParamsError};
pub use route::{Question, Router, length_m};
pub use search::{DIAGONAL, STRAIGHT, Search};

use geometry::{Pose2, Segment, World};
use messages::{
    Once, Parameters, Path, PlanRequest, PlanState, PlanStateName, PoseEstimate, Stamped, Time, TofRanges,
    Waypoint,
};
use overlay::Overlay;

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
}

/// The planner.
#[derive(Debug)]
pub struct GridPlanner {
    params: Params,
    floors: Vec<(i32, Field)>,
    /// The closed leaves of the doors and elevators of each floor.
    leaves: Vec<(i32, Vec<Segment>)>,
    router: Router,
    overlay: Overlay,
    /// The floor whose field holds the overlay.
    overlay_floor: Option<usize>,
    ranges_seen: Once,
    active: Option<Active>,
}

impl GridPlanner {
    /// Whether the world or the map that the parameters name can be used; of a map only the head is read.
    ///
    /// # Errors
    /// When a parameter or a file cannot be used.
    pub fn check(params: &Params) -> Result<(), ParamsError> {
        params.check()?;
        if !params.map.is_empty() {
            floors::check_map(params)
        } else if !params.world.is_empty() {
            floors::check_world(&World::load(&params.world)?, params)
        } else {
            Ok(())
        }
    }

    /// Reads the world or the map that the parameters name; without either there is no floor, and every
    /// request is answered by `NoStart`.
    ///
    /// # Errors
    /// When a parameter or a file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let mut leaves = Vec::new();
        let grids = if !params.map.is_empty() {
            vec![(params.map_floor, floors::grid_of_map(&params)?)]
        } else if !params.world.is_empty() {
            let world = World::load(&params.world)?;
            let of = |floor| world.openings_of(floor).map(|door| door.leaf).collect();
            leaves = world.floors.iter().map(|floor| (floor.number, of(floor.number))).collect();
            floors::grids(&world, &params)?
        } else {
            Vec::new()
        };
        Ok(Self { leaves, ..Self::with_grids(params, grids)? })
    }

    /// A planner with the floors' grids given.
    ///
    /// # Errors
    /// When a parameter is out of range.
    pub fn with_grids(params: Params, grids: Vec<(i32, Grid)>) -> Result<Self, ParamsError> {
        params.check()?;
        let costs = params.costs();
        let floors = grids.into_iter().map(|(floor, grid)| (floor, Field::new(grid, &costs))).collect();
        Ok(Self {
            params,
            floors,
            leaves: Vec::new(),
            router: Router::default(),
            overlay: Overlay::default(),
            overlay_floor: None,
            ranges_seen: Once::default(),
            active: None,
        })
    }

    /// Takes new readings into the grid, and plans when a request is new, its path is blocked, or the robot
    /// has strayed.
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

    /// Cells that observed obstacles occupy now.
    pub fn obstacle_cells(&self) -> usize {
        self.overlay.blocking()
    }

    /// The field of a floor, with the obstacles observed there.
    pub fn field(&self, floor: i32) -> Option<&Field> {
        self.floors.iter().find(|(number, _)| *number == floor).map(|(_, field)| field)
    }

    fn observe(&mut self, now: Time, pose: Option<(i32, Pose2)>, ranges: Option<Stamped<'_, TofRanges>>) {
        let rules = self.params.rules();
        let floor = pose.and_then(|(floor, _)| self.floors.iter().position(|(number, _)| *number == floor));
        if let (Some(old), true) = (self.overlay_floor, floor.is_some() && floor != self.overlay_floor) {
            self.overlay.clear(&mut self.floors[old].1);
        }
        self.overlay_floor = floor.or(self.overlay_floor);
        let Some((number, field)) = self.overlay_floor.map(|floor| &mut self.floors[floor]) else { return };
        self.overlay.fade(field, &rules, now);
        let news = ranges
            .and_then(|ranges| ranges.fresh(now, self.params.input_max_age()))
            .filter(|ranges| self.ranges_seen.is_new(ranges));
        if let (Some(ranges), Some((_, pose))) = (news, pose) {
            self.ranges_seen.take(ranges);
            let leaves = self.leaves.iter().find(|(floor, _)| floor == number);
            let leaves = leaves.map_or(&[][..], |(_, leaves)| leaves.as_slice());
            self.overlay.observe((field, leaves), &rules, now, pose, ranges.message);
        }
    }

    /// Whether the path of a request that was answered before has to be planned again.
    fn is_due(&self, now: Time, active: &Active, pose: Option<(i32, Pose2)>) -> bool {
        if active.state == PlanStateName::NoStart {
            return pose
                .is_some_and(|(floor, _)| floor == active.request.floor && self.field(floor).is_some());
        }
        if now.seconds_since(active.planned) < self.params.replan_interval_s {
            return false;
        }
        if active.state != PlanStateName::Found {
            return true;
        }
        let Some((floor, pose)) = pose.filter(|(floor, _)| *floor == active.request.floor) else {
            return false;
        };
        let Some(field) = self.field(floor) else { return false };
        let to_goal_m = (pose.x_m - active.request.goal_x_m).hypot(pose.y_m - active.request.goal_y_m);
        if to_goal_m <= active.request.tolerance_m {
            return false;
        }
        let waypoints = self.router.waypoints();
        let Some((piece, away_m)) = nearest_piece(waypoints, active.piece, pose) else { return true };
        away_m > self.params.stray_m || self.is_blocked(field, &waypoints[piece..], pose)
    }

    /// Whether an observed obstacle meets the path from the robot on. What is blocked right where the robot
    /// stands is left to the collision guard: no path could avoid it.
    fn is_blocked(&self, field: &Field, ahead: &[Waypoint], pose: Pose2) -> bool {
        let grid = field.grid();
        let mut from = grid.to_cells([pose.x_m, pose.y_m]);
        let mut left_blocked = true;
        for waypoint in ahead.iter().skip(1) {
            let to = grid.to_cells([waypoint.x_m, waypoint.y_m]);
            let free = line::visit(from, to, |column, row| {
                let blocked = grid.checked_index(column, row).is_none_or(|cell| field.is_blocked(cell));
                left_blocked &= blocked;
                !blocked || left_blocked
            });
            if !free {
                return true;
            }
            from = to;
        }
        false
    }

    /// Moves along the path with the robot.
    fn follow(&mut self, pose: Option<(i32, Pose2)>) {
        if let (Some(active), Some((_, pose))) = (&mut self.active, pose)
            && active.state == PlanStateName::Found
            && let Some((piece, _)) = nearest_piece(self.router.waypoints(), active.piece, pose)
        {
            active.piece = piece;
        }
    }

    fn plan(&mut self, now: Time, request: PlanRequest, pose: Option<(i32, Pose2)>) -> Outputs<'_> {
        let known = self.floors.iter().find(|(floor, _)| *floor == request.floor);
        let start = pose.filter(|(floor, _)| *floor == request.floor);
        let numbers = [request.goal_x_m, request.goal_y_m, request.tolerance_m];
        let state = match (known, start) {
            _ if numbers.iter().any(|number| !number.is_finite()) => PlanStateName::InvalidGoal,
            (Some((_, field)), Some((_, pose))) => {
                let question = Question {
                    start_m: [pose.x_m, pose.y_m],
                    goal_m: [request.goal_x_m, request.goal_y_m],
                    tolerance_m: request.tolerance_m.clamp(0.0, 2.0),
                    escape_m: self.params.escape_m,
                    spacing_m: self.params.waypoint_spacing_m,
                    algorithm: self.params.algorithm,
                };
                self.router.plan(field, &question)
            }
            _ => PlanStateName::NoStart,
        };
        let before = self.active.filter(|active| same(&active.request, &request));
        // A goal that stays out of reach is said once.
        let news = state == PlanStateName::Found || before.is_none_or(|before| before.state != state);
        let revision = before.map_or(0, |before| before.revision) + u64::from(news);
        self.active = Some(Active { request, state, revision, planned: now, piece: 0 });
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
}

/// Whether two requests are one, bit by bit, so that a request with NaN is not new for ever.
fn same(a: &PlanRequest, b: &PlanRequest) -> bool {
    let bits =
        |request: &PlanRequest| [request.goal_x_m, request.goal_y_m, request.tolerance_m].map(f64::to_bits);
    (a.request_id, a.floor, bits(a)) == (b.request_id, b.floor, bits(b))
}

/// The piece of the path nearest to the robot, not before `from`, and how far away it is; `None` for no path.
fn nearest_piece(waypoints: &[Waypoint], from: usize, pose: Pose2) -> Option<(usize, f64)> {
    let place = |waypoint: &Waypoint| geometry::Point2::new(waypoint.x_m, waypoint.y_m);
    let pieces = waypoints.windows(2).enumerate().skip(from);
    pieces
        .map(|(piece, ends)| {
            let line = Segment::new(place(&ends[0]), place(&ends[1]));
            (piece, line.distance_m(pose.position()))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
