//! The 3x3 convolution on the CPU: forward, input gradient and weight gradient, without temporaries.
//!
//! Images are channels last ([`Plane`]), weights (9 taps row by row, input channels, output channels). The convolution is
//! *valid*: an output pixel needs all nine inputs, so the output is two cells narrower, and who wants padding pads once.
//! Input channels: 1, 2, 3, 32, 64 or 128. Output channels: a multiple of 32; or 1 or 2 when the input has 32, 64 or 128.
//!
//! candle's own `conv2d` copies every input nine times and reaches a tenth of this speed; `experiments/speed/convolution.rs`
//! measures both. Rows are shared among threads; sums over pixels are made in a fixed number of pieces, so that the same
//! bytes come out for any number of threads.

#[allow(clippy::needless_range_loop, reason = "an index names the same register of several sums")]
mod kernel;
mod op;
mod plane;

pub use kernel::Finish;
pub use op::convolve3;
pub use plane::{Image, Plane};

use crate::error::{Error, Result};
use kernel::{Forward, Weights};
use pulp::Arch;
use rayon::prelude::*;

/// Output rows of one parallel task of a forward pass.
const ROWS: usize = 8;
/// Pieces of a sum over pixels: fixed, so that it does not depend on the number of threads.
const PIECES: usize = 8;

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
    let narrow = (out_channels <= 2).then(|| swapped(weights, 9 * channels, out_channels));
    let weights = narrow.as_deref().unwrap_or(weights);
    let (border, (_, out_cols)) = (out.border(), out.stored());
    let row_length = out_cols * out_channels;
    let inside = &mut out.values_mut()[border * row_length..(border + rows) * row_length];
    let arch = Arch::new();
    inside.par_chunks_mut(ROWS * row_length).enumerate().for_each(|(task, out)| {
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
    let narrow = out_channels <= 2;
    let arch = Arch::new();
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
            if narrow { swapped(&sum, out_channels, 9 * channels) } else { sum }
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
    let taps = weights.chunks_exact(channels * out_channels).rev();
    taps.flat_map(|tap| swapped(tap, channels, out_channels)).collect()
}

/// (a, b) -> (b, a)
fn swapped(values: &[f32], a: usize, b: usize) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    for i in 0..a {
        for j in 0..b {
            out[j * a + i] = values[i * b + j];
        }
    }
    out
}

#[cfg(test)]
mod tests;
