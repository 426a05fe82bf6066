//! The parameters of `particle-localiser`.

use messages::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whose scans are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// `laser/scan`.
    #[default]
    Laser,
    /// `sonar/scan`.
    Sonar,
}

/// How a scan is compared with the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Distance of each beam's end from the nearest wall, likelihoods multiplied (Thrun et al. 2005, table
    /// 6.3).
    #[default]
    LogProduct,
    /// Distance of each beam's end from the nearest wall, the cubes of the likelihoods summed: blunt, and
    /// patient with what the map does not know.
    LikelihoodField,
    /// Each beam's range against the expected one: hit, short, random (Thrun et al. 2005, table 6.1).
    Beam,
    /// Each reading against the expected one by a Gaussian (NXT-057), each reading clipped.
    Gaussian,
    /// Each reading of a cone against the nearest wall within, by a density that knows how echoes err
    /// (NXT-032 to NXT-034). For maps whose walls are lines: world files.
    Echo,
}

/// How the echoes of an ultrasonic sensor err, by the angle at which the sound meets a wall.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Echoes {
    /// An echo is noticed late by about this times the squared tangent of the angle of incidence, up to
    /// `latest_m`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub late_m: f64,
    /// The most by which an echo is noticed late.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub latest_m: f64,
    /// Angle of incidence from which echoes begin to be lost.
    #[schemars(range(min = 0.0, max = 1.57))]
    pub lost_from_rad: f64,
    /// Angle of incidence from which `lost_share` of the echoes is lost.
    #[schemars(range(min = 0.0, max = 1.58))]
    pub lost_to_rad: f64,
    /// The share of echoes that is lost from `lost_to_rad` on, so that something else answers.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub lost_share: f64,
    /// The least share of echoes that is lost wherever a wall is met.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub lost_least: f64,
    /// How much farther away, on average, the thing is that answers instead of a lost echo.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub detour_m: f64,
    /// An edge is heard as well as a wall that is met at this angle. Corners are heard well.
    #[schemars(range(min = 0.0, max = 1.57))]
    pub edge_rad: f64,
}

impl Default for Echoes {
    fn default() -> Self {
        Self {
            late_m: 0.03,
            latest_m: 0.2,
            lost_from_rad: 0.4,
            lost_to_rad: 1.1,
            lost_share: 0.6,
            lost_least: 0.05,
            detour_m: 0.5,
            edge_rad: 0.8,
        }
    }
}

/// Errors of the odometry: standard deviations of what one update's travel adds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionNoise {
    /// Place, with every update: scans and odometry do not belong to the same instant.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub place_m: f64,
    /// Place, for each metre of path.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub place_per_m: f64,
    /// Place, for each radian of turning.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub place_m_per_rad: f64,
    /// Heading, with every update.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub heading_rad: f64,
    /// Heading, for each radian of turning.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub heading_per_rad: f64,
    /// Heading, for each metre of path.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub heading_rad_per_m: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self {
            place_m: 0.02,
            place_per_m: 0.10,
            place_m_per_rad: 0.10,
            heading_rad: 0.01,
            heading_per_rad: 0.15,
            heading_rad_per_m: 0.06,
        }
    }
}

/// Recovery of a robot that was carried away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Recovery {
    /// Share of a new scan in the slow average of the fit.
    #[schemars(range(min = 0.0001, max = 0.5))]
    pub slow_rate: f64,
    /// Share of a new scan in the fast average, above `slow_rate`.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub fast_rate: f64,
    /// The fast average may lie below the slow one by this share before particles are scattered.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub tolerance: f64,
    /// The largest share of the particles that is scattered at once; 0 turns recovery off.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub most_scattered: f64,
    /// Scans after a start without a pose during which the whole map is still searched, beside what has been
    /// found.
    #[schemars(range(min = 0, max = 10000))]
    pub early_scans: u32,
}

impl Default for Recovery {
    fn default() -> Self {
        Self { slow_rate: 0.02, fast_rate: 0.3, tolerance: 0.1, most_scattered: 0.3, early_scans: 10 }
    }
}

/// A known pose at the start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Place in the map.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub x_m: f64,
    /// Place in the map.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub y_m: f64,
    /// Heading in the map.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub heading_rad: f64,
    /// Standard deviation of the place.
    #[serde(default = "start_sigma_m")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub sigma_m: f64,
    /// Standard deviation of the heading.
    #[serde(default = "start_sigma_rad")]
    #[schemars(range(min = 0.0, max = 4.0))]
    pub sigma_rad: f64,
}

fn start_sigma_m() -> f64 {
    0.2
}

fn start_sigma_rad() -> f64 {
    0.1
}

/// What `particle-localiser` can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Map of the kind of ROS (the YAML file), or a world file (`.toml`); empty for none, and then no pose is
    /// ever found.
    #[schemars(extend("format" = "path"))]
    pub map: String,
    /// World file used instead of a map; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// The floor of a world file.
    pub floor: i32,
    /// Side of a cell where a world file's walls are drawn into a grid.
    #[schemars(range(min = 0.002, max = 1.0))]
    pub world_resolution_m: f64,
    /// Cells that are occupied with at least this probability are walls.
    #[schemars(range(min = 1, max = 100))]
    pub occupied_percent: u8,
    /// Whose scans are read.
    pub sensor: Sensor,
    /// How a scan is compared with the map.
    pub model: Model,
    /// Half of the opening angle within which the sensor reports the nearest; 0 for a ray. For the models
    /// that expect ranges.
    #[schemars(range(min = 0.0, max = 0.8))]
    pub cone_half_width_rad: f64,
    /// Angle from one ray of the cone to the next.
    #[schemars(range(min = 0.001, max = 0.5))]
    pub cone_step_rad: f64,
    /// Readings of a scan that are used, evenly over the valid ones.
    #[schemars(range(min = 1, max = 4096))]
    pub beams: u32,
    /// Readings of at least this are left out, and no ray is followed farther.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub range_max_m: f64,
    /// Standard deviation of a reading, the map's error included.
    #[schemars(range(min = 0.001, max = 2.0))]
    pub sigma_m: f64,
    /// Share of readings that have nothing to do with the map.
    #[schemars(range(min = 0.001, max = 0.9))]
    pub random_share: f64,
    /// Share of readings cut short by what the map does not know. Beam model.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub short_share: f64,
    /// The most standard deviations for which a reading counts. Gaussian model.
    #[schemars(range(min = 0.5, max = 20.0))]
    pub clip_sigmas: f64,
    /// How echoes err. Echo model.
    pub echoes: Echoes,
    /// The most independent readings that a scan is worth: neighbouring beams err alike.
    #[schemars(range(min = 0.5, max = 4096.0))]
    pub independent_beams: f64,
    /// The fewest particles.
    #[schemars(range(min = 10, max = 1000000))]
    pub min_particles: u32,
    /// The most particles while the pose is followed; half as many more while several places are kept apart.
    #[schemars(range(min = 10, max = 1000000))]
    pub max_particles: u32,
    /// Beams that the first passes of a search of the whole map look at, evenly over all: there are many
    /// particles then, and little of what a scan tells is used.
    #[schemars(range(min = 1, max = 4096))]
    pub search_beams: u32,
    /// Particles of a start without a pose.
    #[schemars(range(min = 10, max = 4000000))]
    pub global_particles: u32,
    /// Bound of an update: particles times beams times passes. Below what the particles need, their number is
    /// lowered, and the cloud says so; 0 for no bound.
    pub budget_particle_beams: u64,
    /// The most passes over one scan: each sharpens the belief a little, so that few particles suffice for a
    /// scan that tells much.
    #[schemars(range(min = 1, max = 50))]
    pub max_passes: u32,
    /// A pass sharpens the belief until only this share of the particles is still effective.
    #[schemars(range(min = 0.01, max = 0.9))]
    pub pass_effective_share: f64,
    /// Particles are drawn anew when a smaller share of them is effective.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub resample_share: f64,
    /// Error of the belief that the number of particles is chosen for (KLD sampling).
    #[schemars(range(min = 0.001, max = 0.5))]
    pub kld_error: f64,
    /// Upper normal quantile of the probability that the error is kept.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub kld_quantile: f64,
    /// Side of the bins in which particles are counted and clusters are found.
    #[schemars(range(min = 0.005, max = 5.0))]
    pub bin_m: f64,
    /// Width in heading of the bins in which particles are counted and clusters are found.
    #[schemars(range(min = 0.01, max = 3.2))]
    pub bin_rad: f64,
    /// Errors of the odometry.
    pub motion: MotionNoise,
    /// The least noise of places that keeps drawn particles apart.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub jitter_m: f64,
    /// The least noise of headings that keeps drawn particles apart.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub jitter_rad: f64,
    /// A scan is used after this much travel since the last one that was used, or after `update_turn_rad`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub update_distance_m: f64,
    /// A scan is used after this much turning since the last one that was used, or after `update_distance_m`.
    /// With both 0 every scan is used.
    #[schemars(range(min = 0.0, max = 3.2))]
    pub update_turn_rad: f64,
    /// Odometry that jumps farther from one message to the next has begun anew.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub odometry_jump_m: f64,
    /// Pose at the start, where it is known; without it the whole map is searched.
    pub start: Option<Start>,
    /// Recovery of a robot that was carried away.
    pub recovery: Recovery,
    /// The pose counts as found when the standard deviation of its place lies below this, and
    /// `found_sigma_rad` and `found_share` hold too.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub found_sigma_m: f64,
    /// The pose counts as found when the standard deviation of its heading lies below this, and
    /// `found_sigma_m` and `found_share` hold too.
    #[schemars(range(min = 0.001, max = 3.2))]
    pub found_sigma_rad: f64,
    /// The pose counts as found when its cluster holds at least this share of the weight, and `found_sigma_m`
    /// and `found_sigma_rad` hold too.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub found_share: f64,
    /// Threads that weigh the particles; the result does not depend on it.
    #[schemars(range(min = 1, max = 16))]
    pub threads: u32,
    /// Time from one message with the particles to the next; 0 for none.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub cloud_period_s: f64,
    /// The most particles in a message that shows them.
    #[schemars(range(min = 1, max = 100000))]
    pub cloud_particles: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            map: String::new(),
            world: String::new(),
            floor: 0,
            world_resolution_m: 0.05,
            occupied_percent: 65,
            sensor: Sensor::Laser,
            model: Model::LogProduct,
            cone_half_width_rad: 0.0,
            cone_step_rad: 1.0_f64.to_radians(),
            beams: 120,
            range_max_m: 30.0,
            sigma_m: 0.10,
            random_share: 0.1,
            short_share: 0.1,
            clip_sigmas: 4.0,
            echoes: Echoes::default(),
            independent_beams: 40.0,
            min_particles: 500,
            max_particles: 5000,
            search_beams: 4096,
            global_particles: 20_000,
            budget_particle_beams: 0,
            max_passes: 4,
            pass_effective_share: 0.2,
            resample_share: 0.5,
            kld_error: 0.05,
            kld_quantile: 2.33,
            bin_m: 0.25,
            bin_rad: 10.0_f64.to_radians(),
            motion: MotionNoise::default(),
            jitter_m: 0.005,
            jitter_rad: 0.002,
            update_distance_m: 0.05,
            update_turn_rad: 0.03,
            odometry_jump_m: 3.0,
            start: None,
            recovery: Recovery::default(),
            found_sigma_m: 0.25,
            found_sigma_rad: 0.12,
            found_share: 0.8,
            threads: 1,
            cloud_period_s: 0.5,
            cloud_particles: 2000,
        }
    }
}

/// Parameters that make no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Fewest above most.
    #[error(
        "min_particles = {min_particles} is above max_particles = {max_particles}; lower the one or raise the other"
    )]
    FewestAboveMost {
        /// The fewest.
        min_particles: u32,
        /// The most.
        max_particles: u32,
    },
    /// The averages of the recovery could never differ.
    #[error(
        "recovery.slow_rate = {slow_rate} is not below recovery.fast_rate = {fast_rate}; the fast average must react faster"
    )]
    SlowNotSlower {
        /// Share of a new scan in the slow average.
        slow_rate: f64,
        /// Share of a new scan in the fast average.
        fast_rate: f64,
    },
    /// Echoes that would be lost at once, or the other way around.
    #[error(
        "echoes.lost_from_rad = {lost_from_rad} is not below echoes.lost_to_rad = {lost_to_rad}; lower the first"
    )]
    LossBackwards {
        /// Where echoes begin to be lost.
        lost_from_rad: f64,
        /// Where no more are lost.
        lost_to_rad: f64,
    },
    /// The echo model knows walls as lines only.
    #[error(
        "model = \"echo\" needs walls that are lines; give it a world file, or choose \"gaussian\" for a grid map"
    )]
    NoLines,
    /// Shares that leave nothing for readings of the map.
    #[error(
        "random_share = {random_share} and short_share = {short_share} leave nothing for readings of the map; lower one of them"
    )]
    NothingLeft {
        /// Readings from nowhere.
        random_share: f64,
        /// Readings cut short.
        short_share: f64,
    },
    /// A grid of the world would be too large.
    #[error("world_resolution_m = {resolution_m}: the walls of the world make no grid: {cause}")]
    Grid {
        /// Side of a cell.
        resolution_m: f64,
        /// Why.
        cause: geometry::GridError,
    },
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let Self { min_particles, max_particles, random_share, short_share, .. } = *self;
        if min_particles > max_particles {
            return Err(ParamsError::FewestAboveMost { min_particles, max_particles });
        }
        let Recovery { slow_rate, fast_rate, .. } = self.recovery;
        if slow_rate >= fast_rate {
            return Err(ParamsError::SlowNotSlower { slow_rate, fast_rate });
        }
        let Echoes { lost_from_rad, lost_to_rad, .. } = self.echoes;
        if lost_from_rad >= lost_to_rad {
            return Err(ParamsError::LossBackwards { lost_from_rad, lost_to_rad });
        }
        if random_share + short_share > 0.95 {
            return Err(ParamsError::NothingLeft { random_share, short_share });
        }
        Ok(())
    }
}
