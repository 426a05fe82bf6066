//! Upright walls from floor to ceiling, sorted into cells so that a ray meets only those near its way.

use crate::Segment;
use nalgebra::{Point2, Vector2};

/// Up to this many walls are simply tried one after the other.
const FEW: usize = 12;
/// Cells for each wall: what was fastest on hallways and arenas of 20 to 500 walls.
const CELLS_PER_WALL: f64 = 6.0;
/// No more cells than this along either side.
const MOST_CELLS: f64 = 512.0;
/// By how much of its own length a wall is longer for rays, so that none slips through between two walls that
/// share a corner.
const LONGER: f64 = 1e-7;
/// Rays closer to a wall's own line than this (length times sine) pass it: it has no thickness.
const PARALLEL: f64 = 1e-12;

/// A wall where a ray met it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallHit {
    /// Distance from the ray's origin in metres.
    pub range_m: f64,
    /// Cosine of the angle between the ray and the wall's normal: 1 straight on, near 0 grazing.
    pub incidence_cos: f64,
    /// Index of the wall.
    pub wall: usize,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    a: Point2<f64>,
    along: Vector2<f64>,
    wall: u32,
}

/// Walls that never move. Rays are cast in time that hardly grows with their number.
#[derive(Debug, Clone)]
pub struct Walls {
    segments: Vec<Segment>,
    /// The walls in each cell, cell after cell, row after row; a wall is in every cell that it passes.
    edges: Vec<Edge>,
    /// Where each cell begins in `edges`, and where the last one ends.
    starts: Vec<u32>,
    low: Point2<f64>,
    cell_m: f64,
    columns: usize,
    rows: usize,
}

impl Walls {
    /// Sorts the walls. Those of no length, or with a coordinate that is not finite, are never hit.
    pub fn new(segments: impl IntoIterator<Item = Segment>) -> Self {
        let segments: Vec<Segment> = segments.into_iter().collect();
        let usable: Vec<Edge> = (0_u32..)
            .zip(&segments)
            .filter(|(_, segment)| segment.is_finite() && segment.length_m() > 0.0)
            .map(|(wall, segment)| Edge { a: segment.a, along: segment.vector(), wall })
            .collect();
        let ends = usable.iter().flat_map(|edge| [edge.a, edge.a + edge.along]);
        let (low, high) = ends.fold(
            (Point2::new(f64::INFINITY, f64::INFINITY), Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY)),
            |(low, high), end| (low.inf(&end), high.sup(&end)),
        );
        if usable.len() <= FEW {
            let starts = vec![0, usable.len() as u32];
            return Self { segments, edges: usable, starts, low, cell_m: f64::INFINITY, columns: 1, rows: 1 };
        }
        let extent = high - low;
        let longest = extent.x.max(extent.y);
        let area = (extent.x * extent.y).max(1e-3 * longest * longest);
        let cell_m = (area / (CELLS_PER_WALL * usable.len() as f64)).sqrt().max(longest / MOST_CELLS);
        // A rim on each side, so that walls on the border lie well within.
        let low = low - Vector2::repeat(0.01 * cell_m);
        let count = |extent_m: f64| (extent_m / cell_m + 0.02).floor() as usize + 1;
        let (columns, rows) = (count(extent.x), count(extent.y));
        let mut cells = vec![Vec::new(); columns * rows];
        for edge in usable {
            for (column, row) in cells_near(&edge, low, cell_m, columns, rows) {
                cells[row * columns + column].push(edge);
            }
        }
        let mut starts = vec![0];
        let mut edges = Vec::new();
        for cell in cells {
            edges.extend(cell);
            starts.push(edges.len() as u32);
        }
        Self { segments, edges, starts, low, cell_m, columns, rows }
    }

    /// The walls, in the order given.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The nearest wall that a ray meets within `max_range_m`; `None` when there is none, or when a number is
    /// not finite. A ray within a wall's own line passes it.
    pub fn cast(&self, origin: Point2<f64>, heading_rad: f64, max_range_m: f64) -> Option<WallHit> {
        let (sine, cosine) = heading_rad.sin_cos();
        self.cast_along(origin, Vector2::new(cosine, sine), max_range_m)
    }

    /// The nearest wall that a ray along a unit vector meets, as [`Walls::cast`] says.
    pub fn cast_along(
        &self,
        origin: Point2<f64>,
        direction: Vector2<f64>,
        max_range_m: f64,
    ) -> Option<WallHit> {
        let mut nearest = Nearest { range_m: max_range_m, turn: 0.0, edge: usize::MAX };
        if self.starts.len() == 2 {
            nearest.meet(&self.edges, 0, origin, direction);
        } else {
            self.walk(origin, direction, &mut nearest);
        }
        let edge = self.edges.get(nearest.edge)?;
        let incidence_cos = nearest.turn / edge.along.norm();
        Some(WallHit { range_m: nearest.range_m, incidence_cos, wall: edge.wall as usize })
    }

    /// Whether the straight way between two points meets no wall. Ends that lie on a wall count as meeting
    /// it.
    pub fn is_free(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        let step = to - from;
        let length_m = step.norm();
        // The nearest wall must lie strictly within the range: half a nanometre more includes the end itself.
        length_m > 0.0 && self.cast_along(from, step / length_m, length_m + 5e-10).is_none()
    }

    /// Distance from a point to the nearest wall in metres; infinite without walls.
    pub fn distance_m(&self, point: Point2<f64>) -> f64 {
        self.segments.iter().map(|wall| wall.distance_m(point)).fold(f64::INFINITY, f64::min)
    }

    /// Cell by cell along the ray (Amanatides and Woo 1987), until the nearest wall so far lies before the
    /// next cell.
    fn walk(&self, origin: Point2<f64>, direction: Vector2<f64>, nearest: &mut Nearest) {
        let size = Vector2::new(self.columns as f64, self.rows as f64) * self.cell_m;
        let mut enter_m: f64 = 0.0;
        let mut leave_m = nearest.range_m;
        let from = origin - self.low;
        for axis in 0..2 {
            let inverse = 1.0 / direction[axis];
            if inverse.is_finite() {
                let (p, q) = (-from[axis] * inverse, (size[axis] - from[axis]) * inverse);
                enter_m = enter_m.max(p.min(q));
                leave_m = leave_m.min(p.max(q));
            } else if from[axis] < 0.0 || from[axis] > size[axis] {
                return;
            }
        }
        if enter_m > leave_m {
            return;
        }
        let entry = (from + direction * enter_m) / self.cell_m;
        let clamp = |value: f64, count: usize| (value.max(0.0) as usize).min(count - 1);
        let (mut column, mut row) = (clamp(entry.x, self.columns), clamp(entry.y, self.rows));
        let border = |cell: usize, axis: usize| {
            let ahead = if direction[axis] > 0.0 { cell + 1 } else { cell };
            let range_m = (ahead as f64 * self.cell_m - from[axis]) / direction[axis];
            if range_m.is_finite() { range_m } else { f64::INFINITY }
        };
        let (mut next_x_m, mut next_y_m) = (border(column, 0), border(row, 1));
        let step_x_m = (self.cell_m / direction.x).abs();
        let step_y_m = (self.cell_m / direction.y).abs();
        loop {
            let cell = row * self.columns + column;
            let (begin, end) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
            nearest.meet(&self.edges[begin..end], begin, origin, direction);
            let across_m = next_x_m.min(next_y_m);
            if nearest.range_m <= across_m || across_m >= leave_m {
                return;
            }
            let inside = if next_x_m < next_y_m {
                next_x_m += step_x_m;
                advance(&mut column, direction.x, self.columns)
            } else {
                next_y_m += step_y_m;
                advance(&mut row, direction.y, self.rows)
            };
            if !inside {
                return;
            }
        }
    }
}

/// One cell on; false when that leaves the grid.
fn advance(cell: &mut usize, direction: f64, count: usize) -> bool {
    if direction > 0.0 {
        *cell += 1;
        *cell < count
    } else {
        *cell = cell.wrapping_sub(1);
        *cell < count
    }
}

struct Nearest {
    range_m: f64,
    turn: f64,
    edge: usize,
}

impl Nearest {
    /// Tries each edge; `first` is the index of the first of them. No division but for a hit.
    #[inline]
    fn meet(&mut self, edges: &[Edge], first: usize, origin: Point2<f64>, direction: Vector2<f64>) {
        for (i, edge) in edges.iter().enumerate() {
            let turn = direction.x * edge.along.y - direction.y * edge.along.x;
            let (x, y) = (edge.a.x - origin.x, edge.a.y - origin.y);
            let range = x * edge.along.y - y * edge.along.x;
            let beside = x * direction.y - y * direction.x;
            // As if the wall ran the other way, when the ray comes from its other side.
            let sign = 1.0_f64.copysign(turn);
            let (turn, range, beside) = (turn * sign, range * sign, beside * sign);
            let slack = LONGER * turn;
            let meets = turn > PARALLEL
                && beside >= -slack
                && beside <= turn + slack
                && range >= 0.0
                && range < self.range_m * turn;
            if meets {
                (self.range_m, self.turn, self.edge) = (range / turn, turn, first + i);
            }
        }
    }
}

/// The cells that an edge passes, or nearly does.
fn cells_near(
    edge: &Edge,
    low: Point2<f64>,
    cell_m: f64,
    columns: usize,
    rows: usize,
) -> impl Iterator<Item = (usize, usize)> {
    let (a, b) = ((edge.a - low) / cell_m, (edge.a + edge.along - low) / cell_m);
    // In cells: a wall that only touches a cell's border belongs to it, and rounding must not decide.
    let rim = 1e-3;
    let index = |value: f64, count: usize| (value.max(0.0) as usize).min(count - 1);
    let span = |p: f64, q: f64, count| index(p.min(q) - rim, count)..=index(p.max(q) + rim, count);
    let along = b - a;
    let reach = 0.5 * (along.x.abs() + along.y.abs()) + rim * along.norm();
    let columns = span(a.x, b.x, columns);
    span(a.y, b.y, rows).flat_map(move |row| {
        columns.clone().filter_map(move |column| {
            // Separating axis: the cell's centre lies farther from the edge's line than the cell reaches.
            let centre = Vector2::new(column as f64 + 0.5, row as f64 + 0.5) - a;
            let aside = (along.x * centre.y - along.y * centre.x).abs();
            (aside <= reach).then_some((column, row))
        })
    })
}
