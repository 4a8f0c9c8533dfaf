//! The 3x3 convolution on the CPU: forward, input gradient and weight gradient, without temporaries.
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
mod op;
mod plane;
#[allow(clippy::needless_range_loop, reason = "an index names the same register of several sums")]
mod winograd;

pub use finish::Finish;
pub use op::convolve3;
pub use plane::{Image, Plane};

use crate::error::{Error, Result};
use direct::{Forward, Weights};
use pulp::Arch;
use rayon::prelude::*;

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
pub fn check_channels(channels: usize, out_channels: usize) -> Result<()> {
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
    let Image { values, rows: in_rows, cols, channels } = input.into();
    let out_channels = out.channels();
    let (rows, width) = (out.rows(), out.cols());
    assert_eq!((in_rows, cols), (rows + 2, width + 2), "the output is two cells narrower");
    assert_eq!(weights.len(), 9 * channels * out_channels, "nine taps");
    check_channels(channels, out_channels).expect("channels that exist");
    match finish {
        Finish::Activate { bias, .. } => assert_eq!(bias.len(), out_channels, "a bias a channel"),
        Finish::Damp { by, .. } => assert_eq!(by.len(), rows * width * out_channels, "a value an output"),
        Finish::Store => {}
    }
    let (border, (_, out_cols)) = (out.border(), out.stored());
    let row_length = out_cols * out_channels;
    let inside = &mut out.values_mut()[border * row_length..(border + rows) * row_length];
    let tasks = inside.par_chunks_mut(ROWS * row_length).enumerate();
    let arch = Arch::new();
    if channels >= 32 && out_channels >= 32 {
        let mut transformed = vec![0.0; winograd::TERMS * channels * out_channels];
        arch.dispatch(winograd::TransformWeights { weights, out: &mut transformed });
        let source = winograd::Source { values, rows: in_rows, cols };
        tasks.for_each(|(task, out)| {
            arch.dispatch(winograd::Forward {
                source,
                channels,
                weights: &transformed,
                out_channels,
                first_row: task * ROWS,
                out,
                out_cols,
                left: border,
                finish,
            });
        });
        return;
    }
    let narrow = (out_channels <= 2).then(|| swapped(weights, out_channels));
    let weights = narrow.as_deref().unwrap_or(weights);
    tasks.for_each(|(task, out)| {
        arch.dispatch(Forward {
            input: values,
            cols,
            channels,
            weights,
            out_channels,
            first_row: task * ROWS,
            out,
            out_cols,
            left: border,
            finish,
        });
    });
}

/// Adds the weights' gradient, (9, channels, out channels), to `gradient`: over all output pixels, input x `delta`.
///
/// `input` is what [`convolve`] read and `delta` the gradient of what it wrote, in a frame of any width.
///
/// # Panics
/// When shapes do not fit or [`check_channels`] refuses them.
pub fn add_weight_gradient<'a>(input: impl Into<Image<'a>>, delta: &Plane, gradient: &mut [f32]) {
    let Image { values, rows: in_rows, cols, channels } = input.into();
    let out_channels = delta.channels();
    let rows = delta.rows();
    assert_eq!((in_rows, cols), (rows + 2, delta.cols() + 2), "the output is two cells narrower");
    assert_eq!(gradient.len(), 9 * channels * out_channels, "nine taps");
    check_channels(channels, out_channels).expect("channels that exist");
    let arch = Arch::new();
    if channels >= 32 && out_channels >= 32 {
        let source = winograd::Source { values, rows: in_rows, cols };
        let tile_rows = rows.div_ceil(2);
        let count = (tile_rows * cols / 2 / TILES).clamp(2, PIECES);
        let pieces: Vec<Vec<f32>> = (0..count)
            .into_par_iter()
            .map(|piece| {
                let mut terms = vec![0.0; winograd::TERMS * channels * out_channels];
                arch.dispatch(winograd::Weights {
                    source,
                    channels,
                    delta: delta.values(),
                    delta_cols: delta.stored().1,
                    border: delta.border(),
                    out_channels,
                    tile_rows: piece * tile_rows / count..(piece + 1) * tile_rows / count,
                    terms: &mut terms,
                });
                terms
            })
            .collect();
        for terms in &pieces {
            arch.dispatch(winograd::GatherWeights { terms, gradient });
        }
        return;
    }
    let narrow = out_channels <= 2;
    let pieces: Vec<Vec<f32>> = (0..PIECES)
        .into_par_iter()
        .map(|piece| {
            let mut sum = vec![0.0; gradient.len()];
            arch.dispatch(Weights {
                input: values,
                cols,
                channels,
                delta: delta.values(),
                delta_cols: delta.stored().1,
                border: delta.border(),
                out_channels,
                rows: piece * rows / PIECES..(piece + 1) * rows / PIECES,
                gradient: &mut sum,
            });
            if narrow { swapped(&sum, 9 * channels) } else { sum }
        })
        .collect();
    for piece in &pieces {
        for (g, p) in gradient.iter_mut().zip(piece) {
            *g += p;
        }
    }
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
