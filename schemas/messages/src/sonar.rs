//! The turning ultrasonic sensor: what it is told, what it says between scans, and what a scan shows at once
//! (NXT-025, NXT-026, NXT-040).
//!
//! Its scans are `RangeScan`s: raw on `sonar/raw`, the part that is kept for localisation on `sonar/scan`.

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

crate::state! {
    /// What the sensor shall do.
    SonarMode, SonarModeName {
        /// Look ahead, and say what is there: what it does by itself after its start, and after a scan
        /// (NXT-026).
        WatchAhead = 0,
        /// Turn once around and publish the scan, turn back, then watch ahead (NXT-025).
        Ultrascan = 1,
        /// Turn back from wherever it looks, and stay silent.
        Return = 2,
    }
}

/// An order for the turning sensor. Published by `executive` on `sonar/command`; a new number is a new order.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct SonarCommand {
    /// Counts orders. Zero is none.
    pub command_id: u64,
    /// Direction of the first of the four windows of a measuring scan in the robot's frame; the others follow
    /// at right angles.
    pub window_rad: f64,
    /// What to do.
    pub mode: SonarMode,
    /// 1 for a scan to localise by; 0 for one that only looks for the nearest wall.
    pub measure: u32,
}

crate::state! {
    /// What became of a ping.
    SonarStatus, SonarStatusName {
        /// An echo: the range counts.
        Echo = 0,
        /// No echo: the code 255 of the NXT sensor. The range is the largest one.
        Nothing = 1,
        /// Too near to be measured: the range is the smallest one.
        TooNear = 2,
        /// The sensor does not answer.
        Fault = 3,
    }
}

/// What lies ahead of the robot. Published by `ultrasonic-driver` on `sonar/ahead`, while the sensor watches
/// ahead.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct SonarAhead {
    /// Distance from the sensor, which sits above the centre of motion.
    pub range_m: f64,
    /// What became of the ping.
    pub status: SonarStatus,
    /// Always zero.
    pub reserved: u32,
}

impl SonarAhead {
    /// The distance of the nearest thing ahead, infinite where nothing is; `None` when the message says
    /// nothing of use.
    pub fn distance_m(&self) -> Option<f64> {
        match self.status.get().ok()? {
            SonarStatusName::Echo | SonarStatusName::TooNear => {
                (self.range_m.is_finite() && self.range_m >= 0.0).then_some(self.range_m)
            }
            SonarStatusName::Nothing => Some(f64::INFINITY),
            SonarStatusName::Fault => None,
        }
    }
}

/// What a raw scan shows at once. Published by `scan-conditioner` on `sonar/survey`, for every raw scan.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct WallSurvey {
    /// The order that the scan answers.
    pub command_id: u64,
    /// Direction of the nearest wall in the robot's frame, in (-π, π]; NaN when there is none.
    pub bearing_rad: f64,
    /// Distance of the nearest wall; NaN when there is none.
    pub range_m: f64,
    /// The windows of a measuring scan that were kept: one bit each, the first one is bit 0.
    pub kept_windows: u32,
    /// Readings that were handed to the localiser.
    pub readings: u32,
}

impl WallSurvey {
    /// Direction and distance of the nearest wall, where there is one.
    pub fn nearest(&self) -> Option<(f64, f64)> {
        let usable = self.bearing_rad.is_finite() && self.range_m.is_finite() && self.range_m >= 0.0;
        usable.then_some((self.bearing_rad, self.range_m))
    }
}
