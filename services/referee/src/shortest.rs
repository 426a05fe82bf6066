//! The shortest path in a configuration space: what every path is measured against (NXT-104).

use geometry::{Point2, Polygon, Segment, Vector2};
use std::f64::consts::TAU;

/// Points on the circle around a corner that sticks out into the space.
const AROUND: usize = 24;
/// Points and lines may be nearer to a wall by this, for rounding.
const SLACK_M: f64 = 1e-6;

/// Length of the shortest path within an outline that keeps `offset_m` from it, by a visibility graph whose
/// corners are rounded off; `None` where there is none. An end that is nearer to the outline than the offset
/// may leave it the straight way.
pub fn shortest_m(outline: &Polygon, offset_m: f64, from: Point2<f64>, to: Point2<f64>) -> Option<f64> {
    let walls: Vec<Segment> = outline.edges().collect();
    let beside_m = |way: &Segment| {
        walls.iter().map(|wall| wall.distance_to_segment_m(way)).fold(f64::INFINITY, f64::min)
    };
    let ends_m = outline.distance_to_boundary_m(from).min(outline.distance_to_boundary_m(to));
    let needed_m = offset_m.min(ends_m) - SLACK_M;
    // Lines between points on a circle cut it: the points lie a little farther out.
    let radius_m = offset_m / (std::f64::consts::PI / AROUND as f64).cos();
    let mut points = vec![from, to];
    for corner in sticking_out(outline) {
        let around = (0..AROUND).map(|step| {
            let (sine, cosine) = (TAU * step as f64 / AROUND as f64).sin_cos();
            corner + Vector2::new(cosine, sine) * radius_m
        });
        points.extend(around.filter(|point| {
            outline.contains(*point) && outline.distance_to_boundary_m(*point) >= offset_m - SLACK_M
        }));
    }
    let is_free = |a: Point2<f64>, b: Point2<f64>, needed_m: f64| beside_m(&Segment::new(a, b)) >= needed_m;
    let mut best_m = vec![f64::INFINITY; points.len()];
    let mut done = vec![false; points.len()];
    best_m[0] = 0.0;
    loop {
        let open = (0..points.len()).filter(|&index| !done[index] && best_m[index].is_finite());
        let here = open.min_by(|&a, &b| best_m[a].total_cmp(&best_m[b]))?;
        if here == 1 {
            return Some(best_m[1]);
        }
        done[here] = true;
        for there in 0..points.len() {
            let length_m = best_m[here] + (points[there] - points[here]).norm();
            let is_end = here < 2 || there < 2;
            let needed_m = if is_end { needed_m } else { offset_m - SLACK_M };
            if !done[there] && length_m < best_m[there] && is_free(points[here], points[there], needed_m) {
                best_m[there] = length_m;
            }
        }
    }
}

/// The corners at which the outline turns to the right, seen counter-clockwise.
fn sticking_out(outline: &Polygon) -> impl Iterator<Item = Point2<f64>> + '_ {
    let corners = outline.corners();
    let count = corners.len();
    (0..count).filter_map(move |index| {
        let (before, here, after) =
            (corners[(index + count - 1) % count], corners[index], corners[(index + 1) % count]);
        let (first, second) = (here - before, after - here);
        (first.x * second.y - first.y * second.x < 0.0).then_some(here)
    })
}
