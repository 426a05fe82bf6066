//! Where the robot is on a map: one Monte Carlo localiser for lasers on grids and ultrasonic cones in arenas
//! (Fox et al. 1999; NXT-050 to NXT-060). It starts without a pose, follows the odometry, corrects by scans,
//! and notices when the robot has been carried away.

mod beams;
mod bins;
mod clusters;
mod echo;
mod evidence;
mod expected;
mod field;
mod filter;
pub mod kld;
mod map;
mod motion;
mod params;
mod particles;
mod random;
mod ratios;
mod recovery;
mod resample;
mod snapshot;
mod trigonometry;
mod weigh;

#[cfg(test)]
mod tests;

pub use beams::Beams;
pub use clusters::Cluster;
pub use filter::{Filter, Update};
pub use map::{Map, MapLoadError};
pub use motion::{MotionSigma, Travel};
pub use params::{Echoes, Model, MotionNoise, Params, ParamsError, Recovery, Sensor, Start};
pub use particles::Particles;
pub use recovery::Averages;
pub use snapshot::Snapshot;
pub use weigh::Weigher;

use geometry::{Pose2, angle};
use messages::{
    CLUSTER_CAPACITY, LocationStateName, Odometry, Once, Parameters, Particle, ParticleCloud, PoseCluster,
    PoseEstimate, RangeScan, Stamped, Time,
};

/// What the localiser reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest odometry.
    pub odometry: Option<Stamped<'a, Odometry>>,
    /// The next scan; one that was given before is ignored.
    pub scan: Option<Stamped<'a, RangeScan>>,
}

/// What the localiser says.
#[derive(Debug, Clone, Copy)]
pub struct Outputs<'a> {
    /// The pose.
    pub pose: PoseEstimate,
    /// The particles, when it is time to show them.
    pub cloud: Option<(ParticleCloud, &'a [Particle])>,
}

/// The localiser.
#[derive(Debug, Clone)]
pub struct ParticleLocaliser {
    params: Params,
    filter: Filter,
    /// The odometry's last pose.
    odometry: Option<Pose2>,
    /// Travelled since the last scan that was used.
    travel: Travel,
    seen_scan: Once,
    update: Option<Update>,
    /// Whether the pose has been found since the start, or since it was lost.
    is_found: bool,
    accepted: u64,
    rejected: u64,
    shown: Option<Time>,
    elements: Vec<Particle>,
}

/// Below this part of the weight the best place is a guess among several.
const DOUBTFUL_SHARE: f64 = 0.5;

/// How much worse than usual a scan must fit to be a sign that something is wrong.
const DOUBTFUL_FIT: f64 = 0.7;

impl ParticleLocaliser {
    /// A localiser on a map.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params, map: Map, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        if params.model == Model::Echo && map.walls.is_empty() && !map.is_empty() {
            return Err(ParamsError::NoLines);
        }
        let is_found = params.start.is_some();
        Ok(Self {
            filter: Filter::new(params.clone(), map, seed),
            params,
            odometry: None,
            travel: Travel::default(),
            seen_scan: Once::default(),
            update: None,
            is_found,
            accepted: 0,
            rejected: 0,
            shown: None,
            elements: Vec::new(),
        })
    }

    /// The filter within.
    pub fn filter(&self) -> &Filter {
        &self.filter
    }

    /// What the last scan that was used has told.
    pub fn last_update(&self) -> Option<&Update> {
        self.update.as_ref()
    }

    /// Takes in what is new, and says where the robot is.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        if let Some(odometry) = inputs.odometry {
            self.follow(&odometry);
        }
        if let Some(scan) = inputs.scan.and_then(|scan| self.seen_scan.take(scan)) {
            self.look(&scan);
        }
        let pose = self.estimate();
        let period_s = self.params.cloud_period_s;
        let is_time = self.shown.is_none_or(|shown| now < shown || now.seconds_since(shown) >= period_s);
        let cloud = (period_s > 0.0 && is_time && self.update.is_some()).then(|| {
            self.shown = Some(now);
            self.cloud()
        });
        Outputs { pose, cloud: cloud.map(|header| (header, self.elements.as_slice())) }
    }

    fn follow(&mut self, odometry: &Odometry) {
        let Ok(pose) = odometry.pose() else { return };
        let last = self.odometry.replace(pose);
        if let Some(last) = last {
            let step = last.to(pose);
            // Odometry that has begun anew tells nothing of the way between.
            if step.x_m.hypot(step.y_m) <= self.params.odometry_jump_m {
                self.travel.extend(step);
            }
        }
    }

    fn look(&mut self, scan: &Stamped<'_, RangeScan>) {
        let Params { update_distance_m, update_turn_rad, range_max_m, beams, .. } = self.params;
        let every = update_distance_m == 0.0 && update_turn_rad == 0.0;
        let moved = self.travel.path_m >= update_distance_m && update_distance_m > 0.0
            || self.travel.turn_rad >= update_turn_rad && update_turn_rad > 0.0;
        if self.update.is_some() && !moved && !every {
            return;
        }
        let beams = Beams::select(scan.message, scan.elements, range_max_m, beams as usize);
        if beams.is_empty() {
            self.rejected += 1;
            return;
        }
        let travel = std::mem::take(&mut self.travel);
        if every || travel != Travel::default() {
            self.filter.advance(&travel);
        }
        match self.filter.correct(&beams) {
            Some(update) => {
                self.accepted += 1;
                self.judge(&update);
                self.update = Some(update);
            }
            None => self.rejected += 1,
        }
    }

    fn judge(&mut self, update: &Update) {
        let Some(best) = update.clusters.first() else { return };
        let Params { found_sigma_m, found_sigma_rad, found_share, .. } = self.params;
        let share = self.share_of_place(update);
        let certain =
            best.sigma_m() <= found_sigma_m && best.sigma_rad() <= found_sigma_rad && share >= found_share;
        self.is_found |= certain;
        if share < DOUBTFUL_SHARE {
            self.is_found = false;
        }
    }

    /// The part of the weight that lies at the likeliest place: clusters so near to each other that they
    /// share a bin are one place.
    fn share_of_place(&self, update: &Update) -> f64 {
        let Some(best) = update.clusters.first() else { return 0.0 };
        let Params { bin_m, bin_rad, .. } = self.params;
        let is_there = |cluster: &&Cluster| {
            let turn_rad = angle::difference(cluster.pose.heading_rad, best.pose.heading_rad);
            cluster.pose.distance_m(best.pose) <= bin_m && turn_rad.abs() <= bin_rad
        };
        update.clusters.iter().filter(is_there).map(|cluster| cluster.share).sum()
    }

    fn estimate(&self) -> PoseEstimate {
        let message = PoseEstimate {
            accepted: self.accepted,
            rejected: self.rejected,
            floor: self.params.floor,
            ..PoseEstimate::default()
        };
        let map = self.filter.map();
        let Some(update) = &self.update else { return self.before_first_scan(message) };
        let Some(best) = update.clusters.first() else { return message };
        let pose = map.from_own(best.pose.compose(self.travel.motion));
        let sigma = self.travel.sigma(&self.params.motion);
        let mut covariance = rotated(best.covariance, map.rotation_rad());
        if self.travel != Travel::default() {
            covariance[0] += sigma.place_m * sigma.place_m;
            covariance[4] += sigma.place_m * sigma.place_m;
            covariance[8] += sigma.heading_rad * sigma.heading_rad;
        }
        let doubtful = update.fit < DOUBTFUL_FIT * self.filter.usual_fit()
            || self.share_of_place(update) < self.params.found_share;
        let state = match (self.is_found, doubtful) {
            (true, false) => LocationStateName::Tracking,
            (true, true) => LocationStateName::Degraded,
            (false, _) => LocationStateName::Lost,
        };
        PoseEstimate {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            covariance,
            state: state.into(),
            ..message
        }
    }

    /// The given start, moved by the odometry.
    fn before_first_scan(&self, message: PoseEstimate) -> PoseEstimate {
        let Some(start) = self.params.start else { return message };
        let pose = Pose2::new(start.x_m, start.y_m, start.heading_rad).compose(self.travel.motion);
        let (place, heading) = (start.sigma_m * start.sigma_m, start.sigma_rad * start.sigma_rad);
        PoseEstimate {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            covariance: [place, 0.0, 0.0, 0.0, place, 0.0, 0.0, 0.0, heading],
            state: LocationStateName::Degraded.into(),
            ..message
        }
    }

    fn cloud(&mut self) -> ParticleCloud {
        let map = self.filter.map();
        let particles = self.filter.particles();
        let mut header = ParticleCloud { count: particles.len() as u32, ..ParticleCloud::default() };
        let origin = map.from_own(Pose2::IDENTITY);
        (header.origin_x_m, header.origin_y_m) = (origin.x_m, origin.y_m);
        if let Some(update) = &self.update {
            header.effective_count = update.effective;
            header.fit = update.fit;
            header.wanted_count = u32::try_from(update.wanted).unwrap_or(u32::MAX);
            header.clusters_in_all = update.clusters.len() as u32;
            header.cluster_count = update.clusters.len().min(CLUSTER_CAPACITY) as u32;
            header.passes = update.passes;
            header.limited = u32::from(update.limited);
            header.scattered = update.scattered as u32;
            header.beams = update.beams as u32;
            for (place, cluster) in header.clusters.iter_mut().zip(&update.clusters) {
                let pose = map.from_own(cluster.pose);
                *place = PoseCluster {
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    heading_rad: pose.heading_rad,
                    sigma_m: cluster.sigma_m(),
                    sigma_rad: cluster.sigma_rad(),
                    share: cluster.share,
                };
            }
        }
        let rotation = Pose2::new(0.0, 0.0, map.rotation_rad());
        let stride = particles.len().div_ceil(self.params.cloud_particles as usize).max(1);
        self.elements.clear();
        for index in (0..particles.len()).step_by(stride) {
            let [x, y, heading] = particles.pose(index).map(f64::from);
            let turned = rotation.compose(Pose2::new(x, y, heading));
            self.elements.push(Particle {
                x_m: turned.x_m as f32,
                y_m: turned.y_m as f32,
                heading_rad: turned.heading_rad as f32,
                weight: (particles.weight[index] * particles.len() as f64) as f32,
            });
        }
        header
    }
}

/// A covariance of (x, y, heading) in a frame turned by `-angle_rad`.
fn rotated(c: [f64; 9], angle_rad: f64) -> [f64; 9] {
    if angle_rad == 0.0 {
        return c;
    }
    let (s, k) = angle_rad.sin_cos();
    let xx = k * k * c[0] - 2.0 * s * k * c[1] + s * s * c[4];
    let yy = s * s * c[0] + 2.0 * s * k * c[1] + k * k * c[4];
    let xy = s * k * (c[0] - c[4]) + (k * k - s * s) * c[1];
    let (xt, yt) = (k * c[2] - s * c[5], s * c[2] + k * c[5]);
    [xx, xy, xt, xy, yy, yt, xt, yt, c[8]]
}
