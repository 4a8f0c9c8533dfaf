//! Valid convolutions of any size, stride and number of channels, as direct sums.
//!
//! A tile of pixels x one or two registers of output channels stays in registers while taps and input channels run; inputs are
//! broadcast from where they lie. Weights are packed by groups of output channels, filled up with zeros. The input's gradient
//! of a stride of 2 is four such sums, one for each parity of row and column, each over the taps that fall on it, so that
//! nothing is multiplied by an inserted zero. Weight gradients are a task a tap: no partial sums, the same bytes for
//! any number of threads.

use super::finish::Finish;
use super::plane::{Image, Plane};
use crate::machine;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Pixels of a tile on machines with 32 registers: 12 x 2 sums, 2 weights and a broadcast fill them.
const TILE_32: usize = 12;
/// The same for 16 registers.
const TILE_16: usize = 6;
/// Pixels of a tile at the end of a row.
const TILE_END: usize = 3;
/// Output rows of one task: even, for strides of 2.
const ROWS: usize = 8;

/// `f32` of a register at the level in use.
fn lanes() -> usize {
    struct Lanes;
    impl WithSimd for Lanes {
        type Output = usize;
        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> usize {
            S::F32_LANES
        }
    }
    machine::arch().dispatch(Lanes)
}

/// Channels as the kernels write them: whole groups of one or two registers.
#[derive(Clone, Copy)]
struct Groups {
    channels: usize,
    registers: usize,
    count: usize,
    /// `f32` of a group.
    width: usize,
}

impl Groups {
    fn of(channels: usize) -> Self {
        let lanes = lanes();
        let registers = if channels > lanes { 2 } else { 1 };
        let width = registers * lanes;
        Self { channels, registers, count: channels.div_ceil(width), width }
    }
}

/// The taps of one parity of output rows and columns.
struct Phase {
    /// Rows and columns from the first input of an output to the tap's.
    taps: Vec<(usize, usize)>,
    /// (groups, taps, channels, width of a group)
    weights: Vec<f32>,
}

impl Phase {
    /// `weight(tap, input channel, output channel)` of each of the taps.
    fn new(
        taps: Vec<(usize, usize)>,
        channels: usize,
        groups: Groups,
        weight: impl Fn(usize, usize, usize) -> f32 + Sync,
    ) -> Self {
        let mut weights = vec![0.0; groups.count * taps.len() * channels * groups.width];
        let rows = weights.par_chunks_mut(groups.width).enumerate();
        rows.with_min_len(64).for_each(|(row, out)| {
            let (c, tap, group) = (row % channels, row / channels % taps.len(), row / channels / taps.len());
            let first = group * groups.width;
            for (o, out) in (first..groups.channels).zip(out) {
                *out = weight(tap, c, o);
            }
        });
        Self { taps, weights }
    }
}

/// A convolution's sums, whatever is summed: forward one phase, back as many as the stride squared.
struct Sums<'a> {
    input: Image<'a>,
    /// Input cells from one output of a phase to the next.
    step: usize,
    /// Output cells from one output of a phase to the next.
    out_step: usize,
    /// Cells of the whole output that lie outside on each side.
    crop: usize,
    phases: Vec<Phase>,
    groups: Groups,
    finish: Finish<'a>,
}

impl Sums<'_> {
    fn write(&self, out: &mut Plane) {
        let (rows, cols, left) = (out.rows(), out.cols(), out.border());
        let row_length = out.stored().1 * self.groups.channels;
        let arch = machine::arch();
        let inside = &mut out.values_mut()[left * row_length..(left + rows) * row_length];
        inside.par_chunks_mut(ROWS * row_length).enumerate().for_each(|(task, values)| {
            arch.dispatch(Task { sums: self, values, first: task * ROWS, row_length, cols, left });
        });
    }
}

/// Some output rows.
struct Task<'a> {
    sums: &'a Sums<'a>,
    values: &'a mut [f32],
    first: usize,
    row_length: usize,
    cols: usize,
    left: usize,
}

impl WithSimd for Task<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.sums.groups.registers, S::F32_LANES) {
            (1, 16) => self.run::<S, 1, TILE_32>(simd),
            (_, 16) => self.run::<S, 2, TILE_32>(simd),
            (1, _) => self.run::<S, 1, TILE_16>(simd),
            _ => self.run::<S, 2, TILE_16>(simd),
        }
    }
}

impl Task<'_> {
    #[inline(always)]
    fn run<S: Simd, const R: usize, const P: usize>(self, simd: S) {
        let Sums { input, step, out_step, crop, ref phases, groups, finish } = *self.sums;
        let mut scratch = vec![0.0; self.cols * groups.count * groups.width];
        for row in 0..self.values.len() / self.row_length {
            let (y, out) = (self.first + row, &mut self.values[row * self.row_length..][..self.row_length]);
            for first in 0..out_step.min(self.cols) {
                let phase = &phases[(y + crop) % out_step * out_step + (first + crop) % out_step];
                let width = (self.cols - first).div_ceil(out_step);
                let weights: &[S::f32s] = cast_slice(&phase.weights);
                let group_size = phase.taps.len() * input.channels * R;
                for group in 0..groups.count {
                    let weights = &weights[group * group_size..][..group_size];
                    let sums = cast_slice_mut(&mut scratch);
                    let at = Place {
                        y: (y + crop) / out_step * step,
                        x: (first + crop) / out_step * step,
                        step,
                        stride: groups.count * R,
                        first: group * R,
                    };
                    let mut x = 0;
                    while x + P <= width {
                        tile::<S, R, P>(simd, input, &phase.taps, weights, sums, at, x);
                        x += P;
                    }
                    while x + TILE_END <= width {
                        tile::<S, R, TILE_END>(simd, input, &phase.taps, weights, sums, at, x);
                        x += TILE_END;
                    }
                    while x < width {
                        tile::<S, R, 1>(simd, input, &phase.taps, weights, sums, at, x);
                        x += 1;
                    }
                }
                for (x, sums) in scratch.chunks_exact(groups.count * groups.width).take(width).enumerate() {
                    let column = first + x * out_step;
                    let out = &mut out[(self.left + column) * groups.channels..][..groups.channels];
                    let start = (y * self.cols + column) * groups.channels;
                    store(&sums[..groups.channels], out, start, finish);
                }
            }
        }
    }
}

/// Where a row of tiles lies.
#[derive(Clone, Copy)]
struct Place {
    /// Input row and column of the first tap of the first pixel.
    y: usize,
    x: usize,
    /// Input cells from one pixel to the next.
    step: usize,
    /// Registers of a pixel of the sums, and the first of the group.
    stride: usize,
    first: usize,
}

/// `P` pixels from `x` on, `R` registers of output channels.
#[inline(always)]
fn tile<S: Simd, const R: usize, const P: usize>(
    simd: S,
    input: Image<'_>,
    taps: &[(usize, usize)],
    weights: &[S::f32s],
    out: &mut [S::f32s],
    at: Place,
    x: usize,
) {
    let channels = input.channels;
    let mut sums = [[simd.splat_f32s(0.0); R]; P];
    for (&(dy, dx), weights) in taps.iter().zip(weights.chunks_exact(channels * R)) {
        let start = ((at.y + dy) * input.cols + at.x + x * at.step + dx) * channels;
        let mut pixels: [&[f32]; P] = [&[]; P];
        for p in 0..P {
            pixels[p] = &input.values[start + p * at.step * channels..][..channels];
        }
        for c in 0..channels {
            for p in 0..P {
                let value = simd.splat_f32s(pixels[p][c]);
                for r in 0..R {
                    sums[p][r] = simd.mul_add_e_f32s(value, weights[c * R + r], sums[p][r]);
                }
            }
        }
    }
    for p in 0..P {
        for r in 0..R {
            out[(x + p) * at.stride + at.first + r] = sums[p][r];
        }
    }
}

/// One pixel's sums into its place. `start`: its first value among those of [`Finish::Damp`].
#[inline(always)]
fn store(sums: &[f32], out: &mut [f32], start: usize, finish: Finish<'_>) {
    match finish {
        Finish::Store => out.copy_from_slice(sums),
        Finish::Activate { bias, leak } => {
            for ((out, sum), bias) in out.iter_mut().zip(sums).zip(bias) {
                let sum = sum + bias;
                *out = if sum > 0.0 { sum } else { leak * sum };
            }
        }
        Finish::Damp { by, leak } => {
            for ((out, sum), by) in out.iter_mut().zip(sums).zip(&by[start..]) {
                *out = if *by > 0.0 { *sum } else { leak * sum };
            }
        }
    }
}

/// The valid convolution of an image with `weights` (side x side taps, channels, output channels).
pub(super) fn forward(
    side: usize,
    stride: usize,
    input: Image<'_>,
    weights: &[f32],
    out: &mut Plane,
    finish: Finish<'_>,
) {
    let (channels, out_channels) = (input.channels, out.channels());
    let taps = (0..side * side).map(|tap| (tap / side, tap % side)).collect();
    let groups = Groups::of(out_channels);
    let weight = |tap: usize, c: usize, o: usize| weights[(tap * channels + c) * out_channels + o];
    let phases = vec![Phase::new(taps, channels, groups, weight)];
    Sums { input, step: stride, out_step: 1, crop: 0, phases, groups, finish }.write(out);
}

/// The gradient of the image from that of the output, `delta`, in the frame of the way back, without `crop` cells on each side.
#[allow(clippy::too_many_arguments, reason = "a convolution and what follows it")]
pub(super) fn input_gradient(
    side: usize,
    stride: usize,
    crop: usize,
    delta: &Plane,
    weights: &[f32],
    out: &mut Plane,
    finish: Finish<'_>,
) {
    let (channels, out_channels, frame) = (out.channels(), delta.channels(), delta.border());
    let groups = Groups::of(channels);
    let phase = |parity: usize| {
        // Along one axis: the taps of this parity, and how far before the output's own delta theirs lie.
        let along =
            |parity: usize| (parity..side).step_by(stride).map(move |tap| (tap, (tap - parity) / stride));
        let (rows, cols) = (along(parity / stride), move || along(parity % stride));
        let both: Vec<_> = rows.flat_map(|row| cols().map(move |col| (row, col))).collect();
        let taps = both.iter().map(|((_, up), (_, left))| (frame - up, frame - left)).collect();
        Phase::new(taps, out_channels, groups, |tap, o, c| {
            let ((dy, _), (dx, _)) = both[tap];
            weights[((dy * side + dx) * channels + c) * out_channels + o]
        })
    };
    let phases = (0..stride * stride).map(phase).collect();
    Sums { input: delta.into(), step: 1, out_step: stride, crop, phases, groups, finish }.write(out);
}

/// Adds the weights' gradient.
pub(super) fn add_weight_gradient(
    side: usize,
    stride: usize,
    input: Image<'_>,
    delta: &Plane,
    gradient: &mut [f32],
) {
    let groups = Groups::of(delta.channels());
    let (rows, cols) = (delta.rows(), delta.cols());
    // (rows, groups, columns, width of a group)
    let mut deltas = vec![0.0; rows * groups.count * cols * groups.width];
    deltas.par_chunks_mut(cols * groups.width).enumerate().for_each(|(line, out)| {
        let (row, first) = (line / groups.count, line % groups.count * groups.width);
        let pixels = delta.row(row).chunks_exact(groups.channels);
        for (pixel, out) in pixels.zip(out.chunks_exact_mut(groups.width)) {
            let channels = &pixel[first..groups.channels.min(first + groups.width)];
            out[..channels.len()].copy_from_slice(channels);
        }
    });
    // A tap a task; of a single tap, some channels a task.
    let channels = if side > 1 { input.channels } else { input.channels.div_ceil(ROWS) };
    let arch = machine::arch();
    let tasks = gradient.par_chunks_mut(channels * groups.channels).enumerate();
    tasks.for_each(|(task, gradient)| {
        let (tap, first) = if side > 1 { (task, 0) } else { (0, task * channels) };
        let tap = (tap / side, tap % side);
        arch.dispatch(Weights { input, stride, tap, first, deltas: &deltas, cols, groups, gradient });
    });
}

/// The gradients of one tap's weights.
struct Weights<'a> {
    input: Image<'a>,
    stride: usize,
    tap: (usize, usize),
    /// The first input channel.
    first: usize,
    /// (rows, groups, columns, width of a group)
    deltas: &'a [f32],
    cols: usize,
    groups: Groups,
    /// (input channels of the task, output channels)
    gradient: &'a mut [f32],
}

impl WithSimd for Weights<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match (self.groups.registers, S::F32_LANES) {
            (1, 16) => self.run::<S, 1, TILE_32>(simd),
            (_, 16) => self.run::<S, 2, TILE_32>(simd),
            (1, _) => self.run::<S, 1, TILE_16>(simd),
            _ => self.run::<S, 2, TILE_16>(simd),
        }
    }
}

impl Weights<'_> {
    #[inline(always)]
    fn run<S: Simd, const R: usize, const B: usize>(self, simd: S) {
        let Self { input, stride, tap, first, deltas, cols, groups, gradient } = self;
        let channels = gradient.len() / groups.channels;
        let deltas: &[S::f32s] = cast_slice(deltas);
        let mut sums = vec![0.0; groups.count * channels * groups.width];
        for (y, deltas) in deltas.chunks_exact(groups.count * cols * R).enumerate() {
            let start = ((y * stride + tap.0) * input.cols + tap.1) * input.channels + first;
            let row = &input.values[start..];
            let step = stride * input.channels;
            let sums: &mut [S::f32s] = cast_slice_mut(&mut sums);
            let groups = deltas.chunks_exact(cols * R).zip(sums.chunks_exact_mut(channels * R));
            for (deltas, sums) in groups {
                let mut c = 0;
                while c + B <= channels {
                    row_sums::<S, R, B>(simd, row, step, deltas, c, sums);
                    c += B;
                }
                while c + 2 <= channels {
                    row_sums::<S, R, 2>(simd, row, step, deltas, c, sums);
                    c += 2;
                }
                while c < channels {
                    row_sums::<S, R, 1>(simd, row, step, deltas, c, sums);
                    c += 1;
                }
            }
        }
        for (row, sum) in sums.chunks_exact(groups.width).enumerate() {
            let (c, o) = (row % channels, row / channels * groups.width);
            let out = &mut gradient[c * groups.channels..(c + 1) * groups.channels];
            for (out, sum) in out[o..].iter_mut().zip(sum) {
                *out += sum;
            }
        }
    }
}

/// The input channels `c..c + B` along one row, `R` registers of output channels.
#[inline(always)]
fn row_sums<S: Simd, const R: usize, const B: usize>(
    simd: S,
    row: &[f32],
    step: usize,
    deltas: &[S::f32s],
    c: usize,
    out: &mut [S::f32s],
) {
    let mut sums = [[simd.splat_f32s(0.0); R]; B];
    for (x, delta) in deltas.chunks_exact(R).enumerate() {
        let values: &[f32; B] = row[x * step + c..].first_chunk().expect("channels of the tile");
        for b in 0..B {
            let value = simd.splat_f32s(values[b]);
            for r in 0..R {
                sums[b][r] = simd.mul_add_e_f32s(value, delta[r], sums[b][r]);
            }
        }
    }
    for b in 0..B {
        for r in 0..R {
            let at = (c + b) * R + r;
            out[at] = simd.add_f32s(out[at], sums[b][r]);
        }
    }
}
