//! The 3x3 convolution from or to few channels, as a direct sum: a few rows of one image.
//!
//! A *wide* kernel (one to three input channels) keeps a tile of pixels x two registers of output channels and multiplies
//! broadcast inputs with rows of weights: the nine shifted images are read where they lie. A *narrow* one (one or two output
//! channels) runs along the input channels.

use super::finish::{Finish, Rows, finish};
use super::plane::{Image, Plane};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Pixels of a tile on machines with 32 registers of 16 lanes: 12 x 2 sums, 2 weights and a broadcast fill them.
const TILE_32: usize = 12;
/// Pixels of a tile elsewhere: 6 x 2 sums, 2 weights and a broadcast of 16 registers.
const TILE_16: usize = 6;
/// Pixels of a tile at the end of a row.
const TILE_END: usize = 4;
/// One task of a convolution.
pub(super) struct Forward<'a> {
    pub(super) input: Image<'a>,
    /// (9, channels, out_channels); narrow: (out_channels, 9, channels)
    pub(super) weights: &'a [f32],
    pub(super) out: Rows<'a>,
}

impl WithSimd for Forward<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.out.channels, self.input.channels) {
            (1 | 2, _) => self.narrow(simd),
            (_, 1) => self.wide::<S, 1>(simd),
            (_, 2) => self.wide::<S, 2>(simd),
            (_, 3) => self.wide::<S, 3>(simd),
            (_, n) => unreachable!("{n} channels passed the check"),
        }
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn wide<S: Simd, const C: usize>(self, simd: S) {
        let width = self.input.cols - 2;
        let (pixels, _) = self.input.values.as_chunks::<C>();
        let weights: &[S::f32s] = cast_slice(self.weights);
        let registers = self.out.channels / S::F32_LANES;
        let row_length = self.out.cols * self.out.channels;
        for row in 0..self.out.values.len() / row_length {
            let y = self.out.first + row;
            let out = &mut self.out.values[row * row_length..(row + 1) * row_length];
            let out: &mut [S::f32s] = cast_slice_mut(out);
            for pair in 0..registers / 2 {
                let at = Place { y, cols: self.input.cols, registers, pair, left: self.out.left };
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
            let row = &mut out[self.out.left * registers..(self.out.left + width) * registers];
            finish::<S>(simd, row, registers, y * width * registers, self.out.finish);
        }
    }

    #[inline(always)]
    fn narrow<S: Simd>(self, simd: S) {
        let width = self.input.cols - 2;
        let registers = self.input.channels / S::F32_LANES;
        let input: &[S::f32s] = cast_slice(self.input.values);
        let all_weights: &[S::f32s] = cast_slice(self.weights);
        let row_length = self.out.cols * self.out.channels;
        for row in 0..self.out.values.len() / row_length {
            let y = self.out.first + row;
            let out = &mut self.out.values[row * row_length..(row + 1) * row_length];
            for channel in 0..self.out.channels {
                let weights = &all_weights[channel * 9 * registers..(channel + 1) * 9 * registers];
                for x in 0..width {
                    let mut sums = [simd.splat_f32s(0.0); 3];
                    for dy in 0..3 {
                        // The three taps of a row lie side by side.
                        let start = ((y + dy) * self.input.cols + x) * registers;
                        let values = &input[start..start + 3 * registers];
                        let weights = &weights[dy * 3 * registers..(dy + 1) * 3 * registers];
                        for i in 0..values.len() {
                            sums[dy] = simd.mul_add_e_f32s(values[i], weights[i], sums[dy]);
                        }
                    }
                    let sum = simd.reduce_sum_f32s(simd.add_f32s(simd.add_f32s(sums[0], sums[1]), sums[2]));
                    out[(self.out.left + x) * self.out.channels + channel] = match self.out.finish {
                        Finish::Store => sum,
                        Finish::Activate { bias, leak } => {
                            let sum = sum + bias[channel];
                            if sum > 0.0 { sum } else { leak * sum }
                        }
                        Finish::Damp { by, leak } => {
                            let by = by[(y * width + x) * self.out.channels + channel];
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
    for tap in 0..9 {
        let start = (at.y + tap / 3) * at.cols + x + tap % 3;
        let values: &[[f32; C]; P] = pixels[start..].first_chunk().expect("the tile lies inside");
        let weights = &weights[tap * C * at.registers..(tap + 1) * C * at.registers];
        for c in 0..C {
            let low = weights[c * at.registers + 2 * at.pair];
            let high = weights[c * at.registers + 2 * at.pair + 1];
            for p in 0..P {
                let value = simd.splat_f32s(values[p][c]);
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

/// Weight gradients from some output rows: the sum over pixels of input x delta, for each tap.
pub(super) struct Weights<'a> {
    pub(super) input: Image<'a>,
    /// The output's gradient.
    pub(super) delta: &'a Plane,
    /// Output rows of the task.
    pub(super) rows: Range<usize>,
    /// Added to: (9, channels, out_channels); narrow: (out_channels, 9, channels)
    pub(super) gradient: &'a mut [f32],
}

impl WithSimd for Weights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.delta.channels(), self.input.channels) {
            (1 | 2, _) => self.narrow(simd),
            _ => self.wide(simd),
        }
    }
}

impl Weights<'_> {
    #[inline(always)]
    fn wide<S: Simd>(self, simd: S) {
        let width = self.delta.cols();
        let (registers, channels) = (self.delta.channels() / S::F32_LANES, self.input.channels);
        let gradient: &mut [S::f32s] = cast_slice_mut(self.gradient);
        for y in self.rows {
            let delta: &[S::f32s] = cast_slice(self.delta.row(y));
            for dy in 0..3 {
                let start = (y + dy) * self.input.cols * channels;
                let row = &self.input.values[start..start + self.input.cols * channels];
                for pair in 0..registers / 2 {
                    for c in 0..channels {
                        let mut sums = [[simd.splat_f32s(0.0); 2]; 3];
                        for x in 0..width {
                            let low = delta[x * registers + 2 * pair];
                            let high = delta[x * registers + 2 * pair + 1];
                            for dx in 0..3 {
                                let value = simd.splat_f32s(row[(x + dx) * channels + c]);
                                sums[dx][0] = simd.mul_add_e_f32s(value, low, sums[dx][0]);
                                sums[dx][1] = simd.mul_add_e_f32s(value, high, sums[dx][1]);
                            }
                        }
                        for dx in 0..3 {
                            let at = ((3 * dy + dx) * channels + c) * registers + 2 * pair;
                            gradient[at] = simd.add_f32s(gradient[at], sums[dx][0]);
                            gradient[at + 1] = simd.add_f32s(gradient[at + 1], sums[dx][1]);
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn narrow<S: Simd>(self, simd: S) {
        let (width, out_channels) = (self.delta.cols(), self.delta.channels());
        let registers = self.input.channels / S::F32_LANES;
        let input: &[S::f32s] = cast_slice(self.input.values);
        let gradient: &mut [S::f32s] = cast_slice_mut(self.gradient);
        for y in self.rows {
            let delta = self.delta.row(y);
            for dy in 0..3 {
                let start = (y + dy) * self.input.cols * registers;
                let row = &input[start..start + self.input.cols * registers];
                for channel in 0..out_channels {
                    for register in 0..registers {
                        let mut sums = [simd.splat_f32s(0.0); 3];
                        for x in 0..width {
                            let value = simd.splat_f32s(delta[x * out_channels + channel]);
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
