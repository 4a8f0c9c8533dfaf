//! The vector code of the 3x3 convolution: a few rows of one image, at the widest registers of the machine.
//!
//! `pulp` picks the instruction set at run time. A *wide* kernel keeps a tile of pixels x two registers of output channels
//! and multiplies broadcast inputs with rows of weights, the inner loop of a matrix product without its packing: the nine
//! shifted images are read where they lie. A *narrow* one (one or two output channels) runs along the input channels.
//! Loops stand where an iterator with a closure would be shorter: a closure handed to the standard library is compiled for
//! the baseline processor, and every vector operation in it becomes a call.

use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Pixels of a tile on machines with 32 registers of 16 lanes: 12 x 2 sums, 2 weights and a broadcast fill them.
const TILE_32: usize = 12;
/// Pixels of a tile elsewhere: 5 x 2 sums, 2 weights and a broadcast of 16 registers.
const TILE_16: usize = 5;
/// Pixels of a tile at the end of a row.
const TILE_END: usize = 4;
/// Input channels of a pass: 9 x 32 x 32 weights lie in the first-level cache.
const DEPTH: usize = 32;
/// Pixels of a pass of the weight gradient: their inputs and deltas lie in the first-level cache.
const RUN: usize = 64;
/// Input channels whose weight gradients are summed together: 3 taps x 4 channels x 2 sums of 32 registers.
const BLOCK_32: usize = 4;
/// The same for 16 registers.
const BLOCK_16: usize = 2;

/// What happens to a sum before it is stored.
#[derive(Clone, Copy, Debug)]
pub enum Finish<'a> {
    /// Nothing.
    Store,
    /// `y = sum + bias`, then `y` where it is positive and `leak * y` elsewhere; a leak of 1 adds the bias alone.
    Activate {
        /// (output channels)
        bias: &'a [f32],
        /// Slope below 0.
        leak: f32,
    },
    /// The sum where `by` is positive and `leak` times it elsewhere: the derivative of a leaky ReLU whose output is `by`.
    Damp {
        /// (rows, columns, channels) of the output.
        by: &'a [f32],
        /// Slope below 0.
        leak: f32,
    },
}

/// Output rows of one task of a convolution.
pub(super) struct Forward<'a> {
    /// (rows, cols, channels)
    pub(super) input: &'a [f32],
    pub(super) cols: usize,
    pub(super) channels: usize,
    /// (9, channels, out_channels); narrow: (out_channels, 9, channels)
    pub(super) weights: &'a [f32],
    pub(super) out_channels: usize,
    /// First output row of the task.
    pub(super) first_row: usize,
    /// Rows of the task, (rows, stored columns, out_channels)
    pub(super) out: &'a mut [f32],
    pub(super) out_cols: usize,
    /// First stored column that is written.
    pub(super) left: usize,
    pub(super) finish: Finish<'a>,
}

impl WithSimd for Forward<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.out_channels, self.channels) {
            (1 | 2, _) => self.narrow(simd),
            (_, 1) => self.wide::<S, 1>(simd),
            (_, 2) => self.wide::<S, 2>(simd),
            (_, 3) => self.wide::<S, 3>(simd),
            (_, 32) => self.wide::<S, 32>(simd),
            (_, 64) => self.wide::<S, 64>(simd),
            (_, 128) => self.wide::<S, 128>(simd),
            (_, n) => unreachable!("{n} channels passed the check"),
        }
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn wide<S: Simd, const C: usize>(self, simd: S) {
        let width = self.cols - 2;
        let (pixels, _) = self.input.as_chunks::<C>();
        let weights: &[S::f32s] = cast_slice(self.weights);
        let registers = self.out_channels / S::F32_LANES;
        let row_length = self.out_cols * self.out_channels;
        for row in 0..self.out.len() / row_length {
            let y = self.first_row + row;
            let out = &mut self.out[row * row_length..(row + 1) * row_length];
            let out: &mut [S::f32s] = cast_slice_mut(out);
            let blocks = C.div_ceil(DEPTH);
            for step in 0..registers / 2 * blocks {
                let (pair, block) = (step / blocks, step % blocks);
                let at = Place { y, cols: self.cols, registers, pair, block, left: self.left };
                let mut x = 0;
                if S::F32_LANES == 16 {
                    while x + TILE_32 <= width {
                        tile::<S, C, TILE_32>(simd, pixels, weights, out, at, x);
                        x += TILE_32;
                    }
                } else {
                    while x + TILE_16 <= width {
                        tile::<S, C, TILE_16>(simd, pixels, weights, out, at, x);
                        x += TILE_16;
                    }
                }
                while x + TILE_END <= width {
                    tile::<S, C, TILE_END>(simd, pixels, weights, out, at, x);
                    x += TILE_END;
                }
                while x < width {
                    tile::<S, C, 1>(simd, pixels, weights, out, at, x);
                    x += 1;
                }
            }
            let row = &mut out[self.left * registers..(self.left + width) * registers];
            finish::<S>(simd, row, registers, y * width * registers, self.finish);
        }
    }

    #[inline(always)]
    fn narrow<S: Simd>(self, simd: S) {
        let width = self.cols - 2;
        let registers = self.channels / S::F32_LANES;
        let input: &[S::f32s] = cast_slice(self.input);
        let all_weights: &[S::f32s] = cast_slice(self.weights);
        let row_length = self.out_cols * self.out_channels;
        for row in 0..self.out.len() / row_length {
            let y = self.first_row + row;
            let out = &mut self.out[row * row_length..(row + 1) * row_length];
            for channel in 0..self.out_channels {
                let weights = &all_weights[channel * 9 * registers..(channel + 1) * 9 * registers];
                for x in 0..width {
                    let mut sums = [simd.splat_f32s(0.0); 3];
                    for dy in 0..3 {
                        // The three taps of a row lie side by side.
                        let start = ((y + dy) * self.cols + x) * registers;
                        let values = &input[start..start + 3 * registers];
                        let weights = &weights[dy * 3 * registers..(dy + 1) * 3 * registers];
                        for i in 0..values.len() {
                            sums[dy] = simd.mul_add_e_f32s(values[i], weights[i], sums[dy]);
                        }
                    }
                    let sum = simd.reduce_sum_f32s(simd.add_f32s(simd.add_f32s(sums[0], sums[1]), sums[2]));
                    out[(self.left + x) * self.out_channels + channel] = match self.finish {
                        Finish::Store => sum,
                        Finish::Activate { bias, leak } => {
                            let sum = sum + bias[channel];
                            if sum > 0.0 { sum } else { leak * sum }
                        }
                        Finish::Damp { by, leak } => {
                            let by = by[(y * width + x) * self.out_channels + channel];
                            if by > 0.0 { sum } else { leak * sum }
                        }
                    };
                }
            }
        }
    }
}

/// Where a row of tiles lies.
#[derive(Clone, Copy)]
struct Place {
    /// Output row.
    y: usize,
    /// Columns of the input.
    cols: usize,
    /// Registers of an output pixel.
    registers: usize,
    /// Which two of them.
    pair: usize,
    /// Which [`DEPTH`] input channels; those before are in the output already.
    block: usize,
    /// First stored column of the output row.
    left: usize,
}

/// `P` pixels from column `x` on, two registers of output channels.
#[inline(always)]
fn tile<S: Simd, const C: usize, const P: usize>(
    simd: S,
    pixels: &[[f32; C]],
    weights: &[S::f32s],
    out: &mut [S::f32s],
    at: Place,
    x: usize,
) {
    let mut sums = [[simd.splat_f32s(0.0); 2]; P];
    let place = (at.left + x) * at.registers + 2 * at.pair;
    if at.block > 0 {
        for p in 0..P {
            sums[p][0] = out[place + p * at.registers];
            sums[p][1] = out[place + p * at.registers + 1];
        }
    }
    let depth = if C < DEPTH { C } else { DEPTH };
    let first = at.block * depth;
    for tap in 0..9 {
        let start = (at.y + tap / 3) * at.cols + x + tap % 3;
        let values: &[[f32; C]; P] = pixels[start..].first_chunk().expect("the tile lies inside");
        let weights = &weights[(tap * C + first) * at.registers..(tap * C + first + depth) * at.registers];
        for c in 0..depth {
            let low = weights[c * at.registers + 2 * at.pair];
            let high = weights[c * at.registers + 2 * at.pair + 1];
            for p in 0..P {
                let value = simd.splat_f32s(values[p][first + c]);
                sums[p][0] = simd.mul_add_e_f32s(value, low, sums[p][0]);
                sums[p][1] = simd.mul_add_e_f32s(value, high, sums[p][1]);
            }
        }
    }
    for p in 0..P {
        out[place + p * at.registers] = sums[p][0];
        out[place + p * at.registers + 1] = sums[p][1];
    }
}

/// Finishes a row of sums while it is in the cache. `start`: the row's first register in the whole output.
#[inline(always)]
fn finish<S: Simd>(simd: S, row: &mut [S::f32s], registers: usize, start: usize, finish: Finish<'_>) {
    let zero = simd.splat_f32s(0.0);
    match finish {
        Finish::Store => {}
        Finish::Activate { bias, leak } => {
            let bias: &[S::f32s] = cast_slice(bias);
            let leak = simd.splat_f32s(leak);
            for pixel in row.chunks_exact_mut(registers) {
                for i in 0..pixel.len() {
                    let sum = simd.add_f32s(pixel[i], bias[i]);
                    let less = simd.mul_f32s(sum, leak);
                    pixel[i] = simd.select_f32s(simd.greater_than_f32s(sum, zero), sum, less);
                }
            }
        }
        Finish::Damp { by, leak } => {
            let by: &[S::f32s] = cast_slice(by);
            let by = &by[start..start + row.len()];
            let leak = simd.splat_f32s(leak);
            for i in 0..row.len() {
                let less = simd.mul_f32s(row[i], leak);
                row[i] = simd.select_f32s(simd.greater_than_f32s(by[i], zero), row[i], less);
            }
        }
    }
}

/// Weight gradients from some output rows: the sum over pixels of input x delta, for each tap.
pub(super) struct Weights<'a> {
    /// (rows, cols, channels)
    pub(super) input: &'a [f32],
    pub(super) cols: usize,
    pub(super) channels: usize,
    /// (rows, delta_cols, out_channels) with a frame of `border` cells around the output.
    pub(super) delta: &'a [f32],
    pub(super) delta_cols: usize,
    pub(super) border: usize,
    pub(super) out_channels: usize,
    /// Output rows of the task.
    pub(super) rows: Range<usize>,
    /// Added to: (9, channels, out_channels); narrow: (out_channels, 9, channels)
    pub(super) gradient: &'a mut [f32],
}

impl WithSimd for Weights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.out_channels, self.channels) {
            (1 | 2, _) => self.narrow(simd),
            (_, 1..=3) => self.wide::<S, 1>(simd),
            _ if S::F32_LANES == 16 => self.wide::<S, BLOCK_32>(simd),
            _ => self.wide::<S, BLOCK_16>(simd),
        }
    }
}

impl Weights<'_> {
    /// `B` input channels at a time.
    #[inline(always)]
    fn wide<S: Simd, const B: usize>(self, simd: S) {
        let width = self.cols - 2;
        let registers = self.out_channels / S::F32_LANES;
        let blocks = self.channels / B;
        let (input, _) = self.input.as_chunks::<B>();
        let delta: &[S::f32s] = cast_slice(self.delta);
        let gradient: &mut [S::f32s] = cast_slice_mut(self.gradient);
        for y in self.rows {
            let start = ((y + self.border) * self.delta_cols + self.border) * registers;
            let delta = &delta[start..start + width * registers];
            for dy in 0..3 {
                let start = (y + dy) * self.cols * blocks;
                let row = &input[start..start + self.cols * blocks];
                let runs = width.div_ceil(RUN);
                for step in 0..runs * registers / 2 {
                    let (run, pair) = (step / (registers / 2), step % (registers / 2));
                    let end = if run + 1 == runs { width } else { (run + 1) * RUN };
                    for block in 0..blocks {
                        let mut sums = [[[simd.splat_f32s(0.0); 2]; B]; 3];
                        for x in run * RUN..end {
                            let low = delta[x * registers + 2 * pair];
                            let high = delta[x * registers + 2 * pair + 1];
                            for dx in 0..3 {
                                let values = &row[(x + dx) * blocks + block];
                                for b in 0..B {
                                    let value = simd.splat_f32s(values[b]);
                                    sums[dx][b][0] = simd.mul_add_e_f32s(value, low, sums[dx][b][0]);
                                    sums[dx][b][1] = simd.mul_add_e_f32s(value, high, sums[dx][b][1]);
                                }
                            }
                        }
                        for dx in 0..3 {
                            for b in 0..B {
                                let tap = 3 * dy + dx;
                                let at = (tap * self.channels + block * B + b) * registers + 2 * pair;
                                gradient[at] = simd.add_f32s(gradient[at], sums[dx][b][0]);
                                gradient[at + 1] = simd.add_f32s(gradient[at + 1], sums[dx][b][1]);
                            }
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn narrow<S: Simd>(self, simd: S) {
        let width = self.cols - 2;
        let registers = self.channels / S::F32_LANES;
        let input: &[S::f32s] = cast_slice(self.input);
        let gradient: &mut [S::f32s] = cast_slice_mut(self.gradient);
        for y in self.rows {
            let start = ((y + self.border) * self.delta_cols + self.border) * self.out_channels;
            let delta = &self.delta[start..start + width * self.out_channels];
            for dy in 0..3 {
                let start = (y + dy) * self.cols * registers;
                let row = &input[start..start + self.cols * registers];
                for channel in 0..self.out_channels {
                    for register in 0..registers {
                        let mut sums = [simd.splat_f32s(0.0); 3];
                        for x in 0..width {
                            let value = simd.splat_f32s(delta[x * self.out_channels + channel]);
                            for dx in 0..3 {
                                let values = row[(x + dx) * registers + register];
                                sums[dx] = simd.mul_add_e_f32s(value, values, sums[dx]);
                            }
                        }
                        for dx in 0..3 {
                            let at = (channel * 9 + 3 * dy + dx) * registers + register;
                            gradient[at] = simd.add_f32s(gradient[at], sums[dx]);
                        }
                    }
                }
            }
        }
    }
}
