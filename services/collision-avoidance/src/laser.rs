//! The three faces in a laser scan: what its beams meet, and what could hide where they say nothing.

use crate::{FaceRanges, Params};
use geometry::{Hull, Point2, angle};
use messages::{Face, RangeScan, Stamped};
use std::f64::consts::FRAC_PI_2;

/// Something this wide is an obstacle: where it could hide between two beams that can be read, it counts as
/// there.
const HIDDEN_M: f64 = 0.10;
/// Angle between the directions in which gaps are looked at.
const GAP_STEP_RAD: f64 = 0.02;
/// Beams this much farther apart than usual have a gap between them.
const GAP_STEPS: f64 = 1.5;
/// No scanner has more beams in a scan.
const MOST_BEAMS: usize = 100_000;

/// What a scan says of each face: front, right, left; `None` where it cannot be trusted.
pub(crate) type Faces = [Option<f64>; 3];

/// What became of a beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beam {
    /// It met something.
    Hit(f64),
    /// Something is nearer than the scanner can measure: -inf (ROS REP 117).
    TooNear,
    /// It met nothing.
    Nothing,
    /// Nobody knows: NaN, zero or a negative number.
    Unreadable,
}

impl Beam {
    pub(crate) fn of(range_m: f32, range_max_m: f64) -> Self {
        if range_m == f32::NEG_INFINITY {
            Self::TooNear
        } else if range_m.is_nan() || range_m <= 0.0 {
            Self::Unreadable
        } else if f64::from(range_m) < range_max_m {
            Self::Hit(range_m.into())
        } else {
            Self::Nothing
        }
    }
}

/// A scan whose header makes sense.
pub(crate) struct Scan<'a> {
    header: &'a RangeScan,
    ranges_m: &'a [f32],
}

impl<'a> Scan<'a> {
    pub(crate) fn of(scan: &Stamped<'a, RangeScan>) -> Option<Self> {
        let sound = scan.check().is_ok() && scan.range_max_m > 0.0 && scan.elements.len() <= MOST_BEAMS;
        sound.then_some(Self { header: scan.message, ranges_m: scan.elements })
    }

    /// Every beam's direction in the robot's frame, in (-π, π], and what became of it.
    pub(crate) fn beams(&self) -> impl Iterator<Item = (f64, Beam)> + Clone + '_ {
        let first_rad = self.header.sensor_heading_rad + self.header.angle_min_rad;
        self.ranges_m.iter().enumerate().map(move |(index, &range_m)| {
            let direction_rad = first_rad + index as f64 * self.header.angle_step_rad;
            (angle::wrap(direction_rad), Beam::of(range_m, self.header.range_max_m))
        })
    }

    /// The end of a beam in the robot's frame.
    pub(crate) fn end(&self, direction_rad: f64, range_m: f64) -> Point2<f64> {
        let (sine, cosine) = direction_rad.sin_cos();
        Point2::new(self.header.sensor_x_m + range_m * cosine, self.header.sensor_y_m + range_m * sine)
    }

    /// The nearest of each face from the hull.
    pub(crate) fn faces(&self, params: &Params) -> Faces {
        let mut seen = FaceRanges::FAR;
        for (direction_rad, beam) in self.beams() {
            if let Beam::Hit(range_m) = beam {
                let end = self.end(direction_rad, range_m);
                seen.add(end.x, end.y, params);
            }
        }
        [Face::Front, Face::Right, Face::Left].map(|face| {
            let sector = self.sector(face, params);
            let hidden_m = self.hidden_m(face, sector, params)?;
            if self.is_too_near(face, sector) { Some(0.0) } else { Some(seen.of_mut(face).min(hidden_m)) }
        })
    }

    /// The directions in which a face must be seen: the front over the hull's width and margin, a side from
    /// its front corner to straight aside. Farther back the robot has been already.
    fn sector(&self, face: Face, params: &Params) -> [f64; 2] {
        let (x_m, y_m) = (self.header.sensor_x_m, self.header.sensor_y_m);
        let wide_m = params.hull_side_m + params.laser_margin_m;
        let ahead_m = (params.hull_front_m - x_m).max(1e-3);
        let corner_m = params.hull_front_m + params.laser_margin_m - x_m;
        let towards = |across_m: f64, along_m: f64| across_m.atan2(along_m);
        match face {
            Face::Front => [towards(-wide_m - y_m, ahead_m), towards(wide_m - y_m, ahead_m)],
            Face::Left => {
                let corner_rad = towards((params.hull_side_m - y_m).max(1e-3), corner_m);
                [corner_rad.min(FRAC_PI_2), FRAC_PI_2]
            }
            Face::Right => {
                let corner_rad = towards((-params.hull_side_m - y_m).min(-1e-3), corner_m);
                [-FRAC_PI_2, corner_rad.max(-FRAC_PI_2)]
            }
        }
    }

    fn is_too_near(&self, face: Face, [from_rad, to_rad]: [f64; 2]) -> bool {
        // A side reaches back along the hull.
        let concerns = |direction_rad: f64| match face {
            Face::Front => (from_rad..=to_rad).contains(&direction_rad),
            Face::Left => direction_rad >= from_rad,
            Face::Right => direction_rad <= to_rad,
        };
        self.beams().any(|(direction_rad, beam)| beam == Beam::TooNear && concerns(direction_rad))
    }

    /// From the hull to the nearest place at which something could hide from the beams that can be read;
    /// `None` where it could be within the face's radius, or most beams of the sector say nothing.
    fn hidden_m(&self, face: Face, [from_rad, to_rad]: [f64; 2], params: &Params) -> Option<f64> {
        let mut readable: Vec<f64> = Vec::new();
        let (mut within, mut blind) = (0_usize, 0_usize);
        for (direction_rad, beam) in self.beams() {
            let is_within = (from_rad..=to_rad).contains(&direction_rad);
            let is_blind = beam == Beam::Unreadable;
            within += usize::from(is_within);
            blind += usize::from(is_within && is_blind);
            if !is_blind {
                readable.push(direction_rad);
            }
        }
        if within == 0 || 2 * blind > within {
            return None;
        }
        readable.sort_unstable_by(f64::total_cmp);
        let usual_rad = self.header.angle_step_rad.abs();
        let mut nearest = FaceRanges::FAR;
        let ends = readable.iter().copied().chain([f64::INFINITY]);
        let mut last_rad = f64::NEG_INFINITY;
        for next_rad in ends {
            let (begin_rad, end_rad) = (last_rad.max(from_rad), next_rad.min(to_rad));
            // Where the scan ends within the sector, what lies outside of the sector does not matter.
            let is_inner = last_rad.is_finite() && next_rad.is_finite();
            let gap_rad = if is_inner { next_rad - last_rad } else { end_rad - begin_rad };
            if end_rad > begin_rad && gap_rad > GAP_STEPS * usual_rad {
                self.hide(gap_rad, begin_rad, end_rad, params, &mut nearest);
            }
            last_rad = next_rad;
        }
        let hidden_m = *nearest.of_mut(face);
        (hidden_m >= params.radius_m(face)).then_some(hidden_m)
    }

    /// Puts something into a gap, as near to the robot as it can be.
    fn hide(&self, gap_rad: f64, begin_rad: f64, end_rad: f64, params: &Params, nearest: &mut FaceRanges) {
        let hull = params.hull();
        let hidden_m = 0.5 * HIDDEN_M / (0.5 * gap_rad).min(FRAC_PI_2 - 1e-6).tan();
        let steps = ((end_rad - begin_rad) / GAP_STEP_RAD).ceil().max(1.0) as u32;
        for step in 0..=steps {
            let direction_rad = begin_rad + (end_rad - begin_rad) * f64::from(step) / f64::from(steps);
            let range_m = hidden_m.max(self.way_out_m(direction_rad, &hull));
            let end = self.end(direction_rad, range_m);
            nearest.add(end.x, end.y, params);
        }
    }

    /// From the sensor to the edge of the hull, and a hair beyond.
    fn way_out_m(&self, direction_rad: f64, hull: &Hull) -> f64 {
        let origin = self.end(direction_rad, 0.0);
        if !hull.holds(origin) {
            return 0.0;
        }
        let (sine, cosine) = direction_rad.sin_cos();
        let along = |component: f64, ahead_m: f64, back_m: f64| match component {
            _ if component > 1e-9 => ahead_m / component,
            _ if component < -1e-9 => back_m / -component,
            _ => f64::INFINITY,
        };
        let lengthwise = along(cosine, hull.front_m - origin.x, hull.rear_m + origin.x);
        let across = along(sine, hull.side_m - origin.y, hull.side_m + origin.y);
        lengthwise.min(across) + 1e-6
    }
}

impl FaceRanges {
    /// Takes in an end point in the robot's frame.
    fn add(&mut self, x_m: f64, y_m: f64, params: &Params) {
        let margin_m = params.laser_margin_m;
        let front_m = x_m - params.hull_front_m;
        let side_m = y_m.abs() - params.hull_side_m;
        let nearest_side_m = if y_m < 0.0 { &mut self.right_m } else { &mut self.left_m };
        if front_m > 0.0 {
            if side_m <= margin_m {
                self.front_m = self.front_m.min(front_m);
            }
            if side_m > 0.0 && front_m <= margin_m {
                *nearest_side_m = nearest_side_m.min(side_m);
            }
        } else if side_m > 0.0 {
            if x_m >= -params.hull_rear_m - margin_m {
                *nearest_side_m = nearest_side_m.min(side_m);
            }
        } else if x_m >= -params.hull_rear_m {
            // Within the hull: it touches the nearer of the two edges.
            let touched_m = if front_m > side_m { &mut self.front_m } else { nearest_side_m };
            *touched_m = 0.0;
        }
    }
}
