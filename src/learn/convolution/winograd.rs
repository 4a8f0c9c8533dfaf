//! The 3x3 convolution of many channels by minimal filtering: F(2x2, 3x3) of Lavin & Gray, *Fast Algorithms for Convolutional
//! Neural Networks*, 2016, section 4.1 (after Winograd 1980).
//!
//! Outputs are made in tiles of 2x2 from 4x4 inputs: Y = A' [(G g G') . (B' d B)] A, sixteen products in place of thirty-six.
//! Over all channels and tiles they are sixteen matrix products; the three transforms are sums along registers of channels.
//! Rounding is that of a direct sum: no transform multiplies by anything but 1 and 1/2.
//!
//! An output depends on its nine inputs alone, to the bit, but on whether its row and column are even, too: tiles of a map
//! give the whole map's bytes where they begin in even rows and columns.

use super::finish::{Rows, finish};
use super::plane::{Image, Plane};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Products of a tile, and inputs of one.
pub(super) const TERMS: usize = 16;
/// Tiles of a pass: their transforms lie in the second-level cache beside the weights.
const RUN: usize = 24;
/// Tiles of one product on machines with 32 registers of 16 lanes: 12 x 2 sums, 2 weights and a broadcast fill them.
const TILES_32: usize = 12;
/// The same for 16 registers: 6 x 2 sums, 2 weights and a broadcast.
const TILES_16: usize = 6;
/// Input channels whose weight gradients are summed together, two registers of output channels each.
const BLOCK_32: usize = 8;
/// The same for 16 registers.
const BLOCK_16: usize = 6;
/// The same for the channels that are left over: 32, 64 and 128 are some sixes and one or two fours.
const BLOCK_END: usize = 4;

/// G g G': the transform of weights (9, values) to (16, values).
pub(super) struct TransformWeights<'a> {
    pub(super) weights: &'a [f32],
    pub(super) out: &'a mut [f32],
}

impl WithSimd for TransformWeights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let weights: &[S::f32s] = cast_slice(self.weights);
        let out: &mut [S::f32s] = cast_slice_mut(self.out);
        let (from, to) = (weights.len() / 9, out.len() / TERMS);
        let half = simd.splat_f32s(0.5);
        for i in 0..from {
            let mut rows = [[simd.splat_f32s(0.0); 3]; 4];
            for x in 0..3 {
                let g = [weights[x * from + i], weights[(3 + x) * from + i], weights[(6 + x) * from + i]];
                let column = stretch(simd, half, g);
                for y in 0..4 {
                    rows[y][x] = column[y];
                }
            }
            for y in 0..4 {
                let row = stretch(simd, half, rows[y]);
                for x in 0..4 {
                    out[(4 * y + x) * to + i] = row[x];
                }
            }
        }
    }
}

/// G g
#[inline(always)]
fn stretch<S: Simd>(simd: S, half: S::f32s, g: [S::f32s; 3]) -> [S::f32s; 4] {
    let ends = simd.add_f32s(g[0], g[2]);
    let sum = simd.mul_f32s(half, simd.add_f32s(ends, g[1]));
    let difference = simd.mul_f32s(half, simd.sub_f32s(ends, g[1]));
    [g[0], sum, difference, g[2]]
}

/// G' u G added to a gradient: from (16, values) to (9, values).
pub(super) struct GatherWeights<'a> {
    pub(super) terms: &'a [f32],
    pub(super) gradient: &'a mut [f32],
}

impl WithSimd for GatherWeights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let terms: &[S::f32s] = cast_slice(self.terms);
        let gradient: &mut [S::f32s] = cast_slice_mut(self.gradient);
        let (from, to) = (terms.len() / TERMS, gradient.len() / 9);
        let half = simd.splat_f32s(0.5);
        for i in 0..to {
            let mut rows = [[simd.splat_f32s(0.0); 4]; 3];
            for x in 0..4 {
                let u = [
                    terms[x * from + i],
                    terms[(4 + x) * from + i],
                    terms[(8 + x) * from + i],
                    terms[(12 + x) * from + i],
                ];
                let column = gather(simd, half, u);
                for y in 0..3 {
                    rows[y][x] = column[y];
                }
            }
            for y in 0..3 {
                let row = gather(simd, half, rows[y]);
                for x in 0..3 {
                    let g = &mut gradient[(3 * y + x) * to + i];
                    *g = simd.add_f32s(*g, row[x]);
                }
            }
        }
    }
}

/// G' u
#[inline(always)]
fn gather<S: Simd>(simd: S, half: S::f32s, u: [S::f32s; 4]) -> [S::f32s; 3] {
    let sum = simd.mul_f32s(half, simd.add_f32s(u[1], u[2]));
    let difference = simd.mul_f32s(half, simd.sub_f32s(u[1], u[2]));
    [simd.add_f32s(u[0], sum), difference, simd.add_f32s(u[3], sum)]
}

/// B' d
#[inline(always)]
fn spread<S: Simd>(simd: S, d: [S::f32s; 4]) -> [S::f32s; 4] {
    [
        simd.sub_f32s(d[0], d[2]),
        simd.add_f32s(d[1], d[2]),
        simd.sub_f32s(d[2], d[1]),
        simd.sub_f32s(d[1], d[3]),
    ]
}

/// A' m
#[inline(always)]
fn close<S: Simd>(simd: S, m: [S::f32s; 4]) -> [S::f32s; 2] {
    [simd.add_f32s(simd.add_f32s(m[0], m[1]), m[2]), simd.sub_f32s(simd.sub_f32s(m[1], m[2]), m[3])]
}

/// A y
#[inline(always)]
fn open<S: Simd>(simd: S, y: [S::f32s; 2]) -> [S::f32s; 4] {
    let zero = simd.splat_f32s(0.0);
    [y[0], simd.add_f32s(y[0], y[1]), simd.sub_f32s(y[0], y[1]), simd.sub_f32s(zero, y[1])]
}

/// Transforms of a run of tiles, (16, [`RUN`], channels), each sixteenth a register longer than that: without it the sixteen
/// streams would share a few sets of the first-level cache.
struct Scratch {
    values: Vec<f32>,
    start: usize,
    /// Values from one sixteenth to the next.
    stride: usize,
}

impl Scratch {
    fn new(channels: usize, lanes: usize) -> Self {
        let (stride, line) = (RUN * channels + lanes, 64 / size_of::<f32>());
        let values = vec![0.0; TERMS * stride + line];
        // On a cache line, where that can be found out.
        let start = values.as_ptr().align_offset(64).min(line);
        Self { values, start, stride }
    }

    fn all(&mut self) -> &mut [f32] {
        &mut self.values[self.start..self.start + TERMS * self.stride]
    }

    fn term(&self, k: usize) -> &[f32] {
        &self.values[self.start + k * self.stride..self.start + (k + 1) * self.stride]
    }

    fn term_mut(&mut self, k: usize) -> &mut [f32] {
        &mut self.values[self.start + k * self.stride..self.start + (k + 1) * self.stride]
    }
}

/// B' d B of the tiles `tiles` of the tile row `row`, all `C` channels, to (16, [`RUN`], C). What lies outside the image is 0.
#[inline(always)]
fn spread_tiles<S: Simd, const C: usize>(
    simd: S,
    source: Image<'_>,
    row: usize,
    tiles: Range<usize>,
    out: &mut [S::f32s],
) {
    let registers = C / S::F32_LANES;
    let values: &[S::f32s] = cast_slice(source.values);
    let nothing: &[S::f32s] = cast_slice(&[0.0; C]);
    let stride = RUN * registers + 1;
    for (i, tile) in tiles.enumerate() {
        let mut pixels = [nothing; TERMS];
        for k in 0..TERMS {
            let (y, x) = (2 * row + k / 4, 2 * tile + k % 4);
            if y < source.rows && x < source.cols {
                pixels[k] = &values[(y * source.cols + x) * registers..][..registers];
            }
        }
        for r in 0..registers {
            let mut rows = [[simd.splat_f32s(0.0); 4]; 4];
            for x in 0..4 {
                let column =
                    spread(simd, [pixels[x][r], pixels[4 + x][r], pixels[8 + x][r], pixels[12 + x][r]]);
                for y in 0..4 {
                    rows[y][x] = column[y];
                }
            }
            for y in 0..4 {
                let terms = spread(simd, rows[y]);
                for x in 0..4 {
                    out[(4 * y + x) * stride + i * registers + r] = terms[x];
                }
            }
        }
    }
}

/// A' m A of the tiles `tiles` into two output rows (fewer at the end), each of `row` registers, the first `left` of them frame.
#[inline(always)]
fn close_tiles<S: Simd>(
    simd: S,
    sums: &[S::f32s],
    registers: usize,
    tiles: Range<usize>,
    out: &mut [S::f32s],
    (row, left, width): (usize, usize, usize),
) {
    let stride = RUN * registers + 1;
    for (i, tile) in tiles.enumerate() {
        let both = 2 * tile + 1 < width;
        for r in 0..registers {
            let mut rows = [[simd.splat_f32s(0.0); 4]; 2];
            for x in 0..4 {
                let mut m = [simd.splat_f32s(0.0); 4];
                for y in 0..4 {
                    m[y] = sums[(4 * y + x) * stride + i * registers + r];
                }
                let column = close(simd, m);
                rows[0][x] = column[0];
                rows[1][x] = column[1];
            }
            for y in 0..out.len() / row {
                let values = close(simd, rows[y]);
                let at = y * row + left + 2 * tile * registers + r;
                out[at] = values[0];
                if both {
                    out[at + registers] = values[1];
                }
            }
        }
    }
}

/// `P` tiles, two registers of output channels: (P, C) x (C, registers).
#[inline(always)]
fn product<S: Simd, const C: usize, const P: usize>(
    simd: S,
    inputs: &[[f32; C]],
    weights: &[S::f32s],
    registers: usize,
    pair: usize,
    out: &mut [S::f32s],
) {
    let mut sums = [[simd.splat_f32s(0.0); 2]; P];
    let inputs: &[[f32; C]; P] = inputs.first_chunk().expect("tiles of the run");
    for c in 0..C {
        let low = weights[c * registers + 2 * pair];
        let high = weights[c * registers + 2 * pair + 1];
        for p in 0..P {
            let value = simd.splat_f32s(inputs[p][c]);
            sums[p][0] = simd.mul_add_e_f32s(value, low, sums[p][0]);
            sums[p][1] = simd.mul_add_e_f32s(value, high, sums[p][1]);
        }
    }
    for p in 0..P {
        out[p * registers + 2 * pair] = sums[p][0];
        out[p * registers + 2 * pair + 1] = sums[p][1];
    }
}

/// One of the sixteen products: (count, C) x (C, registers).
#[inline(always)]
fn multiply<S: Simd, const C: usize>(
    simd: S,
    inputs: &[f32],
    weights: &[S::f32s],
    registers: usize,
    count: usize,
    out: &mut [S::f32s],
) {
    let (inputs, _) = inputs.as_chunks::<C>();
    for pair in 0..registers / 2 {
        let mut i = 0;
        while S::F32_LANES == 16 && i + TILES_32 <= count {
            product::<S, C, TILES_32>(
                simd,
                &inputs[i..],
                weights,
                registers,
                pair,
                &mut out[i * registers..],
            );
            i += TILES_32;
        }
        while i + TILES_16 <= count {
            product::<S, C, TILES_16>(
                simd,
                &inputs[i..],
                weights,
                registers,
                pair,
                &mut out[i * registers..],
            );
            i += TILES_16;
        }
        while i < count {
            product::<S, C, 1>(simd, &inputs[i..], weights, registers, pair, &mut out[i * registers..]);
            i += 1;
        }
    }
}

/// One task of a convolution; an even number of output rows lie before it.
pub(super) struct Forward<'a> {
    pub(super) input: Image<'a>,
    /// Transformed: (16, channels, out_channels)
    pub(super) weights: &'a [f32],
    pub(super) out: Rows<'a>,
}

impl WithSimd for Forward<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.input.channels {
            32 => self.run::<S, 32>(simd),
            64 => self.run::<S, 64>(simd),
            128 => self.run::<S, 128>(simd),
            n => unreachable!("{n} channels passed the check"),
        }
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn run<S: Simd, const C: usize>(self, simd: S) {
        let width = self.input.cols - 2;
        let tiles = width.div_ceil(2);
        let registers = self.out.channels / S::F32_LANES;
        let weights: &[S::f32s] = cast_slice(self.weights);
        let out: &mut [S::f32s] = cast_slice_mut(self.out.values);
        let (row, left) = (self.out.cols * registers, self.out.left * registers);
        let mut inputs = Scratch::new(C, S::F32_LANES);
        let mut sums = Scratch::new(self.out.channels, S::F32_LANES);
        let rows = out.len() / row;
        let mut y = 0;
        while y < rows {
            let end = if y + 2 < rows { y + 2 } else { rows };
            let out = &mut out[y * row..end * row];
            let mut tile = 0;
            while tile < tiles {
                let end = if tile + RUN < tiles { tile + RUN } else { tiles };
                let all = cast_slice_mut(inputs.all());
                spread_tiles::<S, C>(simd, self.input, (self.out.first + y) / 2, tile..end, all);
                for k in 0..TERMS {
                    let weights = &weights[k * C * registers..(k + 1) * C * registers];
                    let sums = cast_slice_mut(sums.term_mut(k));
                    multiply::<S, C>(simd, inputs.term(k), weights, registers, end - tile, sums);
                }
                let sums = cast_slice(sums.all());
                close_tiles(simd, sums, registers, tile..end, out, (row, left, width));
                tile = end;
            }
            for (i, row) in out.chunks_exact_mut(row).enumerate() {
                let start = (self.out.first + y + i) * width * registers;
                let row = &mut row[left..left + width * registers];
                finish::<S>(simd, row, registers, start, self.out.finish);
            }
            y = end;
        }
    }
}

/// Weight gradients from some rows of tiles: the sum over tiles of the products of both transforms.
pub(super) struct Weights<'a> {
    pub(super) input: Image<'a>,
    /// The output's gradient.
    pub(super) delta: &'a Plane,
    /// Rows of tiles of the task.
    pub(super) tile_rows: Range<usize>,
    /// Added to: (16, channels, out_channels)
    pub(super) terms: &'a mut [f32],
}

impl WithSimd for Weights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.input.channels {
            32 => self.run::<S, 32>(simd),
            64 => self.run::<S, 64>(simd),
            128 => self.run::<S, 128>(simd),
            n => unreachable!("{n} channels passed the check"),
        }
    }
}

impl Weights<'_> {
    #[inline(always)]
    fn run<S: Simd, const C: usize>(self, simd: S) {
        let tiles = self.delta.cols().div_ceil(2);
        let registers = self.delta.channels() / S::F32_LANES;
        let mut inputs = Scratch::new(C, S::F32_LANES);
        let mut deltas = Scratch::new(self.delta.channels(), S::F32_LANES);
        let steps = tiles.div_ceil(RUN);
        for step in self.tile_rows.start * steps..self.tile_rows.end * steps {
            let (row, first) = (step / steps, step % steps * RUN);
            let end = if first + RUN < tiles { first + RUN } else { tiles };
            let all = cast_slice_mut(inputs.all());
            spread_tiles::<S, C>(simd, self.input, row, first..end, all);
            self.open_tiles(simd, row, first..end, cast_slice_mut(deltas.all()));
            let terms: &mut [S::f32s] = cast_slice_mut(self.terms);
            for k in 0..TERMS {
                let terms = &mut terms[k * C * registers..(k + 1) * C * registers];
                let deltas = cast_slice(deltas.term(k));
                accumulate::<S, C>(simd, inputs.term(k), deltas, registers, end - first, terms);
            }
        }
    }

    /// A d A' of the tiles `tiles`.
    #[inline(always)]
    fn open_tiles<S: Simd>(&self, simd: S, row: usize, tiles: Range<usize>, out: &mut [S::f32s]) {
        let registers = self.delta.channels() / S::F32_LANES;
        let stride = RUN * registers + 1;
        let (height, width) = (self.delta.rows(), self.delta.cols());
        let nothing = vec![0.0; self.delta.channels()];
        let nothing: &[S::f32s] = cast_slice(&nothing);
        for (i, tile) in tiles.enumerate() {
            let mut pixels = [nothing; 4];
            for k in 0..4 {
                let (y, x) = (2 * row + k / 2, 2 * tile + k % 2);
                if y < height && x < width {
                    let row: &[S::f32s] = cast_slice(self.delta.row(y));
                    pixels[k] = &row[x * registers..(x + 1) * registers];
                }
            }
            for r in 0..registers {
                let left = open(simd, [pixels[0][r], pixels[2][r]]);
                let right = open(simd, [pixels[1][r], pixels[3][r]]);
                for y in 0..4 {
                    let terms = open(simd, [left[y], right[y]]);
                    for x in 0..4 {
                        out[(4 * y + x) * stride + i * registers + r] = terms[x];
                    }
                }
            }
        }
    }
}

/// One of the sixteen sums over tiles: (count, C)' x (count, registers).
#[inline(always)]
fn accumulate<S: Simd, const C: usize>(
    simd: S,
    inputs: &[f32],
    deltas: &[S::f32s],
    registers: usize,
    count: usize,
    terms: &mut [S::f32s],
) {
    let (inputs, _) = inputs.as_chunks::<C>();
    let inputs = &inputs[..count];
    for pair in 0..registers / 2 {
        let mut c = 0;
        while c < C {
            let left = C - c;
            if S::F32_LANES == 16 {
                accumulate_block::<S, C, BLOCK_32>(simd, inputs, deltas, registers, pair, c, terms);
                c += BLOCK_32;
            } else if left > BLOCK_16 && left != 2 * BLOCK_END {
                accumulate_block::<S, C, BLOCK_16>(simd, inputs, deltas, registers, pair, c, terms);
                c += BLOCK_16;
            } else {
                accumulate_block::<S, C, BLOCK_END>(simd, inputs, deltas, registers, pair, c, terms);
                c += BLOCK_END;
            }
        }
    }
}

/// The input channels `c..c + B` of [`accumulate`], two registers of output channels.
#[inline(always)]
fn accumulate_block<S: Simd, const C: usize, const B: usize>(
    simd: S,
    inputs: &[[f32; C]],
    deltas: &[S::f32s],
    registers: usize,
    pair: usize,
    c: usize,
    terms: &mut [S::f32s],
) {
    let mut sums = [[simd.splat_f32s(0.0); 2]; B];
    for i in 0..inputs.len() {
        let low = deltas[i * registers + 2 * pair];
        let high = deltas[i * registers + 2 * pair + 1];
        let values: &[f32; B] = inputs[i][c..].first_chunk().expect("channels of the block");
        for b in 0..B {
            let value = simd.splat_f32s(values[b]);
            sums[b][0] = simd.mul_add_e_f32s(value, low, sums[b][0]);
            sums[b][1] = simd.mul_add_e_f32s(value, high, sums[b][1]);
        }
    }
    for b in 0..B {
        let at = (c + b) * registers + 2 * pair;
        terms[at] = simd.add_f32s(terms[at], sums[b][0]);
        terms[at + 1] = simd.add_f32s(terms[at + 1], sums[b][1]);
    }
}
