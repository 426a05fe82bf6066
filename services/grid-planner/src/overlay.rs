//! Obstacles seen by the time-of-flight sensors: they come into the field, are freed by readings that pass through, and fade.

use crate::field::Field;
use crate::line;
use geometry::{Point2, Pose2};
use messages::{Reading, TOF_COUNT, Time, TofRanges};
use std::time::Duration;

/// Sightings that count at most, so that an obstacle that leaves is forgotten soon.
const HITS_MAX: u8 = 5;
/// As many obstacles are remembered; a ninth of a hallway's floor.
const MARKS_MAX: usize = 4000;

/// How observed obstacles are judged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    /// Farther readings count as no target (COF-030).
    pub(crate) range_max_m: f64,
    /// Half of the sensors' field of view.
    pub(crate) half_cone_rad: f64,
    /// Readings that end this near to a wall are the wall.
    pub(crate) wall_tolerance_m: f64,
    /// Sightings until a cell blocks.
    pub(crate) confirm: u8,
    /// What was not seen again for so long is gone.
    pub(crate) memory: Duration,
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    cell: usize,
    seen: Time,
    hits: u8,
    blocks: bool,
}

/// The observed obstacles of the floor on which the robot is.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overlay {
    marks: Vec<Mark>,
}

impl Overlay {
    /// How many cells block.
    pub(crate) fn blocking(&self) -> usize {
        self.marks.iter().filter(|mark| mark.blocks).count()
    }

    /// Takes everything away again.
    pub(crate) fn clear(&mut self, field: &mut Field) {
        for mark in self.marks.drain(..).filter(|mark| mark.blocks) {
            field.set_obstacle(mark.cell, false);
        }
    }

    /// One frame of the sensors, taken at a pose.
    pub(crate) fn observe(
        &mut self,
        field: &mut Field,
        rules: &Rules,
        now: Time,
        pose: Pose2,
        ranges: &TofRanges,
    ) {
        let looks = (0..TOF_COUNT).filter_map(|sensor| {
            let (hit_m, free_m) = match ranges.reading(sensor) {
                Reading::Distance(range_m) if f64::from(range_m) < rules.range_max_m => {
                    (Some(f64::from(range_m)), f64::from(range_m))
                }
                Reading::Distance(_) | Reading::NoTarget => (None, rules.range_max_m),
                Reading::Ignore | Reading::Fault => return None,
            };
            Some((pose.compose(TofRanges::MOUNTS[sensor]), hit_m, free_m))
        });
        // What one sensor sees in this frame is not freed by its neighbour in the same frame.
        for (eye, _, free_m) in looks.clone() {
            self.pass_through(field, rules, eye, free_m);
        }
        for (eye, hit_m, _) in looks {
            if let Some(cell) = hit_m.and_then(|hit_m| unexplained(field, rules, eye, hit_m)) {
                self.hit(field, rules, now, cell);
            }
        }
    }

    /// Forgets what was not seen for long.
    pub(crate) fn fade(&mut self, field: &mut Field, rules: &Rules, now: Time) {
        self.marks.retain(|mark| {
            let stays = now.since(mark.seen) <= rules.memory;
            if !stays && mark.blocks {
                field.set_obstacle(mark.cell, false);
            }
            stays
        });
    }

    fn hit(&mut self, field: &mut Field, rules: &Rules, now: Time, cell: usize) {
        if let Some(mark) = self.marks.iter_mut().find(|mark| mark.cell == cell) {
            mark.seen = now;
            mark.hits = (mark.hits + 1).min(HITS_MAX);
        } else if self.marks.len() < MARKS_MAX {
            self.marks.push(Mark { cell, seen: now, hits: 1, blocks: false });
        }
        if let Some(mark) = self.marks.iter_mut().find(|mark| mark.cell == cell)
            && !mark.blocks
            && mark.hits >= rules.confirm
        {
            mark.blocks = true;
            field.set_obstacle(cell, true);
        }
    }

    /// Marks that a reading passes lose a sighting; the last one frees the cell. Thin things flicker (COF-123), so one reading past
    /// a pole does not free it at once.
    fn pass_through(&mut self, field: &mut Field, rules: &Rules, eye: Pose2, free_m: f64) {
        let margin_m = 2.0 * field.grid().resolution_m();
        self.marks.retain_mut(|mark| {
            let [x_m, y_m] = field.grid().to_map(field.grid().centre(mark.cell));
            let seen = eye.inverse_transform(Point2::new(x_m, y_m));
            let passed = seen.x > 0.0
                && seen.coords.norm() < free_m - margin_m
                && seen.y.abs() <= seen.x * rules.half_cone_rad;
            if passed {
                mark.hits = mark.hits.saturating_sub(1);
            }
            if mark.hits == 0 && mark.blocks {
                field.set_obstacle(mark.cell, false);
            }
            mark.hits > 0
        });
    }
}

/// The cell at a reading's end, unless a known wall stands on the way or near the end.
fn unexplained(field: &Field, rules: &Rules, eye: Pose2, range_m: f64) -> Option<usize> {
    let end = eye.transform(Point2::new(range_m, 0.0));
    let grid = field.grid();
    let cell = grid.index_at(end.x, end.y)?;
    if field.wall_m(cell) < rules.wall_tolerance_m {
        return None;
    }
    let (from, to) = (grid.to_cells([eye.x_m, eye.y_m]), grid.to_cells([end.x, end.y]));
    let open = line::visit(from, to, |column, row| {
        grid.checked_index(column, row).is_some_and(|cell| !grid.is_occupied(cell))
    });
    open.then_some(cell)
}
