//! Optimality on the Moving AI Lab's grids (Sturtevant 2012, "Benchmarks for grid-based pathfinding").

use super::{PLAIN, steps_length};
use crate::{Field, Grid, Search};
use std::path::Path;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/movingai");

/// Every `stride`-th problem of a map, with the known optimal lengths.
fn check_optimal(map: &str, stride: usize, tolerance: f64) {
    let folder = Path::new(FOLDER);
    let (Ok(text), Ok(problems)) = (
        std::fs::read_to_string(folder.join(map)),
        std::fs::read_to_string(folder.join(format!("{map}.scen"))),
    ) else {
        println!("skipped: {map} is not in ../shared/data/movingai");
        return;
    };
    let rows: Vec<&str> = text.lines().skip(4).collect();
    let mut grid = Grid::new(rows[0].len(), rows.len(), 1.0, [0.0, 0.0]);
    for (row, line) in rows.iter().enumerate() {
        for (column, symbol) in line.bytes().enumerate() {
            if !b".GS".contains(&symbol) {
                grid.occupy(column as i64, row as i64);
            }
        }
    }
    let field = Field::new(grid, &PLAIN);
    let mut search = Search::default();
    let mut solved = 0;
    for problem in problems.lines().skip(1).filter(|line| !line.is_empty()).step_by(stride) {
        let words: Vec<&str> = problem.split_whitespace().collect();
        let number = |at: usize| words[at].parse::<usize>().unwrap();
        let (from, to) = (field.grid().index(number(4), number(5)), field.grid().index(number(6), number(7)));
        let optimal: f64 = words[8].parse().unwrap();
        // The file holds six digits.
        let tolerance = if optimal < 1000.0 { tolerance } else { tolerance.max(5e-3) };
        let found = search.find(&field, from, to).map(<[u32]>::to_vec).expect("every problem has a solution");
        let length = steps_length(&field, &found);
        assert!((length - optimal).abs() <= tolerance, "{map}: {problem}: {length} instead of {optimal}");
        solved += 1;
    }
    println!("{map}: {solved} optimal");
}

#[test]
fn rooms() {
    check_optimal("8room_000.map", 7, 1e-3);
}

#[test]
fn games() {
    check_optimal("arena.map", 1, 1e-3);
    check_optimal("brc202d.map", 9, 1e-3);
    check_optimal("den312d.map", 1, 1e-3);
}

#[test]
fn mazes() {
    check_optimal("maze512-32-0.map", 40, 5e-3);
}

#[test]
fn random() {
    check_optimal("random512-10-0.map", 7, 1e-3);
}
