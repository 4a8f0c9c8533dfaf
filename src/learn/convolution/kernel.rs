//! A convolution of any of the sizes that networks here use, by the fastest way that there is for it.

use super::finish::Finish;
use super::plane::{Image, Plane};
use super::{add_weight_gradient, check_channels, convolve, general, turned};
use crate::error::{Error, Result};

/// A valid convolution: side and stride of its kernel. Any number of channels; weights are (taps row by row, input channels,
/// output channels).
///
/// 3x3 with stride 1 from and to channels that [`check_channels`] knows takes the fast way; all else is a direct sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kernel {
    side: usize,
    stride: usize,
}

impl Kernel {
    /// One cell: a product of a pixel's channels with a matrix.
    pub(crate) const DOT: Self = Self { side: 1, stride: 1 };

    /// A kernel of `side` x `side` cells.
    ///
    /// # Errors
    /// When the side is not 1 to 4, or the stride neither 1 nor 2 or larger than the side.
    pub(crate) fn new(side: usize, stride: usize) -> Result<Self> {
        if !(1..=4).contains(&side) {
            return Err(Error::value("side of a convolution's kernel", side, "allowed: 1 to 4"));
        }
        if !(1..=side.min(2)).contains(&stride) {
            return Err(Error::value(
                "stride of a convolution",
                stride,
                "allowed: 1, or 2 for kernels of 2 to 4 cells",
            ));
        }
        Ok(Self { side, stride })
    }

    /// Cells of an output's side.
    ///
    /// # Panics
    /// When the input is smaller than the kernel.
    #[must_use]
    pub(crate) const fn outputs(self, inputs: usize) -> usize {
        assert!(inputs >= self.side, "an input at least as large as the kernel");
        (inputs - self.side) / self.stride + 1
    }

    /// The frame that an output's gradient wears.
    #[must_use]
    pub(crate) const fn frame(self) -> usize {
        if self.stride == 1 { self.side - 1 } else { 2 }
    }

    fn is_fast(self, channels: usize, out_channels: usize) -> bool {
        self.side == 3 && self.stride == 1 && check_channels(channels, out_channels).is_ok()
    }

    /// The convolution of `input`, its frame included, into `out`.
    ///
    /// # Panics
    /// When shapes do not fit.
    pub(crate) fn convolve<'a>(
        &self,
        input: impl Into<Image<'a>>,
        weights: &[f32],
        out: &mut Plane,
        finish: Finish<'_>,
    ) {
        let input = input.into();
        if self.is_fast(input.channels, out.channels()) {
            return convolve(input, weights, out, finish);
        }
        self.check(input, (out.rows(), out.cols(), out.channels()), weights.len());
        check_finish(finish, out);
        general::forward(self.side, self.stride, input, weights, out, finish);
    }

    /// The gradient of the input from that of the output, `delta` in its [frame](Self::frame), into `out`.
    ///
    /// # Panics
    /// When shapes do not fit.
    pub(crate) fn input_gradient(&self, delta: &Plane, weights: &[f32], out: &mut Plane, finish: Finish<'_>) {
        let (channels, out_channels) = (out.channels(), delta.channels());
        if self.is_fast(out_channels, channels) {
            return convolve(delta, &turned(weights, channels, out_channels), out, finish);
        }
        let (rows, cols) = (out.rows(), out.cols());
        assert_eq!(
            (self.outputs(rows), self.outputs(cols)),
            (delta.rows(), delta.cols()),
            "the output's size"
        );
        assert_eq!(delta.border(), self.frame(), "the frame of the way back");
        assert_eq!(weights.len(), self.side * self.side * channels * out_channels, "weights of every tap");
        check_finish(finish, out);
        general::input_gradient(self.side, self.stride, 0, delta, weights, out, finish);
    }

    /// The transposed convolution: what [`input_gradient`](Self::input_gradient) gives of an image in its
    /// [frame](Self::frame), without `crop` cells on each side. Weights are (taps, output channels, input channels).
    ///
    /// # Panics
    /// When shapes do not fit.
    pub(crate) fn transpose(
        &self,
        input: &Plane,
        weights: &[f32],
        crop: usize,
        out: &mut Plane,
        finish: Finish<'_>,
    ) {
        let size = [input.rows(), input.cols()].map(|n| self.transposed_outputs(n, crop));
        assert_eq!(size, [out.rows(), out.cols()], "the output's size");
        assert_eq!(input.border(), self.frame(), "the frame of the way back");
        let channels = input.channels() * out.channels();
        assert_eq!(weights.len(), self.side * self.side * channels, "weights of every tap");
        check_finish(finish, out);
        general::input_gradient(self.side, self.stride, crop, input, weights, out, finish);
    }

    /// Cells of a transposed convolution's side.
    ///
    /// # Panics
    /// When nothing is left.
    #[must_use]
    pub(crate) const fn transposed_outputs(self, inputs: usize, crop: usize) -> usize {
        let whole = (inputs - 1) * self.stride + self.side;
        assert!(whole > 2 * crop, "something is left of the output");
        whole - 2 * crop
    }

    /// Adds the weights' gradient: over all output pixels, input x `delta`, in a frame of any width.
    ///
    /// # Panics
    /// When shapes do not fit.
    pub(crate) fn add_weight_gradient<'a>(
        &self,
        input: impl Into<Image<'a>>,
        delta: &Plane,
        gradient: &mut [f32],
    ) {
        let input = input.into();
        if self.is_fast(input.channels, delta.channels()) {
            return add_weight_gradient(input, delta, gradient);
        }
        self.check(input, (delta.rows(), delta.cols(), delta.channels()), gradient.len());
        general::add_weight_gradient(self.side, self.stride, input, delta, gradient);
    }

    fn check(&self, input: Image<'_>, (rows, cols, channels): (usize, usize, usize), weights: usize) {
        assert_eq!((self.outputs(input.rows), self.outputs(input.cols)), (rows, cols), "the output's size");
        assert_eq!(weights, self.side * self.side * input.channels * channels, "weights of every tap");
    }
}

fn check_finish(finish: Finish<'_>, out: &Plane) {
    match finish {
        Finish::Activate { bias, .. } => assert_eq!(bias.len(), out.channels(), "a bias a channel"),
        Finish::Damp { by, .. } => {
            assert_eq!(by.len(), out.rows() * out.cols() * out.channels(), "a value an output");
        }
        Finish::Store => {}
    }
}
