//! The parameters of the mapper.

use geometry::{GridError, GridFrame, MapError, MapImage, OccupancyGrid, Pose2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// The kind of image that a map is saved as.
pub const SAVED_AS: MapImage = MapImage::Pgm;

/// What can be adjusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// ROS map file (YAML) to begin with; empty begins with nothing known. Its size and place replace
    /// `min_x_m`, `min_y_m`, `width_m` and `height_m`.
    #[schemars(extend("format" = "path"))]
    pub load: String,
    /// ROS map file (YAML) that is written, with an image beside it, at the end; empty for none. The run
    /// fails when it cannot be written, or when that takes longer than `stop_after_ms` of the graph.
    #[schemars(extend("format" = "path"))]
    pub save: String,
    /// The map is also written this often while it changes, so that less is lost; 0 for at the end only.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub save_period_s: f64,
    /// Side of a cell.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub resolution_m: f64,
    /// Left edge of the map.
    #[schemars(range(min = -10_000.0, max = 10_000.0))]
    pub min_x_m: f64,
    /// Lower edge of the map.
    #[schemars(range(min = -10_000.0, max = 10_000.0))]
    pub min_y_m: f64,
    /// Extent along x.
    #[schemars(range(min = 0.1, max = 2000.0))]
    pub width_m: f64,
    /// Extent along y.
    #[schemars(range(min = 0.1, max = 2000.0))]
    pub height_m: f64,
    /// The floor that is mapped; poses on other floors are left out. Not set, it is whatever floor the
    /// robot is on.
    pub floor: Option<i32>,
    /// What a reading says of the cell in which it ends: the probability that it is occupied (X-4B).
    #[schemars(range(min = 0.51, max = 0.99))]
    pub hit_probability: f64,
    /// What a reading says of a cell that it passes: the probability that it is occupied (X-4B).
    #[schemars(range(min = 0.01, max = 0.49))]
    pub miss_probability: f64,
    /// The log-odds of a cell stay within this, so that what has changed is learnt again (X-4B).
    #[schemars(range(min = 0.5, max = 10.0))]
    pub clamp_log_odds: f64,
    /// Readings are used up to this distance; one that sees something farther away only clears the cells up
    /// to it.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub range_max_m: f64,
    /// A beam that sees nothing within its sensor's range clears the cells up to that range, at most up to
    /// `range_max_m`; 0 when it may have been swallowed by glass or black paint, and tells nothing.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub clear_max_m: f64,
    /// A beam speaks for what lies within its width, and no farther than halfway to the next beam.
    #[schemars(range(min = 0.0001, max = 0.6))]
    pub beam_width_max_rad: f64,
    /// A scan is placed by poses that are no farther than this from it in time.
    #[schemars(range(min = 10, max = 10_000))]
    pub pose_max_age_ms: u64,
    /// A map that has changed is published this often.
    #[schemars(range(min = 50, max = 60_000))]
    pub publish_period_ms: u64,
    /// Time between two looks at what is due when nothing arrives.
    #[schemars(range(min = 10, max = 1000))]
    pub period_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            load: String::new(),
            save: String::new(),
            save_period_s: 30.0,
            resolution_m: 0.05,
            min_x_m: -15.0,
            min_y_m: -15.0,
            width_m: 30.0,
            height_m: 30.0,
            floor: None,
            hit_probability: 0.65,
            miss_probability: 0.40,
            clamp_log_odds: 3.5,
            range_max_m: 10.0,
            clear_max_m: 6.0,
            beam_width_max_rad: 0.035,
            pose_max_age_ms: 200,
            publish_period_ms: 1000,
            period_ms: 100,
        }
    }
}

/// What can be wrong with the parameters, or with the file that they name.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// The extent and the resolution make no grid.
    #[error(
        "width_m = {width_m}, height_m = {height_m}, resolution_m = {resolution_m}: {cause}; choose larger cells or a smaller extent"
    )]
    NoGrid {
        /// Extent along x.
        width_m: f64,
        /// Extent along y.
        height_m: f64,
        /// Side of a cell.
        resolution_m: f64,
        /// Why not.
        cause: GridError,
    },
    /// The map to begin with cannot be used.
    #[error("load: {0}")]
    Load(#[from] MapError),
    /// The map could not be saved where it is to be.
    #[error("save: {0}")]
    Save(MapError),
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        self.frame().map(|_| ())
    }
}

impl Params {
    /// Whether the files that are named can be used: the map to begin with by its head, and the place where
    /// the map is to be saved. Reads no map, and writes nothing.
    ///
    /// # Errors
    /// When one of them could not be.
    pub fn check_files(&self) -> Result<(), ParamsError> {
        if !self.load.is_empty() {
            OccupancyGrid::look(&self.load)?;
        }
        if !self.save.is_empty() {
            OccupancyGrid::check_save(&self.save, SAVED_AS).map_err(ParamsError::Save)?;
        }
        Ok(())
    }

    /// Time between two looks at what is due when nothing arrives.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }

    /// Where the cells lie of a map that begins with nothing known.
    pub(crate) fn frame(&self) -> Result<GridFrame, ParamsError> {
        let cells = |extent_m: f64| (extent_m / self.resolution_m - 1e-9).ceil() as u32;
        let origin = Pose2 { x_m: self.min_x_m, y_m: self.min_y_m, heading_rad: 0.0 };
        let Self { width_m, height_m, resolution_m, .. } = *self;
        GridFrame::new(cells(width_m), cells(height_m), resolution_m, origin)
            .map_err(|cause| ParamsError::NoGrid { width_m, height_m, resolution_m, cause })
    }

    pub(crate) fn pose_max_age(&self) -> Duration {
        Duration::from_millis(self.pose_max_age_ms)
    }

    pub(crate) fn publish_period(&self) -> Duration {
        Duration::from_millis(self.publish_period_ms)
    }
}
