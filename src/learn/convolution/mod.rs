//! The 3x3 convolution on the CPU: forward, input gradient and weight gradient.
//!
//! Images are channels last ([`Plane`]), weights (9 taps row by row, input channels, output channels). The convolution is
//! *valid*: an output pixel needs all nine inputs, so the output is two cells narrower, and who wants padding pads once.
//! Input channels: 1, 2, 3, 32, 64 or 128. Output channels: a multiple of 32; or 1 or 2 when the input has 32, 64 or 128.
//!
//! From many channels to many it is Winograd's minimal filtering (`winograd`), else a direct sum (`direct`); `pulp` picks
//! the instruction set at run time. candle's own `conv2d` copies every input nine times; `experiments/speed/convolution.rs`
//! measures both. Rows are shared among threads; sums over pixels are made in a number of pieces that the size alone decides, so
//! that the same bytes come out for any number of threads.
//!
//! In the vector code loops stand where an iterator with a closure would be shorter: a closure handed to the standard library is
//! compiled for the baseline processor, and every vector operation in it becomes a call.

#[allow(clippy::needless_range_loop, reason = "an index names the same register of several sums")]
mod direct;
mod finish;
#[allow(clippy::needless_range_loop, reason = "an index names the same register of several sums")]
mod general;
mod kernel;
mod op;
mod plane;
#[allow(clippy::needless_range_loop, reason = "an index names the same register of several sums")]
mod winograd;

pub use finish::Finish;
pub(crate) use kernel::Kernel;
pub use op::convolve3;
pub(crate) use plane::Image;
pub use plane::Plane;

use crate::error::{Error, Result};
use crate::machine;
use finish::Rows;
use rayon::prelude::*;
use std::ops::Range;

/// Output rows of one parallel task of a forward pass.
const ROWS: usize = 8;
/// Pieces of a sum over pixels, at most.
const PIECES: usize = 8;
/// Tiles of such a piece, at least, where it has sums of its own for every pair of channels.
const TILES: usize = 128;

/// Checks that a convolution of these channels exists.
///
/// # Errors
/// Names the channels that do not fit.
pub(crate) fn check_channels(channels: usize, out_channels: usize) -> Result<()> {
    let whole = matches!(channels, 32 | 64 | 128);
    if !(whole || matches!(channels, 1..=3)) {
        return Err(Error::value(
            "input channels of a convolution",
            channels,
            "allowed: 1, 2, 3, 32, 64, 128",
        ));
    }
    if !(out_channels > 0 && out_channels.is_multiple_of(32) || whole && matches!(out_channels, 1 | 2)) {
        let allowed = "allowed: a multiple of 32, or 1 or 2 from at least 32 input channels";
        return Err(Error::value("output channels of a convolution", out_channels, allowed));
    }
    Ok(())
}

/// The convolution of `input`, its frame included, with `weights` (9, channels, out channels) into `out`.
///
/// `out` is two cells narrower than `input` with its frame. With the output's gradient in a frame of two and
/// [`turned`] weights this is the input's gradient.
///
/// # Panics
/// When shapes do not fit or [`check_channels`] refuses them.
pub fn convolve<'a>(input: impl Into<Image<'a>>, weights: &[f32], out: &mut Plane, finish: Finish<'_>) {
    let input = input.into();
    let (rows, width) = (out.rows(), out.cols());
    let (channels, out_channels) = (input.channels, out.channels());
    assert_eq!((input.rows, input.cols), (rows + 2, width + 2), "the output is two cells narrower");
    assert_eq!(weights.len(), 9 * channels * out_channels, "nine taps");
    check_channels(channels, out_channels).expect("channels that exist");
    match finish {
        Finish::Activate { bias, .. } => assert_eq!(bias.len(), out_channels, "a bias a channel"),
        Finish::Damp { by, .. } => assert_eq!(by.len(), rows * width * out_channels, "a value an output"),
        Finish::Store => {}
    }
    let (left, (_, cols)) = (out.border(), out.stored());
    let row_length = cols * out_channels;
    let inside = &mut out.values_mut()[left * row_length..(left + rows) * row_length];
    let tasks = inside.par_chunks_mut(ROWS * row_length).enumerate().map(|(task, values)| Rows {
        values,
        cols,
        channels: out_channels,
        left,
        first: task * ROWS,
        finish,
    });
    let arch = machine::arch();
    if many(channels, out_channels) {
        let mut transformed = vec![0.0; winograd::TERMS * channels * out_channels];
        arch.dispatch(winograd::TransformWeights { weights, out: &mut transformed });
        let weights = &transformed[..];
        tasks.for_each(|out| arch.dispatch(winograd::Forward { input, weights, out }));
    } else {
        let narrow = (out_channels <= 2).then(|| swapped(weights, out_channels));
        let weights = narrow.as_deref().unwrap_or(weights);
        tasks.for_each(|out| arch.dispatch(direct::Forward { input, weights, out }));
    }
}

/// Whether a convolution has many channels on both sides: Winograd's, not a direct sum.
const fn many(channels: usize, out_channels: usize) -> bool {
    channels >= 32 && out_channels >= 32
}

/// Adds the weights' gradient, (9, channels, out channels), to `gradient`: over all output pixels, input x `delta`.
///
/// `input` is what [`convolve`] read and `delta` the gradient of what it wrote, in a frame of any width.
///
/// # Panics
/// When shapes do not fit or [`check_channels`] refuses them.
pub fn add_weight_gradient<'a>(input: impl Into<Image<'a>>, delta: &Plane, gradient: &mut [f32]) {
    let input = input.into();
    let (rows, cols) = (delta.rows(), delta.cols());
    let (channels, out_channels) = (input.channels, delta.channels());
    assert_eq!((input.rows, input.cols), (rows + 2, cols + 2), "the output is two cells narrower");
    assert_eq!(gradient.len(), 9 * channels * out_channels, "nine taps");
    check_channels(channels, out_channels).expect("channels that exist");
    let arch = machine::arch();
    if many(channels, out_channels) {
        let (tile_rows, tile_cols) = (rows.div_ceil(2), cols.div_ceil(2));
        let count = (tile_rows * tile_cols / TILES).clamp(2, PIECES);
        let pieces = pieces(count, tile_rows, |tile_rows| {
            let mut terms = vec![0.0; winograd::TERMS * channels * out_channels];
            arch.dispatch(winograd::Weights { input, delta, tile_rows, terms: &mut terms });
            terms
        });
        for terms in &pieces {
            arch.dispatch(winograd::GatherWeights { terms, gradient });
        }
        return;
    }
    let pieces = pieces(PIECES, rows, |rows| {
        let mut sum = vec![0.0; gradient.len()];
        arch.dispatch(direct::Weights { input, delta, rows, gradient: &mut sum });
        if out_channels <= 2 { swapped(&sum, 9 * channels) } else { sum }
    });
    for piece in &pieces {
        for (g, p) in gradient.iter_mut().zip(piece) {
            *g += p;
        }
    }
}

/// What `sum` makes of each of `count` equal shares of `rows`, in their order.
fn pieces(count: usize, rows: usize, sum: impl Fn(Range<usize>) -> Vec<f32> + Sync) -> Vec<Vec<f32>> {
    let shares = (0..count).into_par_iter();
    shares.map(|piece| sum(piece * rows / count..(piece + 1) * rows / count)).collect()
}

/// The weights of the transposed convolution: taps in reverse order, channels swapped. (9, a, b) -> (9, b, a)
#[must_use]
pub fn turned(weights: &[f32], channels: usize, out_channels: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(weights.len());
    for tap in weights.chunks_exact(channels * out_channels).rev() {
        swap(tap, out_channels, &mut out);
    }
    out
}

/// (a, b) -> (b, a)
fn swapped(values: &[f32], b: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(values.len());
    swap(values, b, &mut out);
    out
}

/// Appends (a, b) as (b, a).
fn swap(values: &[f32], b: usize, out: &mut Vec<f32>) {
    for j in 0..b {
        out.extend(values[j..].iter().step_by(b));
    }
}

#[cfg(test)]
mod tests;
