//! The buffers of one layer, and what a pass does in them.

use super::norm::{self, Projection, Unit, inner_rows};
use super::planes::{add_part, fill_frames};
use super::resample::Resampler;
use super::{Activation, Conv, Kind};
use crate::learn::convolution::{Finish, Kernel, Plane};
use rayon::prelude::*;

/// The buffers of a layer; one plane an image.
#[derive(Default)]
pub(super) struct Slot {
    /// After the activation.
    pub(super) value: Vec<Plane>,
    /// Gradients of what the layer's own sum gave (of the value, for layers without one), in the frame that the way back needs.
    pub(super) delta: Vec<Plane>,
    /// The linear map of a resampling, or of a convolution's frame, and what a framed convolution reads.
    pub(super) map: Option<Resampler>,
    pub(super) framed: Vec<Plane>,
    /// Normalised values before gain and offset, their gradients, and the reciprocal deviations of each set of images.
    pub(super) unit: Vec<Plane>,
    pub(super) unit_delta: Vec<Plane>,
    pub(super) scales: Vec<Vec<f32>>,
    /// Factors of a dropout.
    pub(super) kept: Vec<Vec<f32>>,
    pub(super) pair: Pair,
}

/// The buffers that a tangent needs beside, made when it is first asked for.
#[derive(Default)]
pub(super) struct Pair {
    pub(super) tangent: Vec<Plane>,
    pub(super) framed: Vec<Plane>,
    /// Tangents of unit values, or before a curved activation.
    pub(super) moved: Vec<Plane>,
    pub(super) projections: Vec<Projection>,
    /// Gradients through the values, as `delta`.
    pub(super) mu: Vec<Plane>,
    pub(super) scratch: Vec<Plane>,
}

/// Whose gradients a pass back carries: the output's, or those that a tangent leaves in the values.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Output,
    Tangent,
}

impl Kind {
    pub(super) const fn activation(&self) -> Activation {
        match self {
            Self::Conv { conv, .. } => conv.activation,
            Self::Dense { activation, .. } => *activation,
            _ => Activation::None,
        }
    }

    /// Whether a tangent through it depends on the values beyond kinks.
    pub(super) const fn is_curved(&self) -> bool {
        self.activation().is_curved() || matches!(self, Self::Conv { conv, .. } if conv.norm.is_some())
    }
}

impl Slot {
    pub(super) fn read(&mut self, from: &[Plane]) {
        fill_frames(self.map.as_ref(), from, &mut self.framed);
    }

    pub(super) fn gradients(&mut self, way: Way) -> &mut Vec<Plane> {
        match way {
            Way::Output => &mut self.delta,
            Way::Tangent => &mut self.pair.mu,
        }
    }

    pub(super) fn read_and_gradients<'a>(
        &'a self,
        way: Way,
        from: &'a [Plane],
    ) -> (&'a [Plane], &'a [Plane]) {
        let read = if self.framed.is_empty() { from } else { &self.framed };
        (read, if way == Way::Output { &self.delta } else { &self.pair.mu })
    }

    pub(super) fn map_and_gradients(&self, way: Way) -> (&Resampler, &[Plane]) {
        let map = self.map.as_ref().expect("the map of a resampling");
        (map, if way == Way::Output { &self.delta } else { &self.pair.mu })
    }

    pub(super) fn kept_and_gradients(&self, way: Way) -> (&[Vec<f32>], &[Plane]) {
        (&self.kept, if way == Way::Output { &self.delta } else { &self.pair.mu })
    }

    /// What the tangent of a curved activation says about the value before it.
    pub(super) fn bend_further(&mut self, activation: Activation) {
        let Pair { mu, moved, .. } = &mut self.pair;
        for (((mu, value), delta), moved) in mu.iter_mut().zip(&self.value).zip(&self.delta).zip(moved) {
            inner_rows(mu).enumerate().for_each(|(row, mu)| {
                let all = mu.iter_mut().zip(value.row(row)).zip(delta.row(row)).zip(moved.row(row));
                for (((mu, y), d), moved) in all {
                    *mu += d * moved * activation.curvature(*y);
                }
            });
        }
    }

    pub(super) fn back_through_norm(
        &mut self,
        way: Way,
        conv: &Conv,
        gains: &[f32],
        images: usize,
        mut add: impl FnMut(&norm::Sums),
    ) {
        let Some(norm) = conv.norm else { return };
        for (set, scales) in norm.sets(images).zip(&self.scales) {
            let unit = Unit { norm, values: &self.unit[set.clone()], scales, gains };
            let w = &mut self.unit_delta[set.clone()];
            let Pair { mu, moved, projections, scratch, .. } = &mut self.pair;
            let number = if norm == norm::Norm::Batch { 0 } else { set.start };
            add(&match way {
                Way::Output => unit.backward(&mut self.delta[set], w),
                Way::Tangent => {
                    let (mu, scratch) = (&mut mu[set.clone()], &mut scratch[set.clone()]);
                    unit.value_side(&moved[set], &projections[number], w, mu, scratch)
                }
            });
        }
    }

    /// A convolution's gradient into the layer that it reads. `there`: other readers have left theirs; `alone`: there are none.
    /// Whether what it leaves there is already that of what stood before the activation `before`.
    #[allow(clippy::too_many_arguments, reason = "two layers and what is known of them")]
    pub(super) fn back_into(
        &self,
        way: Way,
        (conv, kernel, weights): (&Conv, &Kernel, &[f32]),
        from: &mut Self,
        there: bool,
        alone: bool,
        before: Activation,
    ) -> bool {
        let grads = if way == Way::Output { &self.delta } else { &self.pair.mu };
        let Slot { value, delta, pair, .. } = from;
        let to = if way == Way::Output { delta } else { &mut pair.mu };
        let direct = self.map.is_none() && !there;
        let fused = direct && alone && !before.is_curved();
        for (image, grad) in grads.iter().enumerate() {
            let finish = match before {
                Activation::Leaky(leak) if fused => Finish::Damp { by: value[image].values(), leak },
                _ => Finish::Store,
            };
            if direct {
                conv.input_gradient(kernel, grad, weights, &mut to[image], finish);
                continue;
            }
            let read = self.framed.get(image).unwrap_or(&value[image]);
            let mut out = Plane::zeros(read.rows(), read.cols(), read.channels(), 0);
            conv.input_gradient(kernel, grad, weights, &mut out, Finish::Store);
            match &self.map {
                Some(map) => map.backward(&out, &mut to[image], there),
                None => add_part(&out, 0, &mut to[image], there),
            }
        }
        fused
    }
}

impl Conv {
    /// The convolution itself. A transposed one reads an image in the frame of its way back.
    pub(super) fn sum(
        self,
        kernel: &Kernel,
        input: &Plane,
        weights: &[f32],
        out: &mut Plane,
        finish: Finish<'_>,
    ) {
        if self.transposed {
            kernel.transpose(input, weights, self.padding.width(), out, finish);
        } else {
            kernel.convolve(input, weights, out, finish);
        }
    }

    /// Back to what [`sum`](Self::sum) read, its frame apart where it is transposed.
    pub(super) fn input_gradient(
        self,
        kernel: &Kernel,
        grad: &Plane,
        weights: &[f32],
        out: &mut Plane,
        finish: Finish<'_>,
    ) {
        if self.transposed {
            kernel.convolve(grad, weights, out, finish);
        } else {
            kernel.input_gradient(grad, weights, out, finish);
        }
    }

    pub(super) fn add_weight_gradient(
        self,
        kernel: &Kernel,
        input: &Plane,
        grad: &Plane,
        gradient: &mut [f32],
    ) {
        if self.transposed {
            kernel.add_weight_gradient(grad, input, gradient);
        } else {
            kernel.add_weight_gradient(input, grad, gradient);
        }
    }
}
