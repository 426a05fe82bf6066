//! How far a footprint can be pushed straight on until it touches something: parry's shape casting behind our
//! own types.

use crate::{BodyId, Polygon, Pose2, Scene, Segment, Shape};
use nalgebra::Point2;
use parry2d_f64::math::{Pose, Vector};
use parry2d_f64::query::{ShapeCastOptions, cast_shapes};
use parry2d_f64::shape;

impl Scene {
    /// How far a robot's footprint moves from `pose` along `heading_rad` (in the scene's frame, without
    /// turning) until it touches a wall, or a part of a body that reaches into the heights between `low_m`
    /// and `high_m`, in metres: 0 when it touches at once, `max_m` when it meets nothing before. A pose or
    /// heading that is not finite goes nowhere. Good to a micrometre. `without` is the robot's own body, if
    /// it is in the scene.
    pub fn free_way_m(
        &self,
        footprint: &Polygon,
        pose: Pose2,
        heading_rad: f64,
        max_m: f64,
        [low_m, high_m]: [f64; 2],
        without: Option<BodyId>,
    ) -> f64 {
        let sure = pose.is_finite() && heading_rad.is_finite() && max_m > 0.0;
        if !sure || self.clearance_m(footprint, pose, [low_m, high_m], without) <= 0.0 {
            return 0.0;
        }
        let placed = footprint.transformed(pose);
        let (sine, cosine) = heading_rad.sin_cos();
        let direction = nalgebra::Vector2::new(cosine, sine);
        let hull = outline(&placed);
        let (centre, radius_m) = (pose.position(), footprint.radius_m());
        // Farther aside or behind than the circle around the footprint nothing is met.
        let lane = Segment::new(centre, centre + direction * max_m.min(1e6));
        let mut free_m = max_m;
        for wall in self.walls().segments() {
            if wall.length_m() > 0.0 && lane.distance_to_segment_m(wall) <= radius_m {
                let wall = shape::Segment::new(vector(wall.a), vector(wall.b));
                free_m = pushed_m(&hull, vector(direction.into()), &wall, Vector::ZERO, free_m);
            }
        }
        for other in self.present_without(without) {
            if lane.distance_m(other.centre) > radius_m + other.radius_m {
                continue;
            }
            for prism in other.prisms.iter().filter(|prism| prism.reaches_between(low_m, high_m)) {
                free_m = match &prism.shape {
                    Shape::Disc { centre, radius_m } => {
                        let ball = shape::Ball::new(*radius_m);
                        pushed_m(&hull, vector(direction.into()), &ball, vector(*centre), free_m)
                    }
                    Shape::Polygon(polygon) => {
                        pushed_m(&hull, vector(direction.into()), &outline(polygon), Vector::ZERO, free_m)
                    }
                };
            }
        }
        free_m
    }
}

/// The boundary as a closed line. Bodies that begin apart touch at their boundaries first, so that it does
/// not matter whether the polygon is convex.
fn outline(polygon: &Polygon) -> shape::Polyline {
    let corners: Vec<Vector> = polygon.corners().iter().map(|&corner| vector(corner)).collect();
    let count = corners.len() as u32;
    shape::Polyline::new(corners, Some((0..count).map(|i| [i, (i + 1) % count]).collect()))
}

fn vector(point: Point2<f64>) -> Vector {
    Vector::new(point.x, point.y)
}

/// The lesser of `free_m` and the way until the pushed shape touches `other`.
fn pushed_m(
    pushed: &dyn shape::Shape,
    direction: Vector,
    other: &dyn shape::Shape,
    place: Vector,
    free_m: f64,
) -> f64 {
    let options = ShapeCastOptions::with_max_time_of_impact(free_m);
    let still = Pose::new(place, 0.0);
    let hit = cast_shapes(&Pose::identity(), direction, pushed, &still, Vector::ZERO, other, options);
    // All pairs of shapes used here are supported.
    hit.ok().flatten().map_or(free_m, |hit| hit.time_of_impact.clamp(0.0, free_m))
}
