//! The gradient penalty of WGAN-GP (Gulrajani et al. 2017), with its exact parameter gradient and no second derivative.
//!
//! With g the gradient of the sum of the critic's map by its input, the penalty is the mean over pixels of (|g| - 1)^2, |g|
//! over the channels of a pixel, as in the published code of SinGAN. With v = 2 (|g| - 1) g / (n |g|) held constant, its
//! parameter gradient is that of the directional derivative of the critic along v: a tangent goes forward beside the values.
//! The gradient of that tangent at every layer is the one that the backward pass for g has left there, so one tangent pass
//! and one sum over pixels are all that is added; with batch normalisation the values have a gradient of their own, which goes
//! back through the layers below. Cost: about 4 passes (6 with batch normalisation); a pass is one run through all layers.

use super::batch_norm::{self, ValueSide};
use super::network::{LAYERS, LEAK, Network, REACH, Shape, Tape, add};
use crate::learn::convolution::{Finish, Plane, add_weight_gradient, convolve, turned};

/// Buffers of the penalty for one size.
#[derive(Debug)]
pub(super) struct Penalty {
    /// Tangents of what each layer reads.
    tangents: Vec<Plane>,
    d_input: Plane,
    values: Option<ValueBuffers>,
}

/// What batch normalisation needs beside.
#[derive(Debug)]
struct ValueBuffers {
    moved: Vec<Plane>,
    scratch: Vec<Plane>,
    mu: Vec<Plane>,
}

impl Penalty {
    /// Buffers for critics' maps of `rows` x `cols`.
    pub(super) fn new(shape: Shape, rows: usize, cols: usize) -> Self {
        let hidden = |border: usize| {
            (0..LAYERS - 1)
                .map(|l| {
                    let more = 2 * (LAYERS - 1 - l);
                    Plane::zeros(rows + more, cols + more, shape.width, border)
                })
                .collect::<Vec<_>>()
        };
        let input = Plane::zeros(rows + 2 * REACH, cols + 2 * REACH, shape.inputs, 0);
        let values =
            shape.batch_norm.then(|| ValueBuffers { moved: hidden(0), scratch: hidden(0), mu: hidden(2) });
        let mut tangents = vec![input.clone()];
        tangents.extend(hidden(0));
        Self { tangents, d_input: input, values }
    }

    /// The penalty at `tape.input`; `weight` times its parameter gradient is added to `gradient`.
    pub(super) fn add(&mut self, net: &Network, tape: &mut Tape, weight: f32, gradient: &mut [f32]) -> f64 {
        tape.forward(net, None);
        let last = &mut tape.deltas[LAYERS - 1];
        (0..last.rows()).for_each(|row| last.row_mut(row).fill(1.0));
        tape.backward(net, None, Some(&mut self.d_input));
        let penalty = direction(&self.d_input, weight, &mut self.tangents[0]);
        let projections = self.tangent(net, tape);
        for layer in 0..LAYERS {
            let place = net.shape.places(layer)[0].clone();
            add_weight_gradient(&self.tangents[layer], &tape.deltas[layer], &mut gradient[place]);
        }
        if let Some(values) = &mut self.values {
            values.backward(net, tape, &projections, gradient);
        }
        penalty
    }

    /// The tangent through all hidden layers.
    fn tangent(&mut self, net: &Network, tape: &Tape) -> Vec<batch_norm::Projection> {
        let mut projections = Vec::new();
        for layer in 0..LAYERS - 1 {
            let (before, after) = self.tangents.split_at_mut(layer + 1);
            let (input, out) = (&before[layer], &mut after[0]);
            let active = &tape.active[layer];
            match &mut self.values {
                None => {
                    let damp = Finish::Damp { by: active.values(), leak: LEAK };
                    convolve(input, net.weights(layer), out, damp);
                }
                Some(values) => {
                    let moved = &mut values.moved[layer];
                    convolve(input, net.weights(layer), moved, Finish::Store);
                    let (unit, scales) = (&tape.unit[layer], &tape.scales[layer]);
                    let activation = net.activation(layer);
                    projections.push(batch_norm::tangent(unit, scales, activation, active, moved, out));
                }
            }
        }
        projections
    }
}

impl ValueBuffers {
    /// The gradient that reaches the parameters through the values.
    fn backward(
        &mut self,
        net: &Network,
        tape: &Tape,
        projections: &[batch_norm::Projection],
        gradient: &mut [f32],
    ) {
        let top = LAYERS - 2;
        self.mu[top].values_mut().fill(0.0);
        for layer in (0..=top).rev() {
            let side = ValueSide {
                unit: &tape.unit[layer],
                scales: &tape.scales[layer],
                gains: net.gains(layer),
                moved: &self.moved[layer],
                projection: &projections[layer],
                w: &tape.unit_deltas[layer],
            };
            let sums = side.backward(&mut self.mu[layer], &mut self.scratch[layer]);
            let places = net.shape.places(layer);
            add(&mut gradient[places[1].clone()], &sums.offset);
            add(&mut gradient[places[2].clone()], &sums.gain);
            add_weight_gradient(tape.input_of(layer), &self.mu[layer], &mut gradient[places[0].clone()]);
            if layer > 0 {
                let (inputs, outputs) = net.shape.channels(layer);
                let weights = turned(net.weights(layer), inputs, outputs);
                let (below, above) = self.mu.split_at_mut(layer);
                let damp = Finish::Damp { by: tape.active[layer - 1].values(), leak: LEAK };
                convolve(&above[0], &weights, &mut below[layer - 1], damp);
            }
        }
    }
}

/// The penalty for input gradients `g`, and `weight` times its derivative by them.
fn direction(g: &Plane, weight: f32, out: &mut Plane) -> f64 {
    let channels = g.channels();
    let n = (g.rows() * g.cols()) as f32;
    let mut penalty = 0.0;
    let pixels = g.values().chunks_exact(channels).zip(out.values_mut().chunks_exact_mut(channels));
    for (g, v) in pixels {
        let norm = g.iter().map(|g| g * g).sum::<f32>().sqrt();
        penalty += f64::from((norm - 1.0) * (norm - 1.0));
        // Where g is 0 the norm has no derivative: 0 stands for it.
        let factor = if norm > 0.0 { weight * 2.0 * (norm - 1.0) / (n * norm) } else { 0.0 };
        for (v, g) in v.iter_mut().zip(g) {
            *v = factor * g;
        }
    }
    penalty / f64::from(n)
}
