//! A simulated tag: the anchors of a world file, and the noise of radio.

use crate::{DeviceError, Params, ParamsError, TagDevice, position_from};
use geometry::{Point2, Pose2, World, world::Anchor};
use messages::{AnchorRange, Stamped, TagRanges, Time, WorldTruth};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::time::Duration;

/// The module's location engine uses no more anchors at once (note 2.3).
const MOST_ANCHORS: usize = 4;
/// Without a newer truth the tag counts as silent.
const SILENT_AFTER: Duration = Duration::from_millis(500);

/// A tag that measures its distances in the world of a file, as `world/truth` has it.
#[derive(Debug, Clone)]
pub struct SimulatedTag {
    params: Params,
    anchors: Vec<Anchor>,
    rng: Pcg64,
    seen: Option<(Time, WorldTruth)>,
    nearest: Vec<(f64, usize)>,
    position: Option<(i32, Point2<f64>)>,
}

impl SimulatedTag {
    /// A tag in the world that the parameters name.
    ///
    /// # Errors
    /// When the world file cannot be used, or has no anchor that `dead_anchors` names.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::in_world(params, &world, seed)
    }

    /// A tag in a world that is at hand already; `params.world` only names it.
    ///
    /// # Errors
    /// When the world has no anchor that `dead_anchors` names.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Result<Self, ParamsError> {
        let exists = |id: &u32| world.anchors.iter().any(|anchor| anchor.id == *id);
        if let Some(&id) = params.dead_anchors.iter().find(|id| !exists(id)) {
            return Err(ParamsError::NoSuchAnchor { id, world: params.world });
        }
        let alive = world.anchors.iter().filter(|anchor| !params.dead_anchors.contains(&anchor.id));
        Ok(Self {
            anchors: alive.cloned().collect(),
            rng: Pcg64::seed_from_u64(seed),
            seen: None,
            nearest: Vec::new(),
            position: None,
            params,
        })
    }

    /// A distance as radio measures it: scattered, now and then far too long, now and then not at all.
    fn measure(&mut self, true_m: f64) -> Option<f64> {
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        let [is_outlier, is_missing] = [self.params.outlier_fraction, self.params.drop_out_fraction]
            .map(|fraction| self.rng.random::<f64>() < fraction);
        let detour_m = if is_outlier { self.params.outlier_m } else { 0.0 };
        let measured_m = (true_m + self.params.sigma_m * noise + detour_m).max(0.0);
        // The module reports whole millimetres.
        (!is_missing).then_some((measured_m * 1000.0).round() / 1000.0)
    }

    fn quality_percent(&mut self) -> f32 {
        self.rng.random_range(40..=90) as f32
    }
}

impl TagDevice for SimulatedTag {
    fn see(&mut self, truth: Option<Stamped<'_, WorldTruth>>) {
        if let Some(truth) = truth {
            self.seen = Some((truth.stamp, *truth.message));
        }
    }

    fn read(&mut self, now: Time) -> Result<TagRanges, DeviceError> {
        let (stamp, truth) = self.seen.ok_or(DeviceError::NeverHeard)?;
        let silent = now.since(stamp);
        if silent > SILENT_AFTER {
            let silent_ms = u64::try_from(silent.as_millis()).unwrap_or(u64::MAX);
            return Err(DeviceError::Silent { silent_ms });
        }
        let robot = Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        let antenna = robot.transform(Point2::new(self.params.antenna_x_m, self.params.antenna_y_m));
        let height_m = self.params.antenna_z_m;
        let mut heard = TagRanges {
            antenna_x_m: self.params.antenna_x_m,
            antenna_y_m: self.params.antenna_y_m,
            antenna_z_m: height_m,
            floor: truth.floor,
            ..TagRanges::default()
        };
        self.nearest.clear();
        let here = self.anchors.iter().enumerate().filter(|(_, anchor)| anchor.floor == truth.floor);
        let far = here.map(|(index, anchor)| {
            let level_m = (antenna - Point2::new(anchor.x_m, anchor.y_m)).norm();
            (level_m.hypot(height_m - anchor.z_m), index)
        });
        // A truth that is not finite has no anchors near it.
        self.nearest.extend(far.filter(|&(distance_m, _)| distance_m <= self.params.reach_m));
        self.nearest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.nearest.truncate(MOST_ANCHORS);
        let mut count = 0;
        for place in 0..self.nearest.len() {
            let (distance_m, index) = self.nearest[place];
            let quality_percent = self.quality_percent();
            if let Some(range_m) = self.measure(distance_m) {
                let Anchor { id, x_m, y_m, z_m, .. } = self.anchors[index];
                heard.anchors[count] = AnchorRange { x_m, y_m, z_m, range_m, id, quality_percent };
                count += 1;
            }
        }
        heard.anchor_count = count as u32;
        heard.quality_percent = self.quality_percent();

        // The module begins its search where it was last, or in the midst of its anchors.
        let last = self.position.filter(|(floor, _)| *floor == truth.floor).map(|(_, place)| place);
        let middle = heard.heard().iter().fold(Point2::origin(), |sum, anchor| {
            sum + geometry::Vector2::new(anchor.x_m, anchor.y_m) / count.max(1) as f64
        });
        self.position =
            position_from(heard.heard(), height_m, last.unwrap_or(middle)).map(|place| (truth.floor, place));
        if let Some((_, place)) = self.position {
            (heard.x_m, heard.y_m, heard.z_m) = (place.x, place.y, height_m);
            heard.has_position = 1;
        }
        Ok(heard)
    }
}
