//! Cases for the planner, one line each where it goes.

mod movingai;
mod service;

use crate::grid::DIRECTIONS;
use crate::queue::BucketQueue;
use crate::{
    Algorithm, Costs, DIAGONAL, Field, Grid, GridPlanner, Params, Question, Router, STRAIGHT, Search, lane,
    line,
};
use messages::{PlanStateName, Waypoint};
use proptest::prelude::*;
use std::f64::consts::SQRT_2;

/// Costs of nothing but length, for a robot without extent.
const PLAIN: Costs = Costs {
    robot_radius_m: 0.0,
    obstacle_margin_m: 0.0,
    keep_right_weight: 0.0,
    lane_m: 0.555,
    hallway_width_max_m: 2.5,
    clearance_weight: 0.0,
    clearance_m: 0.0,
};

/// A grid with cells of 1 m from text, the first line on top.
fn grid_of(rows: &[&str]) -> Grid {
    let height = rows.len();
    let mut grid = Grid::new(rows[0].len(), height, 1.0, [0.0, 0.0]);
    for (row, text) in rows.iter().rev().enumerate() {
        for (column, symbol) in text.bytes().enumerate() {
            if symbol != b'.' {
                grid.occupy(column as i64, row as i64);
            }
        }
    }
    grid
}

/// Length of the shortest path in cells, from the cells of the search.
fn search_length(field: &Field, from: (usize, usize), to: (usize, usize)) -> Option<f64> {
    let (from, to) = (field.grid().index(from.0, from.1), field.grid().index(to.0, to.1));
    let mut search = Search::default();
    let cells = search.find(field, from, to)?.to_vec();
    assert_eq!((cells[0], cells[cells.len() - 1]), (from as u32, to as u32));
    Some(steps_length(field, &cells))
}

/// Length of a chain of cells; each step must be one of the eight, and cut no corner.
fn steps_length(field: &Field, cells: &[u32]) -> f64 {
    let offsets = field.offsets();
    let step = |pair: &[u32]| {
        let offset = pair[1] as isize - pair[0] as isize;
        let direction = offsets.iter().position(|&other| other == offset).expect("a step to a neighbour");
        assert!(field.moves()[pair[0] as usize] & (1 << direction) != 0, "a step that is not open");
        if direction.is_multiple_of(2) { 1.0 } else { SQRT_2 }
    };
    cells.windows(2).map(step).sum()
}

#[track_caller]
fn check_length(rows: &[&str], from: (usize, usize), to: (usize, usize), expected: Option<f64>) {
    let field = Field::new(grid_of(rows), &PLAIN);
    let found = search_length(&field, from, to);
    assert_eq!(found.is_some(), expected.is_some(), "{found:?}");
    assert!((found.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1e-9, "{found:?} {expected:?}");
}

#[test]
fn shortest_paths_by_hand() {
    check_length(&["..."], (0, 0), (2, 0), Some(2.0));
    check_length(&["..."], (1, 0), (1, 0), Some(0.0));
    check_length(&["..", ".."], (0, 0), (1, 1), Some(SQRT_2));
    check_length(&["#.", ".."], (0, 0), (1, 1), Some(2.0));
    check_length(&["#.", ".#"], (0, 0), (1, 1), None);
    check_length(&[".#.", ".#.", ".#."], (0, 0), (2, 0), None);
    check_length(&["...", ".#.", ".#."], (0, 0), (2, 0), Some(6.0));
    check_length(&["..#"], (0, 0), (2, 0), None);
    check_length(&["#.."], (0, 0), (2, 0), None);
}

#[track_caller]
fn check_line(from: [f64; 2], to: [f64; 2], expected: &[(i64, i64)]) {
    let mut seen = Vec::new();
    let mut share = 0.0;
    assert!(line::pieces(from, to, |column, row, part| {
        seen.push((column, row));
        share += part;
        true
    }));
    assert_eq!(seen, expected);
    assert!((share - 1.0).abs() < 1e-9, "the shares add up to {share}");
}

#[test]
fn lines_touch_every_cell_on_their_way() {
    check_line([0.5, 0.5], [0.6, 0.5], &[(0, 0)]);
    check_line([0.5, 0.5], [2.5, 0.5], &[(0, 0), (1, 0), (2, 0)]);
    check_line([2.5, 0.5], [0.5, 0.5], &[(2, 0), (1, 0), (0, 0)]);
    check_line([0.5, 0.5], [0.5, -1.5], &[(0, 0), (0, -1), (0, -2)]);
    check_line([0.5, 0.5], [1.5, 1.5], &[(0, 0), (1, 0), (0, 1), (1, 1)]);
    check_line([0.5, 0.5], [2.5, 1.5], &[(0, 0), (1, 0), (1, 1), (2, 1)]);
}

#[test]
fn distances_are_exact() {
    let grid = grid_of(&["....#", ".....", "#...."]);
    let distances = grid.distances();
    for cell in (0..3).flat_map(|row| (0..5).map(move |column| (column, row))) {
        let (column, row) = (cell.0 as f32, cell.1 as f32);
        let exact = column.hypot(row).min((column - 4.0).hypot(row - 2.0));
        assert!((distances[grid.index(cell.0, cell.1)] - exact).abs() < 1e-5, "{cell:?}");
    }
}

#[test]
fn obstacles_come_and_go_without_a_trace() {
    let mut field = Field::new(grid_of(&[".........."; 10]), &Costs { robot_radius_m: 2.0, ..PLAIN });
    let (untouched, cell) = (field.moves().to_vec(), field.grid().index(5, 5));
    field.set_obstacle(cell, true);
    field.set_obstacle(cell + 1, true);
    assert!(field.is_blocked(cell) && field.is_blocked(cell - 1) && !field.is_blocked(cell - 3));
    field.set_obstacle(cell, false);
    assert!(field.is_blocked(cell), "still too near to the other one");
    field.set_obstacle(cell + 1, false);
    assert_eq!(field.moves(), untouched);
}

#[test]
fn what_obstacles_cost_goes_with_them() {
    let costs = Costs { clearance_weight: 4.0, clearance_m: 3.0, keep_right_weight: 1.0, ..PLAIN };
    let mut field = Field::new(grid_of(&["#.........", "..........", ".........."]), &costs);
    let (untouched, cell) = (field.extra().to_vec(), field.grid().index(5, 1));
    field.set_obstacle(cell, true);
    assert_ne!(field.extra(), untouched);
    field.set_obstacle(cell + 1, true);
    field.set_obstacle(cell, false);
    field.set_obstacle(cell + 1, false);
    assert_eq!(field.extra(), untouched);
    // One that was never there takes nothing away.
    field.set_obstacle(cell, false);
    assert_eq!(field.extra(), untouched);
}

#[test]
fn maps_that_would_need_too_much_are_refused_by_their_heads() {
    let folder = tempfile::tempdir().unwrap();
    let map = |head: &str, resolution: f64| {
        std::fs::write(folder.path().join("m.pgm"), head).unwrap();
        let yaml = folder.path().join("m.yaml");
        let text = format!(
            "image: m.pgm\nresolution: {resolution}\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
        );
        std::fs::write(&yaml, text).unwrap();
        GridPlanner::check(&Params { map: yaml.to_string_lossy().into_owned(), ..Params::default() })
    };
    map("P5 5800 5800 255\n", 0.05).unwrap();
    let refused = |head: &str, resolution: f64, words: &str| {
        let error = map(head, resolution).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused("P5 5900 5900 255\n", 0.05, "needs 34810000 cells of 0.05 m, and 34000000 are possible");
    refused("P5 100 100 255\n", 0.001, "m.yaml has cells of 0.001 m: what robot_radius_m");
    refused("P5 9000 9000 255\n", 0.05, "a grid of 9000 x 9000 cells");
    refused("P5", 0.05, "it is no image that can be read");
    let world = "name = \"w\"\n[[floor]]\nnumber = 1\nwalls = [[[0, 0], [90, 90]]]\n[[floor]]\nnumber = 2\nwalls = [[[0, 0], [9, 9]]]\n";
    let file = folder.path().join("w.toml");
    std::fs::write(&file, world).unwrap();
    let params = |resolution_m| Params {
        world: file.to_string_lossy().into_owned(),
        resolution_m,
        ..Params::default()
    };
    GridPlanner::check(&params(0.05)).unwrap();
    let error = GridPlanner::check(&params(0.01)).unwrap_err().to_string();
    assert!(error.contains("w.toml needs 83810000 cells of 0.01 m"), "{error}");
}

/// A piece of hallway like that of the coffee robot: 20 m long, 1.7 m wide, along x.
fn hallway() -> Grid {
    let (left, right) = ([[-1.0, 0.85], [21.0, 0.85]], [[-1.0, -0.85], [21.0, -0.85]]);
    Grid::from_segments(
        &[left, right, [[-1.0, -0.85], [-1.0, 0.85]], [[21.0, -0.85], [21.0, 0.85]]],
        0.05,
        0.5,
    )
}

fn route(
    field: &Field,
    from: [f64; 2],
    to: [f64; 2],
    algorithm: Algorithm,
) -> (PlanStateName, Vec<Waypoint>) {
    let params = Params::default();
    let (escape_m, spacing_m) = (params.escape_m, params.waypoint_spacing_m);
    let question = Question { start_m: from, goal_m: to, tolerance_m: 0.1, escape_m, spacing_m, algorithm };
    let mut router = Router::default();
    let state = router.plan(field, &question);
    (state, router.waypoints().to_vec())
}

/// Height of a path over a place of the hallway.
fn y_at(path: &[Waypoint], x_m: f64) -> f64 {
    let on = |ends: &&[Waypoint]| ends[0].x_m.min(ends[1].x_m) <= x_m && x_m <= ends[0].x_m.max(ends[1].x_m);
    let ends = path.windows(2).find(on).expect("the path passes there");
    ends[0].y_m + (ends[1].y_m - ends[0].y_m) * (x_m - ends[0].x_m) / (ends[1].x_m - ends[0].x_m)
}

#[track_caller]
fn check_keeps_right(from: [f64; 2], to: [f64; 2], algorithm: Algorithm) {
    let field = Field::new(hallway(), &Params::default().costs());
    let (state, path) = route(&field, from, to, algorithm);
    assert_eq!(state, PlanStateName::Found);
    let side = if to[0] > from[0] { 1.0 } else { -1.0 };
    for x_m in [5.0, 8.0, 10.0, 12.0, 15.0] {
        // Between the robot's right side and the wall.
        let gap_m = 0.85 + side * y_at(&path, x_m) - 0.255;
        assert!((0.25..=0.35).contains(&gap_m), "{gap_m} m at {x_m} m: {path:?}");
    }
}

#[test]
fn keeps_to_the_right() {
    check_keeps_right([0.0, 0.0], [20.0, 0.0], Algorithm::AnyAngle);
    check_keeps_right([20.0, 0.0], [0.0, 0.0], Algorithm::AnyAngle);
    check_keeps_right([0.0, 0.5], [20.0, 0.5], Algorithm::AnyAngle);
    check_keeps_right([0.0, -0.5], [20.0, 0.4], Algorithm::AnyAngle);
    check_keeps_right([0.0, 0.0], [20.0, 0.0], Algorithm::EightConnected);
    check_keeps_right([20.0, 0.5], [0.0, 0.0], Algorithm::EightConnected);
}

#[test]
fn few_corners_in_a_straight_hallway() {
    let field = Field::new(hallway(), &Params::default().costs());
    let (_, path) = route(&field, [0.0, 0.0], [20.0, 0.0], Algorithm::AnyAngle);
    assert!(path.len() <= 8, "{path:?}");
}

#[test]
fn passes_an_obstacle_on_the_left_and_comes_back() {
    let mut field = Field::new(hallway(), &Params::default().costs());
    for y in [-0.8, -0.7, -0.6, -0.5, -0.45] {
        let cell = field.grid().index_at(10.0, y).unwrap();
        field.set_obstacle(cell, true);
    }
    let (_, path) = route(&field, [0.0, -0.3], [20.0, -0.3], Algorithm::AnyAngle);
    assert!(y_at(&path, 10.0) > -0.45 + 0.35, "{path:?}");
    assert!((y_at(&path, 5.0) + 0.3).abs() < 0.1 && (y_at(&path, 15.0) + 0.3).abs() < 0.1, "{path:?}");
}

#[track_caller]
fn check_state(from: [f64; 2], to: [f64; 2], expected: PlanStateName) -> Vec<Waypoint> {
    let field = Field::new(hallway(), &Params::default().costs());
    let (state, path) = route(&field, from, to, Algorithm::AnyAngle);
    assert_eq!(state, expected, "{path:?}");
    assert_eq!(path.is_empty(), expected != PlanStateName::Found);
    path
}

#[test]
fn what_cannot_be_planned_is_answered() {
    check_state([0.0, 0.0], [20.0, 0.0], PlanStateName::Found);
    check_state([0.0, 0.0], [0.0, 0.0], PlanStateName::Found);
    check_state([0.0, 0.0], [20.0, 0.85], PlanStateName::InvalidGoal);
    check_state([0.0, 0.0], [200.0, 0.0], PlanStateName::InvalidGoal);
    check_state([0.0, 0.0], [f64::NAN, 0.0], PlanStateName::InvalidGoal);
    check_state([0.0, 0.0], [20.0, 1.3], PlanStateName::Unreachable);
    check_state([90.0, 0.0], [20.0, 0.0], PlanStateName::NoStart);
    check_state([f64::INFINITY, 0.0], [20.0, 0.0], PlanStateName::NoStart);
}

#[test]
fn a_room_that_nothing_leads_to_is_unreachable() {
    let mut walls = vec![[[-1.0, -2.0], [9.0, -2.0]], [[9.0, -2.0], [9.0, 2.0]], [[9.0, 2.0], [-1.0, 2.0]]];
    walls.extend([[[-1.0, 2.0], [-1.0, -2.0]], [[4.0, -2.0], [4.0, 2.0]]]);
    let field = Field::new(Grid::from_segments(&walls, 0.05, 0.5), &Params::default().costs());
    assert_eq!(route(&field, [0.0, 0.0], [8.0, 0.0], Algorithm::AnyAngle).0, PlanStateName::Unreachable);
}

#[test]
fn a_start_too_near_to_a_wall_is_left_the_short_way() {
    let path = check_state([0.0, 0.75], [10.0, 0.0], PlanStateName::Found);
    assert_eq!((path[0].x_m, path[0].y_m), (0.0, 0.75));
    assert!(path[1].y_m < 0.6 && path[1].y_m > 0.4, "straight away from the wall: {path:?}");
}

#[test]
fn a_blocked_goal_is_replaced_within_its_tolerance() {
    let path = check_state([0.0, 0.0], [10.0, 0.60], PlanStateName::Found);
    let end = path[path.len() - 1];
    assert!((end.x_m - 10.0).hypot(end.y_m - 0.60) <= 0.15, "{end:?}");
}

fn random_grid() -> impl Strategy<Value = (Grid, usize, usize)> {
    (3_usize..14, 3_usize..14, any::<u64>(), 0_u64..45).prop_map(|(width, height, seed, percent)| {
        let mut grid = Grid::new(width, height, 1.0, [0.0, 0.0]);
        let mut state = seed;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        for cell in 0..width * height {
            if draw() % 100 < percent {
                grid.occupy((cell % width) as i64, (cell / width) as i64);
            }
        }
        let (from, to) = (draw() as usize % (width * height), draw() as usize % (width * height));
        let index = |cell: usize| grid.index(cell % width, cell / width);
        let (from, to) = (index(from), index(to));
        (grid, from, to)
    })
}

/// The least cost by Dijkstra's algorithm of another crate.
fn oracle(field: &Field, from: usize, to: usize) -> Option<u32> {
    if field.is_blocked(from) || field.is_blocked(to) {
        return None;
    }
    let neighbours = |&cell: &usize| {
        let offsets = field.offsets();
        let open = field.moves()[cell];
        (0..8)
            .filter(|direction| open & (1 << direction) != 0)
            .map(move |direction| {
                let next = cell.wrapping_add_signed(offsets[direction]);
                let step = if direction.is_multiple_of(2) { STRAIGHT } else { DIAGONAL };
                let extra = field.extra().get(next).map_or(0, |extra| u32::from(extra[direction]));
                (next, step + ((step * extra) >> 4))
            })
            .collect::<Vec<_>>()
    };
    pathfinding::prelude::dijkstra(&from, neighbours, |&cell| cell == to).map(|(_, cost)| cost)
}

fn cost_of(field: &Field, cells: &[u32]) -> u32 {
    let cost = |pair: &[u32]| {
        let offset = pair[1] as isize - pair[0] as isize;
        let direction = field.offsets().iter().position(|&other| other == offset).expect("a neighbour");
        let step = if direction.is_multiple_of(2) { STRAIGHT } else { DIAGONAL };
        let extra = field.extra().get(pair[1] as usize).map_or(0, |extra| u32::from(extra[direction]));
        step + ((step * extra) >> 4)
    };
    cells.windows(2).map(cost).sum()
}

proptest! {
    #[test]
    fn runs_end_at_what_is_occupied(
        cells in prop::collection::vec(prop::bool::weighted(0.2), 1..90), width in 1_usize..12,
    ) {
        let height = cells.len().div_ceil(width);
        let mut grid = Grid::new(width, height, 1.0, [0.0, 0.0]);
        for (at, _) in cells.iter().enumerate().filter(|(_, occupied)| **occupied) {
            grid.occupy((at % width) as i64, (at / width) as i64);
        }
        let mut seen = 0;
        lane::Runs::new(&grid).rows(&grid, |cell, runs| {
            seen += 1;
            let (column, row) = grid.column_row(cell);
            for ((dx, dy), run) in DIRECTIONS.into_iter().zip(runs) {
                let ahead = |step: i64| grid.checked_index(column + step * i64::from(dx), row + step * i64::from(dy));
                let end = (0..).find(|&step| ahead(step).is_none_or(|cell| grid.is_occupied(cell))).unwrap();
                let expected = if ahead(end).is_none() { lane::FAR } else { end as u16 };
                assert_eq!(run, expected, "{column} {row} {dx} {dy}");
            }
        });
        prop_assert_eq!(seen, (0..grid.len()).filter(|&cell| !grid.is_occupied(cell)).count());
    }

    #[test]
    fn as_cheap_as_dijkstra((grid, from, to) in random_grid(), keep_right_weight in 0.0..5.0, plain in any::<bool>()) {
        let lanes = Costs { keep_right_weight, lane_m: 1.0, hallway_width_max_m: 4.0, clearance_weight: 1.0, clearance_m: 2.0, ..PLAIN };
        let field = Field::new(grid, if plain { &PLAIN } else { &lanes });
        let mut search = Search::default();
        let found = search.find(&field, from, to).map(|cells| cost_of(&field, cells));
        prop_assert_eq!(found, oracle(&field, from, to));
    }

    #[test]
    fn paths_are_free_and_no_shorter_than_straight((grid, from, to) in random_grid(), radius in 0.0..1.9, eight in any::<bool>()) {
        let field = Field::new(grid, &Costs { robot_radius_m: radius, ..PLAIN });
        let [start, goal] = [from, to].map(|cell| field.grid().centre(cell));
        let algorithm = if eight { Algorithm::EightConnected } else { Algorithm::AnyAngle };
        let mut router = Router::default();
        let question = Question { start_m: start, goal_m: goal, tolerance_m: 0.0, escape_m: 0.0, spacing_m: 0.0, algorithm };
        if router.plan(&field, &question) == PlanStateName::Found {
            let path = router.waypoints();
            let ends = [path[0], path[path.len() - 1]].map(|end| [end.x_m, end.y_m]);
            prop_assert_eq!(ends, [start, goal]);
            let straight = (goal[0] - start[0]).hypot(goal[1] - start[1]);
            prop_assert!(crate::length_m(path) >= straight - 1e-9);
            for ends in path.windows(2) {
                prop_assert!(field.line_cost([ends[0].x_m, ends[0].y_m], [ends[1].x_m, ends[1].y_m]).is_some());
            }
            let mut search = Search::default();
            let steps = steps_length(&field, search.find(&field, from, to).expect("found before"));
            prop_assert!(crate::length_m(path) <= steps + 1e-6);
        }
    }

    #[test]
    fn the_queue_gives_the_smallest(mut keys in proptest::collection::vec(0_u32..30_000, 1..200), base in 0_u32..1_000_000) {
        let mut queue = BucketQueue::default();
        queue.restart(base);
        let mut last = base;
        let mut taken = Vec::new();
        let first = keys.len().div_ceil(2);
        for &key in &keys[..first] {
            queue.push(base + key, base + key);
        }
        for key in &mut keys[first..] {
            last = queue.pop().expect("not empty yet");
            taken.push(last);
            *key += last - base;
            // What comes later may not lie below what was taken.
            queue.push(base + *key, base + *key);
        }
        while let Some(key) = queue.pop() {
            prop_assert!(key >= last);
            last = key;
            taken.push(key);
        }
        let mut expected: Vec<u32> = keys.iter().map(|key| base + key).collect();
        expected.sort_unstable();
        prop_assert_eq!(taken, expected);
    }

    #[test]
    fn distances_match_brute_force((grid, ..) in random_grid()) {
        let distances = grid.distances();
        let occupied: Vec<[f64; 2]> = (0..grid.height()).flat_map(|row| (0..grid.width()).map(move |column| (column, row)))
            .map(|(column, row)| grid.index(column, row)).filter(|&cell| grid.is_occupied(cell)).map(|cell| grid.centre(cell)).collect();
        for cell in (0..grid.height()).flat_map(|row| (0..grid.width()).map(move |column| (column, row))).map(|(column, row)| grid.index(column, row)) {
            let [x, y] = grid.centre(cell);
            let exact = occupied.iter().map(|other| (other[0] - x).hypot(other[1] - y)).fold(f64::INFINITY, f64::min);
            prop_assert!(exact > 1e5 && distances[cell] > 1e5 || (f64::from(distances[cell]) - exact).abs() < 1e-4);
        }
    }
}

#[test]
fn directions_turn_counter_clockwise() {
    for (direction, (dx, dy)) in DIRECTIONS.into_iter().enumerate() {
        let angle = f64::from(dy).atan2(f64::from(dx)).rem_euclid(std::f64::consts::TAU);
        assert!((angle - direction as f64 * std::f64::consts::FRAC_PI_4).abs() < 1e-9);
    }
}
