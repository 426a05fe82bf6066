//! Straight pieces of a plane: walls, edges, steps of a path.

use crate::Pose2;
use nalgebra::{Point2, Vector2};

/// A straight piece from `a` to `b`, in metres. Both ends belong to it; they may coincide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub a: Point2<f64>,
    /// Where it ends.
    pub b: Point2<f64>,
}

/// The z component of the cross product: positive when `v` lies counter-clockwise of `u`.
pub(crate) fn cross(u: Vector2<f64>, v: Vector2<f64>) -> f64 {
    u.x * v.y - u.y * v.x
}

impl Segment {
    /// The piece between two points.
    pub const fn new(a: Point2<f64>, b: Point2<f64>) -> Self {
        Self { a, b }
    }

    /// From `a` to `b` as plain coordinates in metres.
    pub const fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { a: Point2::new(a[0], a[1]), b: Point2::new(b[0], b[1]) }
    }

    /// The step from `a` to `b`, in metres.
    pub fn vector(&self) -> Vector2<f64> {
        self.b - self.a
    }

    /// Length in metres.
    pub fn length_m(&self) -> f64 {
        self.vector().norm()
    }

    /// The unit vector from `a` to `b`; `None` when the ends coincide.
    pub fn direction(&self) -> Option<Vector2<f64>> {
        self.vector().try_normalize(0.0)
    }

    /// The point halfway between the ends.
    pub fn midpoint(&self) -> Point2<f64> {
        nalgebra::center(&self.a, &self.b)
    }

    /// The point at `fraction` of the way from `a` (0) to `b` (1).
    pub fn at(&self, fraction: f64) -> Point2<f64> {
        self.a + self.vector() * fraction
    }

    /// Points along it from one end to the other, evenly spread and no farther apart than `apart_m`.
    pub fn points(&self, apart_m: f64) -> impl Iterator<Item = Point2<f64>> + Clone + use<> {
        let pieces = (self.length_m() / apart_m).ceil().max(1.0) as u32;
        let line = *self;
        (0..=pieces).map(move |piece| line.a + line.vector() * (f64::from(piece) / f64::from(pieces)))
    }

    /// How far along the piece the point closest to `point` lies: 0 at `a`, 1 at `b`.
    pub fn closest_fraction(&self, point: Point2<f64>) -> f64 {
        let along = self.vector();
        let square = along.norm_squared();
        if square > 0.0 { ((point - self.a).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The point of the piece that lies closest to `point`.
    pub fn closest_point(&self, point: Point2<f64>) -> Point2<f64> {
        let fraction = self.closest_fraction(point);
        // The ends are returned bit by bit, so that a distance to an end is that to the given corner.
        if fraction >= 1.0 { self.b } else { self.at(fraction) }
    }

    /// Distance from `point` to the piece, in metres.
    pub fn distance_m(&self, point: Point2<f64>) -> f64 {
        nalgebra::distance(&self.closest_point(point), &point)
    }

    /// Smallest distance between two pieces, in metres; 0 when they touch or cross.
    pub fn distance_to_segment_m(&self, other: &Self) -> f64 {
        if self.intersects(other) {
            return 0.0;
        }
        let from_other = self.distance_m(other.a).min(self.distance_m(other.b));
        from_other.min(other.distance_m(self.a)).min(other.distance_m(self.b))
    }

    /// Whether the pieces share a point; touching counts.
    pub fn intersects(&self, other: &Self) -> bool {
        let (along, across) = (self.vector(), other.vector());
        let a_side = cross(along, other.a - self.a);
        let b_side = cross(along, other.b - self.a);
        let c_side = cross(across, self.a - other.a);
        let d_side = cross(across, self.b - other.a);
        if opposite(a_side, b_side) && opposite(c_side, d_side) {
            return true;
        }
        let within = |piece: &Self, point: Point2<f64>| {
            point.x >= piece.a.x.min(piece.b.x)
                && point.x <= piece.a.x.max(piece.b.x)
                && point.y >= piece.a.y.min(piece.b.y)
                && point.y <= piece.a.y.max(piece.b.y)
        };
        (is_zero(a_side) && within(self, other.a))
            || (is_zero(b_side) && within(self, other.b))
            || (is_zero(c_side) && within(other, self.a))
            || (is_zero(d_side) && within(other, self.b))
    }

    /// The point that two pieces share. Of pieces that overlap along a line, the shared point closest to this
    /// piece's `a`; `None` when they do not meet.
    pub fn intersection(&self, other: &Self) -> Option<Point2<f64>> {
        if !self.intersects(other) {
            return None;
        }
        let (along, across) = (self.vector(), other.vector());
        let turn = cross(along, across);
        if is_zero(turn) {
            let first = [other.a, other.b, self.a, self.b]
                .into_iter()
                .filter(|&point| self.distance_m(point) <= 1e-9 && other.distance_m(point) <= 1e-9);
            return first
                .min_by(|p, q| nalgebra::distance(p, &self.a).total_cmp(&nalgebra::distance(q, &self.a)));
        }
        Some(self.at((cross(other.a - self.a, across) / turn).clamp(0.0, 1.0)))
    }

    /// How far a ray from `origin` along the unit vector `direction` runs until it meets the piece, in
    /// metres; `None` when it misses. A ray within the piece's own line meets it at its nearer end.
    pub fn cast_m(&self, origin: Point2<f64>, direction: Vector2<f64>) -> Option<f64> {
        let (along, to_a) = (self.vector(), self.a - origin);
        let turn = cross(direction, along);
        if is_zero(turn) {
            if cross(to_a, direction).abs() > 1e-12 {
                return None;
            }
            let (near, far) = (to_a.dot(&direction), (self.b - origin).dot(&direction));
            return if near.max(far) < 0.0 { None } else { Some(near.min(far).max(0.0)) };
        }
        let range_m = cross(to_a, along) / turn;
        let fraction = cross(to_a, direction) / turn;
        (range_m >= 0.0 && (0.0..=1.0).contains(&fraction)).then_some(range_m)
    }

    /// The piece, given in the body frame of `pose`, in the frame of `pose`.
    pub fn transformed(&self, pose: Pose2) -> Self {
        Self::new(pose.transform(self.a), pose.transform(self.b))
    }

    /// Whether all four coordinates are finite.
    pub fn is_finite(&self) -> bool {
        [self.a.x, self.a.y, self.b.x, self.b.y].iter().all(|value| value.is_finite())
    }
}

/// Strictly on both sides of zero.
fn opposite(a: f64, b: f64) -> bool {
    (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0)
}

/// Whether an orientation is exactly zero: the points lie on one line, as far as the numbers can tell.
fn is_zero(value: f64) -> bool {
    value == 0.0
}
