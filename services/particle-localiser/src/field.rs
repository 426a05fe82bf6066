//! Grids of one byte a cell, and their look-up for many particles at once.
//!
//! A likelihood field says of each cell how likely a beam ends there, in 255 steps: sums over beams are sums
//! of whole numbers, exact in any order, and four to eight times as much of the map lies in the cache as with
//! single precision.

#![allow(clippy::needless_range_loop, reason = "one lane of several arrays at a time")]

use crate::trigonometry::sin_cos;
use geometry::Grid;

/// Particles that are weighed side by side.
pub(crate) const LANES: usize = 16;

/// One byte a cell, with a border of one cell around it that stands for everything outside.
#[derive(Debug, Clone)]
pub(crate) struct ByteField {
    /// Row by row, and three bytes more: a look-up reads four.
    cells: Vec<u8>,
    stride: usize,
    /// The last column and row, the border included.
    last: [f32; 2],
    pub(crate) per_metre: f32,
}

/// How many bytes more than its cell a look-up reads.
const READ_AHEAD: usize = 3;

/// The poses of a block of particles in cells of a field, with the sines and cosines of their headings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block {
    pub(crate) u: [f32; LANES],
    pub(crate) v: [f32; LANES],
    pub(crate) sine: [f32; LANES],
    pub(crate) cosine: [f32; LANES],
}

impl Block {
    /// Up to sixteen particles; the rest of the lanes repeats the map's corner.
    #[inline(always)]
    pub(crate) fn gather(x: &[f32], y: &[f32], heading: &[f32], per_metre: f32, border: f32) -> Self {
        let mut block = Self { u: [0.0; LANES], v: [0.0; LANES], sine: [0.0; LANES], cosine: [0.0; LANES] };
        let mut headings = [0.0; LANES];
        let count = x.len().min(LANES);
        block.u[..count].copy_from_slice(&x[..count]);
        block.v[..count].copy_from_slice(&y[..count]);
        headings[..count].copy_from_slice(&heading[..count]);
        for lane in 0..LANES {
            block.u[lane] = block.u[lane] * per_metre + border;
            block.v[lane] = block.v[lane] * per_metre + border;
            (block.sine[lane], block.cosine[lane]) = sin_cos(headings[lane]);
        }
        block
    }

    /// From the robots' middles to a place ahead and to the left of each.
    pub(crate) fn shift(&mut self, [ahead, aside]: [f32; 2]) {
        for lane in 0..LANES {
            self.u[lane] += self.cosine[lane] * ahead - self.sine[lane] * aside;
            self.v[lane] += self.sine[lane] * ahead + self.cosine[lane] * aside;
        }
    }
}

impl ByteField {
    /// `value` of each cell's distance from the nearest wall, `outside` around the map.
    ///
    /// Each cell of the map becomes `fineness` x `fineness` cells whose distances are interpolated between
    /// the middles of the map's.
    pub(crate) fn new(
        distances_m: &Grid<f32>,
        fineness: usize,
        outside: u8,
        value: impl Fn(f32) -> u8,
    ) -> Self {
        let frame = distances_m.frame();
        let (width, height) = (frame.width() as usize, frame.height() as usize);
        let (fine_width, fine_height) = (width * fineness, height * fineness);
        let stride = fine_width + 2;
        let mut cells = vec![outside; stride * (fine_height + 2) + READ_AHEAD];
        let known = distances_m.as_slice();
        // Middles of fine cells in coarse ones: the lower neighbour and the share of the upper one.
        let between = |fine: usize, count: usize| {
            let place = ((fine as f32 + 0.5) / fineness as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let low = place as usize;
            (low, (low + 1).min(count - 1), place - low as f32)
        };
        for row in 0..fine_height {
            let (below, above, up) = between(row, height);
            for column in 0..fine_width {
                let (left, right, across) = between(column, width);
                let mix = |a: f32, b: f32, share: f32| {
                    if share == 0.0 || a == b { a } else { a + (b - a) * share }
                };
                let low = mix(known[below * width + left], known[below * width + right], across);
                let high = mix(known[above * width + left], known[above * width + right], across);
                cells[(row + 1) * stride + column + 1] = value(mix(low, high, up));
            }
        }
        let last = [(fine_width + 1) as f32, (fine_height + 1) as f32];
        Self { cells, stride, last, per_metre: (fineness as f64 / frame.resolution_m()) as f32 }
    }

    /// Bytes that the field takes.
    pub(crate) fn bytes(&self) -> usize {
        self.cells.len()
    }

    /// Adds up, for each particle, the bytes of the cells in which the beams end. `ends_u` and `ends_v` are
    /// the beams' ends in the robot's frame, in cells of this field.
    pub(crate) fn sums(&self, poses: [&[f32]; 3], ends_u: &[f32], ends_v: &[f32], sums: &mut [u32]) {
        let [x, y, heading] = poses;
        let blocks =
            x.chunks(LANES).zip(y.chunks(LANES)).zip(heading.chunks(LANES)).zip(sums.chunks_mut(LANES));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            for (((x, y), heading), sums) in blocks {
                // SAFETY: the processor has AVX2.
                unsafe { self.block_sums_avx2([x, y, heading], ends_u, ends_v, sums) };
            }
            return;
        }
        for (((x, y), heading), sums) in blocks {
            self.block_sums([x, y, heading], ends_u, ends_v, sums);
        }
    }

    /// The sums of up to sixteen particles, in plain arithmetic.
    pub(crate) fn block_sums(
        &self,
        [x, y, heading]: [&[f32]; 3],
        ends_u: &[f32],
        ends_v: &[f32],
        sums: &mut [u32],
    ) {
        let block = Block::gather(x, y, heading, self.per_metre, 1.0);
        let mut totals = [0_u32; LANES];
        for (&bu, &bv) in ends_u.iter().zip(ends_v) {
            for lane in 0..LANES {
                let u = block.u[lane] + (block.cosine[lane] * bu - block.sine[lane] * bv);
                let v = block.v[lane] + (block.sine[lane] * bu + block.cosine[lane] * bv);
                totals[lane] += u32::from(self.at(u, v));
            }
        }
        sums.copy_from_slice(&totals[..sums.len()]);
    }

    /// The byte at a place in cells; the border's for everything outside.
    #[inline(always)]
    pub(crate) fn at(&self, u: f32, v: f32) -> u8 {
        let column = u.max(0.0).min(self.last[0]) as usize;
        let row = v.max(0.0).min(self.last[1]) as usize;
        self.cells[row * self.stride + column]
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn block_sums_avx2(
        &self,
        [x, y, heading]: [&[f32]; 3],
        ends_u: &[f32],
        ends_v: &[f32],
        sums: &mut [u32],
    ) {
        use std::arch::x86_64::*;
        let block = Block::gather(x, y, heading, self.per_metre, 1.0);
        // SAFETY: halves of arrays of sixteen numbers.
        let load =
            |lanes: &[f32; LANES], half: usize| unsafe { _mm256_loadu_ps(lanes.as_ptr().add(8 * half)) };
        let halves = |lanes: &[f32; LANES]| [load(lanes, 0), load(lanes, 1)];
        let (pu, pv, sine, cosine) =
            (halves(&block.u), halves(&block.v), halves(&block.sine), halves(&block.cosine));
        let view = self.avx2();
        let mut totals = [_mm256_setzero_si256(); 2];
        for (&bu, &bv) in ends_u.iter().zip(ends_v) {
            let (bu, bv) = (_mm256_set1_ps(bu), _mm256_set1_ps(bv));
            for half in 0..2 {
                let du = _mm256_sub_ps(_mm256_mul_ps(cosine[half], bu), _mm256_mul_ps(sine[half], bv));
                let dv = _mm256_add_ps(_mm256_mul_ps(sine[half], bu), _mm256_mul_ps(cosine[half], bv));
                let bytes = view.bytes(_mm256_add_ps(pu[half], du), _mm256_add_ps(pv[half], dv));
                totals[half] = _mm256_add_epi32(totals[half], bytes);
            }
        }
        let mut lanes = [0_u32; LANES];
        for (half, total) in totals.into_iter().enumerate() {
            // SAFETY: halves of an array of sixteen numbers.
            unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().add(8 * half).cast(), total) };
        }
        sums.copy_from_slice(&lanes[..sums.len()]);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(crate) fn avx2(&self) -> Avx2View {
        use std::arch::x86_64::*;
        Avx2View {
            cells: self.cells.as_ptr(),
            stride: _mm256_set1_epi32(self.stride as i32),
            last: [_mm256_set1_ps(self.last[0]), _mm256_set1_ps(self.last[1])],
        }
    }
}

/// A field as eight look-ups at a time need it. Lives no longer than the field.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx2View {
    cells: *const u8,
    stride: std::arch::x86_64::__m256i,
    last: [std::arch::x86_64::__m256; 2],
}

#[cfg(target_arch = "x86_64")]
impl Avx2View {
    /// The bytes at eight places in cells.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(crate) fn bytes(
        self,
        u: std::arch::x86_64::__m256,
        v: std::arch::x86_64::__m256,
    ) -> std::arch::x86_64::__m256i {
        use std::arch::x86_64::*;
        let zero = _mm256_setzero_ps();
        // The second operand is the result when the first is NaN: 0, which lies in the field.
        let column = _mm256_cvttps_epi32(_mm256_min_ps(_mm256_max_ps(u, zero), self.last[0]));
        let row = _mm256_cvttps_epi32(_mm256_min_ps(_mm256_max_ps(v, zero), self.last[1]));
        let index = _mm256_add_epi32(_mm256_mullo_epi32(row, self.stride), column);
        // SAFETY: columns and rows are clamped to those of the field, which has three bytes more than its
        // last cell.
        let words = unsafe { _mm256_i32gather_epi32::<1>(self.cells.cast(), index) };
        _mm256_and_si256(words, _mm256_set1_epi32(0xff))
    }
}
