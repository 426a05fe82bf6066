//! A robot that drives to and fro in a hallway, with noisy wheels and a noisy tag.

use geometry::{Pose2, angle};
use messages::{AnchorRange, Odometry, TagRanges, TofRanges};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

pub(crate) fn hallway_anchors() -> [[f64; 3]; 6] {
    [
        [2.0, 0.8, 2.4],
        [9.0, -0.8, 2.4],
        [16.0, 0.8, 2.4],
        [23.0, -0.8, 2.4],
        [30.0, 0.8, 2.4],
        [37.0, -0.8, 2.4],
    ]
}

pub(crate) fn range_to(pose: Pose2, antenna: [f64; 3], anchor: [f64; 3]) -> f64 {
    let at = pose.transform(geometry::Point2::new(antenna[0], antenna[1]));
    (at.x - anchor[0]).hypot(at.y - anchor[1]).hypot(antenna[2] - anchor[2])
}

pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

pub(crate) fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// What is wrong with the wheels.
pub(crate) struct Wheels {
    pub(crate) scale: f64,
    pub(crate) turn_scale: f64,
    pub(crate) slip: f64,
}

impl Default for Wheels {
    fn default() -> Self {
        Self { scale: 1.01, turn_scale: 0.98, slip: 0.03 }
    }
}

/// One moment.
pub(crate) struct Frame {
    pub(crate) truth: Pose2,
    pub(crate) odometry: Odometry,
    pub(crate) tag: TagRanges,
    pub(crate) ranges: TofRanges,
}

pub(crate) struct Hallway {
    truth: Pose2,
    odometry: Pose2,
    wheels: Wheels,
    outliers: f64,
    random: Pcg64,
}

impl Hallway {
    pub(crate) fn new(seed: u64, wheels: Wheels, outliers: f64) -> Self {
        Self {
            truth: Pose2::new(5.0, 0.1, 0.0),
            odometry: Pose2::IDENTITY,
            wheels,
            outliers,
            random: Pcg64::seed_from_u64(seed),
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        Normal::new(0.0, sigma).unwrap().sample(&mut self.random)
    }

    /// Drives 0.05 s at 0.5 m/s, weaving about the middle; turns back after 18 m.
    pub(crate) fn step(&mut self, step: u32) -> Frame {
        let ahead = if step < 500 { 0.0 } else { std::f64::consts::PI };
        let side = if step < 500 { self.truth.y_m } else { -self.truth.y_m };
        let wanted = ahead - 0.8 * side + 0.15 * (f64::from(step) * 0.03).sin();
        let error = angle::difference(wanted, self.truth.heading_rad);
        let turn = error.clamp(-0.05, 0.05);
        let path = if error.abs() > 0.5 { 0.0 } else { 0.025 };
        self.truth = self.truth.after_arc(path, turn);
        let (path, turn) = (
            path * (self.wheels.scale + self.normal(self.wheels.slip)),
            turn * (self.wheels.turn_scale + self.normal(self.wheels.slip)) + self.normal(0.02 * path),
        );
        self.odometry = self.odometry.after_arc(path, turn);
        let odometry = Odometry {
            x_m: self.odometry.x_m,
            y_m: self.odometry.y_m,
            heading_rad: self.odometry.heading_rad,
            ..Odometry::default()
        };
        Frame { truth: self.truth, odometry, tag: self.hear(), ranges: self.feel() }
    }

    fn hear(&mut self) -> TagRanges {
        let mut tag = TagRanges { antenna_z_m: 1.0, floor: 2, anchor_count: 4, ..TagRanges::default() };
        let mut anchors =
            hallway_anchors().map(|anchor| (range_to(self.truth, [0.0, 0.0, 1.0], anchor), anchor));
        anchors.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (slot, (range_m, anchor)) in tag.anchors.iter_mut().zip(anchors.into_iter().take(4)) {
            let mut range_m = range_m + self.normal(0.10);
            if self.random.random::<f64>() < self.outliers {
                range_m += if self.random.random::<bool>() { 1.0 } else { -1.0 };
            }
            let id = (anchor[0] * 10.0) as u32;
            *slot = AnchorRange {
                x_m: anchor[0],
                y_m: anchor[1],
                z_m: anchor[2],
                range_m,
                id,
                quality_percent: 60.0,
            };
        }
        tag
    }

    fn feel(&mut self) -> TofRanges {
        let mut ranges = TofRanges::default();
        for (sensor, mount) in TofRanges::MOUNTS.iter().enumerate() {
            let eye = self.truth.compose(*mount);
            let slope = eye.heading_rad.sin();
            let wall_m = ((0.85 * slope.signum() - eye.y_m) / slope).clamp(0.0, 3.9);
            // A doorway 0.9 m wide and 0.15 m deep every 5 m, on both sides, that no drawing shows.
            let met_m = eye.x_m + wall_m * eye.heading_rad.cos();
            let door_m = if met_m.rem_euclid(5.0) < 0.9 { 0.15 } else { 0.0 };
            ranges.range_m[sensor] = (wall_m + door_m + self.normal(0.01)) as f32;
        }
        ranges
    }
}
