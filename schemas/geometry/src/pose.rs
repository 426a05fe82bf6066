//! Poses in the plane and the motions between them.

use crate::angle;
use nalgebra::{Point2, Vector2};

/// A place and a direction in a plane frame: metres and radians, x forward, y left, heading counter-clockwise
/// from x.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose2 {
    /// Along the frame's x axis, in metres.
    pub x_m: f64,
    /// Along the frame's y axis, in metres.
    pub y_m: f64,
    /// Direction of the body's x axis, in radians.
    #[serde(default)]
    pub heading_rad: f64,
}

impl Pose2 {
    /// The frame itself.
    pub const IDENTITY: Self = Self { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 };

    /// A pose whose heading is wrapped to (-π, π].
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        Self { x_m, y_m, heading_rad: angle::wrap(heading_rad) }
    }

    /// The place without the direction.
    pub fn position(self) -> Point2<f64> {
        Point2::new(self.x_m, self.y_m)
    }

    /// Whether all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.heading_rad.is_finite()
    }

    /// `relative`, given in this body's frame, in the frame of this pose.
    pub fn compose(self, relative: Self) -> Self {
        let place = self.transform(relative.position());
        Self::new(place.x, place.y, self.heading_rad + relative.heading_rad)
    }

    /// The pose of the frame as seen from this body.
    pub fn inverse(self) -> Self {
        let (sine, cosine) = self.heading_rad.sin_cos();
        Self::new(
            -cosine * self.x_m - sine * self.y_m,
            sine * self.x_m - cosine * self.y_m,
            -self.heading_rad,
        )
    }

    /// `other` as seen from this body; both are given in one frame.
    pub fn to(self, other: Self) -> Self {
        self.inverse().compose(other)
    }

    /// This body's frame, for many points at a time.
    pub fn frame(self) -> Frame {
        let (sine, cosine) = self.heading_rad.sin_cos();
        Frame { origin: self.position(), sine, cosine }
    }

    /// A point of this body's frame in the frame of this pose.
    pub fn transform(self, point: Point2<f64>) -> Point2<f64> {
        self.frame().transform(point)
    }

    /// A point of the frame as seen from this body.
    pub fn inverse_transform(self, point: Point2<f64>) -> Point2<f64> {
        self.frame().inverse_transform(point)
    }

    /// Where a differential drive stands after an arc of `distance_m` along its path while its heading
    /// changes by `turn_rad` (the exact motion at constant wheel speeds; Siegwart and Nourbakhsh 2011,
    /// section 5.2.4, without their small-angle step).
    pub fn after_arc(self, distance_m: f64, turn_rad: f64) -> Self {
        // The chord of an arc is its length times sinc(turn / 2).
        let half = 0.5 * turn_rad;
        let shrink = if half.abs() < 1e-6 { 1.0 - half * half / 6.0 } else { half.sin() / half };
        let along = self.heading_rad + half;
        Self::new(
            self.x_m + distance_m * shrink * along.cos(),
            self.y_m + distance_m * shrink * along.sin(),
            self.heading_rad + turn_rad,
        )
    }

    /// Distance between the two places, in metres.
    pub fn distance_m(self, other: Self) -> f64 {
        (self.x_m - other.x_m).hypot(self.y_m - other.y_m)
    }

    /// Direction from this place to `point` relative to this heading, in (-π, π].
    pub fn bearing_rad(self, point: Point2<f64>) -> f64 {
        angle::wrap((point.y - self.y_m).atan2(point.x - self.x_m) - self.heading_rad)
    }
}
/// A body's frame with sine and cosine of its heading worked out once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    origin: Point2<f64>,
    sine: f64,
    cosine: f64,
}

impl Frame {
    /// A point of the body's frame in the frame in which its pose is given.
    pub fn transform(&self, point: Point2<f64>) -> Point2<f64> {
        let (sine, cosine) = (self.sine, self.cosine);
        Point2::new(
            self.origin.x + cosine * point.x - sine * point.y,
            self.origin.y + sine * point.x + cosine * point.y,
        )
    }

    /// A point of the frame in which the body's pose is given, as seen from the body.
    pub fn inverse_transform(&self, point: Point2<f64>) -> Point2<f64> {
        let (sine, cosine) = (self.sine, self.cosine);
        let offset: Vector2<f64> = point - self.origin;
        Point2::new(cosine * offset.x + sine * offset.y, cosine * offset.y - sine * offset.x)
    }
}
