//! Which cells of which rows have their middles inside a polygon: found along the polygon's edges, not cell
//! by cell.

use crate::sectors::Point;

/// Crossings that have room in a row; more are kept elsewhere, and cost more.
const ROOM: usize = 15;

/// The columns where a polygon's edges cross the middle of one row.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    count: u32,
    columns: [u32; ROOM],
}

/// The crossings of a polygon's edges with the middles of the rows; its memory is kept for the next polygon.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spans {
    rows: Vec<Row>,
    /// Row and column of crossings that found no room.
    more: Vec<(u32, u32)>,
    crowded: Vec<u32>,
}

impl Spans {
    /// Calls `fill(row, first column, column behind the last)` for every run of cells inside, each cell at
    /// most once. A middle on an edge belongs to what lies to its right.
    pub(crate) fn visit(
        &mut self,
        polygon: &[Point],
        [columns, rows]: [u32; 2],
        mut fill: impl FnMut(usize, usize, usize),
    ) {
        let Some(&last) = polygon.last() else { return };
        let (lowest, end) = polygon.iter().fold((rows, 0), |(lowest, end), point| {
            let row = row_from(point[1], rows);
            (lowest.min(row), end.max(row))
        });
        self.rows.resize(self.rows.len().max(end as usize), Row::default());
        let crossed = &mut self.rows[lowest.min(end) as usize..end as usize];
        crossed.iter_mut().for_each(|row| row.count = 0);
        self.more.clear();
        let (mut from, mut from_row) = (last, row_from(last[1], rows));
        for &to in polygon {
            let to_row = row_from(to[1], rows);
            let (low, low_row, high_row) =
                if from_row < to_row { (from, from_row, to_row) } else { (to, to_row, from_row) };
            if low_row != high_row {
                let slope = (to[0] - from[0]) / (to[1] - from[1]);
                let mut x = low[0] + (f64::from(low_row) + 0.5 - low[1]) * slope;
                for (number, row) in
                    (low_row..).zip(&mut crossed[(low_row - lowest) as usize..(high_row - lowest) as usize])
                {
                    let column = row_from(x, columns);
                    match row.columns.get_mut(row.count as usize) {
                        Some(place) => *place = column,
                        None => self.more.push((number, column)),
                    }
                    row.count += 1;
                    x += slope;
                }
            }
            (from, from_row) = (to, to_row);
        }
        for (number, row) in (lowest..).zip(crossed) {
            let found = if row.count as usize <= ROOM {
                &mut row.columns[..row.count as usize]
            } else {
                let more = self.more.iter().filter(|(other, _)| *other == number).map(|(_, column)| *column);
                self.crowded.clear();
                self.crowded.extend(row.columns.into_iter().chain(more));
                &mut self.crowded[..]
            };
            sort(found);
            for ends in found.chunks_exact(2) {
                if ends[0] < ends[1] {
                    fill(number as usize, ends[0] as usize, ends[1] as usize);
                }
            }
        }
    }
}

/// The first row, or column, whose middle lies behind a place, at most `count`.
fn row_from(place: f64, count: u32) -> u32 {
    // The cast rounds down, and gives zero for what is below zero; places are finite.
    ((place + 0.5) as u32).min(count)
}

/// Rows have few crossings, mostly two, and else in falling or in rising order, as the polygon goes round.
fn sort(columns: &mut [u32]) {
    if let [one, other] = columns {
        (*one, *other) = (*one.min(other), *one.max(other));
        return;
    }
    if columns.first() > columns.last() {
        columns.reverse();
    }
    for end in 1..columns.len() {
        let mut at = end;
        while at > 0 && columns[at - 1] > columns[at] {
            columns.swap(at - 1, at);
            at -= 1;
        }
    }
}
