//! Simple polygons and the shapes of bodies.

use crate::{Pose2, Segment, segment::cross};
use nalgebra::{Point2, Vector2};
use std::f64::consts::TAU;

/// Why a list of points is no simple polygon.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// A polygon needs three corners.
    #[error("a polygon needs at least 3 corners, not {corners}")]
    TooFewCorners {
        /// Corners given, without the repeated first one.
        corners: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("corner {corner} is not finite: ({x_m}, {y_m})")]
    NotFinite {
        /// Index of the corner.
        corner: usize,
        /// Its x in metres.
        x_m: f64,
        /// Its y in metres.
        y_m: f64,
    },
    /// Two edges cross or touch, or two corners coincide.
    #[error("edges {first} and {second} touch or cross each other")]
    NotSimple {
        /// Index of an edge: it begins at the corner of the same index.
        first: usize,
        /// Index of the other edge.
        second: usize,
    },
    /// The corners lie on a line.
    #[error("the polygon encloses no area")]
    NoArea,
}

/// A polygon whose edges meet at their common corners only, counter-clockwise, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    corners: Vec<Point2<f64>>,
}

impl Polygon {
    /// Checks and keeps the corners, in either order of turning. A last corner equal to the first is dropped.
    pub fn new(corners: impl IntoIterator<Item = Point2<f64>>) -> Result<Self, PolygonError> {
        let mut corners: Vec<_> = corners.into_iter().collect();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 {
            return Err(PolygonError::TooFewCorners { corners: corners.len() });
        }
        if let Some(corner) = corners.iter().position(|p| !(p.x.is_finite() && p.y.is_finite())) {
            let Point2 { coords } = corners[corner];
            return Err(PolygonError::NotFinite { corner, x_m: coords.x, y_m: coords.y });
        }
        if let Some((first, second)) = first_touching_edges(&corners) {
            return Err(PolygonError::NotSimple { first, second });
        }
        let area = signed_area_m2(&corners);
        if area.abs() < 1e-12 {
            return Err(PolygonError::NoArea);
        }
        if area < 0.0 {
            corners.reverse();
        }
        Ok(Self { corners })
    }

    /// [`Polygon::new`] from plain coordinates in metres.
    pub fn from_coordinates(corners: &[[f64; 2]]) -> Result<Self, PolygonError> {
        Self::new(corners.iter().map(|&[x, y]| Point2::new(x, y)))
    }

    /// A rectangle about the origin: `length_m` along x, `width_m` along y. Both must be positive and finite.
    pub fn rectangle(length_m: f64, width_m: f64) -> Result<Self, PolygonError> {
        let (x, y) = (0.5 * length_m, 0.5 * width_m);
        Self::from_coordinates(&[[-x, -y], [x, -y], [x, y], [-x, y]])
    }

    /// The rectangle with sides along the axes between two opposite corners.
    pub fn axis_aligned(corner: [f64; 2], opposite: [f64; 2]) -> Result<Self, PolygonError> {
        let ([a, b], [c, d]) = (corner, opposite);
        Self::from_coordinates(&[[a, b], [c, b], [c, d], [a, d]])
    }

    /// A regular polygon about the origin whose first corner lies on the x axis, `radius_m` from the centre.
    pub fn regular(corners: usize, radius_m: f64) -> Result<Self, PolygonError> {
        Self::new((0..corners).map(|corner| {
            let (sine, cosine) = (TAU * corner as f64 / corners as f64).sin_cos();
            Point2::new(radius_m * cosine, radius_m * sine)
        }))
    }

    /// The corners, counter-clockwise, the first not repeated.
    pub fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// The edges, counter-clockwise: the inside lies to the left of each.
    pub fn edges(&self) -> impl ExactSizeIterator<Item = Segment> + Clone + '_ {
        let count = self.corners.len();
        (0..count).map(move |i| Segment::new(self.corners[i], self.corners[(i + 1) % count]))
    }

    /// Area in square metres, positive.
    pub fn area_m2(&self) -> f64 {
        signed_area_m2(&self.corners)
    }

    /// Length of the boundary in metres.
    pub fn perimeter_m(&self) -> f64 {
        self.edges().map(|edge| edge.length_m()).sum()
    }

    /// Centre of mass.
    pub fn centroid(&self) -> Point2<f64> {
        // About the first corner, so that a small polygon far from the origin keeps its digits.
        let anchor = self.corners[0];
        let (mut sum, mut twice_area) = (Vector2::zeros(), 0.0);
        for edge in self.edges() {
            let (a, b) = (edge.a - anchor, edge.b - anchor);
            let doubled = cross(a, b);
            twice_area += doubled;
            sum += (a + b) * doubled;
        }
        anchor + sum / (3.0 * twice_area)
    }

    /// Whether `point` lies inside. Left and lower edges belong to the polygon, right and upper ones do not,
    /// so that polygons which tile the plane share no point.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        let mut inside = false;
        for edge in self.edges() {
            if (edge.a.y > point.y) != (edge.b.y > point.y) {
                let side = cross(edge.vector(), point - edge.a);
                if (side > 0.0) == (edge.b.y > edge.a.y) {
                    inside = !inside;
                }
            }
        }
        inside
    }

    /// A random place inside, at least `clearance_m` from the boundary, by numbers of the caller's that are
    /// uniform in [0, 1); `None` where there is none, or next to none.
    pub fn random_place(&self, clearance_m: f64, mut uniform: impl FnMut() -> f64) -> Option<Point2<f64>> {
        const TRIES: usize = 10_000;
        let (low, high) = self.bounds();
        (0..TRIES).find_map(|_| {
            let share = Vector2::new(uniform(), uniform());
            let point = low + (high - low).component_mul(&share);
            (self.contains(point) && self.distance_to_boundary_m(point) >= clearance_m).then_some(point)
        })
    }

    /// Distance from `point` to the nearest edge in metres, inside as well as outside.
    pub fn distance_to_boundary_m(&self, point: Point2<f64>) -> f64 {
        self.edges().map(|edge| edge.distance_m(point)).fold(f64::INFINITY, f64::min)
    }

    /// Distance from `point` to the polygon in metres: 0 inside.
    pub fn distance_m(&self, point: Point2<f64>) -> f64 {
        if self.contains(point) { 0.0 } else { self.distance_to_boundary_m(point) }
    }

    /// Smallest distance from the solid polygon to a segment, in metres: 0 when they share a point.
    pub fn distance_to_segment_m(&self, segment: &Segment) -> f64 {
        if self.contains(segment.a) {
            return 0.0;
        }
        self.edges().map(|edge| edge.distance_to_segment_m(segment)).fold(f64::INFINITY, f64::min)
    }

    /// Smallest distance between two solid polygons, in metres: 0 when they share a point.
    pub fn distance_to_polygon_m(&self, other: &Self) -> f64 {
        if other.contains(self.corners[0]) {
            return 0.0;
        }
        other.edges().map(|edge| self.distance_to_segment_m(&edge)).fold(f64::INFINITY, f64::min)
    }

    /// Whether every corner turns left (straight corners allowed).
    pub fn is_convex(&self) -> bool {
        let count = self.corners.len();
        (0..count).all(|i| {
            let (a, b, c) = (self.corners[i], self.corners[(i + 1) % count], self.corners[(i + 2) % count]);
            cross(b - a, c - b) >= -1e-12
        })
    }

    /// The polygon, given in the body frame of `pose`, in the frame of `pose`.
    pub fn transformed(&self, pose: Pose2) -> Self {
        Self { corners: self.corners.iter().map(|&corner| pose.transform(corner)).collect() }
    }

    /// Lower left and upper right corner of the smallest rectangle along the axes that holds the polygon.
    pub fn bounds(&self) -> (Point2<f64>, Point2<f64>) {
        self.corners.iter().fold((self.corners[0], self.corners[0]), |(low, high), corner| {
            (low.inf(corner), high.sup(corner))
        })
    }

    /// Distance of the farthest corner from the origin, in metres.
    pub fn radius_m(&self) -> f64 {
        self.corners.iter().map(|corner| corner.coords.norm()).fold(0.0, f64::max)
    }
}

/// Whether the closed line through `corners` touches itself nowhere but at common corners of neighbouring
/// edges.
pub fn is_simple(corners: &[Point2<f64>]) -> bool {
    corners.len() >= 3 && first_touching_edges(corners).is_none()
}

fn first_touching_edges(corners: &[Point2<f64>]) -> Option<(usize, usize)> {
    let count = corners.len();
    let edge = |i: usize| Segment::new(corners[i], corners[(i + 1) % count]);
    for first in 0..count {
        for second in first + 1..count {
            let (e, f) = (edge(first), edge(second));
            let touching = if e.a == e.b || f.a == f.b {
                true
            } else if second == first + 1 {
                folds_back(e.vector(), f.vector()) || (count == 3 && e.a == f.b && e.b == f.a)
            } else if first == 0 && second == count - 1 {
                folds_back(f.vector(), e.vector())
            } else {
                e.intersects(&f)
            };
            if touching {
                return Some((first, second));
            }
        }
    }
    None
}

/// Whether the second of two neighbouring edges runs back over the first.
fn folds_back(before: Vector2<f64>, after: Vector2<f64>) -> bool {
    let turn = cross(before, after).abs();
    before.dot(&after) < 0.0 && turn <= 1e-12 * before.norm() * after.norm()
}

fn signed_area_m2(corners: &[Point2<f64>]) -> f64 {
    let anchor = corners[0];
    let count = corners.len();
    (1..count).map(|i| 0.5 * cross(corners[i] - anchor, corners[(i + 1) % count] - anchor)).sum()
}

/// The outline of a body, or of a part of one, in the body's own frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A circle, filled.
    Disc {
        /// Its centre.
        centre: Point2<f64>,
        /// Its radius in metres, positive.
        radius_m: f64,
    },
    /// A polygon, filled.
    Polygon(Polygon),
}

impl Shape {
    /// A disc about the body's origin.
    pub fn disc(radius_m: f64) -> Self {
        Self::Disc { centre: Point2::origin(), radius_m }
    }

    /// The shape, given in the body frame of `pose`, in the frame of `pose`.
    pub fn transformed(&self, pose: Pose2) -> Self {
        match self {
            Self::Disc { centre, radius_m } => {
                Self::Disc { centre: pose.transform(*centre), radius_m: *radius_m }
            }
            Self::Polygon(polygon) => Self::Polygon(polygon.transformed(pose)),
        }
    }

    /// Whether `point` lies inside.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        match self {
            Self::Disc { centre, radius_m } => nalgebra::distance(centre, &point) < *radius_m,
            Self::Polygon(polygon) => polygon.contains(point),
        }
    }

    /// Distance from `point` in metres: 0 inside.
    pub fn distance_m(&self, point: Point2<f64>) -> f64 {
        match self {
            Self::Disc { centre, radius_m } => (nalgebra::distance(centre, &point) - radius_m).max(0.0),
            Self::Polygon(polygon) => polygon.distance_m(point),
        }
    }

    /// Smallest distance to a segment in metres: 0 when they share a point.
    pub fn distance_to_segment_m(&self, segment: &Segment) -> f64 {
        match self {
            Self::Disc { centre, radius_m } => (segment.distance_m(*centre) - radius_m).max(0.0),
            Self::Polygon(polygon) => polygon.distance_to_segment_m(segment),
        }
    }

    /// Smallest distance between two shapes in metres: 0 when they share a point.
    pub fn distance_to_shape_m(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Disc { centre, radius_m }, shape) | (shape, Self::Disc { centre, radius_m }) => {
                (shape.distance_m(*centre) - radius_m).max(0.0)
            }
            (Self::Polygon(polygon), Self::Polygon(other)) => polygon.distance_to_polygon_m(other),
        }
    }

    /// Area in square metres.
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Disc { radius_m, .. } => 0.5 * TAU * radius_m * radius_m,
            Self::Polygon(polygon) => polygon.area_m2(),
        }
    }

    /// Distance of the farthest point from the body's origin, in metres.
    pub fn radius_m(&self) -> f64 {
        match self {
            Self::Disc { centre, radius_m } => centre.coords.norm() + radius_m,
            Self::Polygon(polygon) => polygon.radius_m(),
        }
    }
}
