//! The network of both players: five valid 3x3 convolutions (SinGAN, section 2.1), its passes written out by hand.
//!
//! inputs -> width -> width -> width -> width -> 1, leaky ReLU after the first four, batch normalisation before each of them
//! when asked for. An output pixel sees 11x11 inputs. [`Tape`] owns every buffer of one pass and is used again for the next, so
//! that a training step allocates almost nothing. Without batch normalisation bias and activation happen while a row of
//! sums is still in the cache, and the activation's derivative is read off the sign of its output.

use super::batch_norm::{self, Activation, Moments};
use crate::learn::convolution::{Finish, Plane, add_weight_gradient, convolve, turned};
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use std::ops::Range;

/// Convolutions of a network.
pub(super) const LAYERS: usize = 5;
/// Cells by which the output is narrower than the input on each side.
pub(super) const REACH: usize = LAYERS;
/// Slope of the leaky ReLU below 0 (SinGAN, supplementary material).
pub(super) const LEAK: f32 = 0.2;

/// What a network looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// Channels of the input: 1 to 3.
    pub(super) inputs: usize,
    /// Channels of the hidden layers: 32 or 64.
    pub(super) width: usize,
    /// Whether batch normalisation stands before each activation.
    pub(super) batch_norm: bool,
}

impl Shape {
    /// (input channels, output channels) of a layer.
    pub(super) const fn channels(self, layer: usize) -> (usize, usize) {
        let input = if layer == 0 { self.inputs } else { self.width };
        (input, if layer + 1 == LAYERS { 1 } else { self.width })
    }

    pub(super) const fn normalised(self, layer: usize) -> bool {
        self.batch_norm && layer + 1 < LAYERS
    }

    /// Where a layer's weights (9, inputs, outputs), biases and gains lie. The bias of a normalised layer is the offset
    /// after its normalisation (the one before it would have no effect); other layers have no gains.
    pub(super) fn places(self, layer: usize) -> [Range<usize>; 3] {
        let mut start = 0;
        let mut places = [0..0, 0..0, 0..0];
        for l in 0..=layer {
            let (inputs, outputs) = self.channels(l);
            let gains = if self.normalised(l) { outputs } else { 0 };
            for (place, len) in places.iter_mut().zip([9 * inputs * outputs, outputs, gains]) {
                *place = start..start + len;
                start += len;
            }
        }
        places
    }

    /// Number of trainable values.
    pub(super) fn value_count(self) -> usize {
        self.places(LAYERS - 1)[2].end
    }
}

/// A network's values.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) shape: Shape,
    /// All trainable values, see [`Shape::places`].
    pub(super) values: Vec<f32>,
    /// Running mean and variance of each normalised layer, for use after the training.
    pub(super) running: Vec<Moments>,
}

/// How weights begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// Normal with deviation .02 (the published code).
    Published,
    /// Normal with the variance that keeps the size of signals through leaky ReLUs (He et al. 2015); the last layer of a
    /// generator begins at a tenth of it, so that a scale begins near the identity.
    Scaled,
}

impl Network {
    /// Fresh weights from `seed`; `last`: factor of the last layer's.
    pub(super) fn new(shape: Shape, start: Start, last: f32, seed: Seed) -> Self {
        let mut values = vec![0.0; shape.value_count()];
        for layer in 0..LAYERS {
            let (inputs, outputs) = shape.channels(layer);
            let mut stream = seed.stream(&format!("layer {layer}"));
            let mut normal = || stream.sample::<f32, _>(StandardNormal);
            let [weights, _, gains] = shape.places(layer);
            let deviation = match start {
                Start::Published => 0.02,
                Start::Scaled => (2.0 / ((1.0 + LEAK * LEAK) * 9.0 * inputs as f32)).sqrt(),
            };
            let factor = if layer + 1 == LAYERS && start == Start::Scaled { last } else { 1.0 };
            values[weights].fill_with(|| deviation * factor * normal());
            values[gains].fill_with(|| 1.0 + if start == Start::Published { 0.02 * normal() } else { 0.0 });
            debug_assert!(outputs > 0);
        }
        let running = (0..LAYERS - 1).filter(|&l| shape.normalised(l)).map(|_| Moments::unit(shape.width));
        Self { shape, values, running: running.collect() }
    }

    pub(super) fn weights(&self, layer: usize) -> &[f32] {
        &self.values[self.shape.places(layer)[0].clone()]
    }

    pub(super) fn bias(&self, layer: usize) -> &[f32] {
        &self.values[self.shape.places(layer)[1].clone()]
    }

    pub(super) fn gains(&self, layer: usize) -> &[f32] {
        &self.values[self.shape.places(layer)[2].clone()]
    }

    /// What follows the normalisation of a layer.
    pub(super) fn activation(&self, layer: usize) -> Activation<'_> {
        Activation { gains: self.gains(layer), offsets: self.bias(layer), leak: LEAK }
    }

    /// The same network for use: running moments folded into weights and biases, no normalisation left.
    pub(super) fn folded(&self) -> Self {
        let plain = Shape { batch_norm: false, ..self.shape };
        let mut values = Vec::with_capacity(plain.value_count());
        for layer in 0..LAYERS {
            if !self.shape.normalised(layer) {
                values.extend_from_slice(self.weights(layer));
                values.extend_from_slice(self.bias(layer));
                continue;
            }
            let (moments, gains, offsets) = (&self.running[layer], self.gains(layer), self.bias(layer));
            let scale: Vec<f32> = gains.iter().zip(moments.scales()).map(|(g, s)| g * s).collect();
            let width = self.shape.width;
            values.extend(self.weights(layer).iter().enumerate().map(|(i, w)| w * scale[i % width]));
            values.extend((0..width).map(|c| offsets[c] - scale[c] * moments.mean[c]));
        }
        Self { shape: plain, values, running: Vec::new() }
    }
}

/// Every buffer of a pass over inputs of one size.
#[derive(Debug)]
pub(super) struct Tape {
    shape: Shape,
    /// (rows + 10, cols + 10, inputs)
    pub(super) input: Plane,
    /// Outputs of the activations.
    pub(super) active: Vec<Plane>,
    /// Normalised values before gain and offset, and the reciprocal deviations: with batch normalisation only.
    pub(super) unit: Vec<Plane>,
    pub(super) scales: Vec<Vec<f32>>,
    /// (rows, cols, 1)
    pub(super) out: Plane,
    /// Gradients of the convolutions' outputs, each in a frame of two; the last one is the caller's to fill.
    pub(super) deltas: Vec<Plane>,
    /// Gradients of the normalised values (after the gain): with batch normalisation only.
    pub(super) unit_deltas: Vec<Plane>,
}

impl Tape {
    /// Buffers for outputs of `rows` x `cols`.
    pub(super) fn new(shape: Shape, rows: usize, cols: usize) -> Self {
        let side = |layer: usize| {
            let more = 2 * (LAYERS - 1 - layer);
            (rows + more, cols + more)
        };
        let plane = |layer: usize, channels: usize, border: usize| {
            let (rows, cols) = side(layer);
            Plane::zeros(rows, cols, channels, border)
        };
        let hidden = || (0..LAYERS - 1).map(|l| plane(l, shape.width, 0)).collect::<Vec<_>>();
        let normalised = if shape.batch_norm { LAYERS - 1 } else { 0 };
        Self {
            shape,
            input: Plane::zeros(rows + 2 * REACH, cols + 2 * REACH, shape.inputs, 0),
            active: hidden(),
            unit: (0..normalised).map(|l| plane(l, shape.width, 0)).collect(),
            scales: vec![Vec::new(); normalised],
            out: Plane::zeros(rows, cols, 1, 0),
            deltas: (0..LAYERS).map(|l| plane(l, shape.channels(l).1, 2)).collect(),
            unit_deltas: (0..normalised).map(|l| plane(l, shape.width, 0)).collect(),
        }
    }

    /// `input` -> `out`. `running`: where the moments of this pass are mixed in.
    pub(super) fn forward(&mut self, net: &Network, mut running: Option<&mut Vec<Moments>>) {
        assert_eq!(self.shape, net.shape, "the tape of this network");
        for layer in 0..LAYERS {
            let (before, after) = self.active.split_at_mut(layer.min(LAYERS - 1));
            let input = before.last().unwrap_or(&self.input);
            let (weights, bias) = (net.weights(layer), net.bias(layer));
            if layer + 1 == LAYERS {
                convolve(input, weights, &mut self.out, Finish::Activate { bias, leak: 1.0 });
            } else if self.shape.batch_norm {
                let unit = &mut self.unit[layer];
                convolve(input, weights, unit, Finish::Store);
                let moments = batch_norm::normalise(unit, net.activation(layer), &mut after[0]);
                self.scales[layer] = moments.scales();
                if let Some(running) = running.as_mut() {
                    running[layer].mix(&moments, unit.rows() * unit.cols());
                }
            } else {
                convolve(input, weights, &mut after[0], Finish::Activate { bias, leak: LEAK });
            }
        }
    }

    /// What a layer read.
    pub(super) fn input_of(&self, layer: usize) -> &Plane {
        if layer == 0 { &self.input } else { &self.active[layer - 1] }
    }

    /// From `deltas[4]`, the gradient of `out`, to those of all layers; adds to `gradient` (as [`Network::values`]) and
    /// writes the gradient of the input when asked.
    pub(super) fn backward(
        &mut self,
        net: &Network,
        mut gradient: Option<&mut [f32]>,
        d_input: Option<&mut Plane>,
    ) {
        for layer in (0..LAYERS).rev() {
            let (inputs, outputs) = self.shape.channels(layer);
            let places = self.shape.places(layer);
            if self.shape.normalised(layer) {
                let sums = batch_norm::backward(
                    &self.unit[layer],
                    &self.scales[layer],
                    net.gains(layer),
                    &mut self.deltas[layer],
                    &mut self.unit_deltas[layer],
                );
                if let Some(gradient) = gradient.as_deref_mut() {
                    add(&mut gradient[places[1].clone()], &sums.offset);
                    add(&mut gradient[places[2].clone()], &sums.gain);
                }
            } else if let Some(gradient) = gradient.as_deref_mut() {
                add(&mut gradient[places[1].clone()], &batch_norm::channel_sums(&self.deltas[layer]));
            }
            if let Some(gradient) = gradient.as_deref_mut() {
                let input = if layer == 0 { &self.input } else { &self.active[layer - 1] };
                add_weight_gradient(input, &self.deltas[layer], &mut gradient[places[0].clone()]);
            }
            if layer > 0 {
                let weights = turned(net.weights(layer), inputs, outputs);
                let (below, above) = self.deltas.split_at_mut(layer);
                let damp = Finish::Damp { by: self.active[layer - 1].values(), leak: LEAK };
                convolve(&above[0], &weights, &mut below[layer - 1], damp);
            }
        }
        if let Some(d_input) = d_input {
            let weights = turned(net.weights(0), self.shape.inputs, self.shape.width);
            convolve(&self.deltas[0], &weights, d_input, Finish::Store);
        }
    }
}

/// Adds `more` to `sum`.
pub(super) fn add(sum: &mut [f32], more: &[f32]) {
    for (s, m) in sum.iter_mut().zip(more) {
        *s += m;
    }
}
