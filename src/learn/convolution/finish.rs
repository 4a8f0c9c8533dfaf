//! Where a task's sums go and what is done to them: nothing, bias and activation, or an activation's derivative.

use pulp::Simd;
use pulp::bytemuck::cast_slice;

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

/// The output rows of one task of a convolution.
pub(super) struct Rows<'a> {
    /// (rows, stored columns, channels)
    pub(super) values: &'a mut [f32],
    /// Stored columns.
    pub(super) cols: usize,
    pub(super) channels: usize,
    /// First stored column that is written.
    pub(super) left: usize,
    /// The first of them in the whole output.
    pub(super) first: usize,
    pub(super) finish: Finish<'a>,
}

/// Finishes a row of sums while it is in the cache. `start`: the row's first register in the whole output.
#[inline(always)]
pub(super) fn finish<S: Simd>(
    simd: S,
    row: &mut [S::f32s],
    registers: usize,
    start: usize,
    finish: Finish<'_>,
) {
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
