//! Recorded drives for the tests: a minimal reader of CARMEN logs, a map of their even scans, and a run over the odd ones.
#![allow(
    dead_code,
    missing_docs,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test uses a part of it"
)]

use flate2::read::GzDecoder;
use geometry::{Grid, GridFrame, Occupancy, OccupancyGrid, Point2, Pose2, angle};
use messages::{Odometry, PoseEstimate, RangeScan, Stamped, Time};
use particle_localiser::{Inputs, Map, Params, ParticleLocaliser, Start};
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::Read;
use std::path::PathBuf;

pub const RANGE_MAX_M: f64 = 80.0;

pub enum Entry {
    Odometry(Pose2),
    Scan { truth: Pose2, ranges: Vec<f32> },
}

pub struct Log {
    pub entries: Vec<Entry>,
    pub map: Map,
}

/// The shared data, where they are; a line is printed where they are not.
pub fn shared(path: &str) -> Option<PathBuf> {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(path);
    if !file.exists() {
        println!("skipped: {path} is not in ../shared/data");
        return None;
    }
    Some(file)
}

pub fn scan_header(ranges: &[f32]) -> RangeScan {
    let step = match ranges.len() {
        360 | 361 => PI / 360.0,
        _ => PI / 180.0,
    };
    RangeScan {
        angle_min_rad: -FRAC_PI_2,
        angle_step_rad: step,
        range_max_m: RANGE_MAX_M,
        ..RangeScan::default()
    }
}

pub fn load(name: &str) -> Option<Log> {
    let mut text = String::new();
    let file = std::fs::File::open(shared(&format!("laser_carmen/{name}-corrected.log.gz"))?).unwrap();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let entries: Vec<Entry> = text.lines().filter_map(read_line).collect();
    let map = Map::of_grid(&map_of_even_scans(&entries), 65);
    Some(Log { entries, map })
}

fn read_line(line: &str) -> Option<Entry> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let number = |index: usize| words.get(index).and_then(|word| word.parse::<f64>().ok());
    let pose = |index| Some(Pose2::new(number(index)?, number(index + 1)?, number(index + 2)?));
    match *words.first()? {
        "ODOM" => Some(Entry::Odometry(pose(1)?)),
        "FLASER" => {
            let count = number(1)? as usize;
            let ranges =
                (2..2 + count).map(|index| number(index).map(|range| range as f32)).collect::<Option<_>>()?;
            Some(Entry::Scan { truth: pose(2 + count)?, ranges })
        }
        _ => None,
    }
}

fn scans(entries: &[Entry]) -> impl Iterator<Item = (Pose2, &[f32])> {
    entries.iter().filter_map(|entry| match entry {
        Entry::Scan { truth, ranges } => Some((*truth, ranges.as_slice())),
        Entry::Odometry(_) => None,
    })
}

/// Hits and passes of each cell, counted.
pub fn map_of_even_scans(entries: &[Entry]) -> OccupancyGrid {
    let resolution_m = 0.05;
    let even = || scans(entries).step_by(2);
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for (truth, _) in even() {
        low = [low[0].min(truth.x_m), low[1].min(truth.y_m)];
        high = [high[0].max(truth.x_m), high[1].max(truth.y_m)];
    }
    let reach_m = 20.0;
    let cells = |axis: usize| ((high[axis] - low[axis] + 2.0 * reach_m) / resolution_m) as u32;
    let frame =
        GridFrame::new(cells(0), cells(1), resolution_m, Pose2::new(low[0] - reach_m, low[1] - reach_m, 0.0))
            .unwrap();
    let mut counts = Grid::filled(frame, [0_u32; 2]);
    for (truth, ranges) in even() {
        let header = scan_header(ranges);
        for index in 0..ranges.len() {
            let Some((direction, range_m)) = header.beam(ranges, index).filter(|beam| beam.1 < reach_m)
            else {
                continue;
            };
            let end = truth.transform(Point2::new(range_m * direction.cos(), range_m * direction.sin()));
            let end_cell = frame.cell_at(end);
            for cell in frame.cells_along(truth.position(), end) {
                if Some(cell) != end_cell
                    && let Some(count) = counts.get_mut(cell)
                {
                    count[0] += 1;
                }
            }
            if let Some(count) = end_cell.and_then(|cell| counts.get_mut(cell)) {
                count[1] += 1;
            }
        }
    }
    counts.map(|&[passes, hits]| match (passes, hits) {
        (0, 0) => Occupancy::UNKNOWN,
        (passes, hits) if hits > 0 && 4 * hits >= passes => Occupancy::OCCUPIED,
        _ => Occupancy::FREE,
    })
}

/// How a run went.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Errors of every scan, in metres and radians.
    pub errors: Vec<(f64, f64)>,
    /// Travelled at each scan.
    pub path_m: Vec<f64>,
    /// Whether the localiser claimed to know.
    pub found: Vec<bool>,
    pub last: PoseEstimate,
    pub particles: Vec<usize>,
}

impl Run {
    pub fn median(&self) -> (f64, f64) {
        self.quantile(0.5)
    }

    pub fn quantile(&self, share: f64) -> (f64, f64) {
        let pick = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(((values.len() - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
        };
        (pick(self.errors.iter().map(|e| e.0).collect()), pick(self.errors.iter().map(|e| e.1).collect()))
    }
}

pub fn start_at(pose: Pose2) -> Start {
    Start { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad, sigma_m: 0.1, sigma_rad: 0.05 }
}

/// Localises on the odd scans from the `first`-th scan of the log on, over `most_m` of path. With `tracking` it begins at the true pose.
pub fn run(log: &Log, mut params: Params, seed: u64, first: usize, most_m: f64, tracking: bool) -> Run {
    let mut run = Run::default();
    let mut localiser = None;
    let mut odometry = None;
    let (mut path_m, mut last_truth): (f64, Option<Pose2>) = (0.0, None);
    let (mut number, mut stamp) = (0, 0);
    let mut last_odometry = None;
    for entry in &log.entries {
        stamp += 1;
        let now = Time::from_nanos(stamp * 1_000_000);
        match entry {
            Entry::Odometry(pose) => {
                let message = Odometry {
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    heading_rad: pose.heading_rad,
                    ..Odometry::default()
                };
                last_odometry = Some((now, message));
                if let Some(localiser) = &mut localiser {
                    odometry = last_odometry;
                    let inputs = Inputs { odometry: Some(Stamped::new(now, &message)), scan: None };
                    let _ = ParticleLocaliser::step(localiser, now, inputs);
                }
            }
            Entry::Scan { truth, ranges } => {
                number += 1;
                if number - 1 < first || number % 2 != 0 || path_m > most_m {
                    continue;
                }
                if localiser.is_none() {
                    params.start = tracking.then(|| start_at(*truth));
                    localiser = Some(ParticleLocaliser::new(params.clone(), log.map.clone(), seed).unwrap());
                    odometry = last_odometry;
                }
                path_m += last_truth.map_or(0.0, |last| last.distance_m(*truth));
                last_truth = Some(*truth);
                let header = scan_header(ranges);
                let localiser = localiser.as_mut().unwrap();
                let inputs = Inputs {
                    odometry: odometry.as_ref().map(|(stamp, message)| Stamped::new(*stamp, message)),
                    scan: Some(Stamped::with_elements(now, &header, ranges)),
                };
                let pose = localiser.step(now, inputs).pose;
                run.errors.push((
                    Pose2::new(pose.x_m, pose.y_m, 0.0).distance_m(*truth),
                    angle::difference(pose.heading_rad, truth.heading_rad).abs(),
                ));
                run.path_m.push(path_m);
                run.found.push(pose.pose().is_ok());
                run.particles.push(localiser.filter().particles().len());
                run.last = pose;
            }
        }
    }
    run
}
