//! Expected ranges: what a sensor at each of sixteen particles would read, along the walls' lines or over the
//! cells of a grid.

use crate::field::{Block, ByteField, LANES};
use geometry::{Grid, Segment};

/// One number for each particle of a block.
pub(crate) type Lanes = [f32; LANES];

/// Casts rays for blocks of particles.
#[derive(Debug, Clone)]
pub(crate) enum Caster {
    /// Against lines, exactly.
    Lines(Vec<Line>),
    /// Over a grid: each step is as long as the nearest wall is far (sphere tracing, Hart 1996).
    Cells(ByteField),
}

/// A wall: its begin, and the way to its end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    a: [f32; 2],
    along: [f32; 2],
}

/// A cell's distance is measured from its middle to a wall cell's middle: from any point to any point it is
/// shorter by this.
const MIDDLES: f32 = std::f32::consts::SQRT_2;
/// Steps are stored in quarters of a cell.
const QUARTERS: f32 = 4.0;
/// No ray needs more steps.
const MOST_STEPS: usize = 512;

impl Caster {
    /// Lines where there are any, else cells.
    pub(crate) fn new(walls: &[Segment], distances_m: &Grid<f32>) -> Self {
        if !walls.is_empty() {
            let line = |wall: &Segment| Line {
                a: [wall.a.x as f32, wall.a.y as f32],
                along: [(wall.b.x - wall.a.x) as f32, (wall.b.y - wall.a.y) as f32],
            };
            return Self::Lines(walls.iter().map(line).collect());
        }
        let per_metre = (1.0 / distances_m.frame().resolution_m()) as f32;
        let step = |distance_m: f32| {
            let cells = distance_m * per_metre;
            // At least half a cell, so that rays along walls arrive; 0 is a wall.
            if cells < 0.5 { 0 } else { (QUARTERS * (cells - MIDDLES)).clamp(2.0, 255.0) as u8 }
        };
        Self::Cells(ByteField::new(distances_m, 1, u8::MAX, step))
    }

    /// The block of these particles as [`Caster::cast`] needs it.
    pub(crate) fn block(&self, [x, y, heading]: [&[f32]; 3], sensor: [f32; 2]) -> Block {
        let (per_metre, border) = match self {
            Self::Lines(_) => (1.0, 0.0),
            Self::Cells(field) => (field.per_metre, 1.0),
        };
        let mut block = Block::gather(x, y, heading, per_metre, border);
        block.shift(sensor.map(|offset| offset * per_metre));
        block
    }

    /// For each direction (cosine and sine in the robot's frame) the range at each particle, at most
    /// `most_m`.
    pub(crate) fn cast(&self, block: &Block, directions: &[[f32; 2]], most_m: f32, ranges: &mut Vec<Lanes>) {
        ranges.clear();
        ranges.resize(directions.len(), [most_m; LANES]);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            unsafe { self.cast_avx2(block, directions, most_m, ranges) };
            return;
        }
        self.cast_plain(block, directions, most_m, ranges);
    }

    pub(crate) fn cast_plain(
        &self,
        block: &Block,
        directions: &[[f32; 2]],
        most_m: f32,
        ranges: &mut [Lanes],
    ) {
        for (direction, ranges) in directions.iter().zip(ranges) {
            let (du, dv) = turned(block, *direction);
            match self {
                Self::Lines(lines) => meet(lines, block, &du, &dv, ranges),
                Self::Cells(field) => trace(field, block, &du, &dv, most_m, ranges),
            }
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn cast_avx2(&self, block: &Block, directions: &[[f32; 2]], most_m: f32, ranges: &mut [Lanes]) {
        for (direction, ranges) in directions.iter().zip(ranges) {
            let (du, dv) = turned(block, *direction);
            match self {
                Self::Lines(lines) => meet(lines, block, &du, &dv, ranges),
                Self::Cells(field) => trace_avx2(field, block, &du, &dv, most_m, ranges),
            }
        }
    }
}

/// A direction of the robot's frame at each particle.
#[inline(always)]
pub(crate) fn turned(block: &Block, [cosine, sine]: [f32; 2]) -> (Lanes, Lanes) {
    let (mut du, mut dv) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        du[lane] = block.cosine[lane] * cosine - block.sine[lane] * sine;
        dv[lane] = block.sine[lane] * cosine + block.cosine[lane] * sine;
    }
    (du, dv)
}

/// The nearest line along a ray from each particle.
#[inline(always)]
fn meet(lines: &[Line], block: &Block, du: &Lanes, dv: &Lanes, ranges: &mut Lanes) {
    for line in lines {
        for lane in 0..LANES {
            let (wu, wv) = (line.a[0] - block.u[lane], line.a[1] - block.v[lane]);
            let cross = du[lane] * line.along[1] - dv[lane] * line.along[0];
            // A parallel line gives infinities or NaN, which fail the comparisons.
            let inverse = 1.0 / cross;
            let range = (wu * line.along[1] - wv * line.along[0]) * inverse;
            let share = (wu * dv[lane] - wv * du[lane]) * inverse;
            // A hair longer than the line is, so that no ray slips through a corner.
            let met = ((share - 0.5).abs() <= 0.500_01) & (range >= 0.0) & (range < ranges[lane]);
            ranges[lane] = if met { range } else { ranges[lane] };
        }
    }
}

/// From the edge of a wall's cell to its middle, which is where the map's wall is on average.
const INTO_WALL: f32 = 0.5;

/// Of rays that ended after `along` cells: the exact range to the edge of the cell in which they did, and
/// into the wall; in metres.
#[inline(always)]
fn arrive(
    block: &Block,
    du: &Lanes,
    dv: &Lanes,
    along: &Lanes,
    [per_metre, most_m]: [f32; 2],
    ranges: &mut Lanes,
) {
    // Where a ray crosses the edge of its last cell that it met first on one axis.
    let edge = |origin: f32, direction: f32, along: f32| {
        let place = origin + direction * along;
        let low = place as i32 as f32;
        let edge = if direction > 0.0 { low } else { low + 1.0 };
        if direction.abs() > 1e-6 { (edge - origin) / direction } else { 0.0 }
    };
    for lane in 0..LANES {
        let met = edge(block.u[lane], du[lane], along[lane]).max(edge(block.v[lane], dv[lane], along[lane]));
        let range_m = (met.max(0.0) + INTO_WALL) / per_metre;
        ranges[lane] = if along[lane] < most_m * per_metre { range_m.min(most_m) } else { most_m };
    }
}

fn trace(field: &ByteField, block: &Block, du: &Lanes, dv: &Lanes, most_m: f32, ranges: &mut Lanes) {
    let most = most_m * field.per_metre;
    let mut ends = [0.0; LANES];
    for lane in 0..LANES {
        let mut along = 0.0;
        for _ in 0..MOST_STEPS {
            let step = field.at(block.u[lane] + du[lane] * along, block.v[lane] + dv[lane] * along);
            if step == 0 || along >= most {
                break;
            }
            along += f32::from(step) * (1.0 / QUARTERS);
        }
        ends[lane] = along;
    }
    arrive(block, du, dv, &ends, [field.per_metre, most_m], ranges);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn trace_avx2(field: &ByteField, block: &Block, cu: &Lanes, cv: &Lanes, most_m: f32, ranges: &mut Lanes) {
    use std::arch::x86_64::*;
    let view = field.avx2();
    // SAFETY: halves of arrays of sixteen numbers.
    let load = |lanes: &Lanes, half: usize| unsafe { _mm256_loadu_ps(lanes.as_ptr().add(8 * half)) };
    let halves = |lanes: &Lanes| [load(lanes, 0), load(lanes, 1)];
    let (u, v, du, dv) = (halves(&block.u), halves(&block.v), halves(cu), halves(cv));
    let most = _mm256_set1_ps(most_m * field.per_metre);
    let quarter = _mm256_set1_ps(1.0 / QUARTERS);
    let mut along = [_mm256_setzero_ps(); 2];
    for _ in 0..MOST_STEPS {
        let mut running = 0;
        // Two independent chains hide each other's wait for memory.
        for half in 0..2 {
            let at_u = _mm256_add_ps(u[half], _mm256_mul_ps(du[half], along[half]));
            let at_v = _mm256_add_ps(v[half], _mm256_mul_ps(dv[half], along[half]));
            let bytes = view.bytes(at_u, at_v);
            let short = _mm256_cmp_ps::<_CMP_LT_OQ>(along[half], most);
            let step = _mm256_and_ps(_mm256_mul_ps(_mm256_cvtepi32_ps(bytes), quarter), short);
            along[half] = _mm256_add_ps(along[half], step);
            running |= _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(step, _mm256_setzero_ps()));
        }
        if running == 0 {
            break;
        }
    }
    let mut lanes = [0.0; LANES];
    for (half, along) in along.into_iter().enumerate() {
        // SAFETY: halves of an array of sixteen numbers.
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr().add(8 * half), along) };
    }
    arrive(block, cu, cv, &lanes, [field.per_metre, most_m], ranges);
}
