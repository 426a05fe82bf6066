//! Rays a second, beside the common way, beam by beam, in the same run: `cargo bench -p mapper`.
//!
//! Scans of 180 beams, 1 degree apart, taken on a drive through rooms; cells of 5 cm; one thread, its
//! processor time, medians of rounds that alternate. The bar
//! is 20 million rays a second; MRPT, the best known, does 6.5 to 7.4.

use geometry::{Cell, Grid, GridFrame, Point2, Pose2, Scene, Segment};
use mapper::{Map, Params};
use messages::RangeScan;
use rustix::time::{ClockId, clock_gettime};
use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;

const BEAMS: usize = 180;
const SCANS: usize = 200;
const ROUNDS: usize = 21;

/// A square building of square rooms with doors and pillars.
fn building(room_m: f64, rooms: i32) -> Scene {
    let mut walls = Vec::new();
    let end = f64::from(rooms) * room_m;
    for line in 0..=rooms {
        let at = f64::from(line) * room_m;
        for room in 0..rooms {
            let from = f64::from(room) * room_m;
            let pieces = if line == 0 || line == rooms {
                vec![(from, from + room_m)]
            } else {
                vec![(from, from + 0.4 * room_m), (from + 0.4 * room_m + 1.0, from + room_m)]
            };
            for (low, high) in pieces {
                walls.push(Segment::between([at, low], [at, high]));
                walls.push(Segment::between([low, at], [high, at]));
            }
        }
    }
    let mut x = 1.3;
    while x < end {
        let y = (x * 7.3).rem_euclid(end);
        let corners = [[x, y], [x + 0.3, y + 0.1], [x + 0.2, y + 0.4], [x - 0.1, y + 0.3]];
        walls.extend((0..4).map(|at| Segment::between(corners[at], corners[(at + 1) % 4])));
        x += 1.7;
    }
    Scene::new(walls)
}

struct Drive {
    header: RangeScan,
    scans: Vec<(Pose2, Vec<f32>)>,
    mean_m: f64,
}

fn drive(scene: &Scene, size_m: f64) -> Drive {
    let step = 1_f64.to_radians();
    let header = RangeScan {
        angle_min_rad: -FRAC_PI_2 + 0.5 * step,
        angle_step_rad: step,
        range_max_m: 10.0,
        ..RangeScan::default()
    };
    let mut scans = Vec::new();
    let mut sum_m = 0.0;
    for index in 0..SCANS {
        let share = index as f64 / SCANS as f64;
        let pose = Pose2::new(
            size_m * (0.15 + 0.7 * (share * 3.7).fract()),
            size_m * (0.15 + 0.7 * share),
            share * 17.0,
        );
        let ranges: Vec<f32> = (0..BEAMS)
            .map(|beam| {
                let heading_rad = pose.heading_rad + header.angle_min_rad + beam as f64 * step;
                let scatter_m = 0.04 * (((index * BEAMS + beam) as f64 * 0.618_034).fract() - 0.5);
                let hit = scene.walls().cast(pose.position(), heading_rad, 10.0);
                hit.map_or(99.0, |hit| hit.range_m + scatter_m) as f32
            })
            .collect();
        sum_m += ranges.iter().map(|range| f64::from(range.min(10.0))).sum::<f64>();
        scans.push((pose, ranges));
    }
    Drive { header, scans, mean_m: sum_m / (SCANS * BEAMS) as f64 }
}

/// Beam by beam, cell by cell (Bresenham 1965, in fixed point): cells near the sensor are touched by every
/// beam that passes.
struct Beams {
    frame: GridFrame,
    cells: Grid<i16>,
}

impl Beams {
    fn add(&mut self, header: &RangeScan, pose: Pose2, ranges: &[f32]) {
        let from = self.frame.to_cells(pose.position());
        let columns = self.frame.width() as i64;
        for (beam, range_m) in ranges.iter().enumerate() {
            let range_m = f64::from(*range_m);
            let is_hit = range_m < header.range_max_m;
            let angle_rad = pose.heading_rad + header.angle_min_rad + beam as f64 * header.angle_step_rad;
            let (sine, cosine) = angle_rad.sin_cos();
            let end = Point2::new(
                pose.x_m + cosine * range_m.min(header.range_max_m),
                pose.y_m + sine * range_m.min(header.range_max_m),
            );
            let to = self.frame.to_cells(end);
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            let steps = dx.abs().max(dy.abs()).max(1.0);
            let scale = f64::from(1_u32 << 31);
            let (mut x, mut y) = ((from.x * scale) as i64, (from.y * scale) as i64);
            let (step_x, step_y) = ((dx / steps * scale) as i64, (dy / steps * scale) as i64);
            let (width, height) = (columns, self.frame.height() as i64);
            let cells = self.cells.as_mut_slice();
            for _ in 0..steps as u32 {
                let (column, row) = (x >> 31, y >> 31);
                if column < 0 || row < 0 || column >= width || row >= height {
                    break;
                }
                let cell = &mut cells[(row * columns + column) as usize];
                *cell = (*cell - 405).max(-3500);
                x += step_x;
                y += step_y;
            }
            if is_hit && let Some(cell) = self.frame.cell_at(end).and_then(|cell| self.cells.get_mut(cell)) {
                *cell = (*cell + 619 + 405).min(3500);
            }
        }
    }
}

/// Time that this thread had a processor.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    println!(
        "{:<24} {:>8} {:>9} {:>11} {:>12} {:>14} {:>6}",
        "building", "beam, m", "us/scan", "M rays/s", "cells/scan", "beam by beam", "ratio"
    );
    for (name, room_m, rooms) in
        [("rooms of 4 m", 4.0, 6), ("rooms of 8 m", 8.0, 4), ("a hall of 30 m", 30.0, 1)]
    {
        let size_m = room_m * f64::from(rooms);
        let scene = building(room_m, rooms);
        let drive = drive(&scene, size_m);
        let params = Params {
            min_x_m: -1.0,
            min_y_m: -1.0,
            width_m: size_m + 2.0,
            height_m: size_m + 2.0,
            ..Params::default()
        };
        let cells = ((size_m + 2.0) / params.resolution_m).ceil() as u32;
        let frame = GridFrame::new(cells, cells, params.resolution_m, Pose2::new(-1.0, -1.0, 0.0))
            .expect("a small grid");
        let mut map = Map::new(&params, frame);
        let mut beams = Beams { frame, cells: Grid::filled(frame, 0) };
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let begin = processor_s();
            for (pose, ranges) in &drive.scans {
                map.add(*pose, black_box(&drive.header), black_box(ranges));
            }
            ours.push((processor_s() - begin) / SCANS as f64);
            let begin = processor_s();
            for (pose, ranges) in &drive.scans {
                beams.add(black_box(&drive.header), *pose, black_box(ranges));
            }
            theirs.push((processor_s() - begin) / SCANS as f64);
        }
        black_box((map.thousandths(), beams.cells.get(Cell::new(0, 0))));
        let touched: usize = drive
            .scans
            .iter()
            .map(|(pose, ranges)| {
                let mut fresh = Map::new(&params, frame);
                fresh.add(*pose, &drive.header, ranges);
                fresh.thousandths().iter().filter(|value| **value != 0).count()
            })
            .sum();
        let (ours, theirs) = (median(ours), median(theirs));
        let rate = |scan_s: f64| BEAMS as f64 / scan_s * 1e-6;
        println!(
            "{name:<24} {:>8.2} {:>9.2} {:>11.1} {:>12} {:>14.1} {:>6.1}",
            drive.mean_m,
            ours * 1e6,
            rate(ours),
            touched / SCANS,
            rate(theirs),
            theirs / ours
        );
    }
}
