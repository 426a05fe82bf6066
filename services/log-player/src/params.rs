//! The parameters of `log-player`.

use geometry::{Point2, Pose2};
use messages::{ANCHOR_CAPACITY, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a log is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Lines `ODOM step dx dy dphi`, `LASER step ..`, `BEACON step id range ..`: MRPT's action-observation
    /// pairs as text.
    #[default]
    Steps,
    /// CARMEN's `ODOM x y theta ..`, `FLASER n r1 .. rn x y theta ..`, `ROBOTLASER1 ..`, `RAWLASER1 ..` and
    /// the like.
    Carmen,
}

/// Where the time of a message comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Timing {
    /// From the log's time stamps where they are of use, from the order of its lines where not.
    #[default]
    Auto,
    /// From the log's time stamps.
    Recorded,
    /// From the order in the log: `period_s` from one to the next.
    Order,
}

/// Which laser of a CARMEN log is played, by its place on the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Laser {
    /// The first laser, in the order of this list, of which the log holds scans.
    #[default]
    Auto,
    /// The laser that looks ahead: `FLASER`, `ROBOTLASER1`, `RAWLASER1`.
    Front,
    /// The laser that looks to the rear: `RLASER`, `ROBOTLASER2`, `RAWLASER2`.
    Rear,
    /// `LASER3`, `RAWLASER3`.
    Third,
    /// `LASER4`, `RAWLASER4`.
    Fourth,
    /// `LASER5`, `RAWLASER5`.
    Fifth,
}

impl Laser {
    /// Its number in today's CARMEN logs; `None` for whichever there is.
    pub fn number(self) -> Option<u32> {
        Some(match self {
            Self::Auto => return None,
            Self::Front => 1,
            Self::Rear => 2,
            Self::Third => 3,
            Self::Fourth => 4,
            Self::Fifth => 5,
        })
    }
}

/// Which scans of a log are played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scans {
    /// All of them.
    #[default]
    All,
    /// The first, the third, and so on (numbers 0, 2, ..): to make a map of.
    Even,
    /// The second, the fourth, and so on (numbers 1, 3, ..): to be localised on that map.
    Odd,
}

impl Scans {
    /// Whether the scan of this number, counted from 0, is played.
    pub fn plays(self, number: usize) -> bool {
        match self {
            Self::All => true,
            Self::Even => number.is_multiple_of(2),
            Self::Odd => !number.is_multiple_of(2),
        }
    }
}

/// Which odometry of a CARMEN log is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OdometryLines {
    /// The odometry as it is recorded.
    #[default]
    Recorded,
    /// Only the pieces of way between two scans, one put to the other's end. In a log that was corrected
    /// later the odometry after each scan begins anew at that scan's corrected pose: the step to there is no
    /// odometry, but the truth.
    BetweenScans,
}

/// What `log-player` can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The log, as text or compressed by gzip; empty plays nothing.
    #[schemars(extend("format" = "path"))]
    pub file: String,
    /// How the log is written.
    pub format: Format,
    /// True poses beside the log, lines `row x y heading`; empty for none, or when the log holds them itself.
    #[schemars(extend("format" = "path"))]
    pub truth: String,
    /// Row k of the true poses belongs to step k plus this.
    #[schemars(range(min = 0, max = 1000))]
    pub truth_step_offset: u32,
    /// Which laser of a CARMEN log is played.
    pub laser: Laser,
    /// Field of view of a laser whose lines do not hold it (`FLASER`, `RLASER`, `LASER3`); 0 for what the
    /// log's PARAM lines say, or else what instruments with so many beams have.
    #[schemars(range(min = 0.0, max = 6.3))]
    pub laser_fov_rad: f64,
    /// Which scans are played; in a CARMEN log the true pose of a scan goes with it.
    pub scans: Scans,
    /// Which odometry of a CARMEN log is played.
    pub odometry: OdometryLines,
    /// Publishes the true poses as `location/pose` too, in the place of a localiser: to make a map.
    pub truth_as_location: bool,
    /// How many times faster than it was recorded the log is played.
    #[schemars(range(min = 0.001, max = 100000.0))]
    pub speed: f64,
    /// Where the times of a CARMEN log come from.
    pub timing: Timing,
    /// Time from one step of a log without time stamps to the next, at speed 1.
    #[schemars(range(min = 0.001, max = 3600.0))]
    pub period_s: f64,
    /// Wait after the start, on the board's clock, so that readers are there for the first message.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub start_delay_s: f64,
    /// Time between two looks at what is due.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub tick_ms: f64,
    /// Laser ranges of at least this mean "nothing seen", where the log does not say it.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub range_max_m: f64,
    /// Distance between the wheels, from which their paths are made up.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub wheel_track_m: f64,
    /// The radio anchors, in their own frame.
    pub anchors: Vec<AnchorPlace>,
    /// Pose of the map's frame in the anchors' frame. The map's frame is that of the true poses.
    pub map_in_anchor_frame: Pose,
}

/// Where an anchor hangs, in the anchors' frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnchorPlace {
    /// Its number in the log.
    pub id: u32,
    /// Place along x.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub x_m: f64,
    /// Place along y.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub y_m: f64,
    /// Height above the floor.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub z_m: f64,
}

/// A pose in a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Place along x.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub x_m: f64,
    /// Place along y.
    #[schemars(range(min = -1000000.0, max = 1000000.0))]
    pub y_m: f64,
    /// Direction.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub heading_rad: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            file: String::new(),
            format: Format::Steps,
            truth: String::new(),
            truth_step_offset: 1,
            laser: Laser::Auto,
            laser_fov_rad: 0.0,
            scans: Scans::All,
            odometry: OdometryLines::Recorded,
            truth_as_location: false,
            speed: 1.0,
            timing: Timing::Auto,
            period_s: 1.05,
            start_delay_s: 0.5,
            tick_ms: 5.0,
            range_max_m: 80.0,
            wheel_track_m: 0.40,
            anchors: Vec::new(),
            map_in_anchor_frame: Pose::default(),
        }
    }
}

impl Params {
    /// How often it is looked what is due.
    pub fn tick(&self) -> std::time::Duration {
        std::time::Duration::from_secs_f64(self.tick_ms.clamp(0.1, 1000.0) * 1e-3)
    }

    /// An anchor in the map.
    pub fn anchor_in_map(&self, id: u32) -> Option<[f64; 3]> {
        let anchor = self.anchors.iter().find(|anchor| anchor.id == id)?;
        let frame = self.map_in_anchor_frame;
        let frame = Pose2::new(frame.x_m, frame.y_m, frame.heading_rad);
        let place = frame.inverse_transform(Point2::new(anchor.x_m, anchor.y_m));
        Some([place.x, place.y, anchor.z_m])
    }
}

/// Parameters that make no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// Two anchors with one number.
    #[error("anchors: number {id} occurs twice; give each anchor its own")]
    AnchorTwice {
        /// The number.
        id: u32,
    },
    /// More anchors than a message holds.
    #[error("anchors: {count} are more than the {ANCHOR_CAPACITY} that a message holds")]
    TooManyAnchors {
        /// How many there are.
        count: usize,
    },
    /// True poses without a log.
    #[error("truth = {truth:?} without a file; name the log that it belongs to")]
    TruthWithoutLog {
        /// The file of true poses.
        truth: String,
    },
    /// No log, although something is said about it.
    #[error(
        "file is empty, so there is nothing to play: name the log, in the graph or with `--set log-player.file=PATH`"
    )]
    NoLog,
}

impl Params {
    /// Whether a log is named. The defaults name none, since a service has to say what it is without one.
    ///
    /// # Errors
    /// When anything is set and the log is not.
    pub fn check_log(&self) -> Result<(), ParamsError> {
        let names_one = !self.file.is_empty() || *self == Self::default();
        if names_one { Ok(()) } else { Err(ParamsError::NoLog) }
    }
}

impl Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        if self.anchors.len() > ANCHOR_CAPACITY {
            return Err(ParamsError::TooManyAnchors { count: self.anchors.len() });
        }
        for (index, anchor) in self.anchors.iter().enumerate() {
            if self.anchors[..index].iter().any(|earlier| earlier.id == anchor.id) {
                return Err(ParamsError::AnchorTwice { id: anchor.id });
            }
        }
        if self.file.is_empty() && !self.truth.is_empty() {
            return Err(ParamsError::TruthWithoutLog { truth: self.truth.clone() });
        }
        Ok(())
    }
}
