//! Where the middle of the robot may be, what each step there costs, and how both change with obstacles that
//! come and go.

use crate::grid::Grid;
use crate::lane;
use crate::line;
use std::collections::HashMap;

/// Sixteenths: an extra cost of 16 doubles the cost of a step.
const SIXTEENTHS: f32 = 16.0;

/// Around an observed obstacle this much more room costs: not as much as beside walls, as what stands on the
/// other side may not be seen yet.
const OBSTACLE_BAND_M: f64 = 0.10;

/// Around an observed obstacle no cells farther away than this change: each obstacle that comes or goes costs
/// as many as the square.
const REACH_MAX: f64 = 400.0;

/// What decides where the robot may be and what it costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// No middle of the robot nearer to an occupied cell than this.
    pub robot_radius_m: f64,
    /// Added to the radius around observed obstacles.
    pub obstacle_margin_m: f64,
    /// Extra cost per metre travelled for each metre beside the lane.
    pub keep_right_weight: f64,
    /// The lane's middle, from the wall on the right.
    pub lane_m: f64,
    /// Passages wider than this have no lanes.
    pub hallway_width_max_m: f64,
    /// Extra cost per metre travelled in contact with the inflated walls, falling to zero at `clearance_m`.
    pub clearance_weight: f64,
    /// Beyond this distance a wall costs nothing.
    pub clearance_m: f64,
}

/// A wall is there, or is too near.
const BY_WALLS: u8 = 1;
/// An observed obstacle is too near.
const BY_OBSTACLES: u8 = 2;

/// A cell near observed obstacles.
#[derive(Debug, Clone, Copy, Default)]
struct Touched {
    /// How many are too near.
    taken: u16,
    /// How many are near enough to cost, and how many are nearer than half of that.
    near: [u16; 2],
    /// What steps into it cost without them.
    walls_extra: [u8; 8],
}

impl Costs {
    /// Whether what an observed obstacle changes around it is few enough cells of this size.
    pub(crate) fn are_fit_for(&self, resolution_m: f64) -> bool {
        self.obstacle_reach_m() / resolution_m <= REACH_MAX
    }

    /// How far from an observed obstacle cells cost, in metres.
    pub(crate) fn obstacle_reach_m(&self) -> f64 {
        self.robot_radius_m + self.obstacle_margin_m + OBSTACLE_BAND_M
    }
}

/// The inflated grid of a floor with the costs of its steps.
#[derive(Debug, Clone)]
pub struct Field {
    grid: Grid,
    /// Distance to the nearest wall, in metres.
    wall_m: Vec<f32>,
    robot_radius_m: f64,
    has_costs: bool,
    clearance_weight: f64,
    /// What blocks each cell: `BY_WALLS`, `BY_OBSTACLES`.
    blocked: Vec<u8>,
    /// Which of the eight moves are open in each cell.
    moves: Vec<u8>,
    /// What steps into a cell cost in addition, by direction, in sixteenths; empty without costs.
    extra: Vec<[u8; 8]>,
    /// Around observed obstacles: what has become of the cells. Of a building there are few.
    touched: HashMap<usize, Touched>,
    /// Cells around an observed obstacle that are taken, and those beyond that are near.
    taken_disc: Vec<(i32, i32)>,
    near_discs: [Vec<(i32, i32)>; 2],
}

impl Field {
    /// Inflates the grid by the robot's true radius and works out the costs.
    pub fn new(grid: Grid, costs: &Costs) -> Self {
        let wall_m: Vec<f32> =
            grid.distances().into_iter().map(|cells| cells * grid.resolution_m() as f32).collect();
        let is_inflated =
            |cell: usize| grid.is_occupied(cell) || f64::from(wall_m[cell]) < costs.robot_radius_m;
        let blocked: Vec<u8> =
            (0..grid.len()).map(|cell| if is_inflated(cell) { BY_WALLS } else { 0 }).collect();
        let has_costs = costs.keep_right_weight > 0.0 || costs.clearance_weight > 0.0;
        let extra = if has_costs { extras(&grid, &wall_m, costs) } else { Vec::new() };
        let taken_m = costs.robot_radius_m + costs.obstacle_margin_m;
        let near_m = taken_m + OBSTACLE_BAND_M;
        let taken_disc = disc(0.0, taken_m, grid.resolution_m());
        let middle_m = 0.5 * (taken_m + near_m);
        let near_discs = [middle_m, near_m].map(|to_m| disc(taken_m, to_m, grid.resolution_m()));
        let mut field = Self {
            moves: vec![0; grid.len()],
            extra,
            touched: HashMap::new(),
            robot_radius_m: costs.robot_radius_m,
            clearance_weight: costs.clearance_weight,
            grid,
            wall_m,
            has_costs,
            blocked,
            taken_disc,
            near_discs,
        };
        for row in 0..field.grid.height() as i64 {
            field.update_moves(row, 0, field.grid.width() as i64 - 1);
        }
        field
    }

    /// The grid below.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The radius by which it is inflated.
    pub fn robot_radius_m(&self) -> f64 {
        self.robot_radius_m
    }

    /// Length of flat arrays.
    pub fn len(&self) -> usize {
        self.grid.len()
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.grid.is_empty()
    }

    /// From one row to the next in flat arrays.
    pub fn stride(&self) -> usize {
        self.grid.stride()
    }

    /// The step in flat arrays for each direction.
    pub fn offsets(&self) -> [isize; 8] {
        self.grid.offsets()
    }

    /// Whether steps cost more than their length anywhere.
    pub fn has_costs(&self) -> bool {
        self.has_costs
    }

    /// Whether the robot's middle may not be in a cell, because of walls or of observed obstacles.
    pub fn is_blocked(&self, cell: usize) -> bool {
        self.blocked[cell] != 0
    }

    /// Distance from a cell's middle to the nearest wall, in metres.
    pub fn wall_m(&self, cell: usize) -> f64 {
        f64::from(self.wall_m[cell])
    }

    /// The open moves of each cell, a bit for each direction.
    pub(crate) fn moves(&self) -> &[u8] {
        &self.moves
    }

    /// The extra cost of steps into each cell.
    pub(crate) fn extra(&self) -> &[[u8; 8]] {
        &self.extra
    }

    /// Cost of driving straight from one point to another, in units of cells; `None` when it touches a
    /// blocked cell.
    pub fn line_cost(&self, from: [f64; 2], to: [f64; 2]) -> Option<f64> {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy);
        // Between two of the eight directions the extra cost is interpolated.
        let eighths = dy.atan2(dx) / std::f64::consts::FRAC_PI_4;
        let (below, beyond) = (eighths.floor(), eighths - eighths.floor());
        let direction = (below as i64).rem_euclid(8) as usize;
        let mut weighted = 0.0;
        let reached = line::pieces(from, to, |column, row, share| {
            let Some(cell) = self.grid.checked_index(column, row) else { return false };
            if self.is_blocked(cell) {
                return false;
            }
            if self.has_costs {
                let extra = &self.extra[cell];
                let (low, high) = (f64::from(extra[direction]), f64::from(extra[(direction + 1) % 8]));
                weighted += share * (low + (high - low) * beyond);
            }
            true
        });
        reached.then_some(length * (1.0 + weighted / f64::from(SIXTEENTHS)))
    }

    /// Puts an observed obstacle into a cell, or takes it away again.
    pub fn set_obstacle(&mut self, cell: usize, present: bool) {
        let (column, row) = self.grid.column_row(cell);
        let mut reach = 0;
        for at in 0..self.taken_disc.len() {
            let (dx, dy) = self.taken_disc[at];
            reach = reach.max(i64::from(dy));
            if let Some(other) = self.grid.checked_index(column + i64::from(dx), row + i64::from(dy)) {
                self.touch(other, |touched| count(&mut touched.taken, present));
            }
        }
        for ring in 0..self.near_discs.len() {
            for at in 0..self.near_discs[ring].len() {
                let (dx, dy) = self.near_discs[ring][at];
                if let Some(other) = self.grid.checked_index(column + i64::from(dx), row + i64::from(dy)) {
                    self.touch(other, |touched| count(&mut touched.near[ring], present));
                }
            }
        }
        for other_row in row - reach - 1..=row + reach + 1 {
            self.update_moves(other_row, column - reach - 1, column + reach + 1);
        }
    }

    /// Changes what obstacles do to a cell.
    fn touch(&mut self, cell: usize, change: impl Fn(&mut Touched)) {
        let walls_extra = self.extra.get(cell).copied().unwrap_or_default();
        let touched = self.touched.entry(cell).or_insert(Touched { walls_extra, ..Touched::default() });
        change(touched);
        let Touched { taken, near, walls_extra } = *touched;
        self.blocked[cell] &= !BY_OBSTACLES;
        self.blocked[cell] |= if taken > 0 { BY_OBSTACLES } else { 0 };
        if let Some(extra) = self.extra.get_mut(cell) {
            let rings = near.iter().filter(|&&ring| ring > 0).count();
            let beside = self.clearance_weight as f32 * 0.25 * rings as f32 * SIXTEENTHS;
            *extra = walls_extra.map(|walls| walls.saturating_add(beside as u8));
        }
        if taken == 0 && near == [0, 0] {
            self.touched.remove(&cell);
        }
    }

    /// Works out the open moves of a part of a row: into free cells, diagonally only past two free cells.
    fn update_moves(&mut self, row: i64, first: i64, last: i64) {
        if row < 0 || row >= self.grid.height() as i64 {
            return;
        }
        let offsets = self.grid.offsets();
        for column in first.max(0)..=last.min(self.grid.width() as i64 - 1) {
            let cell = self.grid.index(column as usize, row as usize);
            let free = |direction: usize| !self.is_blocked(cell.wrapping_add_signed(offsets[direction % 8]));
            let mut open = 0_u8;
            if !self.is_blocked(cell) {
                for direction in (0..8).step_by(2) {
                    open |= u8::from(free(direction)) << direction;
                }
                for direction in (1..8).step_by(2) {
                    let passes = free(direction - 1) && free(direction + 1) && free(direction);
                    open |= u8::from(passes) << direction;
                }
            }
            self.moves[cell] = open;
        }
    }
}

fn count(value: &mut u16, present: bool) {
    *value = if present { value.saturating_add(1) } else { value.saturating_sub(1) };
}

/// The cells whose middles lie at `from_m` or farther, and nearer than `to_m`; the first disc holds its own
/// middle.
fn disc(from_m: f64, to_m: f64, resolution_m: f64) -> Vec<(i32, i32)> {
    let reach = (to_m / resolution_m).ceil() as i32;
    let cells = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
    cells
        .filter(|&(dx, dy)| {
            let away_m = f64::from(dx).hypot(f64::from(dy)) * resolution_m;
            away_m >= from_m && (away_m < to_m || (dx, dy) == (0, 0))
        })
        .collect()
}

/// The extra cost of steps by direction: for leaving the lane, and for nearness to walls.
fn extras(grid: &Grid, wall_m: &[f32], costs: &Costs) -> Vec<[u8; 8]> {
    let band_m = (costs.clearance_m - costs.robot_radius_m).max(grid.resolution_m());
    let close = |cell: usize| {
        let missing_m = (costs.clearance_m - f64::from(wall_m[cell])).clamp(0.0, band_m);
        costs.clearance_weight * missing_m / band_m
    };
    // The conversion saturates: far beyond any sensible weight.
    let sixteenths = |all: f64| (all as f32 * SIXTEENTHS).round() as u8;
    let mut extra: Vec<[u8; 8]> = (0..grid.len()).map(|cell| [sixteenths(close(cell)); 8]).collect();
    if costs.keep_right_weight > 0.0 {
        lane::beside_lane(grid, costs.lane_m, costs.hallway_width_max_m, |cell, beside_m| {
            let close = close(cell);
            extra[cell] =
                beside_m.map(|beside_m| sixteenths(costs.keep_right_weight * f64::from(beside_m) + close));
        });
    }
    extra
}
