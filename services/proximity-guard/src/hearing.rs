//! Whether the sensor hears at all.

use messages::{Odometry, RangeScan, Stamped, Time};

/// The robot does not get this far from one look to the next.
const JUMP_M: f64 = 0.5;

/// How far the robot has driven since the sensor last heard an echo.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Hearing {
    heard: bool,
    silent_m: f64,
    travelled_m: Option<f64>,
    scan: Option<Time>,
}

impl Hearing {
    /// The robot has driven on.
    pub(crate) fn follow(&mut self, odometry: Option<Stamped<'_, Odometry>>) {
        let Some(odometry) = odometry else { return };
        let travelled_m = 0.5 * (odometry.left_travel_m + odometry.right_travel_m);
        if travelled_m.is_finite() {
            let way_m =
                self.travelled_m.replace(travelled_m).map_or(0.0, |last_m| (travelled_m - last_m).abs());
            self.silent_m += if way_m <= JUMP_M { way_m } else { 0.0 };
        }
    }

    /// A reading ahead: infinite without an echo.
    pub(crate) fn hear(&mut self, distance_m: f64) {
        if distance_m.is_finite() {
            (self.heard, self.silent_m) = (true, 0.0);
        }
    }

    /// A scan all around.
    pub(crate) fn hear_scan(&mut self, scan: Option<Stamped<'_, RangeScan>>) {
        let Some(scan) = scan.filter(|scan| self.scan != Some(scan.stamp)) else { return };
        self.scan = Some(scan.stamp);
        if scan.elements.iter().any(|range_m| *range_m > 0.0 && f64::from(*range_m) < scan.range_max_m) {
            (self.heard, self.silent_m) = (true, 0.0);
        }
    }

    /// Whether it ever heard anything.
    pub(crate) fn has_heard(&self) -> bool {
        self.heard
    }

    /// Whether it has heard something on the last metres, as many as given.
    pub(crate) fn hears(&self, deaf_way_m: f64) -> bool {
        deaf_way_m <= 0.0 || (self.heard && self.silent_m <= deaf_way_m)
    }
}
