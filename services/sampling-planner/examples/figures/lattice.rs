//! What the paper compares its planner with (Fig. 6): A* over a decomposed arena, from star to star.

use geometry::{Point2, Segment};
use pathfinding::prelude::astar;
use sampling_planner::View;

/// The shortest path over the eight neighbours of each star, from the start to the star at the goal, with
/// every star on its way; `None` when there is none.
pub(crate) fn path(
    view: &View<'_>,
    start: Point2<f64>,
    goal: Point2<f64>,
    spacing_m: f64,
) -> Option<Vec<Point2<f64>>> {
    let target = ((goal - start) / spacing_m).map(f64::round);
    let target = (target.x as i32, target.y as i32);
    // Whole numbers sort: a straight step is 1e6 long.
    let length = |(x, y): (i32, i32)| (1e6 * f64::from(x).hypot(f64::from(y))) as u64;
    let neighbours = |&(x, y): &(i32, i32)| {
        let from = place(start, spacing_m, (x, y));
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter(|&step| step != (0, 0));
        around
            .filter(|(dx, dy)| view.is_open(from, place(start, spacing_m, (x + dx, y + dy))))
            .map(|(dx, dy)| ((x + dx, y + dy), length((dx, dy))))
            .collect::<Vec<_>>()
    };
    let left = |&(x, y): &(i32, i32)| {
        let (dx, dy) = ((target.0 - x).abs(), (target.1 - y).abs());
        let diagonal = dx.min(dy);
        length((1, 1)) * diagonal as u64 + length((1, 0)) * (dx.max(dy) - diagonal) as u64
    };
    let (steps, _) = astar(&(0, 0), neighbours, left, |&at| at == target)?;
    Some(steps.into_iter().map(|step| place(start, spacing_m, step)).collect())
}

/// Length of a chain of places.
pub(crate) fn length_m(path: &[Point2<f64>]) -> f64 {
    path.windows(2).map(|ends| Segment::new(ends[0], ends[1]).length_m()).sum()
}

/// How often the direction changes along a chain of places.
pub(crate) fn turns(path: &[Point2<f64>]) -> usize {
    let turn = |ends: &[Point2<f64>]| {
        let (before, after) = ((ends[1] - ends[0]).normalize(), (ends[2] - ends[1]).normalize());
        usize::from(before.dot(&after) < 1.0 - 1e-9)
    };
    path.windows(3).map(turn).sum()
}

/// A star by column and row.
pub(crate) fn place(start: Point2<f64>, spacing_m: f64, (column, row): (i32, i32)) -> Point2<f64> {
    Point2::new(start.x + f64::from(column) * spacing_m, start.y + f64::from(row) * spacing_m)
}
