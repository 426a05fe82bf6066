//! What a turning ultrasonic sensor reads in an arena, and how likely each of its errors is: the model for
//! cones among straight walls.
//!
//! Sound spreads as a cone, and the nearest thing within it answers (NXT-032). That is a wall where it faces
//! the sensor, the end of a wall, or a wall where the edge of the cone cuts it; in the last case the sound
//! meets it askew, and the more so, the later its echo is noticed, or it is lost and something farther away
//! answers (NXT-033, NXT-034). A reading is compared with the nearest thing by a density that knows this:
//! narrow where a wall faces the sensor, broad and one-sided where it is met askew. A narrow Gaussian for all
//! would be too sure of the askew ones, a broad one wastes the others.

#![allow(clippy::needless_range_loop, reason = "one lane of several arrays at a time")]

use crate::expected::{Lanes, turned};
use crate::field::{Block, LANES};
use crate::params::{Echoes, Params};
use crate::{Beams, Particles};
use geometry::{Point2, Segment, Vector2};

/// Kinds of meetings, by the cosine of the angle of incidence.
const KINDS: usize = 32;
/// The kind of meeting for directions in which nothing is expected: one more.
const NOTHING: usize = KINDS;
/// Columns of the table: differences between a reading and what was expected.
const COLUMNS: usize = 512;
/// Width of a column.
const COLUMN_M: f64 = 0.004;
/// The difference at which the first column begins: readings that are too short.
const SHORTEST_M: f64 = -0.448;
/// Points of a perfect reading.
const FULL: f64 = 255.0;

/// Walls as lines, and the ends that they have in common.
#[derive(Debug, Clone)]
pub(crate) struct EchoModel {
    lines: Vec<Line>,
    ends: Vec<End>,
    half_cosine: f32,
    half_sine: f32,
    has_cone: bool,
    /// Cosine of the angle of incidence that an edge is worth.
    edge_facing: f32,
    range_max_m: f32,
    /// Points by kind and column.
    table: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct Line {
    a: [f32; 2],
    /// To the other end.
    along: [f32; 2],
    inverse_length: f32,
}

/// Where walls end.
#[derive(Debug, Clone, Copy)]
struct End {
    at: [f32; 2],
    /// The ways along the walls that meet there, the same one twice at a free end. A sensor between them
    /// looks into a corner, which sends sound back wherever it comes from; any other looks at an edge, which
    /// scatters it, or hears the end of a wall that faces it.
    arms: [[f32; 2]; 2],
}

/// Something that may answer, as seen from the particles of a block.
#[derive(Debug, Clone, Copy)]
struct Thing {
    /// The direction to it.
    u: Lanes,
    v: Lanes,
    range_m: Lanes,
    facing: Lanes,
}

/// A block of particles, and what stands around each of them.
#[derive(Debug)]
struct BlockView {
    block: Block,
    walls: Vec<SeenWall>,
    things: Vec<Thing>,
}

/// A wall as seen from the particles of a block: the way to its first end, and that way's cross product with
/// the wall.
#[derive(Debug, Clone, Copy)]
struct SeenWall {
    u: Lanes,
    v: Lanes,
    area: Lanes,
}

/// A ray that misses a wall by this part of its length meets it.
const SLACK: f32 = 1e-5;
/// Ends closer than this are one.
const SAME_M: f64 = 1e-4;
/// Walls that go on so straight have no end there.
const STRAIGHT: f64 = 1e-3;

impl EchoModel {
    /// Prepares the walls and the table. Returns with it the nats between the worst and the best reading.
    pub(crate) fn new(params: &Params, walls: &[Segment]) -> (Self, f64) {
        let walls: Vec<&Segment> = walls.iter().filter(|wall| wall.length_m() > SAME_M).collect();
        let line = |wall: &&Segment| Line {
            a: single(wall.a.coords),
            along: single(wall.vector()),
            inverse_length: (1.0 / wall.length_m()) as f32,
        };
        let (half_sine, half_cosine) = params.cone_half_width_rad.sin_cos();
        let (table, nats) = table(params);
        let model = Self {
            lines: walls.iter().map(line).collect(),
            ends: ends(&walls),
            half_cosine: half_cosine as f32,
            half_sine: half_sine as f32,
            has_cone: params.cone_half_width_rad > 0.0,
            edge_facing: params.echoes.edge_rad.cos() as f32,
            range_max_m: params.range_max_m as f32,
            table,
        };
        (model, nats)
    }

    pub(crate) fn table_bytes(&self) -> usize {
        self.table.len() + size_of_val(self.lines.as_slice()) + size_of_val(self.ends.as_slice())
    }

    /// The points of a block of particles for all beams.
    pub(crate) fn points(&self, poses: [&[f32]; 3], beams: &Beams) -> [u32; LANES] {
        let mut total = [0; LANES];
        self.expect(poses, beams, |beam, nearest_m, facing| {
            let measured_m = beams.range_m[beam];
            for lane in 0..LANES {
                total[lane] += u32::from(self.table[self.index(measured_m, nearest_m[lane], facing[lane])]);
            }
        });
        total
    }

    /// What each particle's sensor is expected to read along each beam, particle by particle.
    pub(crate) fn expected_ranges(&self, particles: &Particles, beams: &Beams) -> Vec<f32> {
        let mut expected = vec![0.0; particles.len() * beams.len()];
        for first in (0..particles.len()).step_by(LANES) {
            let last = (first + LANES).min(particles.len());
            let poses =
                [&particles.x[first..last], &particles.y[first..last], &particles.heading[first..last]];
            self.expect(poses, beams, |beam, nearest_m, _| {
                for (lane, range_m) in nearest_m.iter().enumerate().take(last - first) {
                    expected[(first + lane) * beams.len() + beam] = *range_m;
                }
            });
        }
        expected
    }

    /// Hands to `judge`, for each beam, the range of the nearest thing at each particle, and the cosine of
    /// the angle at which it is met.
    pub(crate) fn expect(
        &self,
        [x, y, heading]: [&[f32]; 3],
        beams: &Beams,
        mut judge: impl FnMut(usize, &Lanes, &Lanes),
    ) {
        let view = self.look_around([x, y, heading], beams.sensor);
        for (beam, direction_rad) in beams.direction_rad.iter().enumerate() {
            let (sine, cosine) = direction_rad.sin_cos();
            let (mut nearest_m, mut facing) = ([self.range_max_m; LANES], [0.0; LANES]);
            self.look_fast(&view, [cosine, sine], &mut nearest_m, &mut facing);
            judge(beam, &nearest_m, &facing);
        }
    }

    fn look_fast(&self, view: &BlockView, direction: [f32; 2], nearest_m: &mut Lanes, facing: &mut Lanes) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            unsafe { self.look_avx2(view, direction, nearest_m, facing) };
            return;
        }
        self.look(view, direction, nearest_m, facing);
    }

    /// The nearest thing within the cone around a direction, given as cosine and sine in the robot's frame:
    /// the edges of the cone against every wall, then what faces the sensor within. Ranges along the edges
    /// are kept as fractions, for one division a beam.
    fn look(&self, view: &BlockView, direction: [f32; 2], nearest_m: &mut Lanes, facing: &mut Lanes) {
        let [middle, left, right] = self.rays(view, direction);
        for lane in 0..LANES {
            let (mut most, mut part, mut faces) = (nearest_m[lane], 1.0_f32, facing[lane]);
            for (line, seen) in self.lines.iter().zip(&view.walls) {
                for (du, dv) in [(left.0[lane], left.1[lane]), (right.0[lane], right.1[lane])] {
                    let cross = du * line.along[1] - dv * line.along[0];
                    let size = cross.abs();
                    // The range is `ahead / size`, and the wall is met at `aside / size` of its length.
                    let ahead = with_sign_of(cross, seen.area[lane]);
                    let aside = with_sign_of(cross, seen.u[lane] * dv - seen.v[lane] * du);
                    // A hair longer than the line is, so that no ray slips through a corner.
                    let slack = SLACK * size;
                    let met = aside >= -slack && aside <= size + slack && ahead >= 0.0;
                    if met && ahead * part < most * size {
                        (most, part, faces) = (ahead, size, size * line.inverse_length);
                    }
                }
            }
            let mut near = most / part;
            for thing in &view.things {
                let inside = thing.u[lane] * middle.0[lane] + thing.v[lane] * middle.1[lane];
                if inside >= self.half_cosine && thing.range_m[lane] < near {
                    (near, faces) = (thing.range_m[lane], thing.facing[lane]);
                }
            }
            (nearest_m[lane], facing[lane]) = (near, faces);
        }
    }

    /// What `look` finds, for eight particles at a time and equal bit for bit.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn look_avx2(&self, view: &BlockView, direction: [f32; 2], nearest_m: &mut Lanes, facing: &mut Lanes) {
        use std::arch::x86_64::*;
        let [middle, left, right] = self.rays(view, direction);
        let sign_bit = _mm256_set1_ps(-0.0);
        let zero = _mm256_setzero_ps();
        for half in 0..2 {
            // SAFETY: halves of arrays of sixteen numbers.
            let load = |lanes: &Lanes| unsafe { _mm256_loadu_ps(lanes.as_ptr().add(8 * half)) };
            let edges = [(load(&left.0), load(&left.1)), (load(&right.0), load(&right.1))];
            let (mut most, mut part, mut faces) = (load(nearest_m), _mm256_set1_ps(1.0), load(facing));
            for (line, seen) in self.lines.iter().zip(&view.walls) {
                let (along_u, along_v) = (_mm256_set1_ps(line.along[0]), _mm256_set1_ps(line.along[1]));
                let (u, v, area) = (load(&seen.u), load(&seen.v), load(&seen.area));
                for (du, dv) in edges {
                    let cross = _mm256_sub_ps(_mm256_mul_ps(du, along_v), _mm256_mul_ps(dv, along_u));
                    let sign = _mm256_and_ps(cross, sign_bit);
                    let size = _mm256_xor_ps(cross, sign);
                    let ahead = _mm256_xor_ps(area, sign);
                    let aside =
                        _mm256_xor_ps(_mm256_sub_ps(_mm256_mul_ps(u, dv), _mm256_mul_ps(v, du)), sign);
                    let slack = _mm256_mul_ps(_mm256_set1_ps(SLACK), size);
                    let after = _mm256_cmp_ps::<_CMP_GE_OQ>(aside, _mm256_xor_ps(slack, sign_bit));
                    let before = _mm256_cmp_ps::<_CMP_LE_OQ>(aside, _mm256_add_ps(size, slack));
                    let forward = _mm256_cmp_ps::<_CMP_GE_OQ>(ahead, zero);
                    let nearer =
                        _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_mul_ps(ahead, part), _mm256_mul_ps(most, size));
                    let met = _mm256_and_ps(_mm256_and_ps(after, before), _mm256_and_ps(forward, nearer));
                    most = _mm256_blendv_ps(most, ahead, met);
                    part = _mm256_blendv_ps(part, size, met);
                    let faced = _mm256_mul_ps(size, _mm256_set1_ps(line.inverse_length));
                    faces = _mm256_blendv_ps(faces, faced, met);
                }
            }
            let mut near = _mm256_div_ps(most, part);
            let (du, dv) = (load(&middle.0), load(&middle.1));
            let half_cosine = _mm256_set1_ps(self.half_cosine);
            for thing in &view.things {
                let (u, v, range_m) = (load(&thing.u), load(&thing.v), load(&thing.range_m));
                let inside = _mm256_add_ps(_mm256_mul_ps(u, du), _mm256_mul_ps(v, dv));
                let met = _mm256_and_ps(
                    _mm256_cmp_ps::<_CMP_GE_OQ>(inside, half_cosine),
                    _mm256_cmp_ps::<_CMP_LT_OQ>(range_m, near),
                );
                near = _mm256_blendv_ps(near, range_m, met);
                faces = _mm256_blendv_ps(faces, load(&thing.facing), met);
            }
            // SAFETY: halves of arrays of sixteen numbers.
            unsafe {
                _mm256_storeu_ps(nearest_m.as_mut_ptr().add(8 * half), near);
                _mm256_storeu_ps(facing.as_mut_ptr().add(8 * half), faces);
            }
        }
    }

    /// The middle and both edges of a cone, at each particle.
    fn rays(&self, view: &BlockView, [cosine, sine]: [f32; 2]) -> [(Lanes, Lanes); 3] {
        let (c, s) = (self.half_cosine, self.half_sine);
        let left = [cosine * c - sine * s, sine * c + cosine * s];
        let right = [cosine * c + sine * s, sine * c - cosine * s];
        [[cosine, sine], left, right].map(|direction| turned(&view.block, direction))
    }

    /// Where walls face the sensor, and where they end, from each particle.
    fn look_around(&self, [x, y, heading]: [&[f32]; 3], sensor: [f32; 2]) -> BlockView {
        let mut block = Block::gather(x, y, heading, 1.0, 0.0);
        block.shift(sensor);
        let wall = |line: &Line| {
            let mut wall = SeenWall { u: [0.0; LANES], v: [0.0; LANES], area: [0.0; LANES] };
            for lane in 0..LANES {
                (wall.u[lane], wall.v[lane]) = (line.a[0] - block.u[lane], line.a[1] - block.v[lane]);
                wall.area[lane] = wall.u[lane] * line.along[1] - wall.v[lane] * line.along[0];
            }
            wall
        };
        let walls = self.lines.iter().map(wall).collect();
        let mut things = Vec::new();
        if !self.has_cone {
            return BlockView { block, walls, things };
        }
        things.reserve(self.lines.len() + self.ends.len());
        let thing = |lane_of: &dyn Fn(usize) -> Option<([f32; 2], f32)>| {
            let (mut u, mut v, mut range_m, mut facing) =
                ([0.0; LANES], [0.0; LANES], [f32::INFINITY; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                if let Some((way, faces)) = lane_of(lane) {
                    let length = (way[0] * way[0] + way[1] * way[1]).sqrt().max(1e-6);
                    (u[lane], v[lane]) = (way[0] / length, way[1] / length);
                    (range_m[lane], facing[lane]) = (length, faces);
                }
            }
            Thing { u, v, range_m, facing }
        };
        for line in &self.lines {
            things.push(thing(&|lane| {
                let (wu, wv) = (line.a[0] - block.u[lane], line.a[1] - block.v[lane]);
                let share =
                    -(wu * line.along[0] + wv * line.along[1]) * line.inverse_length * line.inverse_length;
                let foot = [wu + share * line.along[0], wv + share * line.along[1]];
                (0.0..=1.0).contains(&share).then_some((foot, 1.0))
            }));
        }
        for end in &self.ends {
            things.push(thing(&|lane| {
                let way = [end.at[0] - block.u[lane], end.at[1] - block.v[lane]];
                let [one, other] = end.arms;
                let back = [-way[0], -way[1]];
                let is_corner = cross(one, back) * cross(one, other) > 0.0
                    && cross(other, back) * cross(other, one) > 0.0;
                let length = (way[0] * way[0] + way[1] * way[1]).sqrt().max(1e-6);
                let faced = cross(one, way).abs().max(cross(other, way).abs()) / length;
                Some((way, if is_corner { 1.0 } else { faced.max(self.edge_facing) }))
            }));
        }
        BlockView { block, walls, things }
    }

    /// Where in the table a reading is.
    #[inline(always)]
    fn index(&self, measured_m: f32, nearest_m: f32, facing: f32) -> usize {
        let column = (measured_m - nearest_m - SHORTEST_M as f32) * (1.0 / COLUMN_M) as f32;
        let column = column.clamp(0.0, (COLUMNS - 1) as f32) as usize;
        let kind = (facing * KINDS as f32).clamp(0.0, (KINDS - 1) as f32) as usize;
        let kind = if nearest_m < self.range_max_m { kind } else { NOTHING };
        (kind * COLUMNS + column).min(self.table.len() - 1)
    }
}

/// A number, negated where another one is negative.
#[inline(always)]
fn with_sign_of(sign: f32, number: f32) -> f32 {
    f32::from_bits(number.to_bits() ^ (sign.to_bits() & 0x8000_0000))
}

#[cfg(test)]
impl EchoModel {
    /// Whether both ways to compute give the same bits, at these particles along this direction.
    pub(crate) fn agrees_with_itself(&self, poses: [&[f32]; 3], direction_rad: f32) -> bool {
        let view = self.look_around(poses, [0.02, -0.01]);
        let (sine, cosine) = direction_rad.sin_cos();
        let mut both = [([self.range_max_m; LANES], [0.0; LANES]); 2];
        let [(nearest_m, facing), (plain_m, plain_facing)] = &mut both;
        self.look_fast(&view, [cosine, sine], nearest_m, facing);
        self.look(&view, [cosine, sine], plain_m, plain_facing);
        both[0] == both[1]
    }

    /// The points of a reading that is so much longer than expected.
    pub(crate) fn points_of(&self, facing: f32, difference_m: f32) -> u8 {
        self.table[self.index(1.0 + difference_m, 1.0, facing)]
    }

    /// The probability of all differences that the table knows, where a reading without points has the
    /// density `worst`.
    pub(crate) fn mass(&self, facing: f32, nats: f64, worst: f64) -> f64 {
        let density = |column: usize| {
            let difference_m = SHORTEST_M + (column as f64 + 0.5) * COLUMN_M;
            let points = f64::from(self.points_of(facing, difference_m as f32));
            (points / FULL * nats).exp()
        };
        let sum: f64 = (0..COLUMNS).map(density).sum();
        sum * COLUMN_M * worst
    }
}

fn single(vector: Vector2<f64>) -> [f32; 2] {
    [vector.x as f32, vector.y as f32]
}

fn cross(a: [f32; 2], b: [f32; 2]) -> f32 {
    a[0] * b[1] - a[1] * b[0]
}

/// The places where walls end, each once; not those where one goes straight on as another.
fn ends(walls: &[&Segment]) -> Vec<End> {
    let mut places: Vec<(Point2<f64>, Vec<Vector2<f64>>)> = Vec::new();
    for wall in walls {
        let Some(along) = wall.direction() else { continue };
        for (end, arm) in [(wall.a, along), (wall.b, -along)] {
            match places.iter_mut().find(|(place, _)| (*place - end).norm() < SAME_M) {
                Some((_, arms)) => arms.push(arm),
                None => places.push((end, vec![arm])),
            }
        }
    }
    let end = |(place, arms): (Point2<f64>, Vec<Vector2<f64>>)| {
        let arms = match arms[..] {
            [one, other] if (one + other).norm() < STRAIGHT => return None,
            [one, other, ..] => [single(one), single(other)],
            [one] => [single(one); 2],
            [] => return None,
        };
        Some(End { at: single(place.coords), arms })
    };
    places.into_iter().filter_map(end).collect()
}

/// Points by kind of meeting and difference, and the nats between the worst and the best.
fn table(params: &Params) -> (Vec<u8>, f64) {
    let middle = |index: usize, width: f64| (index as f64 + 0.5) * width;
    let differences = || (0..COLUMNS).map(|column| SHORTEST_M + middle(column, COLUMN_M));
    let anything = params.random_share / params.range_max_m;
    let of_kind = |kind: usize| {
        let facing = middle(kind, 1.0 / KINDS as f64);
        let incidence_rad = facing.acos();
        let (late_m, lost) = (params.echoes.late_m(incidence_rad), params.echoes.lost_share(incidence_rad));
        let density = move |difference_m: f64| {
            let heard = heard(difference_m, params.sigma_m, late_m);
            let detour_m = params.echoes.detour_m;
            let other = if difference_m > 0.0 { (-difference_m / detour_m).exp() / detour_m } else { 0.0 };
            (1.0 - params.random_share) * ((1.0 - lost) * heard + lost * other) + anything
        };
        differences().map(density)
    };
    let of_nothing = differences().map(|_| 1.0 / params.range_max_m);
    let logs: Vec<f64> = (0..KINDS).flat_map(of_kind).chain(of_nothing).map(f64::ln).collect();
    let worst = logs.iter().copied().fold(f64::INFINITY, f64::min);
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let nats = (best - worst).max(1e-9);
    (logs.iter().map(|log| (FULL * (log - worst) / nats).round() as u8).collect(), nats)
}

/// Density of an echo that is so much longer than the way: noise, and a delay that is half of a normal number
/// of size `late_m`.
fn heard(difference_m: f64, sigma_m: f64, late_m: f64) -> f64 {
    let normal = |value: f64, sigma: f64| {
        (-0.5 * (value / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt())
    };
    // Delays, from none to four times their size; those that lie too far from the difference to matter are
    // left out.
    let (mut sum, mut mass) = (0.0, 0.0);
    for step in 0..DELAYS {
        let delay = (step as f64 + 0.5) / DELAYS as f64 * 4.0;
        let weight = normal(delay, 1.0);
        let left_m = difference_m - delay * late_m;
        mass += weight;
        if left_m.abs() < FAR_SIGMAS * sigma_m {
            sum += weight * normal(left_m, sigma_m);
        }
    }
    sum / mass
}

/// Delays that the density is summed over.
const DELAYS: usize = 100;
/// Farther away a normal density is nothing.
const FAR_SIGMAS: f64 = 8.0;

impl Echoes {
    /// Size of the delay of an echo met at this angle of incidence.
    fn late_m(&self, incidence_rad: f64) -> f64 {
        let tangent = incidence_rad.tan().clamp(0.0, 100.0);
        (self.late_m * tangent * tangent).min(self.latest_m)
    }

    /// Share of such echoes that are lost.
    fn lost_share(&self, incidence_rad: f64) -> f64 {
        let slant = (incidence_rad - self.lost_from_rad) / (self.lost_to_rad - self.lost_from_rad);
        (self.lost_share * slant.clamp(0.0, 1.0)).max(self.lost_least)
    }
}
