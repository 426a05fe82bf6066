use crate::{
    Cell, Grid, GridError, GridFrame, Occupancy, OccupancyGrid, Point2, Pose2, log_odds, probability,
};
use proptest::prelude::*;

fn frame(width: u32, height: u32, resolution_m: f64) -> GridFrame {
    GridFrame::new(width, height, resolution_m, Pose2::IDENTITY).expect("a good frame")
}

/// A map from text: `#` occupied, `?` unknown, the first line the uppermost row; cells of 1 m.
fn map(rows: &[&str]) -> OccupancyGrid {
    let cells = rows.iter().rev().flat_map(|row| row.chars()).map(|letter| match letter {
        '#' => Occupancy::OCCUPIED,
        '?' => Occupancy::UNKNOWN,
        _ => Occupancy::FREE,
    });
    let frame = frame(rows[0].len() as u32, rows.len() as u32, 1.0);
    Grid::new(frame, cells.collect()).expect("as many cells as the frame has")
}

#[test]
fn impossible_grids_are_refused() {
    let bad = |w, h, m, x| GridFrame::new(w, h, m, Pose2 { x_m: x, ..Pose2::IDENTITY }).expect_err("refused");
    assert_eq!(bad(0, 5, 0.1, 0.0), GridError::BadSize { width: 0, height: 5 });
    assert_eq!(bad(1 << 16, 1 << 16, 0.1, 0.0), GridError::BadSize { width: 1 << 16, height: 1 << 16 });
    assert!(matches!(bad(5, 5, f64::NAN, 0.0), GridError::BadResolution { .. }));
    assert!(matches!(bad(5, 5, 0.1, f64::INFINITY), GridError::BadOrigin { .. }));
    assert!(Grid::new(frame(2, 2, 1.0), vec![0; 3]).is_err());
}

#[test]
fn cells_lie_where_ros_puts_them() {
    let turned = GridFrame::new(10, 4, 0.5, Pose2::new(2.0, 3.0, std::f64::consts::FRAC_PI_2)).expect("good");
    let centre = turned.centre(Cell::new(3, 1));
    assert!((centre - Point2::new(2.0 - 0.75, 3.0 + 1.75)).norm() < 1e-12);
    assert_eq!(turned.cell_at(centre), Some(Cell::new(3, 1)));
    assert_eq!(turned.cell_at(Point2::new(2.1, 3.1)), None);
    assert_eq!(turned.cell_at(Point2::new(f64::NAN, 3.1)), None);
    assert_eq!(turned.index(Cell::new(3, 1)), Some(13));
    assert_eq!(turned.cell(13), Some(Cell::new(3, 1)));
    assert_eq!((turned.index(Cell::new(10, 1)), turned.cell(40)), (None, None));
}

#[test]
fn occupancy_keeps_what_ros_says() {
    assert_eq!(Occupancy::from_ros(-7), Occupancy::UNKNOWN);
    assert_eq!(Occupancy::from_ros(101), Occupancy::UNKNOWN);
    assert_eq!(Occupancy::from_probability(f64::NAN), Occupancy::UNKNOWN);
    assert_eq!(Occupancy::from_probability(0.654).percent(), Some(65));
    assert!(!Occupancy::UNKNOWN.is_occupied(0) && Occupancy::OCCUPIED.is_occupied(100));
    assert!((probability(log_odds(0.3)) - 0.3).abs() < 1e-12);
    assert!(probability(800.0) <= 1.0 && probability(-800.0) >= 0.0);
}

#[test]
fn lines_of_sight_do_not_cut_corners() {
    let rows = map(&["..#.", ".#..", "....", "?..."]);
    let sees = |a: (u32, u32), b: (u32, u32)| {
        let (a, b) = (Cell::new(a.0, a.1), Cell::new(b.0, b.1));
        assert_eq!(rows.is_in_sight(a, b, 65), rows.is_in_sight(b, a, 65));
        rows.is_in_sight(a, b, 65)
    };
    assert!(sees((0, 0), (3, 1)) && sees((0, 1), (0, 3)) && sees((2, 2), (2, 2)));
    assert!(!sees((1, 3), (2, 2)), "between two occupied cells that touch at a corner");
    assert!(!sees((0, 2), (1, 3)), "past the corner of one");
    assert!(!sees((0, 2), (3, 2)) && !sees((0, 0), (9, 9)));
}

#[test]
fn rays_stop_at_the_face_of_a_cell() {
    let rows = map(&["....#", "....#", "....."]);
    let cast = |x, y, heading_rad: f64| rows.cast_m(Point2::new(x, y), heading_rad, 100.0, 65);
    assert_eq!(cast(0.5, 1.5, 0.0), Some(3.5));
    assert_eq!(cast(-2.5, 1.5, 0.0), Some(6.5));
    assert_eq!(cast(4.5, 1.5, 2.0), Some(0.0));
    assert_eq!(cast(0.5, 0.5, 0.0), None);
    assert_eq!(cast(0.5, 1.5, f64::NAN), None);
    assert_eq!(rows.cast_m(Point2::new(0.5, 1.5), 0.0, 3.4, 65), None);
    assert_eq!(rows.cast_m(Point2::new(0.5, 1.5), 0.0, f64::INFINITY, 65), Some(3.5));
}

#[test]
fn inflation_reaches_exactly_the_radius() {
    let grown = map(&[".....", ".....", "..#..", "?....", "....."]).inflated(1.0, 65);
    assert_eq!(grown, map(&[".....", "..#..", ".###.", "?.#..", "....."]));
    assert!(map(&["...", "?.."]).distances_m(65).as_slice().iter().all(|m| m.is_infinite()));
}

fn grids() -> impl Strategy<Value = OccupancyGrid> {
    (1_u32..24, 1_u32..24, 0.0..0.4).prop_flat_map(|(width, height, share)| {
        let cell = prop::bool::weighted(share)
            .prop_map(|full| if full { Occupancy::OCCUPIED } else { Occupancy::FREE });
        let cells = prop::collection::vec(cell, (width * height) as usize);
        cells.prop_map(move |cells| Grid::new(frame(width, height, 0.05), cells).expect("as many"))
    })
}

proptest! {
    #[test]
    fn distances_are_those_of_brute_force(grid in grids()) {
        let distances = grid.distances_m(65);
        let full: Vec<_> = grid.frame().cells().filter(|&cell| grid.get(cell).is_some_and(|c| c.is_occupied(65))).collect();
        for cell in grid.frame().cells() {
            let squares = full.iter().map(|other| {
                let (x, y) = (i64::from(other.column) - i64::from(cell.column), i64::from(other.row) - i64::from(cell.row));
                x * x + y * y
            });
            let expected = squares.min().map_or(f32::INFINITY, |square| ((square as f64).sqrt() * 0.05) as f32);
            prop_assert_eq!(distances.get(cell).copied(), Some(expected));
        }
    }

    #[test]
    fn the_line_between_cells_is_what_it_touches(
        from in (0_u32..14, 0_u32..14), to in (0_u32..14, 0_u32..14),
    ) {
        let (from, to) = (Cell::new(from.0, from.1), Cell::new(to.0, to.1));
        let frame = frame(14, 14, 1.0);
        let mut found: Vec<_> = frame.cells_between(from, to).collect();
        prop_assert_eq!((found.first(), found.last()), (Some(&from), Some(&to)));
        found.sort();
        // In whole numbers: the line from middle to middle touches the closed square of a cell when no axis
        // separates them.
        let (ax, ay) = (i64::from(2 * from.column) + 1, i64::from(2 * from.row) + 1);
        let (bx, by) = (i64::from(2 * to.column) + 1, i64::from(2 * to.row) + 1);
        let mut expected: Vec<_> = frame.cells().filter(|cell| {
            let (cx, cy) = (i64::from(2 * cell.column) + 1, i64::from(2 * cell.row) + 1);
            let apart = |c: i64, a: i64, b: i64| c + 1 < a.min(b) || c - 1 > a.max(b);
            let side = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).abs();
            !apart(cx, ax, bx) && !apart(cy, ay, by) && side <= (bx - ax).abs() + (by - ay).abs()
        }).collect();
        expected.sort();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn walks_go_from_end_to_end_without_a_jump(
        a in (-3.0..17.0, -3.0..17.0), b in (-3.0..17.0, -3.0..17.0), turn in -4.0..4.0,
    ) {
        let frame = GridFrame::new(14, 14, 1.0, Pose2::new(1.0, -2.0, turn)).expect("good");
        let (from, to) = (frame.from_cells(Point2::new(a.0, a.1)), frame.from_cells(Point2::new(b.0, b.1)));
        let walked: Vec<_> = frame.cells_along(from, to).collect();
        for pair in walked.windows(2) {
            prop_assert_eq!(pair[0].column.abs_diff(pair[1].column) + pair[0].row.abs_diff(pair[1].row), 1);
        }
        if let Some(first) = frame.cell_at(from) { prop_assert_eq!(walked.first(), Some(&first)); }
        if let Some(last) = frame.cell_at(to) { prop_assert_eq!(walked.last(), Some(&last)); }
        for i in 0..=200 {
            let point = from + (to - from) * (f64::from(i) / 200.0);
            let place = frame.to_cells(point);
            let clear = [place.x, place.y].iter().all(|value| (value - value.round()).abs() > 1e-9);
            if let Some(cell) = frame.cell_at(point).filter(|_| clear) { prop_assert!(walked.contains(&cell)); }
        }
    }
}
