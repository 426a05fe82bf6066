//! Recorded drives for the tests: minimal readers of the logs, a map of the even scans, and a robot that
//! drives along a recording.
#![allow(
    dead_code,
    missing_docs,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test uses a part of it"
)]

pub mod arenas;

use flate2::read::GzDecoder;
use geometry::{Grid, GridFrame, Occupancy, OccupancyGrid, Point2, Pose2, angle};
use messages::{Odometry, PoseEstimate, RangeScan, Stamped, Time};
use particle_localiser::{Inputs, Map, Params, ParticleLocaliser, Snapshot, Start};
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::Read;
use std::path::{Path, PathBuf};

pub const RANGE_MAX_M: f64 = 80.0;

/// A scan, and the odometry on the way to it.
#[derive(Debug, Clone)]
pub struct Look {
    /// Raw odometry since the scan before, in order; the last is the newest before this scan.
    pub way: Vec<Pose2>,
    pub truth: Pose2,
    pub header: RangeScan,
    pub ranges: Vec<f32>,
}

/// What a robot saw that was not used for the map, and the map.
pub struct Drive {
    pub looks: Vec<Look>,
    pub grid: OccupancyGrid,
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

fn unpacked(file: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(std::fs::File::open(file).unwrap()).read_to_string(&mut text).unwrap();
    text
}

/// A CARMEN log: its even scans, from 0 on, make the map at their corrected poses; its odd ones are to be
/// localised.
pub fn load(name: &str) -> Option<Drive> {
    let looks = read_carmen(&unpacked(&shared(&format!("laser_carmen/{name}-corrected.log.gz"))?));
    let grid = map_of(looks.iter().step_by(2));
    let mut way = Vec::new();
    let mut odd = Vec::new();
    for (index, mut look) in looks.into_iter().enumerate() {
        way.append(&mut look.way);
        if index % 2 == 1 {
            odd.push(Look { way: std::mem::take(&mut way), ..look });
        }
    }
    let map = Map::of_grid(&grid, 65);
    Some(Drive { looks: odd, grid, map })
}

/// The drive in Málaga on the map that came with it, put into the frame of the true poses (see the README
/// beside it).
pub fn malaga() -> Drive {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../launch/graphs/data/malaga");
    let truth = std::fs::read_to_string(folder.join("truth.txt")).unwrap();
    let looks = read_steps(&unpacked(&folder.join("log.txt.gz")), &truth);
    let grid = OccupancyGrid::load(folder.join("map-in-truth-frame.yaml")).unwrap();
    let map = Map::of_grid(&grid, 65);
    Drive { looks, grid, map }
}

/// The odometry of these logs was corrected too: after a scan it goes on from the scan's corrected pose. Only
/// the steps between two scans are the robot's own, and are put one to the other's end.
fn read_carmen(text: &str) -> Vec<Look> {
    let (mut looks, mut way) = (Vec::new(), Vec::new());
    let (mut recorded, mut odometry) = (None::<Pose2>, Pose2::IDENTITY);
    for line in text.lines() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let number = |index: usize| words[index].parse::<f64>().unwrap();
        let pose = |index| Pose2::new(number(index), number(index + 1), number(index + 2));
        match words.first() {
            Some(&"ODOM") => {
                let last = recorded.replace(pose(1)).unwrap_or(pose(1));
                odometry = odometry.compose(last.to(pose(1)));
                way.push(odometry);
            }
            Some(&"FLASER") => {
                let count = number(1) as usize;
                let step = if count > 181 { PI / 360.0 } else { PI / 180.0 };
                let header = RangeScan {
                    angle_min_rad: -FRAC_PI_2,
                    angle_step_rad: step,
                    range_max_m: RANGE_MAX_M,
                    ..RangeScan::default()
                };
                let ranges = (2..2 + count).map(|index| number(index) as f32).collect();
                recorded = Some(pose(2 + count));
                looks.push(Look { way: std::mem::take(&mut way), truth: pose(2 + count), header, ranges });
            }
            _ => {}
        }
    }
    looks
}

/// Steps of motion and scan; row k of the truth belongs to step k + 1.
fn read_steps(text: &str, truth: &str) -> Vec<Look> {
    let numbers = |line: &str| -> Vec<f64> {
        line.split_ascii_whitespace().filter_map(|word| word.parse().ok()).collect()
    };
    let mut truths = vec![None];
    truths.extend(truth.lines().map(numbers).map(|row| Some(Pose2::new(row[1], row[2], row[3]))));
    let (mut looks, mut way, mut odometry) = (Vec::new(), Vec::new(), Pose2::IDENTITY);
    for line in text.lines() {
        let row = numbers(line);
        if line.starts_with("ODOM") {
            odometry = odometry.compose(Pose2::new(row[1], row[2], row[3]));
            way.push(odometry);
        } else if line.starts_with("LASER") {
            let Some(truth) = truths.get(row[0] as usize).copied().flatten() else { continue };
            let header = RangeScan {
                sensor_x_m: row[2],
                sensor_y_m: row[3],
                sensor_heading_rad: row[4],
                angle_min_rad: -0.5 * row[1],
                angle_step_rad: row[1] / (row[5] - 1.0),
                range_max_m: RANGE_MAX_M,
            };
            let ranges = row[6..].iter().map(|range| *range as f32).collect();
            looks.push(Look { way: std::mem::take(&mut way), truth, header, ranges });
        }
    }
    looks
}

/// Hits and passes of each cell, counted.
pub fn map_of<'a>(looks: impl Iterator<Item = &'a Look> + Clone) -> OccupancyGrid {
    let resolution_m = 0.05;
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for Look { truth, .. } in looks.clone() {
        low = [low[0].min(truth.x_m), low[1].min(truth.y_m)];
        high = [high[0].max(truth.x_m), high[1].max(truth.y_m)];
    }
    let reach_m = 20.0;
    let cells = |axis: usize| ((high[axis] - low[axis] + 2.0 * reach_m) / resolution_m) as u32;
    let frame =
        GridFrame::new(cells(0), cells(1), resolution_m, Pose2::new(low[0] - reach_m, low[1] - reach_m, 0.0))
            .unwrap();
    let mut counts = Grid::filled(frame, [0_u32; 2]);
    for Look { truth, header, ranges, .. } in looks {
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

/// A robot that drives along a recording; its odometry knows nothing of a hand that carries it elsewhere.
pub struct Robot {
    pub localiser: ParticleLocaliser,
    /// Its own odometry, and the recording's.
    odometry: Pose2,
    recorded: Option<Pose2>,
    stamp: u64,
}

impl Robot {
    pub fn new(drive: &Drive, params: Params, seed: u64) -> Self {
        let localiser = ParticleLocaliser::new(params, drive.map.clone(), seed).unwrap();
        Self { localiser, odometry: Pose2::IDENTITY, recorded: None, stamp: 0 }
    }

    /// The next look comes from elsewhere in the recording.
    pub fn carry(&mut self) {
        self.recorded = None;
    }

    /// Puts a new process in this one's place; the odometry is another process and goes on.
    pub fn replaced(&self, drive: &Drive, seed: u64, snapshot: &Snapshot) -> Self {
        let mut successor = Self { stamp: self.stamp, ..Self::new(drive, Params::default(), seed) };
        (successor.odometry, successor.recorded) = (self.odometry, self.recorded);
        successor.localiser.restore(snapshot);
        successor
    }

    /// Stands, and sees nothing.
    pub fn wait(&mut self) -> PoseEstimate {
        self.step(None)
    }

    /// Drives the way to a scan, as the raw odometry tells of it, and takes the scan in.
    pub fn drive(&mut self, look: &Look) -> PoseEstimate {
        // Where a recording is entered only the end of the way counts.
        let begin = match self.recorded {
            Some(_) => 0,
            None => look.way.len().saturating_sub(1),
        };
        for &pose in &look.way[begin..] {
            let last = self.recorded.replace(pose).unwrap_or(pose);
            self.odometry = self.odometry.compose(last.to(pose));
            self.step(None);
        }
        self.step(Some(look))
    }

    fn step(&mut self, look: Option<&Look>) -> PoseEstimate {
        self.stamp += 1;
        let now = Time::from_nanos(self.stamp * 1_000_000);
        let Pose2 { x_m, y_m, heading_rad } = self.odometry;
        let message = Odometry { x_m, y_m, heading_rad, ..Odometry::default() };
        let inputs = Inputs {
            odometry: Some(Stamped::new(now, &message)),
            scan: look.map(|look| Stamped::with_elements(now, &look.header, &look.ranges)),
        };
        self.localiser.step(now, inputs).pose
    }
}

/// How a part of a drive went, scan by scan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Run {
    pub estimates: Vec<Pose2>,
    /// In metres and radians; infinite where no pose was known.
    pub errors: Vec<(f64, f64)>,
    /// Travelled since the begin, by the truth.
    pub path_m: Vec<f64>,
    pub particles: Vec<usize>,
}

impl Run {
    pub fn of(robot: &mut Robot, looks: &[Look], most_m: f64) -> Self {
        let mut run = Self::default();
        let (mut path_m, mut last): (f64, Option<Pose2>) = (0.0, None);
        for look in looks {
            path_m += last.replace(look.truth).map_or(0.0, |last| last.distance_m(look.truth));
            if path_m > most_m {
                break;
            }
            let message = robot.drive(look);
            let error = |pose: Pose2| {
                let turn = angle::difference(pose.heading_rad, look.truth.heading_rad);
                (pose.distance_m(look.truth), turn.abs())
            };
            run.errors.push(message.pose().map_or((f64::INFINITY, f64::INFINITY), error));
            run.estimates.push(Pose2::new(message.x_m, message.y_m, message.heading_rad));
            run.path_m.push(path_m);
            run.particles.push(robot.localiser.filter().particles().len());
        }
        run
    }

    /// This share of the errors lies below: metres, and degrees.
    pub fn quantile(&self, share: f64) -> (f64, f64) {
        let pick = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(((values.len() - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
        };
        let metres = pick(self.errors.iter().map(|error| error.0).collect());
        (metres, pick(self.errors.iter().map(|error| error.1).collect()).to_degrees())
    }

    /// Whether it ended at the right place, and knew.
    pub fn is_right(&self) -> bool {
        self.errors.last().is_some_and(|error| error.0 < 0.5 && error.1 < 0.2)
    }
}

pub fn start_at(pose: Pose2) -> Start {
    Start { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad, sigma_m: 0.1, sigma_rad: 0.05 }
}

/// Follows a drive from its first pose on with 500 particles.
pub fn track(drive: &Drive, seed: u64, most_m: f64) -> Run {
    let start = Some(start_at(drive.looks[0].truth));
    let params = Params { min_particles: 500, max_particles: 500, start, ..Params::default() };
    Run::of(&mut Robot::new(drive, params, seed), &drive.looks, most_m)
}

/// Numbers from 0 to 1 for where robots are put.
pub struct Dice(pub u64);

impl Dice {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// Follows a drive from a known pose for 10 m, is carried elsewhere, at least 3 m away, and drives on there
/// for `most_m`.
pub fn kidnap(drive: &Drive, params: Params, seed: u64, most_m: f64) -> Run {
    let mut dice = Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1);
    let looks = &drive.looks;
    // Room for the ways before and after.
    let mut place = || (dice.uniform() * 0.85 * looks.len() as f64) as usize;
    let from = place();
    let params = Params { start: Some(start_at(looks[from].truth)), ..params };
    let mut robot = Robot::new(drive, params, seed);
    let before = Run::of(&mut robot, &looks[from..], 10.0);
    let left = looks[from + before.errors.len() - 1].truth;
    let to = (0..1000).map(|_| place()).find(|to| looks[*to].truth.distance_m(left) > 3.0).unwrap();
    robot.carry();
    Run::of(&mut robot, &looks[to..], most_m)
}

/// How a drive was followed, the worst of several seeds.
#[derive(Debug, Clone, Copy)]
pub struct Followed {
    pub median_m: f64,
    pub median_deg: f64,
    /// The largest single error.
    pub farthest_m: f64,
}

/// Follows a drive with 500 particles, with several seeds.
pub fn follow(drive: &Drive, seeds: u64, most_m: f64) -> Followed {
    let mut worst = Followed { median_m: 0.0, median_deg: 0.0, farthest_m: 0.0 };
    for seed in 0..seeds {
        let run = track(drive, seed, most_m);
        let (median_m, median_deg) = run.quantile(0.5);
        worst.median_m = worst.median_m.max(median_m);
        worst.median_deg = worst.median_deg.max(median_deg);
        worst.farthest_m = worst.farthest_m.max(run.quantile(1.0).0);
    }
    worst
}

/// Of so many starts without a pose, spread over the drive, how many were right at the end of 10 m of travel,
/// and knew.
pub fn found(drive: &Drive, starts: usize) -> usize {
    let is_right = |start: &usize| {
        let looks = &drive.looks[start * (drive.looks.len() * 9 / 10) / starts..];
        Run::of(&mut Robot::new(drive, Params::default(), *start as u64), looks, 10.0).is_right()
    };
    (0..starts).filter(is_right).count()
}

/// Of so many robots that were carried elsewhere, how many knew where they were within so much travel.
pub fn recovered(drive: &Drive, runs: u64, most_m: f64) -> usize {
    (0..runs).filter(|seed| kidnap(drive, Params::default(), *seed, most_m).is_right()).count()
}
