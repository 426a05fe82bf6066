//! From a pose to a goal on one floor: escape, search, straighten.

use crate::field::Field;
use crate::params::Algorithm;
use crate::search::Search;
use crate::smooth::Smoother;
use messages::{PlanStateName, Waypoint};

/// What a corner may save, in cells, and still be left out for lying too near to another.
const MERGE_COST: f64 = 1.0;

/// What is asked, in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question {
    /// Where the robot's middle is.
    pub start_m: [f64; 2],
    /// Where it shall be.
    pub goal_m: [f64; 2],
    /// A blocked goal may be replaced by a free cell no farther away than this.
    pub tolerance_m: f64,
    /// A blocked start may be left for a free cell no farther away than this.
    pub escape_m: f64,
    /// Inner corners nearer to each other are merged where the way stays free.
    pub spacing_m: f64,
    /// How to search.
    pub algorithm: Algorithm,
}

/// Searches and keeps its memory for the next time: no plan allocates once the first ones have been made.
#[derive(Debug, Clone, Default)]
pub struct Router {
    search: Search,
    smoother: Smoother,
    points: Vec<[f64; 2]>,
    waypoints: Vec<Waypoint>,
}

impl Router {
    /// Finds the way. Only `Found` leaves waypoints; the first is the start, the last the goal or the free
    /// cell next to it.
    pub fn plan(&mut self, field: &Field, question: &Question) -> PlanStateName {
        self.waypoints.clear();
        let grid = field.grid();
        let at = |place: [f64; 2]| grid.index_at(place[0], place[1]);
        let Some(start) = at(question.start_m) else { return PlanStateName::NoStart };
        let Some(goal) = at(question.goal_m) else { return PlanStateName::InvalidGoal };
        let in_cells = |metres: f64| metres / grid.resolution_m();
        let Some(target) = nearest_free(field, goal, in_cells(question.tolerance_m), false) else {
            return PlanStateName::InvalidGoal;
        };
        let Some(first) = nearest_free(field, start, in_cells(question.escape_m), true) else {
            return PlanStateName::Unreachable;
        };
        let Some(cells) = self.search.find(field, first, target) else { return PlanStateName::Unreachable };

        self.points.clear();
        if first == start {
            self.points.push(grid.to_cells(question.start_m));
        }
        self.points.extend(cells.iter().map(|&cell| grid.centre(cell as usize)));
        if target == goal {
            self.points.push(grid.to_cells(question.goal_m));
        }
        if first != start {
            self.waypoints.push(waypoint(question.start_m));
        }
        match question.algorithm {
            Algorithm::AnyAngle => {
                let chosen = self.smoother.straighten(field, &self.points);
                push_spaced(&mut self.waypoints, field, chosen, in_cells(question.spacing_m));
            }
            Algorithm::EightConnected => push_corners(&mut self.waypoints, field, &self.points),
        }
        // A robot at its goal still gets two ends.
        if let &[only] = self.waypoints.as_slice() {
            self.waypoints.push(only);
        }
        PlanStateName::Found
    }

    /// The way found last.
    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    /// Cells expanded by the last search.
    pub fn expanded(&self) -> u64 {
        self.search.expanded()
    }
}

/// Length of a chain of waypoints.
pub fn length_m(waypoints: &[Waypoint]) -> f64 {
    let pieces =
        waypoints.windows(2).map(|ends| (ends[1].x_m - ends[0].x_m).hypot(ends[1].y_m - ends[0].y_m));
    // The sum of nothing would be -0.
    pieces.fold(0.0, |sum, piece| sum + piece)
}

fn waypoint([x_m, y_m]: [f64; 2]) -> Waypoint {
    Waypoint { x_m, y_m }
}

/// The free cell nearest to `cell`, itself first, at most `reach` cells away. An escape does not cross a
/// wall: only cells whose straight line from `cell` meets none are taken, unless `cell` itself is within one.
fn nearest_free(field: &Field, cell: usize, reach: f64, escape: bool) -> Option<usize> {
    if !field.is_blocked(cell) {
        return Some(cell);
    }
    let grid = field.grid();
    let (column, row) = grid.column_row(cell);
    let within = reach.floor() as i64;
    let candidates = (-within..=within).flat_map(|dy| (-within..=within).map(move |dx| (dx, dy)));
    let sees = |other: usize| {
        !escape
            || grid.is_occupied(cell)
            || crate::line::visit(grid.centre(cell), grid.centre(other), |column, row| {
                grid.checked_index(column, row).is_some_and(|between| !grid.is_occupied(between))
            })
    };
    let square = |&(dx, dy): &(i64, i64)| dx * dx + dy * dy;
    candidates
        .filter(|step| (square(step) as f64) <= reach * reach)
        .filter_map(|step| Some((square(&step), grid.checked_index(column + step.0, row + step.1)?)))
        .filter(|&(_, other)| !field.is_blocked(other) && sees(other))
        .min()
        .map(|(_, other)| other)
}

/// The points without those that lie too near to their predecessors and can be left out.
fn push_spaced(waypoints: &mut Vec<Waypoint>, field: &Field, points: &[[f64; 2]], spacing: f64) {
    let mut last: Option<[f64; 2]> = None;
    for (at, &point) in points.iter().enumerate() {
        if let (Some(before), Some(&after)) = (last, points.get(at + 1)) {
            let close = (point[0] - before[0]).hypot(point[1] - before[1]) < spacing;
            let cost = |from, to| field.line_cost(from, to).unwrap_or(f64::INFINITY);
            if close && cost(before, after) <= cost(before, point) + cost(point, after) + MERGE_COST {
                continue;
            }
        }
        last = Some(point);
        waypoints.push(waypoint(field.grid().to_map(point)));
    }
}

/// The points at which the direction changes, and both ends.
fn push_corners(waypoints: &mut Vec<Waypoint>, field: &Field, points: &[[f64; 2]]) {
    for (at, &point) in points.iter().enumerate() {
        let straight =
            at.checked_sub(1).and_then(|before| points.get(before)).zip(points.get(at + 1)).is_some_and(
                |(before, after)| {
                    let (u, v) = (
                        [point[0] - before[0], point[1] - before[1]],
                        [after[0] - point[0], after[1] - point[1]],
                    );
                    (u[0] * v[1] - u[1] * v[0]).abs() < 1e-9 && u[0] * v[0] + u[1] * v[1] > 0.0
                },
            );
        if !straight {
            waypoints.push(waypoint(field.grid().to_map(point)));
        }
    }
}
