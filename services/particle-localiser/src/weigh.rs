//! The measurement models: how well a scan fits each particle, as a whole number.
//!
//! Every model gives each beam 0 (the map does not explain it) to [`FULL`] points. Points are whole numbers,
//! so their sum does not depend on the order, the vector unit or the number of threads.

use crate::echo::EchoModel;
use crate::expected::{Caster, Lanes};
use crate::field::{ByteField, LANES};
use crate::params::{Model, Params};
use crate::ratios::Ratios;
use crate::{Beams, Map, Particles};

/// Points of a beam that fits perfectly.
pub(crate) const FULL: u32 = 255;
/// Cells of a likelihood field along a cell of the map: finer than the map, as beams end anywhere.
const FINENESS: usize = 2;
/// No larger field is made finer than its map: it would not fit the cache.
const FINE_BYTES: usize = 1 << 22;
/// Ranges that the beam model tells apart.
const RANGES: usize = 512;
/// Fewer look-ups than this are not worth a second thread.
const WORTH_A_THREAD: usize = 200_000;

/// One measurement model on one map.
#[derive(Debug, Clone)]
pub struct Weigher {
    kind: Kind,
    /// Logarithm of the likelihood ratio between 0 and [`FULL`] points.
    nats: f64,
    cone: Cone,
    range_max_m: f32,
    independent_beams: f64,
    threads: usize,
}

#[derive(Debug, Clone)]
enum Kind {
    /// Points are logarithms of likelihoods.
    LogField(ByteField),
    /// Points are likelihoods, to the third power.
    CubeField(ByteField),
    /// A table of points by measured and expected range.
    Beam { caster: Caster, table: Vec<u8>, per_metre: f32 },
    /// Squared differences, clipped.
    Gaussian { caster: Caster, per_metre: f32, clip: f32 },
    /// Logarithms of densities that depend on how a wall is met.
    Echo(EchoModel),
}

#[derive(Debug, Clone, Copy)]
struct Cone {
    half_width_rad: f32,
    step_rad: f32,
}

impl Weigher {
    /// Prepares the model's tables.
    pub fn new(params: &Params, map: &Map) -> Self {
        let (sigma_m, random) = (params.sigma_m, params.random_share);
        let range_max_m = params.range_max_m as f32;
        let hit = 1.0 - random;
        // Likelihood of an end at a distance from the nearest wall, relative to one on the wall.
        let fit = |distance_m: f32| {
            let sigmas = f64::from(distance_m) / sigma_m;
            hit * (-0.5 * sigmas * sigmas).exp() + random
        };
        let cells = map.distances_m.frame().len();
        let fineness = if cells * FINENESS * FINENESS <= FINE_BYTES { FINENESS } else { 1 };
        let caster = || Caster::new(&map.walls, &map.distances_m);
        let (kind, nats) = match params.model {
            Model::LogProduct => {
                let nats = -random.ln();
                let points =
                    |distance_m: f32| (f64::from(FULL) * (1.0 + fit(distance_m).ln() / nats)).round() as u8;
                (Kind::LogField(ByteField::new(&map.distances_m, fineness, 0, points)), nats)
            }
            Model::LikelihoodField => {
                let points = |distance_m: f32| (f64::from(FULL) * fit(distance_m).powi(3)).round() as u8;
                (
                    Kind::CubeField(ByteField::new(
                        &map.distances_m,
                        fineness,
                        points(f32::INFINITY),
                        points,
                    )),
                    1.0,
                )
            }
            Model::Beam => {
                let (table, nats) = beam_table(params);
                let per_metre = (RANGES as f64 / params.range_max_m) as f32;
                (Kind::Beam { caster: caster(), table, per_metre }, nats)
            }
            Model::Echo => {
                let (echoes, nats) = EchoModel::new(params, &map.walls);
                (Kind::Echo(echoes), nats)
            }
            Model::Gaussian => {
                let clip = params.clip_sigmas as f32;
                (
                    Kind::Gaussian { caster: caster(), per_metre: (1.0 / sigma_m) as f32, clip },
                    0.5 * f64::from(clip * clip),
                )
            }
        };
        let cone =
            Cone { half_width_rad: params.cone_half_width_rad as f32, step_rad: params.cone_step_rad as f32 };
        let threads = params.threads as usize;
        Self { kind, nats, cone, range_max_m, independent_beams: params.independent_beams, threads }
    }

    /// Bytes of the model's tables.
    pub fn table_bytes(&self) -> usize {
        let of_caster = |caster: &Caster| match caster {
            Caster::Lines(lines) => size_of_val(lines.as_slice()),
            Caster::Cells(field) => field.bytes(),
        };
        match &self.kind {
            Kind::LogField(field) | Kind::CubeField(field) => field.bytes(),
            Kind::Beam { caster, table, .. } => of_caster(caster) + table.len(),
            Kind::Gaussian { caster, .. } => of_caster(caster),
            Kind::Echo(echoes) => echoes.table_bytes(),
        }
    }

    /// The points of every particle for this scan.
    pub fn weigh(&self, particles: &Particles, beams: &Beams, points: &mut Vec<u32>) {
        let count = particles.len();
        points.clear();
        points.resize(count, 0);
        let scan = Scan::new(self, beams);
        let threads = if count * beams.len() < WORTH_A_THREAD { 1 } else { self.threads };
        // Whole blocks for each thread; which thread weighs a particle makes no difference to it.
        let part = count.div_ceil(threads * LANES).max(1) * LANES;
        let parts =
            particles.x.chunks(part).zip(particles.y.chunks(part)).zip(particles.heading.chunks(part));
        let mut parts =
            parts.zip(points.chunks_mut(part)).map(|(((x, y), heading), points)| ([x, y, heading], points));
        if threads == 1 {
            parts.for_each(|(poses, points)| self.weigh_part(poses, beams, &scan, points));
            return;
        }
        let first = parts.next();
        std::thread::scope(|scope| {
            for (poses, points) in parts {
                let scan = &scan;
                scope.spawn(move || self.weigh_part(poses, beams, scan, points));
            }
            if let Some((poses, points)) = first {
                self.weigh_part(poses, beams, &scan, points);
            }
        });
    }

    /// What each particle's sensor is expected to read along each beam, particle by particle; nothing for the
    /// models that expect no ranges.
    pub fn expected_ranges(&self, particles: &Particles, beams: &Beams) -> Vec<f32> {
        if let Kind::Echo(echoes) = &self.kind {
            return echoes.expected_ranges(particles, beams);
        }
        let (Kind::Beam { caster, .. } | Kind::Gaussian { caster, .. }) = &self.kind else {
            return Vec::new();
        };
        let scan = Scan::new(self, beams);
        let mut expected = vec![0.0; particles.len() * beams.len()];
        for first in (0..particles.len()).step_by(LANES) {
            let last = (first + LANES).min(particles.len());
            let poses =
                [&particles.x[first..last], &particles.y[first..last], &particles.heading[first..last]];
            let mut points = [0; LANES];
            let keep = std::cell::RefCell::new(&mut expected);
            self.expect(caster, poses, beams, &scan, &mut points[..last - first], |beam, ranges, _| {
                for (lane, range_m) in ranges.iter().enumerate().take(last - first) {
                    keep.borrow_mut()[(first + lane) * beams.len() + beam] = *range_m;
                }
            });
        }
        expected
    }

    /// How well so many points of so many beams fit: 0 to 1.
    pub fn fit(points: f64, beams: usize) -> f64 {
        points / (f64::from(FULL) * beams.max(1) as f64)
    }

    /// Logarithm of the likelihood of a scan of so many beams, but for a constant.
    pub fn log_likelihood(&self, points: u32, beams: usize) -> f64 {
        let full = f64::from(FULL);
        match self.kind {
            Kind::CubeField(_) => (1.0 + f64::from(points) / full).ln(),
            _ => {
                let worth = (self.independent_beams / beams.max(1) as f64).min(1.0);
                f64::from(points) / full * self.nats * worth
            }
        }
    }

    /// Likelihoods to a power, relative to that of so many points.
    pub(crate) fn ratios(&self, best: u32, beams: usize, exponent: f64) -> Ratios {
        match self.kind {
            Kind::CubeField(_) => Ratios::of_sums(best, f64::from(FULL), exponent),
            _ => Ratios::of_logs(best, self.log_likelihood(1, beams) * exponent),
        }
    }

    fn weigh_part(&self, poses: [&[f32]; 3], beams: &Beams, scan: &Scan, points: &mut [u32]) {
        match &self.kind {
            Kind::LogField(field) | Kind::CubeField(field) => {
                field.sums(poses, &scan.ends_u, &scan.ends_v, points);
            }
            Kind::Beam { caster, table, per_metre } => {
                let last = (RANGES - 1) as f32;
                self.expect(caster, poses, beams, scan, points, |beam, expected, total| {
                    let row = &table[scan.rows[beam] * RANGES..][..RANGES];
                    for lane in 0..LANES {
                        let column = (expected[lane] * per_metre).min(last) as usize;
                        total[lane] += u32::from(row[column & (RANGES - 1)]);
                    }
                });
            }
            Kind::Echo(echoes) => {
                let blocks = poses[0].chunks(LANES).zip(poses[1].chunks(LANES)).zip(poses[2].chunks(LANES));
                for (((x, y), heading), points) in blocks.zip(points.chunks_mut(LANES)) {
                    points.copy_from_slice(&echoes.points([x, y, heading], beams)[..points.len()]);
                }
            }
            Kind::Gaussian { caster, per_metre, clip } => {
                let most = clip * clip;
                let scale = FULL as f32 / most;
                self.expect(caster, poses, beams, scan, points, |beam, expected, total| {
                    let measured_m = beams.range_m[beam];
                    for lane in 0..LANES {
                        let sigmas = (expected[lane] - measured_m) * per_metre;
                        let left = (most - sigmas * sigmas).max(0.0);
                        // At most 255.
                        total[lane] += (left * scale + 0.5) as u32;
                    }
                });
            }
        }
    }

    /// Casts the rays for each block of particles, takes the nearest of each beam's cone, and hands it to
    /// `judge`.
    fn expect(
        &self,
        caster: &Caster,
        [x, y, heading]: [&[f32]; 3],
        beams: &Beams,
        scan: &Scan,
        points: &mut [u32],
        judge: impl Fn(usize, &Lanes, &mut [u32; LANES]),
    ) {
        let mut ranges: Vec<Lanes> = Vec::new();
        let blocks = x.chunks(LANES).zip(y.chunks(LANES)).zip(heading.chunks(LANES));
        for (((x, y), heading), points) in blocks.zip(points.chunks_mut(LANES)) {
            let block = caster.block([x, y, heading], beams.sensor);
            caster.cast(&block, &scan.directions, self.range_max_m, &mut ranges);
            let mut total = [0_u32; LANES];
            for (beam, &(from, to)) in scan.windows.iter().enumerate() {
                let mut nearest = ranges[from];
                for other in &ranges[from + 1..to] {
                    for lane in 0..LANES {
                        nearest[lane] = nearest[lane].min(other[lane]);
                    }
                }
                judge(beam, &nearest, &mut total);
            }
            points.copy_from_slice(&total[..points.len()]);
        }
    }
}

/// What of a scan is the same for all particles.
#[derive(Debug, Default)]
struct Scan {
    ends_u: Vec<f32>,
    ends_v: Vec<f32>,
    /// Rays to cast, by direction, as cosine and sine.
    directions: Vec<[f32; 2]>,
    /// For each beam the rays of its cone.
    windows: Vec<(usize, usize)>,
    /// For each beam its row in the beam model's table.
    rows: Vec<usize>,
}

impl Scan {
    fn new(weigher: &Weigher, beams: &Beams) -> Self {
        let mut scan = Self::default();
        match &weigher.kind {
            Kind::LogField(field) | Kind::CubeField(field) => {
                scan.ends_u = beams.end_x.iter().map(|x| x * field.per_metre).collect();
                scan.ends_v = beams.end_y.iter().map(|y| y * field.per_metre).collect();
            }
            Kind::Beam { per_metre, .. } => {
                scan.aim(beams, weigher.cone);
                let row = |range_m: &f32| ((range_m * per_metre) as usize).min(RANGES - 1);
                scan.rows = beams.range_m.iter().map(row).collect();
            }
            Kind::Gaussian { .. } => scan.aim(beams, weigher.cone),
            Kind::Echo(_) => {}
        }
        scan
    }

    /// The rays of all cones, each direction once: cones of neighbouring readings share them.
    fn aim(&mut self, beams: &Beams, cone: Cone) {
        let steps = (cone.half_width_rad / cone.step_rad + 1e-3).floor() as i32;
        let turns = (-steps..=steps).map(|step| step as f32 * cone.step_rad);
        let mut rays: Vec<f32> = beams
            .direction_rad
            .iter()
            .flat_map(|middle| turns.clone().map(move |turn| middle + turn))
            .collect();
        rays.sort_by(f32::total_cmp);
        rays.dedup_by(|next, kept| *next - *kept < SAME_RAD);
        let reach = steps as f32 * cone.step_rad + SAME_RAD;
        let window = |middle: &f32| {
            let from = rays.partition_point(|ray| *ray < middle - reach);
            let to = rays.partition_point(|ray| *ray <= middle + reach);
            (from, to.max(from + 1).min(rays.len()))
        };
        self.windows = beams.direction_rad.iter().map(window).collect();
        self.directions = rays.iter().map(|ray| [ray.cos(), ray.sin()]).collect();
    }
}

/// Rays closer than this are one.
const SAME_RAD: f32 = 1e-3;

/// Points by measured (rows) and expected range (columns), and the nats between the worst and the best: Thrun
/// et al. 2005, equation 6.12, without the share of readings at the maximum, which are dropped before. The
/// last row and column stand for everything beyond.
fn beam_table(params: &Params) -> (Vec<u8>, f64) {
    let width_m = params.range_max_m / RANGES as f64;
    let middle = |index: usize| (index as f64 + 0.5) * width_m;
    let (random, short) = (params.random_share, params.short_share);
    // Half of what comes too early comes in the first two metres.
    let decay_per_m = 0.35;
    let sigma_m = params.sigma_m.max(0.5 * width_m);
    let density = |measured_m: f64, expected_m: f64| {
        let sigmas = (measured_m - expected_m) / sigma_m;
        let hit = (-0.5 * sigmas * sigmas).exp() / (sigma_m * std::f64::consts::TAU.sqrt());
        let early = if measured_m < expected_m {
            decay_per_m * (-decay_per_m * measured_m).exp() / (1.0 - (-decay_per_m * expected_m).exp())
        } else {
            0.0
        };
        (1.0 - random - short) * hit + short * early + random / params.range_max_m
    };
    let logs: Vec<f64> = (0..RANGES)
        .flat_map(|row| (0..RANGES).map(move |column| (row, column)))
        .map(|(row, column)| density(middle(row), middle(column)).ln())
        .collect();
    let worst = logs.iter().copied().fold(f64::INFINITY, f64::min);
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let nats = (best - worst).max(1e-9);
    (logs.iter().map(|log| (f64::from(FULL) * (log - worst) / nats).round() as u8).collect(), nats)
}
