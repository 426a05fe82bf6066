//! Range sensors.

use crate::{InvalidMessage, Message};
use geometry::Pose2;
use std::f64::consts::FRAC_PI_2;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// How many time-of-flight sensors the coffee robot carries (COF-020).
pub const TOF_COUNT: usize = 8;

crate::state! {
    /// What a VL53L1X says of a reading: the range status codes of its interface (note 2.1).
    RangeStatus, RangeStatusName {
        /// Valid.
        Valid = 0,
        /// The reading scatters too much.
        SigmaFail = 1,
        /// Too little light came back.
        SignalFail = 2,
        /// Valid, clipped at the minimum.
        MinimumClipped = 3,
        /// The phase is out of bounds: nothing in range.
        OutOfBounds = 4,
        /// The sensor is broken.
        HardwareFail = 5,
        /// Valid, first reading: not checked for wrap-around.
        WrapNotChecked = 6,
        /// A far target seen as a near one.
        Wrapped = 7,
        /// Crosstalk: the sensor sees its own cover.
        CrosstalkFail = 9,
        /// Synchronisation; no reading.
        Synchronisation = 10,
        /// Nearer than the minimum.
        MinimumFail = 13,
        /// No new reading.
        NoUpdate = 255,
    }
}

/// The eight time-of-flight sensors. Published by `tof-driver` on `tof/ranges`.
///
/// Numbered as an arc from the farthest back right (0) to the farthest back left (7): 0, 1 right; 2 to 5
/// front, right to left; 6, 7 left (COF-024, COF-025).
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct TofRanges {
    /// Distance from each sensor along its axis; meaningful only where the status says so.
    pub range_m: [f32; TOF_COUNT],
    /// What each sensor says of its reading.
    pub status: [RangeStatus; TOF_COUNT],
}

const fn mount(x_m: f64, y_m: f64, heading_rad: f64) -> Pose2 {
    Pose2 { x_m, y_m, heading_rad }
}

/// One reading of a time-of-flight sensor, judged by its status (note 2.1, X-23, X-27).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// A distance in metres; a target nearer than the minimum reads as 0.040.
    Distance(f32),
    /// Nothing within range: far.
    NoTarget,
    /// No new information in this frame.
    Ignore,
    /// The sensor cannot be trusted: stop.
    Fault,
}

impl TofRanges {
    /// The smallest distance that a VL53L1X measures (COF-021); what is nearer violates every radius.
    pub const MINIMUM_M: f32 = 0.040;

    /// Distance between the two sensors of a side (COF-023).
    pub const SIDE_BASE_M: f64 = 0.277;

    /// Where each sensor sits and looks in the robot's frame, whose origin is the middle of the 610 mm long
    /// and 510 mm wide body (COF-003, COF-023, COF-025): the front sensors 115 mm apart on the front edge,
    /// the side sensors 277 mm apart on the side edges.
    pub const MOUNTS: [Pose2; TOF_COUNT] = [
        mount(-0.1385, -0.255, -FRAC_PI_2),
        mount(0.1385, -0.255, -FRAC_PI_2),
        mount(0.305, -0.1725, 0.0),
        mount(0.305, -0.0575, 0.0),
        mount(0.305, 0.0575, 0.0),
        mount(0.305, 0.1725, 0.0),
        mount(0.1385, 0.255, FRAC_PI_2),
        mount(-0.1385, 0.255, FRAC_PI_2),
    ];

    /// The reading of one sensor. Sensors that do not exist, states without a name and numbers that are no
    /// distance are faults.
    pub fn reading(&self, sensor: usize) -> Reading {
        let (Some(&range_m), Some(status)) = (self.range_m.get(sensor), self.status.get(sensor)) else {
            return Reading::Fault;
        };
        match status.get() {
            Ok(RangeStatusName::Valid | RangeStatusName::WrapNotChecked) => {
                if !range_m.is_finite() || range_m < 0.0 {
                    Reading::Fault
                } else {
                    Reading::Distance(range_m.max(Self::MINIMUM_M))
                }
            }
            Ok(RangeStatusName::MinimumClipped | RangeStatusName::MinimumFail) => {
                Reading::Distance(Self::MINIMUM_M)
            }
            Ok(RangeStatusName::SigmaFail | RangeStatusName::SignalFail | RangeStatusName::OutOfBounds) => {
                Reading::NoTarget
            }
            Ok(RangeStatusName::Wrapped | RangeStatusName::Synchronisation | RangeStatusName::NoUpdate) => {
                Reading::Ignore
            }
            Ok(RangeStatusName::HardwareFail | RangeStatusName::CrosstalkFail) | Err(_) => Reading::Fault,
        }
    }
}

/// A scan of a laser or of a turning sensor: the header, then one range per beam. Published on `laser/scan`,
/// by `ultrasonic-driver` on `sonar/raw`, and by `scan-conditioner` on `sonar/scan`.
///
/// Beam `i` looks along `sensor_heading_rad + angle_min_rad + i * angle_step_rad` in the robot's frame.
/// Ranges from `range_max_m` on, and +inf, say that nothing was seen; -inf says that something is too near to
/// be measured (ROS REP 117); zero, negative numbers and NaN are no readings.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = f32)]
#[repr(C)]
pub struct RangeScan {
    /// Where the sensor sits in the robot's frame.
    pub sensor_x_m: f64,
    /// Where the sensor sits in the robot's frame.
    pub sensor_y_m: f64,
    /// Where the sensor looks in the robot's frame.
    pub sensor_heading_rad: f64,
    /// Direction of the first beam from the sensor's axis.
    pub angle_min_rad: f64,
    /// From one beam to the next; positive is counter-clockwise.
    pub angle_step_rad: f64,
    /// Ranges from here on mean "nothing seen".
    pub range_max_m: f64,
}

impl RangeScan {
    /// Direction of beam `index` in the robot's frame, and its range if it is one.
    pub fn beam(&self, elements: &[f32], index: usize) -> Option<(f64, f64)> {
        let range_m = f64::from(*elements.get(index)?);
        let direction_rad = self.sensor_heading_rad + self.angle_min_rad + index as f64 * self.angle_step_rad;
        (direction_rad.is_finite() && range_m > 0.0 && range_m < self.range_max_m)
            .then_some((direction_rad, range_m))
    }

    /// Whether the header's numbers can be used at all.
    ///
    /// # Errors
    /// Names the first that is not finite.
    pub fn check(&self) -> Result<(), InvalidMessage> {
        let numbers = [
            ("sensor_x_m", self.sensor_x_m),
            ("sensor_y_m", self.sensor_y_m),
            ("sensor_heading_rad", self.sensor_heading_rad),
            ("angle_min_rad", self.angle_min_rad),
            ("angle_step_rad", self.angle_step_rad),
        ];
        match numbers.iter().find(|(_, number)| !number.is_finite()) {
            Some((field, _)) => Err(InvalidMessage::UnusableNumber { field }),
            None => Ok(()),
        }
    }
}

/// How many anchors a tag reading can hold. A DWM1001 uses four at once (note 2.3).
pub const ANCHOR_CAPACITY: usize = 8;

/// The distance to one anchor.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct AnchorRange {
    /// The anchor's place in the map.
    pub x_m: f64,
    /// The anchor's place in the map.
    pub y_m: f64,
    /// The anchor's height above the floor.
    pub z_m: f64,
    /// Measured distance from the tag.
    pub range_m: f64,
    /// The anchor's number.
    pub id: u32,
    /// 0 to 100, as the module judges it.
    pub quality_percent: f32,
}

/// What the radio tag heard. Published by `tag-driver` or `log-player` on `tag/ranges`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct TagRanges {
    /// The module's own position estimate in the map, where `has_position` is 1.
    pub x_m: f64,
    /// The module's own position estimate.
    pub y_m: f64,
    /// The module's own position estimate.
    pub z_m: f64,
    /// Where the tag's antenna sits in the robot's frame.
    pub antenna_x_m: f64,
    /// Where the tag's antenna sits in the robot's frame.
    pub antenna_y_m: f64,
    /// Height of the tag's antenna above the floor.
    pub antenna_z_m: f64,
    /// The anchors heard; the first `anchor_count` are valid.
    pub anchors: [AnchorRange; ANCHOR_CAPACITY],
    /// How many anchors were heard.
    pub anchor_count: u32,
    /// 1 when the position is valid, 0 when not.
    pub has_position: u32,
    /// The floor whose anchors were heard.
    pub floor: i32,
    /// 0 to 100, the module's judgement of its position.
    pub quality_percent: f32,
}

impl TagRanges {
    /// The anchors heard, whatever the count claims.
    pub fn heard(&self) -> &[AnchorRange] {
        &self.anchors[..(self.anchor_count as usize).min(ANCHOR_CAPACITY)]
    }
}
