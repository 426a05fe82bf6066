//! Obstacles as points of the map, from the eight time-of-flight sensors or a scan, for a short while.

use crate::Params;
use geometry::Pose2;
use messages::{RangeScan, Reading, TOF_COUNT, Time, TofRanges};
use nalgebra::Point2;

/// A reading is a cone 15 to 27 degrees wide (COF-021): its middle and points this far to both sides stand
/// for it.
const CONE_SIDE_RAD: f64 = 0.10;
/// Readings from here on scatter (COF-030) and are too far away to matter.
const RANGE_MAX_M: f64 = 1.0;
/// Points nearer to each other than this are one.
const GRAIN_M: f64 = 0.06;
/// The most beams of a scan that count, evenly spread.
const BEAMS_MAX: usize = 60;
/// More points than this are not kept.
const POINTS_MAX: usize = 160;

/// What was seen lately.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    points: Vec<(Point2<f64>, Time)>,
    frame: Option<Time>,
    held: [Option<(f64, Time)>; TOF_COUNT],
}

impl Memory {
    /// Takes a frame of the eight sensors. The nearest in front; `None` if a sensor is faulty or silent for
    /// too long.
    pub(crate) fn take_tof(
        &mut self,
        now: Time,
        stamp: Time,
        ranges: &TofRanges,
        pose: Pose2,
        params: &Params,
    ) -> Option<f64> {
        let is_new = self.frame.replace(stamp) != Some(stamp);
        for (sensor, mount) in TofRanges::MOUNTS.iter().enumerate() {
            match ranges.reading(sensor) {
                Reading::Distance(range_m) => {
                    let range_m = f64::from(range_m);
                    self.held[sensor] = Some((range_m, now));
                    if is_new && range_m < RANGE_MAX_M {
                        for side_rad in [-CONE_SIDE_RAD, 0.0, CONE_SIDE_RAD] {
                            let direction_rad = mount.heading_rad + side_rad;
                            let point = Point2::new(
                                mount.x_m + range_m * direction_rad.cos(),
                                mount.y_m + range_m * direction_rad.sin(),
                            );
                            self.remember(pose.transform(point), now);
                        }
                    }
                }
                Reading::NoTarget => self.held[sensor] = Some((f64::INFINITY, now)),
                Reading::Ignore => {}
                Reading::Fault => self.held[sensor] = None,
            }
        }
        let oldest = params.input_max_age();
        let fresh = |held: &Option<(f64, Time)>| held.filter(|(_, seen)| now.since(*seen) <= oldest);
        self.held.iter().all(|held| fresh(held).is_some()).then(|| {
            self.held[2..=5]
                .iter()
                .filter_map(fresh)
                .map(|(range_m, _)| range_m)
                .fold(f64::INFINITY, f64::min)
        })
    }

    /// Takes a scan that is there beside the eight sensors.
    pub(crate) fn take_scan(&mut self, now: Time, scan: &RangeScan, ranges_m: &[f32], pose: Pose2) {
        if scan.check().is_err() {
            return;
        }
        for index in (0..ranges_m.len()).step_by(ranges_m.len().div_ceil(BEAMS_MAX).max(1)) {
            let Some((direction_rad, range_m)) = scan.beam(ranges_m, index) else { continue };
            if range_m < 2.0 * RANGE_MAX_M {
                let (sine, cosine) = direction_rad.sin_cos();
                let point = Point2::new(scan.sensor_x_m + range_m * cosine, scan.sensor_y_m + range_m * sine);
                self.remember(pose.transform(point), now);
            }
        }
    }

    fn remember(&mut self, point: Point2<f64>, now: Time) {
        if !(point.x.is_finite() && point.y.is_finite()) {
            return;
        }
        let near = self.points.iter().position(|(known, _)| (known - point).norm() < GRAIN_M);
        let oldest = || (0..self.points.len()).min_by_key(|&index| self.points[index].1);
        // When there is no room, the oldest makes some.
        match near.or_else(|| if self.points.len() < POINTS_MAX { None } else { oldest() }) {
            Some(index) => self.points[index] = (point, now),
            None => self.points.push((point, now)),
        }
    }

    /// What is remembered, in the robot's frame.
    pub(crate) fn points(&mut self, now: Time, pose: Pose2, params: &Params) -> Vec<Point2<f64>> {
        let oldest = std::time::Duration::from_millis(params.memory_ms.max(params.period_ms));
        self.points.retain(|(_, seen)| now.since(*seen) <= oldest);
        self.points.iter().map(|(point, _)| pose.inverse_transform(*point)).collect()
    }
}
