//! A simulated sensor: sound that spreads as a cone, and what of it finds the way back.

use crate::{DeviceError, NoiseProfile, Params, ParamsError, Reading, UltrasonicDevice};
use geometry::{Hit, Point2, Pose2, Ray, Scene, Surface, Vector2, World};
use messages::{Stamped, Surroundings, Time, WorldTruth};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

/// Without a newer truth the sensor counts as silent.
const SILENT_AFTER: Duration = Duration::from_millis(300);
/// Height of the sensor, no higher than the walls (NXT-015).
const HEIGHT_M: f64 = 0.10;
/// No ray is followed farther, whatever the sensor can hear.
const FARTHEST_M: f64 = 20.0;
/// So near to a wall's end, the end is heard.
const END_M: f64 = 0.015;
/// Ends of walls that are nearer to each other than this are one.
const SAME_M: f64 = 1e-4;
/// How far from a wall a ray that leaves it begins.
const OFF_WALL_M: f64 = 1e-6;

/// A sensor that casts its cones into the world of a file, as `world/truth` has it.
#[derive(Debug, Clone)]
pub struct SimulatedSonar {
    params: Params,
    surroundings: Surroundings,
    rng: Pcg64,
    seen: Option<(Time, WorldTruth)>,
}

impl SimulatedSonar {
    /// A sensor in the world that the parameters name.
    ///
    /// # Errors
    /// When the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Ok(Self::in_world(params, &world, seed))
    }

    /// A sensor in a world that is at hand already.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Self {
        Self { surroundings: Surroundings::new(world), rng: Pcg64::seed_from_u64(seed), seen: None, params }
    }

    /// Pings from a pose of the sensor.
    pub fn measure(&mut self, floor: i32, sensor: Pose2) -> Reading {
        // So many draws a ping whatever it meets, so that one wall more does not change all that follows.
        let noise: [f64; 2] = [StandardNormal.sample(&mut self.rng), StandardNormal.sample(&mut self.rng)];
        let (lost, late) = (self.rng.random::<f64>(), self.rng.random::<f64>());
        let Some(scene) = self.surroundings.scene(floor) else { return Reading::Nothing };
        match self.params.noise {
            NoiseProfile::None => self.limited(self.nearest(scene, sensor).map(|(hit, _)| hit.range_m)),
            NoiseProfile::Botsim => {
                let ray = Ray::level(sensor.position(), sensor.heading_rad, HEIGHT_M);
                let Some(hit) = scene.cast_ray(&ray, FARTHEST_M) else { return Reading::Nothing };
                let scatter = Vector2::new(noise[0], noise[1]) * self.params.sigma_m;
                Reading::Echo { range_m: (ray.direction * hit.range_m + scatter).norm() }
            }
            NoiseProfile::Paper => {
                let nearest = self.nearest(scene, sensor);
                let range_m = nearest.and_then(|(hit, ray)| self.echo(scene, hit, &ray, noise, lost, late));
                self.limited(range_m)
            }
        }
    }

    /// The nearest thing within the cone, and the ray that meets it (NXT-032).
    fn nearest(&self, scene: &Scene, sensor: Pose2) -> Option<(Hit, Ray)> {
        let steps = (self.params.half_cone_deg / self.params.ray_step_deg + 1e-9).floor() as i32;
        let rays = (-steps..=steps).filter_map(|step| {
            let aside_rad = (f64::from(step) * self.params.ray_step_deg).to_radians();
            let ray = Ray::level(sensor.position(), sensor.heading_rad + aside_rad, HEIGHT_M);
            Some((scene.cast_ray(&ray, FARTHEST_M)?, ray))
        });
        rays.min_by(|a, b| a.0.range_m.total_cmp(&b.0.range_m))
    }

    /// What is heard of an echo: errors grow with the angle of incidence, until the sound does not come back
    /// at all, or by way of another wall (NXT-033, NXT-034).
    fn echo(&self, scene: &Scene, hit: Hit, ray: &Ray, noise: [f64; 2], lost: f64, late: f64) -> Option<f64> {
        let params = &self.params;
        // A corner sends sound back wherever it comes from, an edge a part of it.
        let most_rad = match end(scene, hit, ray) {
            Some(End::Corner) => 0.0,
            Some(End::Edge { faced_rad }) => faced_rad.min(params.edge_deg.to_radians()),
            None => FRAC_PI_2,
        };
        let incidence_rad = hit.incidence_rad().min(most_rad);
        let (from_deg, to_deg) = (params.lost_from_deg, params.lost_to_deg);
        let slant = ((incidence_rad.to_degrees() - from_deg) / (to_deg - from_deg)).clamp(0.0, 1.0);
        let detour_m = if lost < slant * params.lost_share {
            if late >= params.late_share {
                return None;
            }
            reflected_m(scene, hit, ray)?
        } else {
            0.0
        };
        // The sound cannot come back before it was there: weak echoes are only ever late.
        let tangent = incidence_rad.tan().min(100.0);
        let weak_m = params.sigma_m * params.incidence_growth * tangent * tangent * noise[1].abs();
        Some((hit.range_m + detour_m + weak_m.min(params.latest_m) + params.sigma_m * noise[0]).max(0.0))
    }

    /// Whole steps between the least and the largest range.
    fn limited(&self, range_m: Option<f64>) -> Reading {
        let Some(range_m) = range_m else { return Reading::Nothing };
        let step_m = if self.params.noise == NoiseProfile::Paper { self.params.resolution_m } else { 0.0 };
        let range_m = if step_m > 0.0 { (range_m / step_m).round() * step_m } else { range_m };
        if range_m < self.params.range_min_m {
            Reading::TooNear
        } else if range_m >= self.params.range_max_m {
            Reading::Nothing
        } else {
            Reading::Echo { range_m }
        }
    }
}

/// The end of a wall, as a sensor sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    /// The sensor looks between two walls into the corner that they make: the sound comes back by way of
    /// both.
    Corner,
    /// The wall ends there, or another begins behind it: the sound is scattered, or comes back from the one
    /// of them that is met the least askew.
    Edge { faced_rad: f64 },
}

/// The end that a ray meets a wall at, if it does.
fn end(scene: &Scene, hit: Hit, ray: &Ray) -> Option<End> {
    let Surface::Wall(wall) = hit.surface else { return None };
    let walls = scene.walls().segments();
    let wall = walls.get(wall as usize)?;
    let place = ray.origin + ray.direction * hit.range_m;
    let (near, far) =
        if (place - wall.a).norm() < (place - wall.b).norm() { (wall.a, wall.b) } else { (wall.b, wall.a) };
    if (place - near).norm() >= END_M {
        return None;
    }
    let back = ray.origin - near;
    let arms = walls.iter().flat_map(|other| [(other.a, other.b), (other.b, other.a)]);
    let others = arms.filter(|(begin, end)| (begin - near).norm() < SAME_M && (end - far).norm() >= SAME_M);
    let others: Vec<Vector2<f64>> = others.map(|(begin, end)| end - begin).collect();
    // The sensor is between two arms if it lies on the side of each on which the other one is.
    let is_between = |arm: Vector2<f64>, other: Vector2<f64>| {
        let same_side = |one: Vector2<f64>, two: Vector2<f64>| one.perp(&back) * one.perp(&two) > 0.0;
        same_side(arm, other) && same_side(other, arm)
    };
    if others.iter().any(|other| is_between(far - near, *other)) {
        return Some(End::Corner);
    }
    let incidence_rad = |arm: &Vector2<f64>| {
        let length = arm.norm() * back.norm();
        if length > 0.0 { (arm.perp(&back).abs() / length).min(1.0).acos() } else { 0.0 }
    };
    let faced_rad = others.iter().map(incidence_rad).fold(hit.incidence_rad(), f64::min);
    Some(End::Edge { faced_rad })
}

/// How far it is from where a ray meets a wall to what it meets next, mirrored at that wall.
fn reflected_m(scene: &Scene, hit: Hit, ray: &Ray) -> Option<f64> {
    let Surface::Wall(wall) = hit.surface else { return None };
    let along = scene.walls().segments().get(wall as usize)?.direction()?;
    let mirrored = along * (2.0 * ray.direction.dot(&along)) - ray.direction;
    let origin: Point2<f64> = ray.origin + ray.direction * hit.range_m + mirrored * OFF_WALL_M;
    Some(scene.walls().cast_along(origin, mirrored, FARTHEST_M)?.range_m)
}

impl UltrasonicDevice for SimulatedSonar {
    fn see(&mut self, truth: Option<Stamped<'_, WorldTruth>>) {
        if let Some(truth) = truth {
            self.surroundings.show(truth.message, truth.elements);
            self.seen = Some((truth.stamp, *truth.message));
        }
    }

    fn ping(&mut self, now: Time, direction_rad: f64) -> Result<Reading, DeviceError> {
        let (stamp, truth) = self.seen.ok_or(DeviceError::NeverHeard)?;
        let silent = now.since(stamp);
        if silent > SILENT_AFTER {
            let silent_ms = u64::try_from(silent.as_millis()).unwrap_or(u64::MAX);
            return Err(DeviceError::Silent { silent_ms });
        }
        let robot = Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        if !robot.is_finite() || !direction_rad.is_finite() {
            return Ok(Reading::Nothing);
        }
        Ok(self.measure(truth.floor, robot.compose(Pose2::new(0.0, 0.0, direction_rad))))
    }
}
