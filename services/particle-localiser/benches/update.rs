//! Milliseconds for an update, with its accuracy beside it: `cargo bench -p particle-localiser`.
//!
//! "weigh" is the measurement model alone; "update" is all of it: motion, model, weights, clusters, estimate,
//! and the drawing of the next generation, while the pose is followed. One thread. The error is that of the
//! last update's likeliest place.
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use geometry::{Grid, GridFrame, Occupancy, OccupancyGrid, Pose2, angle};
use messages::RangeScan;
use particle_localiser::{Beams, Filter, Map, Model, Params, Particles, Start, Travel, Weigher};
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

const SIDE_M: f64 = 30.0;
const RESOLUTION_M: f64 = 0.05;

/// Rooms of 6 x 5 m with doors, pillars and a corridor.
fn office() -> OccupancyGrid {
    let cells = (SIDE_M / RESOLUTION_M) as u32;
    let frame = GridFrame::new(cells, cells, RESOLUTION_M, Pose2::IDENTITY).expect("a small grid");
    let mut grid = Grid::filled(frame, Occupancy::FREE);
    for cell in frame.cells() {
        let place = frame.centre(cell);
        let (x, y) = (place.x, place.y);
        let on = |value: f64, every: f64| value.rem_euclid(every) < 0.1;
        let door_x = (y.rem_euclid(5.0) - 2.0).abs() < 0.5;
        let door_y = (x.rem_euclid(6.0) - 4.0).abs() < 0.5;
        let edge = x < 0.1 || y < 0.1 || x > SIDE_M - 0.1 || y > SIDE_M - 0.1;
        let pillar = (x.rem_euclid(7.3) - 3.1).hypot(y.rem_euclid(6.1) - 3.9) < 0.2;
        let is_wall = edge || on(x, 6.0) && !door_x || on(y, 5.0) && !door_y || pillar;
        if is_wall && let Some(value) = grid.get_mut(cell) {
            *value = Occupancy::OCCUPIED;
        }
    }
    grid
}

fn scan(grid: &OccupancyGrid, pose: Pose2, beams: usize) -> (RangeScan, Vec<f32>) {
    let step = 1.5 * PI / beams as f64;
    let header = RangeScan {
        angle_min_rad: -0.75 * PI,
        angle_step_rad: step,
        range_max_m: 12.0,
        ..RangeScan::default()
    };
    let ranges = (0..beams).map(|index| {
        let direction = pose.heading_rad + header.angle_min_rad + index as f64 * step;
        // A repeatable scatter of about a centimetre.
        let scatter_m = 0.02 * ((index as f64 * 0.618).fract() - 0.5);
        grid.cast_m(pose.position(), direction, 12.0, 65)
            .map_or(99.0, |range_m| (range_m + 0.025 + scatter_m) as f32)
    });
    (header, ranges.collect())
}

/// Processor time of this thread: other processes of the machine do not count.
fn cpu_ms() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// Times of repeated work.
#[derive(Debug, Default)]
struct Times(Vec<f64>);

impl Times {
    fn take(&mut self, work: impl FnOnce()) {
        let begin = cpu_ms();
        work();
        self.0.push(cpu_ms() - begin);
    }

    fn quantile(&mut self, share: f64) -> f64 {
        self.0.sort_by(f64::total_cmp);
        self.0[(self.0.len() as f64 * share) as usize]
    }
}

fn main() {
    let grid = office();
    let map = Map::of_grid(&grid, 65);
    println!("processor time in ms, least and median");
    println!(
        "{:<18} {:>9} {:>5} {:>8} {:>8} {:>8} {:>8} {:>6} {:>9} {:>6}",
        "model", "particles", "beams", "weigh", "median", "update", "median", "bar", "error m", "mrad"
    );
    let cases = [
        (Model::LikelihoodField, 2000, 60, 0.2),
        (Model::LikelihoodField, 10_000, 180, 1.5),
        (Model::LogProduct, 500, 60, 0.1),
        (Model::LogProduct, 2000, 60, 0.2),
        (Model::LogProduct, 10_000, 180, 1.5),
        (Model::Beam, 2000, 60, 4.0),
        (Model::Gaussian, 2000, 60, 4.0),
    ];
    for (model, count, beams, bar_ms) in cases {
        let build = Instant::now();
        let params = Params {
            model,
            beams: beams as u32,
            min_particles: count,
            max_particles: count,
            max_passes: 1,
            range_max_m: 12.0,
            ..Params::default()
        };
        let weigher = Weigher::new(&params, &map);
        let build_ms = build.elapsed().as_secs_f64() * 1e3;
        let poses = [Pose2::new(8.0, 12.0, 0.3), Pose2::new(15.5, 7.0, 2.0), Pose2::new(22.0, 23.5, -2.4)];
        let (mut weigh, mut update) = (Times::default(), Times::default());
        let (mut error_m, mut error_rad) = (0.0, 0.0);
        for (seed, pose) in (1..).zip(poses) {
            let (header, ranges) = scan(&grid, pose, beams);
            let beams = Beams::select(&header, &ranges, 12.0, beams);
            let start = Start {
                x_m: pose.x_m,
                y_m: pose.y_m,
                heading_rad: pose.heading_rad,
                sigma_m: 0.1,
                sigma_rad: 0.05,
            };
            let mut filter = Filter::new(Params { start: Some(start), ..params.clone() }, map.clone(), seed);
            let particles: Particles = filter.particles().clone();
            let mut points = Vec::new();
            let mut last = filter.correct(&beams);
            let drive = Travel { path_m: 0.1, ..Travel::default() };
            // In turns, so that what disturbs one disturbs the other.
            for _ in 0..51 {
                weigh.take(|| weigher.weigh(black_box(&particles), black_box(&beams), &mut points));
                update.take(|| {
                    filter.advance(&drive);
                    last = filter.correct(&beams);
                });
            }
            if let Some(best) = last.and_then(|update| update.clusters.first().copied()) {
                error_m += best.pose.distance_m(pose) / 3.0;
                error_rad += angle::difference(best.pose.heading_rad, pose.heading_rad).abs() / 3.0;
            }
        }
        println!(
            "{:<18} {count:>9} {beams:>5} {:>8.3} {:>8.3} {:>8.3} {:>8.3} {bar_ms:>6.1} {error_m:>9.3} {:>6.2}   tables {} KiB in {build_ms:.1} ms",
            format!("{model:?}"),
            weigh.quantile(0.02),
            weigh.quantile(0.5),
            update.quantile(0.02),
            update.quantile(0.5),
            error_rad * 1e3,
            weigher.table_bytes() / 1024,
        );
    }
    rays(&grid, &map);
}

/// Nanoseconds a ray of 12 m at most, and its error against the exact walk from cell to cell of
/// `OccupancyGrid::cast_m`.
fn rays(grid: &OccupancyGrid, map: &Map) {
    let params = Params { model: Model::Beam, range_max_m: 12.0, ..Params::default() };
    let weigher = Weigher::new(&params, map);
    let pose = Pose2::new(15.5, 7.0, 2.0);
    let (header, ranges) = scan(grid, pose, 60);
    let beams = Beams::select(&header, &ranges, 12.0, 60);
    let start =
        Start { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad, sigma_m: 0.5, sigma_rad: 0.5 };
    let params = Params { max_particles: 2000, start: Some(start), ..params };
    let particles = Filter::new(params, map.clone(), 1).particles().clone();
    let mut times = Times::default();
    let mut expected = Vec::new();
    for _ in 0..51 {
        times.take(|| expected = weigher.expected_ranges(black_box(&particles), black_box(&beams)));
    }
    let mut exact = Times::default();
    let mut errors: Vec<f64> = Vec::new();
    exact.take(|| {
        errors = (0..particles.len() * beams.len())
            .map(|index| {
                let [x, y, heading] = particles.pose(index / beams.len()).map(f64::from);
                let direction = heading + f64::from(beams.direction_rad[index % beams.len()]);
                let range_m = grid.cast_m(geometry::Point2::new(x, y), direction, 12.0, 65);
                // Half a cell into the wall.
                let range_m = range_m.map_or(12.0, |range_m| (range_m + 0.5 * RESOLUTION_M).min(12.0));
                (f64::from(expected[index]) - range_m).abs()
            })
            .collect();
    });
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| 1e3 * errors[((errors.len() - 1) as f64 * share) as usize];
    println!(
        "a ray: {:.1} ns (median {:.1}; bar 35), {:.0} ns by the exact walk; error {:.2} mm in the median, {:.1} mm at 99 %, {:.0} mm at most",
        times.quantile(0.02) * 1e6 / errors.len() as f64,
        times.quantile(0.5) * 1e6 / errors.len() as f64,
        exact.quantile(0.0) * 1e6 / errors.len() as f64,
        at(0.5),
        at(0.99),
        at(1.0),
    );
}
