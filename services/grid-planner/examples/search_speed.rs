//! Milliseconds a search on an office of 1000 x 1000 cells of 5 cm, over long distances:
//! `cargo run --release -p grid-planner --example search_speed`.

use grid_planner::{Algorithm, Costs, Field, Grid, Params, Question, Router, Search};
use std::time::Instant;

/// Rooms of 5 m by 4 m with doors, and boxes in them, from a fixed sequence of numbers.
fn office(cells: usize) -> Grid {
    let mut state = 7_u64;
    let mut draw = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % below) as i64
    };
    let end = cells as i64;
    let mut gaps = Vec::new();
    for x in (100..end).step_by(100) {
        for y in (0..end).step_by(80) {
            let at = y + 10 + draw(40);
            gaps.extend((at..at + 22).map(|row| (x, row)));
        }
    }
    for y in (80..end).step_by(80) {
        for x in (0..end).step_by(100) {
            let at = x + 10 + draw(60);
            gaps.extend((at..at + 22).map(|column| (column, y)));
        }
    }
    let mut free = Grid::new(cells, cells, 0.05, [0.0, 0.0]);
    let open: std::collections::HashSet<_> = gaps.into_iter().collect();
    for row in 0..end {
        for column in 0..end {
            if (column % 100 == 0 || row % 80 == 0) && !open.contains(&(column, row)) {
                free.occupy(column, row);
            }
        }
    }
    for _ in 0..400 {
        let (x, y) = (draw(cells as u64), draw(cells as u64));
        for cell in 0..36 {
            free.occupy(x + cell % 6, y + cell / 6);
        }
    }
    free
}

#[expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
fn main() {
    let plain = Costs {
        robot_radius_m: 0.2,
        obstacle_margin_m: 0.0,
        keep_right_weight: 0.0,
        lane_m: 0.5,
        hallway_width_max_m: 2.0,
        clearance_weight: 0.0,
        clearance_m: 0.0,
    };
    println!("{:28} {:>8} {:>10} {:>12} {:>10}", "field", "solved", "ms/search", "expanded", "M/s");
    for (name, costs) in
        [("eight neighbours, length", plain), ("lanes and clearance", Params::default().costs())]
    {
        let began = Instant::now();
        let field = Field::new(office(1000), &costs);
        let built_ms = began.elapsed().as_secs_f64() * 1e3;
        let free: Vec<usize> = (0..1000 * 1000)
            .map(|cell| field.grid().index(cell % 1000, cell / 1000))
            .filter(|&cell| !field.is_blocked(cell))
            .collect();
        let pairs: Vec<(usize, usize)> = (0..200)
            .map(|k| {
                (free[k * 7919 % (free.len() / 6)], free[free.len() - 1 - k * 104_729 % (free.len() / 6)])
            })
            .collect();
        let mut search = Search::default();
        let mut router = Router::default();
        for any_angle in [false, true] {
            let (mut solved, mut expanded) = (0, 0);
            let began = Instant::now();
            for &(from, to) in &pairs {
                if any_angle {
                    let place = |cell| field.grid().to_map(field.grid().centre(cell));
                    let question = Question {
                        start_m: place(from),
                        goal_m: place(to),
                        tolerance_m: 0.0,
                        escape_m: 0.0,
                        spacing_m: 0.4,
                        algorithm: Algorithm::AnyAngle,
                    };
                    solved += usize::from(router.plan(&field, &question) == messages::PlanStateName::Found);
                    expanded += router.expanded();
                } else {
                    solved += usize::from(search.find(&field, from, to).is_some());
                    expanded += search.expanded();
                }
            }
            let seconds = began.elapsed().as_secs_f64();
            let name = format!("{name}{}", if any_angle { ", any angle" } else { "" });
            let count = pairs.len() as f64;
            println!(
                "{name:28} {solved:8} {:10.3} {:12.0} {:10.1}",
                seconds * 1e3 / count,
                expanded as f64 / count,
                expanded as f64 / seconds / 1e6
            );
        }
        println!("{:28} {built_ms:.1} ms to build", "");
    }
}
