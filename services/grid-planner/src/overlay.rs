//! Obstacles seen by the time-of-flight sensors: they come into the field, are freed by readings that pass
//! through, and fade.

use crate::field::Field;
use crate::line;
use geometry::{Point2, Pose2, Segment};
use messages::{Reading, TOF_COUNT, Time, TofRanges};
use std::time::Duration;

/// What a sighting adds to an obstacle's weight: thin things are seen only now and then (COF-123).
const SIGHTING: u8 = 24;
/// What weighs most, so that an obstacle that leaves is forgotten soon.
const WEIGHT_MAX: u8 = 5 * SIGHTING;
/// What lies in the outer part of a cone fills too little of it to be seen for sure: a reading that passes
/// takes much weight within this share of its width, and little beside it, a cell beyond its edge included.
const SURE_SHARE: f64 = 0.6;
const SURE_PASS: u8 = 8;
const UNSURE_SHARE: f64 = 1.3;
const UNSURE_PASS: u8 = 2;
/// The robot's body (COF-003), less the error of its pose: where it stands there is no obstacle.
const BODY_M: [f64; 2] = [0.305 - 0.05, 0.255 - 0.05];
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
    /// What was not seen again for this long is gone.
    pub(crate) memory: Duration,
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    cell: usize,
    seen: Time,
    weight: u8,
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

    /// One frame of the sensors, taken at a pose on a floor whose closed doors are `leaves`.
    pub(crate) fn observe(
        &mut self,
        (field, leaves): (&mut Field, &[Segment]),
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
        self.free_below(field, pose);
        for (eye, _, free_m) in looks.clone() {
            self.pass_through(field, rules, eye, free_m);
        }
        let margin_m = 2.0 * field.grid().resolution_m();
        let free = |place: Point2<f64>| {
            looks.clone().any(|(eye, _, free_m)| sees(rules, eye, free_m - margin_m, place, SURE_SHARE))
        };
        for (eye, hit_m, _) in looks.clone() {
            let Some(hit_m) = hit_m else { continue };
            // It may stand anywhere across the cone, but for where a neighbour sees through; the rest is seen
            // from nearer by.
            if let Some(across) = unexplained((field, leaves), rules, eye, hit_m) {
                let all_free = across.clone().all(free);
                let mut last = None;
                for end in across.filter(|end| all_free || !free(*end)) {
                    let cell = field.grid().index_at(end.x, end.y).filter(|cell| last != Some(*cell));
                    if let Some(cell) = cell {
                        last = Some(cell);
                        self.hit(field, rules, now, cell);
                    }
                }
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
            mark.weight = (mark.weight + SIGHTING).min(WEIGHT_MAX);
        } else if self.marks.len() < MARKS_MAX {
            self.marks.push(Mark { cell, seen: now, weight: SIGHTING, blocks: false });
        }
        if let Some(mark) = self.marks.iter_mut().find(|mark| mark.cell == cell)
            && !mark.blocks
            && mark.weight >= SIGHTING * rules.confirm
        {
            mark.blocks = true;
            field.set_obstacle(cell, true);
        }
    }

    /// Marks that a reading passes lose weight; the last loss frees the cell.
    fn pass_through(&mut self, field: &mut Field, rules: &Rules, eye: Pose2, free_m: f64) {
        let margin_m = 2.0 * field.grid().resolution_m();
        let sees = |place, share| sees(rules, eye, free_m - margin_m, place, share);
        self.lighten(field, |place| match (sees(place, SURE_SHARE), sees(place, UNSURE_SHARE)) {
            (true, _) => SURE_PASS,
            (false, true) => UNSURE_PASS,
            (false, false) => 0,
        });
    }

    /// Where the robot stands nothing else does.
    fn free_below(&mut self, field: &mut Field, pose: Pose2) {
        self.lighten(field, |place| {
            let inside = pose.inverse_transform(place);
            if inside.x.abs() < BODY_M[0] && inside.y.abs() < BODY_M[1] { WEIGHT_MAX } else { 0 }
        });
    }

    fn lighten(&mut self, field: &mut Field, by: impl Fn(Point2<f64>) -> u8) {
        self.marks.retain_mut(|mark| {
            let [x_m, y_m] = field.grid().to_map(field.grid().centre(mark.cell));
            mark.weight = mark.weight.saturating_sub(by(Point2::new(x_m, y_m)));
            if mark.weight == 0 && mark.blocks {
                field.set_obstacle(mark.cell, false);
            }
            mark.weight > 0
        });
    }
}

/// Whether a place lies in the inner `share` of a sensor's cone and nearer than `reach_m`.
fn sees(rules: &Rules, eye: Pose2, reach_m: f64, place: Point2<f64>, share: f64) -> bool {
    let seen = eye.inverse_transform(place);
    seen.x > 0.0 && seen.x < reach_m && seen.y.abs() <= share * rules.half_cone_rad.tan() * seen.x
}

/// The places across the cone at a reading's range, unless a known wall stands on the way to one of them or
/// near it, or the closed leaf of a known door: then the reading is that wall, or a door that may open. The
/// range counts along the axis.
fn unexplained(
    (field, leaves): (&Field, &[Segment]),
    rules: &Rules,
    eye: Pose2,
    range_m: f64,
) -> Option<impl Iterator<Item = Point2<f64>> + Clone + use<>> {
    let grid = field.grid();
    let half_m = range_m * rules.half_cone_rad.tan();
    let steps = (4.0 * half_m / grid.resolution_m()).ceil().max(1.0) as i32;
    let across = (0..=steps).map(move |step| {
        let aside_m = half_m * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
        eye.transform(Point2::new(range_m, aside_m))
    });
    let from = grid.to_cells([eye.x_m, eye.y_m]);
    let is_leaf = |end: Point2<f64>| leaves.iter().any(|leaf| leaf.distance_m(end) < rules.wall_tolerance_m);
    let open = across.clone().all(|end| {
        !is_leaf(end)
            && grid.index_at(end.x, end.y).is_some_and(|cell| field.wall_m(cell) >= rules.wall_tolerance_m)
            && line::visit(from, grid.to_cells([end.x, end.y]), |column, row| {
                grid.checked_index(column, row).is_some_and(|cell| !grid.is_occupied(cell))
            })
    });
    open.then_some(across)
}
