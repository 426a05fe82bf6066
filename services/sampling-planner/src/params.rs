//! The parameters of the planner.

use crate::obstacles::Rules;
use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What can be adjusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file with the floors' walls; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// The offset by which the floor is shrunk: no point of a path comes nearer to a wall. Half the robot's
    /// length (NXT-070, X-09).
    #[schemars(range(min = 0.0, max = 2.0))]
    pub robot_radius_m: f64,
    /// Waypoints to choose from in the first draw (NXT-071).
    #[schemars(range(min = 1, max = 10_000))]
    pub samples: u32,
    /// Each further draw has twice as many as the one before, up to this (NXT-081). No step draws more: a
    /// search may take several steps.
    #[schemars(range(min = 1, max = 10_000))]
    pub samples_max: u32,
    /// Draws after which a goal counts as unreachable.
    #[schemars(range(min = 1, max = 100))]
    pub tries_max: u32,
    /// Begin with one waypoint, as the printed algorithm does, and never drive straight to the goal.
    pub literal: bool,
    /// Observed obstacles are kept farther away than walls by this much.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub obstacle_margin_m: f64,
    /// How far from a place that is too near to something the way out is looked for.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub escape_m: f64,
    /// A robot farther from its path than this gets a new one.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub stray_m: f64,
    /// The least time before a path for one request is changed, or an unreachable goal is tried again.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub replan_interval_s: f64,
    /// Range readings of at least this are no obstacle (COF-030).
    #[schemars(range(min = 0.1, max = 4.0))]
    pub range_max_m: f64,
    /// Half of a range sensor's field of view (COF-021).
    #[schemars(range(min = 0.01, max = 0.5))]
    pub half_cone_rad: f64,
    /// Readings that end this near to a known wall are that wall.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub wall_tolerance_m: f64,
    /// How often an obstacle must be seen to count.
    #[schemars(range(min = 1, max = 5))]
    pub confirm_sightings: u8,
    /// Obstacles that were not seen for this long are forgotten.
    #[schemars(range(min = 0.5, max = 600.0))]
    pub obstacle_memory_s: f64,
    /// Without effect, as the algorithm knows lengths only: it is here so that the table of a planner with
    /// lanes serves this one too.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub keep_right_weight: f64,
    /// Without effect, as beyond the offset a wall costs nothing: it is here so that the table of a planner
    /// with costs serves this one too.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub clearance_m: f64,
    /// Poses and range readings older than this are not used.
    #[schemars(range(min = 50, max = 10_000))]
    pub input_max_age_ms: u64,
    /// Time between two looks at the path when nothing arrives.
    #[schemars(range(min = 10, max = 1000))]
    pub period_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            robot_radius_m: 0.08,
            samples: 30,
            samples_max: 960,
            tries_max: 20,
            literal: false,
            obstacle_margin_m: 0.05,
            escape_m: 1.0,
            stray_m: 0.4,
            replan_interval_s: 1.0,
            range_max_m: 1.0,
            half_cone_rad: 0.13,
            wall_tolerance_m: 0.12,
            confirm_sightings: 2,
            obstacle_memory_s: 20.0,
            keep_right_weight: 0.0,
            clearance_m: 0.0,
            input_max_age_ms: 500,
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
    /// Later draws would be smaller than the first.
    #[error(
        "samples = {samples} is above samples_max = {samples_max}: raise samples_max, which limits how the draws grow"
    )]
    DrawsShrink {
        /// Waypoints in the first draw.
        samples: u32,
        /// Waypoints in the largest.
        samples_max: u32,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.samples > self.samples_max {
            return Err(ParamsError::DrawsShrink { samples: self.samples, samples_max: self.samples_max });
        }
        Ok(())
    }
}

impl Params {
    /// Time between two looks at the path when nothing arrives.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }

    /// From an observed obstacle to the nearest path.
    pub(crate) fn obstacle_distance_m(&self) -> f64 {
        self.robot_radius_m + self.obstacle_margin_m
    }

    pub(crate) fn rules(&self) -> Rules {
        Rules {
            range_max_m: self.range_max_m,
            half_cone_rad: self.half_cone_rad,
            wall_tolerance_m: self.wall_tolerance_m,
            confirm: self.confirm_sightings,
            memory: Duration::from_secs_f64(self.obstacle_memory_s),
        }
    }

    pub(crate) fn input_max_age(&self) -> Duration {
        Duration::from_millis(self.input_max_age_ms)
    }
}
