//! Cones of rays: what the field of view of a range sensor covers.

use crate::{Hit, Pose2, Ray, Scene};
use nalgebra::Vector2;

/// A field of view as a grid of rays: `columns` from right to left, `rows` from low to high.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// From the middle to either side, in radians.
    pub half_width_rad: f64,
    /// From the middle up and down, in radians, below π/2.
    pub half_height_rad: f64,
    /// Rays beside each other, at least 1; a single one points ahead.
    pub columns: usize,
    /// Rays above each other, at least 1; a single one is level.
    pub rows: usize,
    /// Rays end here, in metres.
    pub max_range_m: f64,
}

impl Cone {
    /// Rays of the cone.
    pub fn rays(&self) -> usize {
        self.columns * self.rows
    }

    /// Azimuth (counter-clockwise) and elevation (up) of a ray in radians, relative to the sensor's axis.
    /// Rays are numbered row by row, from the lowest row, each from right to left.
    pub fn direction_rad(&self, ray: usize) -> (f64, f64) {
        let columns = self.columns.max(1);
        let (row, column) = (ray / columns, ray % columns);
        (spread(column, columns, self.half_width_rad), spread(row, self.rows, self.half_height_rad))
    }
}

/// The middle of the `index`-th of `count` equal parts of the angles from `-half_rad` to `half_rad`.
fn spread(index: usize, count: usize, half_rad: f64) -> f64 {
    half_rad * ((2 * index + 1) as f64 / count.max(1) as f64 - 1.0)
}

impl Scene {
    /// Casts every ray of a cone from `sensor` at a height above the floor. `hits` is emptied, and then holds
    /// one entry a ray in the order of [`Cone::direction_rad`]: what the ray meets, or `None` within the
    /// cone's range.
    pub fn cast_cone(&self, sensor: Pose2, height_m: f64, cone: &Cone, hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.resize(cone.rays(), None);
        if !sensor.is_finite() {
            return;
        }
        let origin = sensor.position();
        // Only bodies within reach, and not behind a narrow cone, are tried ray by ray.
        let (sine, cosine) = sensor.heading_rad.sin_cos();
        let axis = Vector2::new(cosine, sine);
        let is_narrow = cone.half_width_rad < std::f64::consts::FRAC_PI_2;
        let edge = cone.half_width_rad.sin_cos();
        let near: Vec<_> = self
            .bodies
            .iter()
            .filter(|placed| {
                let to_centre = placed.centre - origin;
                let (ahead_m, aside_m) =
                    (to_centre.dot(&axis), (axis.x * to_centre.y - axis.y * to_centre.x).abs());
                // Distance to the cone's own side line, positive outside.
                let outside_m = aside_m * edge.1 - ahead_m * edge.0;
                placed.is_present
                    && to_centre.norm() <= cone.max_range_m + placed.radius_m
                    && !(is_narrow && outside_m > placed.radius_m)
            })
            .collect();
        for column in 0..cone.columns {
            let azimuth_rad = spread(column, cone.columns, cone.half_width_rad);
            let level = Ray::level(origin, sensor.heading_rad + azimuth_rad, height_m);
            // Walls reach from floor to ceiling: rays above each other meet the same one.
            let wall = self.reach(&level, cone.max_range_m);
            for row in 0..cone.rows {
                let slope = spread(row, cone.rows, cone.half_height_rad).tan();
                let ray = Ray { slope, ..level };
                let reach = wall.shortened(cone.max_range_m / ray.stretch());
                hits[row * cone.columns + column] = self.cast_among(&ray, reach, near.iter().copied());
            }
        }
    }
}
