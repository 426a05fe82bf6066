//! The parameters of the planner.

use crate::field::Costs;
use crate::overlay::Rules;
use geometry::{MapError, WorldError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// How paths are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Algorithm {
    /// Over the eight neighbours, then straightened into the cheapest pieces of any direction.
    #[default]
    AnyAngle,
    /// Over the eight neighbours; corners at multiples of 45 degrees.
    EightConnected,
}

/// What can be adjusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file with the floors' walls; empty for none.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// ROS map file (YAML) used instead of a world; empty for none.
    #[schemars(extend("format" = "path"))]
    pub map: String,
    /// The floor that the map file shows.
    pub map_floor: i32,
    /// A map's cell is free when its freeness (0 occupied, 0.5 unknown, 1 free) is above this (ASN Table 1,
    ///
    #[schemars(range(min = 0.0, max = 1.0))]
    pub occupancy_threshold: f64,
    /// How paths are searched.
    pub algorithm: Algorithm,
    /// Edge of a cell of the grid made from a world.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub resolution_m: f64,
    /// No point of a path comes nearer to a wall.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub robot_radius_m: f64,
    /// Observed obstacles are kept farther away than walls by this much.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub obstacle_margin_m: f64,
    /// Extra cost per metre for each metre beside the lane on the right of a hallway (COF-006); zero means
    /// that there are no lanes.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub keep_right_weight: f64,
    /// The lane's middle, from the wall on the right.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub lane_m: f64,
    /// Passages wider than this have no lanes.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub hallway_width_max_m: f64,
    /// Extra cost per metre travelled in contact with the inflated walls, falling to zero at `clearance_m`;
    /// zero switches it off.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_weight: f64,
    /// Beyond this distance a wall costs nothing.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub clearance_m: f64,
    /// How far from an inflated cell the way out is looked for.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub escape_m: f64,
    /// Inner corners nearer to each other than this are merged where the way stays free.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub waypoint_spacing_m: f64,
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
    /// Without effect, as a grid has no waypoints to draw: it is here so that the table of a sampling planner
    /// serves this one too.
    #[schemars(range(min = 1, max = 10_000))]
    pub samples: u32,
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
            map: String::new(),
            map_floor: 0,
            occupancy_threshold: 0.4,
            algorithm: Algorithm::AnyAngle,
            resolution_m: 0.05,
            robot_radius_m: 0.30,
            obstacle_margin_m: 0.08,
            keep_right_weight: 2.0,
            lane_m: 0.555,
            hallway_width_max_m: 2.5,
            clearance_weight: 1.0,
            clearance_m: 0.45,
            escape_m: 1.0,
            waypoint_spacing_m: 0.4,
            stray_m: 0.4,
            replan_interval_s: 1.0,
            range_max_m: 1.0,
            half_cone_rad: 0.13,
            wall_tolerance_m: 0.12,
            confirm_sightings: 2,
            obstacle_memory_s: 20.0,
            samples: 30,
            input_max_age_ms: 500,
            period_ms: 100,
        }
    }
}

/// What can be wrong with the parameters, or with the files that they name.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Two sources of walls.
    #[error("world = \"{world}\" and map = \"{map}\" both name the walls: leave one of them empty")]
    TwoMaps {
        /// The world file.
        world: String,
        /// The map file.
        map: String,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
    /// The map file cannot be used.
    #[error("map: {0}")]
    Map(#[from] MapError),
    /// A map whose rows do not run along x.
    #[error("map = \"{map}\" is turned by {yaw_rad} rad: set the yaw in its origin to zero")]
    TurnedMap {
        /// The map file.
        map: String,
        /// The direction of its rows.
        yaw_rad: f64,
    },
    /// A floor whose grid would be too large.
    #[error("{what} needs {cells} cells of {resolution_m} m, and {most} are possible: choose larger cells")]
    TooLarge {
        /// The map, or the floors of the world.
        what: String,
        /// Cells needed.
        cells: u64,
        /// The cells' edge.
        resolution_m: f64,
        /// The most.
        most: u64,
    },
    /// Cells that are too small for the robot.
    #[error(
        "{what} has cells of {resolution_m} m: what robot_radius_m and obstacle_margin_m keep free around an obstacle, {reach_m} m, \
         is too many of them; choose larger cells"
    )]
    TooFine {
        /// The map, or the floors of the world.
        what: String,
        /// The cells' edge.
        resolution_m: f64,
        /// How far from an obstacle cells change.
        reach_m: f64,
    },
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if !self.world.is_empty() && !self.map.is_empty() {
            return Err(ParamsError::TwoMaps { world: self.world.clone(), map: self.map.clone() });
        }
        Ok(())
    }
}

impl Params {
    /// Time between two looks at the path when nothing arrives.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }

    /// What decides where the robot may be and what it costs.
    pub fn costs(&self) -> Costs {
        Costs {
            robot_radius_m: self.robot_radius_m,
            obstacle_margin_m: self.obstacle_margin_m,
            keep_right_weight: self.keep_right_weight,
            lane_m: self.lane_m,
            hallway_width_max_m: self.hallway_width_max_m,
            clearance_weight: self.clearance_weight,
            clearance_m: self.clearance_m,
        }
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
