//! Networks of images: layers that are put together once, and passes on buffers that are used again.
//!
//! A [`Net`] lists its layers in the order of their computation; each names the earlier ones that it reads, so that skips and
//! several inputs need nothing more. All trainable values of a net are one flat vector in a fixed order. A [`Tape`] owns every
//! buffer of the passes over images of one size: forward, backward, and the tangent pass of a gradient penalty
//! ([`crate::learn::gan`]). Images are channels last, several at once where a batch is wanted.
//!
//! A convolution comes with what follows it: normalisation, bias, activation. Bias and leaky ReLU happen while a row of sums
//! is still in the cache, and the activation's derivative is read off its output.

mod norm;
mod planes;
mod resample;
mod slot;
mod spectral;
mod tape;

pub(crate) use norm::{Moments, Norm};
pub(crate) use resample::{Padding, Resampling};
pub(crate) use spectral::SpectralNorm;
pub(crate) use tape::Tape;

use crate::error::{Error, Result};
use crate::learn::convolution::Kernel;
use crate::learn::{exp, tanh};
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use std::ops::Range;

/// Most channels of a layer.
pub(crate) const MOST_CHANNELS: usize = 512;

/// A layer of a net.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayerId(usize);

/// What follows a sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Activation {
    /// Nothing.
    None,
    /// The value where it is positive, and this much of it elsewhere: 0 to 1.
    Leaky(f32),
    /// Hyperbolic tangent.
    Tanh,
    /// 1 / (1 + e^-x)
    Sigmoid,
}

impl Activation {
    /// Slope below 0 of those that a convolution does on its own.
    const fn leak(self) -> f32 {
        if let Self::Leaky(leak) = self { leak } else { 1.0 }
    }

    const fn is_curved(self) -> bool {
        matches!(self, Self::Tanh | Self::Sigmoid)
    }

    fn curved(self, x: f32) -> f32 {
        match self {
            Self::Tanh => tanh(x),
            Self::Sigmoid => 1.0 / (1.0 + exp(-x)),
            Self::None | Self::Leaky(_) => x,
        }
    }

    /// The derivative, from the output.
    fn slope(self, y: f32) -> f32 {
        match self {
            Self::None => 1.0,
            Self::Leaky(leak) => {
                if y > 0.0 {
                    1.0
                } else {
                    leak
                }
            }
            Self::Tanh => 1.0 - y * y,
            Self::Sigmoid => y * (1.0 - y),
        }
    }

    /// The second derivative over the first, from the output.
    fn curvature(self, y: f32) -> f32 {
        match self {
            Self::Tanh => -2.0 * y,
            Self::Sigmoid => 1.0 - 2.0 * y,
            Self::None | Self::Leaky(_) => 0.0,
        }
    }
}

/// A convolution and what follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conv {
    /// Cells of the kernel's side: 1 to 4.
    pub(crate) side: usize,
    /// Input cells from one output to the next: 1 or 2.
    pub(crate) stride: usize,
    /// Output channels.
    pub(crate) channels: usize,
    /// What stands around the input.
    pub(crate) padding: Padding,
    /// Whether it is a transposed convolution: a stride of 2 then enlarges. The padding, valid or zero, is what is cut off the
    /// output (as in PyTorch: 4 cells, stride 2 and a padding of 1 double the sides), and weights are (taps, output channels,
    /// input channels). It leaves a checkerboard where [`Net::resample`] before a convolution leaves none.
    pub(crate) transposed: bool,
    /// Normalisation before the activation; the bias is then the offset after it.
    pub(crate) norm: Option<Norm>,
    /// What follows. Curved ones are not for normalised layers.
    pub(crate) activation: Activation,
}

impl Conv {
    /// A valid convolution with stride 1 and nothing after it.
    #[must_use]
    pub(crate) const fn new(side: usize, channels: usize) -> Self {
        Self {
            side,
            stride: 1,
            channels,
            padding: Padding::Valid,
            transposed: false,
            norm: None,
            activation: Activation::None,
        }
    }
}

/// The size that an image is resampled to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// So many times as many cells on each side.
    Times(usize),
    /// One in so many cells on each side, rounded up.
    Over(usize),
    /// That of another layer.
    Like(LayerId),
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Input,
    Conv { from: usize, conv: Conv, kernel: Kernel },
    Dense { from: usize, inputs: usize, shape: (usize, usize), activation: Activation },
    Resample { from: usize, how: Resampling, size: Size },
    Add(usize, usize),
    Concat(usize, usize),
    Dropout { from: usize, rate: f32 },
}

#[derive(Clone, Debug, PartialEq)]
struct Layer {
    kind: Kind,
    channels: usize,
    /// Where weights, biases (offsets) and gains lie.
    places: [Range<usize>; 3],
    /// How many layers read this one.
    readers: usize,
}

/// What a network looks like; the last layer is its output.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Net {
    layers: Vec<Layer>,
    value_count: usize,
}

/// How weights begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Start {
    /// Normal with deviation .02 (the published code of pix2pix and SinGAN).
    Published,
    /// Normal with the variance that keeps the size of signals through leaky ReLUs (He et al. 2015).
    Scaled,
}

impl Net {
    /// A net without layers.
    #[must_use]
    pub(crate) fn new() -> Self {
        Self::default()
    }

    fn push(&mut self, kind: Kind, channels: usize, lengths: [usize; 3], reads: &[usize]) -> LayerId {
        let places = lengths.map(|length| {
            let start = self.value_count;
            self.value_count += length;
            start..self.value_count
        });
        reads.iter().for_each(|&layer| self.layers[layer].readers += 1);
        self.layers.push(Layer { kind, channels, places, readers: 0 });
        LayerId(self.layers.len() - 1)
    }

    /// An image from outside.
    ///
    /// # Errors
    /// When there are no channels or more than [`MOST_CHANNELS`].
    pub(crate) fn input(&mut self, channels: usize) -> Result<LayerId> {
        Ok(self.push(Kind::Input, check_channels(channels)?, [0; 3], &[]))
    }

    /// A convolution of a layer.
    ///
    /// # Errors
    /// Names the first setting that is out of range.
    pub(crate) fn conv(&mut self, from: LayerId, conv: Conv) -> Result<LayerId> {
        let kernel = Kernel::new(conv.side, conv.stride)?;
        let channels = check_channels(conv.channels)?;
        check_activation(conv.activation)?;
        if conv.norm.is_some() && conv.activation.is_curved() {
            let allowed = "allowed after a normalisation: none, leaky";
            return Err(Error::value("activation", format!("{:?}", conv.activation), allowed));
        }
        if conv.transposed && !matches!(conv.padding, Padding::Valid | Padding::Zero(_)) {
            let allowed = "allowed for a transposed convolution: valid, zero";
            return Err(Error::value("padding", format!("{:?}", conv.padding), allowed));
        }
        let weights = conv.side * conv.side * self.layers[from.0].channels * channels;
        let gains = if conv.norm.is_some() { channels } else { 0 };
        let kind = Kind::Conv { from: from.0, conv, kernel };
        Ok(self.push(kind, channels, [weights, channels, gains], &[from.0]))
    }

    /// Every output a sum over all `inputs` values (rows x columns x channels) of a layer: an image of (rows, columns,
    /// channels).
    ///
    /// # Errors
    /// When there is nothing to sum or to make.
    pub(crate) fn dense(
        &mut self,
        from: LayerId,
        inputs: usize,
        (rows, cols, channels): (usize, usize, usize),
        activation: Activation,
    ) -> Result<LayerId> {
        check_activation(activation)?;
        let outputs = rows * cols * check_channels(channels)?;
        if inputs == 0 || outputs == 0 {
            return Err(Error::value("values of a dense layer", inputs.min(outputs), "allowed: at least 1"));
        }
        let kind = Kind::Dense { from: from.0, inputs, shape: (rows, cols), activation };
        Ok(self.push(kind, channels, [inputs * outputs, outputs, 0], &[from.0]))
    }

    /// A layer at another size: before a convolution, instead of a transposed one.
    ///
    /// # Errors
    /// When a factor is 0.
    pub(crate) fn resample(&mut self, from: LayerId, how: Resampling, size: Size) -> Result<LayerId> {
        if matches!(size, Size::Times(0) | Size::Over(0)) {
            return Err(Error::value("factor of a resampling", 0, "allowed: at least 1"));
        }
        Ok(self.push(
            Kind::Resample { from: from.0, how, size },
            self.layers[from.0].channels,
            [0; 3],
            &[from.0],
        ))
    }

    /// The sum of two layers.
    ///
    /// # Errors
    /// When their channels differ.
    pub(crate) fn add(&mut self, a: LayerId, b: LayerId) -> Result<LayerId> {
        let [one, two] = [a, b].map(|layer| self.layers[layer.0].channels);
        if one != two {
            return Err(Error::value("channels of a sum", two, format!("allowed: {one}, as the other has")));
        }
        Ok(self.push(Kind::Add(a.0, b.0), one, [0; 3], &[a.0, b.0]))
    }

    /// The channels of two layers side by side.
    ///
    /// # Errors
    /// When there are more than [`MOST_CHANNELS`].
    pub(crate) fn concat(&mut self, a: LayerId, b: LayerId) -> Result<LayerId> {
        let channels = check_channels(self.layers[a.0].channels + self.layers[b.0].channels)?;
        Ok(self.push(Kind::Concat(a.0, b.0), channels, [0; 3], &[a.0, b.0]))
    }

    /// A layer of which a pass drops a share `rate` of the values and enlarges the others as much (Srivastava et al. 2014), by
    /// what [`Tape::draw_dropout`] drew; none before it.
    ///
    /// # Errors
    /// When the rate is not from 0 to below 1.
    pub(crate) fn dropout(&mut self, from: LayerId, rate: f32) -> Result<LayerId> {
        if !(0.0..1.0).contains(&rate) {
            return Err(Error::value("rate of dropout", rate, "allowed: 0 to below 1"));
        }
        Ok(self.push(Kind::Dropout { from: from.0, rate }, self.layers[from.0].channels, [0; 3], &[from.0]))
    }

    /// Number of trainable values.
    #[must_use]
    pub(crate) const fn value_count(&self) -> usize {
        self.value_count
    }

    /// Where a layer's weights (taps, input channels, output channels), biases and gains lie. The bias of a normalised layer is
    /// the offset after its normalisation; other layers have no gains.
    #[must_use]
    pub(crate) fn places(&self, layer: LayerId) -> [Range<usize>; 3] {
        self.layers[layer.0].places.clone()
    }

    /// The layers that come from outside, in order.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = LayerId> {
        let is_input = |(_, layer): &(usize, &Layer)| layer.kind == Kind::Input;
        self.layers.iter().enumerate().filter(is_input).map(|(i, _)| LayerId(i))
    }

    /// The layers with weights, in order.
    pub(crate) fn weighted(&self) -> impl DoubleEndedIterator<Item = LayerId> {
        let has_weights = |(_, layer): &(usize, &Layer)| !layer.places[0].is_empty();
        self.layers.iter().enumerate().filter(has_weights).map(|(i, _)| LayerId(i))
    }

    /// Fresh values from `seed`, a stream for each layer; `last`: factor of the last layer's weights in [`Start::Scaled`], so
    /// that what a net adds may begin small.
    #[must_use]
    pub(crate) fn start(&self, start: Start, last: f32, seed: Seed) -> Vec<f32> {
        let mut values = vec![0.0; self.value_count];
        let count = self.weighted().count();
        for (number, layer) in self.weighted().enumerate() {
            let layer = &self.layers[layer.0];
            let mut stream = seed.stream(&format!("layer {number}"));
            let mut normal = || stream.sample::<f32, _>(StandardNormal);
            let [weights, biases, gains] = layer.places.clone();
            let taps = if let Kind::Conv { conv, .. } = layer.kind { conv.side * conv.side } else { 1 };
            let inputs = weights.len() / biases.len() / taps;
            let leak = if let Activation::Leaky(leak) = layer.kind.activation() { leak } else { 0.2 };
            let deviation = match start {
                Start::Published => 0.02,
                Start::Scaled => (2.0 / ((1.0 + leak * leak) * taps as f32 * inputs as f32)).sqrt(),
            };
            let factor = if number + 1 == count && start == Start::Scaled { last } else { 1.0 };
            values[weights].fill_with(|| deviation * factor * normal());
            values[gains].fill_with(|| 1.0 + if start == Start::Published { 0.02 * normal() } else { 0.0 });
        }
        values
    }

    /// Running moments of the batch-normalised layers before any pass.
    #[must_use]
    pub(crate) fn running(&self) -> Vec<Moments> {
        self.batch_normalised().map(|layer| Moments::unit(layer.channels)).collect()
    }

    fn batch_normalised(&self) -> impl Iterator<Item = &Layer> {
        self.layers.iter().filter(|layer| layer.is_batch_normalised())
    }

    /// The same function with running moments folded into weights and biases: no batch normalisation left.
    ///
    /// # Panics
    /// When moments or values are not those of the net.
    #[must_use]
    pub(crate) fn folded(&self, values: &[f32], running: &[Moments]) -> (Self, Vec<f32>) {
        let (mut net, mut folded, mut running) = (Self::new(), Vec::new(), running.iter());
        for layer in &self.layers {
            let [weights, biases, gains] = layer.places.clone().map(|place| &values[place]);
            let mut kind = layer.kind.clone();
            if let (Kind::Conv { conv, .. }, true) = (&mut kind, layer.is_batch_normalised()) {
                conv.norm = None;
                let moments = running.next().expect("moments of every batch normalisation");
                let scale: Vec<f32> = gains.iter().zip(moments.scales()).map(|(g, s)| g * s).collect();
                // The output's channels come last, or before the input's.
                let inner = if conv.transposed {
                    weights.len() / (conv.side * conv.side * layer.channels)
                } else {
                    1
                };
                folded.extend(weights.iter().enumerate().map(|(i, w)| w * scale[i / inner % layer.channels]));
                folded.extend((0..layer.channels).map(|c| biases[c] - scale[c] * moments.mean[c]));
                net.push(kind, layer.channels, [weights.len(), biases.len(), 0], &[]);
            } else {
                [weights, biases, gains].iter().for_each(|part| folded.extend_from_slice(part));
                net.push(kind, layer.channels, [weights.len(), biases.len(), gains.len()], &[]);
            }
        }
        for (layer, old) in net.layers.iter_mut().zip(&self.layers) {
            layer.readers = old.readers;
        }
        (net, folded)
    }
}

impl Layer {
    fn is_batch_normalised(&self) -> bool {
        matches!(&self.kind, Kind::Conv { conv, .. } if conv.norm == Some(Norm::Batch))
    }
}

fn check_channels(channels: usize) -> Result<usize> {
    if (1..=MOST_CHANNELS).contains(&channels) {
        return Ok(channels);
    }
    Err(Error::value("channels of a layer", channels, format!("allowed: 1 to {MOST_CHANNELS}")))
}

fn check_activation(activation: Activation) -> Result<()> {
    match activation {
        Activation::Leaky(leak) if !(0.0..=1.0).contains(&leak) => {
            Err(Error::value("leak of an activation", leak, "allowed: 0 to 1"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
