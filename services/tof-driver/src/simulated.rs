//! Simulated sensors: cones of rays into the true world, and the noise of real ones.

use crate::{DeviceError, NoiseProfile, Params, ParamsError, TofDevice};
use geometry::{Cone, Hit, Pose2, Surface, World};
use messages::{RangeStatus, RangeStatusName, Stamped, Surroundings, TOF_COUNT, Time, TofRanges, WorldTruth};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::time::Duration;

/// Without a newer truth the bus counts as silent.
const SILENT_AFTER: Duration = Duration::from_millis(300);
/// Rays whose ranges differ by less than this see one thing.
const ONE_THING_M: f64 = 0.06;

/// Eight sensors that cast cones of rays into the world of a file, as `world/truth` has it.
#[derive(Debug, Clone)]
pub struct SimulatedTof {
    params: Params,
    surroundings: Surroundings,
    cone: Cone,
    rng: Pcg64,
    seen: Option<(Time, WorldTruth)>,
    hits: Vec<Option<Hit>>,
    /// Axial share of each ray's range: the cosine between ray and axis.
    axial: Vec<f64>,
    echoes: Vec<Echo>,
}

/// What one ray brings back.
#[derive(Debug, Clone, Copy)]
struct Echo {
    /// Along the sensor's axis.
    range_m: f64,
    /// Share of the light that comes back: the cosine of the incidence.
    strength: f64,
}

impl SimulatedTof {
    /// Sensors in the world that the parameters name.
    ///
    /// # Errors
    /// When the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Ok(Self::in_world(params, &world, seed))
    }

    /// Sensors in a world that is at hand already.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Self {
        let half_rad = 0.5 * params.field_of_view_deg.to_radians();
        let side = params.rays_per_side as usize;
        let cone = Cone {
            half_width_rad: half_rad,
            half_height_rad: half_rad,
            columns: side,
            rows: side,
            // What lies farther cannot be told from noise, so nobody need look there.
            max_range_m: params.noise_above_m.min(params.reach_m()) / half_rad.cos().powi(2),
        };
        let axial = (0..cone.rays()).map(|ray| {
            let (azimuth_rad, elevation_rad) = cone.direction_rad(ray);
            azimuth_rad.cos() * elevation_rad.cos()
        });
        Self {
            surroundings: Surroundings::new(world),
            axial: axial.collect(),
            hits: Vec::with_capacity(cone.rays()),
            echoes: Vec::with_capacity(cone.rays()),
            cone,
            rng: Pcg64::seed_from_u64(seed),
            seen: None,
            params,
        }
    }

    /// What one sensor would read without noise, if it sees anything: the nearest thing that fills enough of
    /// its view.
    fn look(&mut self, truth: &WorldTruth, mount: Pose2) -> Option<f64> {
        let scene = self.surroundings.scene(truth.floor)?;
        let robot = Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        scene.cast_cone(robot.compose(mount), self.params.height_m, &self.cone, &mut self.hits);
        self.echoes.clear();
        let echoes = self.hits.iter().zip(&self.axial).filter_map(|(hit, axial)| {
            // The floor is met at a grazing angle and far away: it sends nothing back.
            let hit = hit.filter(|hit| hit.surface != Surface::Floor)?;
            Some(Echo { range_m: hit.range_m * axial, strength: hit.incidence_cos })
        });
        self.echoes.extend(echoes);
        self.echoes.sort_unstable_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let rays = self.cone.rays() as f64;
        let mut rest = self.echoes.as_slice();
        while !rest.is_empty() {
            let gap = rest.windows(2).position(|pair| pair[1].range_m - pair[0].range_m > ONE_THING_M);
            let (thing, behind) = rest.split_at(gap.map_or(rest.len(), |before| before + 1));
            let fill = thing.iter().map(|echo| echo.strength).sum::<f64>() / rays;
            // Thin things flicker: now the sensor sees them, now what lies behind (COF-123).
            if fill >= self.params.sure_fill_fraction
                || self.rng.random::<f64>() * self.params.sure_fill_fraction < fill
            {
                return Some(thing.iter().map(|echo| echo.range_m).sum::<f64>() / thing.len() as f64);
            }
            rest = behind;
        }
        None
    }

    /// What the sensor makes of it.
    fn measure(&mut self, truth: &WorldTruth, mount: Pose2) -> (f64, RangeStatusName) {
        let reach_m = self.params.reach_m();
        let noise_above_m = self.params.noise_above_m.min(reach_m);
        match self.look(truth, mount) {
            Some(range_m) if range_m < TofRanges::MINIMUM_M.into() => {
                (TofRanges::MINIMUM_M.into(), RangeStatusName::MinimumClipped)
            }
            Some(range_m) if range_m <= noise_above_m => {
                let noise: f64 = StandardNormal.sample(&mut self.rng);
                let measured_m = range_m + self.sigma_m() * noise;
                (measured_m.max(TofRanges::MINIMUM_M.into()), RangeStatusName::Valid)
            }
            _ => {
                let draw = self.rng.random::<f64>();
                let anywhere_m = noise_above_m + (reach_m - noise_above_m) * self.rng.random::<f64>();
                if draw >= self.params.no_target_fraction && reach_m > noise_above_m {
                    return (anywhere_m, RangeStatusName::Valid);
                }
                // Mostly nothing came back; now and then too little, or too scattered.
                let status = match (draw * 997.0) as u32 % 10 {
                    0 => RangeStatusName::SigmaFail,
                    1 | 2 => RangeStatusName::SignalFail,
                    _ => RangeStatusName::OutOfBounds,
                };
                (anywhere_m, status)
            }
        }
    }

    fn sigma_m(&self) -> f64 {
        match (self.params.noise, self.params.strong_light) {
            (NoiseProfile::Paper, _) => 0.005,
            (NoiseProfile::Datasheet, false) => 0.020 / 3.0,
            (NoiseProfile::Datasheet, true) => 0.025 / 3.0,
            (NoiseProfile::None, _) => 0.0,
        }
    }
}

impl TofDevice for SimulatedTof {
    fn see(&mut self, truth: Option<Stamped<'_, WorldTruth>>) {
        if let Some(truth) = truth {
            self.surroundings.show(truth.message, truth.elements);
            self.seen = Some((truth.stamp, *truth.message));
        }
    }

    fn read(&mut self, now: Time) -> Result<TofRanges, DeviceError> {
        let (stamp, truth) = self.seen.ok_or(DeviceError::NeverHeard)?;
        let silent = now.since(stamp);
        if silent > SILENT_AFTER {
            let silent_ms = u64::try_from(silent.as_millis()).unwrap_or(u64::MAX);
            return Err(DeviceError::Silent { silent_ms });
        }
        let mut ranges = TofRanges::default();
        for sensor in 0..TOF_COUNT {
            let (range_m, status) = self.measure(&truth, TofRanges::MOUNTS[sensor]);
            // The sensor reports whole millimetres.
            ranges.range_m[sensor] = ((range_m * 1000.0).round() / 1000.0) as f32;
            ranges.status[sensor] = status.into();
        }
        for &sensor in &self.params.broken_sensors {
            if let Some(status) = ranges.status.get_mut(sensor as usize) {
                *status = RangeStatus::from(RangeStatusName::HardwareFail);
            }
        }
        Ok(ranges)
    }
}
