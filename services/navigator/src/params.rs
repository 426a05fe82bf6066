//! The parameters of the navigator.

use geometry::WorldError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What can be adjusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// World file with doors, home and elevator; empty for none, and then every order is refused.
    #[schemars(extend("format" = "path"))]
    pub world: String,
    /// The place where coffee is taken aboard and where the robot waits for orders.
    pub home: String,
    /// Room of an order that is there from the start; empty for none.
    pub default_order: String,
    /// A goal of a path counts as reached within this distance.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub arrival_tolerance_m: f64,
    /// The planner may end a path this far from a goal on which something stands.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub goal_tolerance_m: f64,
    /// How far before the door the path ends and the search for the door begins.
    #[schemars(range(min = 0.3, max = 5.0))]
    pub approach_m: f64,
    /// Distance from a door on the right to the line on which the robot passes it.
    #[schemars(range(min = 0.3, max = 3.0))]
    pub right_door_m: f64,
    /// Distance from a door on the left to the line on which the robot passes it: nearer than the lane, so
    /// that the side sensors see it well.
    #[schemars(range(min = 0.3, max = 3.0))]
    pub left_door_m: f64,
    /// How near to the door's centre line the robot halts with its middle.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub halt_tolerance_m: f64,
    /// The distance from the door's centre line that is accepted after the last correction.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub halt_accept_m: f64,
    /// How far past the map's place of the door the search for it ends, and the map decides.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub overrun_m: f64,
    /// Sightings that disagree more than this with the map are not believed.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub sighting_gate_m: f64,
    /// Sightings with less confidence are not believed.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_confidence: f64,
    /// Speed limit along a path.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub travel_speed_mps: f64,
    /// Speed while searching the door.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub creep_speed_mps: f64,
    /// The least speed on the last centimetres.
    #[schemars(range(min = 0.01, max = 0.2))]
    pub crawl_speed_mps: f64,
    /// Speed backwards.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub back_off_speed_mps: f64,
    /// Deceleration of the drive (note 2.5).
    #[schemars(range(min = 0.1, max = 5.0))]
    pub brake_m_per_s2: f64,
    /// Time from a command to the wheels (note 2.5).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub latency_s: f64,
    /// How long loading in the tea room takes.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub load_s: f64,
    /// How long the robot waits at the door for the coffee to be taken.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub dwell_s: f64,
    /// A stop that lasts longer than this is a blocked way; a walker that passes is not.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub blocked_after_s: f64,
    /// How long the robot backs off from an obstacle before it plans anew.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub back_off_s: f64,
    /// Blocked attempts without progress after which human help is asked for.
    #[schemars(range(min = 1, max = 100))]
    pub max_failures: u32,
    /// A fault is tried again after this time; zero for never.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub fault_retry_s: f64,
    /// Without a pose younger than this the robot stands.
    #[schemars(range(min = 50, max = 10000))]
    pub pose_max_age_ms: u64,
    /// How far before the elevator's door the robot waits.
    #[schemars(range(min = 0.3, max = 5.0))]
    pub elevator_wait_m: f64,
    /// An elevator that does not come in this time is called again.
    #[schemars(range(min = 5.0, max = 600.0))]
    pub elevator_timeout_s: f64,
    /// Time between two steps when nothing arrives.
    #[schemars(range(min = 10, max = 1000))]
    pub period_ms: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            world: String::new(),
            home: "tea-room".to_owned(),
            default_order: String::new(),
            arrival_tolerance_m: 0.2,
            goal_tolerance_m: 0.5,
            approach_m: 1.2,
            right_door_m: 0.555,
            left_door_m: 1.05,
            halt_tolerance_m: 0.05,
            halt_accept_m: 0.1,
            overrun_m: 0.7,
            sighting_gate_m: 0.25,
            min_confidence: 0.3,
            travel_speed_mps: 0.36,
            creep_speed_mps: 0.15,
            crawl_speed_mps: 0.04,
            back_off_speed_mps: 0.1,
            brake_m_per_s2: 0.5,
            latency_s: 0.2,
            load_s: 3.0,
            dwell_s: 3.0,
            blocked_after_s: 5.0,
            back_off_s: 1.5,
            max_failures: 5,
            fault_retry_s: 30.0,
            pose_max_age_ms: 1000,
            elevator_wait_m: 1.0,
            elevator_timeout_s: 60.0,
            period_ms: 100,
        }
    }
}

/// What can be wrong with the parameters, or with the world that they name.
#[derive(Debug, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Two speeds in the wrong order.
    #[error(
        "crawl_speed_mps = {crawl_mps} is above creep_speed_mps = {creep_mps}: the last centimetres are driven more slowly"
    )]
    CrawlAboveCreep {
        /// The slower one.
        crawl_mps: f64,
        /// The faster one.
        creep_mps: f64,
    },
    /// Two tolerances in the wrong order.
    #[error(
        "halt_tolerance_m = {halt_m} is above halt_accept_m = {accept_m}: what is accepted last must not be less"
    )]
    ToleranceAboveAccept {
        /// What is aimed at.
        halt_m: f64,
        /// What is accepted.
        accept_m: f64,
    },
    /// The world file cannot be used.
    #[error("world: {0}")]
    World(#[from] WorldError),
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.crawl_speed_mps > self.creep_speed_mps {
            return Err(ParamsError::CrawlAboveCreep {
                crawl_mps: self.crawl_speed_mps,
                creep_mps: self.creep_speed_mps,
            });
        }
        if self.halt_tolerance_m > self.halt_accept_m {
            return Err(ParamsError::ToleranceAboveAccept {
                halt_m: self.halt_tolerance_m,
                accept_m: self.halt_accept_m,
            });
        }
        Ok(())
    }
}

impl Params {
    /// Time between two steps when nothing arrives.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms)
    }

    pub(crate) fn pose_max_age(&self) -> Duration {
        Duration::from_millis(self.pose_max_age_ms)
    }
}
