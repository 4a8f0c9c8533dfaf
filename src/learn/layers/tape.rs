//! The buffers and passes of a [`Net`] over images of one size.

use super::norm::{self, Affine, Moments, Unit, channel_sums};
use super::planes::{
    add, add_two, bend, bend_tangent, damp, drop_some, fill_frames, flat, join, part, unflatten,
};
use super::resample::{Axis, Padding, Resampler};
use super::slot::{Slot, Way};
use super::{Activation, Kind, LayerId, Net, Size};
use crate::learn::convolution::{Finish, Kernel, Plane};
use crate::seed::Stream;
use rand::RngExt;

/// A single convolution of one cell, which a dense layer is.
const DOT: Kernel = Kernel::DOT;

/// Every buffer of a net's passes.
pub(crate) struct Tape {
    net: Net,
    images: usize,
    slots: Vec<Slot>,
}

impl Tape {
    /// Buffers for `images` at once; `inputs`: (rows, columns) of each input layer in order.
    ///
    /// # Panics
    /// When there is no image, or a shape does not fit a layer.
    #[must_use]
    pub(crate) fn new(net: &Net, images: usize, inputs: &[(usize, usize)]) -> Self {
        assert!(images > 0 && !net.layers.is_empty(), "a pass has an image and a layer");
        let mut inputs = inputs.iter().copied();
        let mut slots: Vec<Slot> = Vec::new();
        for layer in &net.layers {
            let shape = |layer: usize| (slots[layer].value[0].rows(), slots[layer].value[0].cols());
            let mut map = None;
            let mut frame = 0;
            let (rows, cols) = match &layer.kind {
                Kind::Input => inputs.next().expect("a size for each input"),
                Kind::Conv { from, conv, kernel } => {
                    let (rows, cols) = shape(*from);
                    let pad = conv.padding;
                    if conv.transposed {
                        frame = pad.width();
                        [rows, cols].map(|n| kernel.transposed_outputs(n, frame)).into()
                    } else {
                        frame = kernel.frame();
                        if pad != Padding::Valid {
                            map = Some(Resampler::new(Axis::padding(pad, rows), Axis::padding(pad, cols)));
                        }
                        let width = 2 * pad.width();
                        (kernel.outputs(rows + width), kernel.outputs(cols + width))
                    }
                }
                Kind::Dense { from, inputs, shape: made, .. } => {
                    let (rows, cols) = shape(*from);
                    let all = rows * cols * net.layers[*from].channels;
                    assert_eq!(all, *inputs, "a dense layer over all values of {rows}x{cols}");
                    *made
                }
                Kind::Resample { from, how, size } => {
                    let (rows, cols) = shape(*from);
                    let (to_rows, to_cols) = match *size {
                        Size::Times(n) => (rows * n, cols * n),
                        Size::Over(n) => (rows.div_ceil(n), cols.div_ceil(n)),
                        Size::Like(LayerId(other)) => shape(other),
                    };
                    let axis = |a, b| Axis::resampling(*how, a, b);
                    map = Some(Resampler::new(axis(rows, to_rows), axis(cols, to_cols)));
                    (to_rows, to_cols)
                }
                Kind::Add(a, b) | Kind::Concat(a, b) => {
                    assert_eq!(shape(*a), shape(*b), "layers of one size");
                    shape(*a)
                }
                Kind::Dropout { from, .. } => shape(*from),
            };
            let planes = |channels: usize, border: usize| {
                (0..images).map(|_| Plane::zeros(rows, cols, channels, border)).collect::<Vec<_>>()
            };
            let mut slot = Slot {
                value: planes(layer.channels, 0),
                delta: planes(layer.channels, frame),
                ..Slot::default()
            };
            if let Kind::Conv { from, conv, kernel } = &layer.kind {
                let channels = net.layers[*from].channels;
                let framed = match &map {
                    Some(map) => Some((map.shape(), 0)),
                    None => conv.transposed.then(|| (shape(*from), kernel.frame())),
                };
                if let Some(((rows, cols), border)) = framed {
                    slot.framed = (0..images).map(|_| Plane::zeros(rows, cols, channels, border)).collect();
                }
                if conv.norm.is_some() {
                    (slot.unit, slot.unit_delta) = (planes(layer.channels, 0), planes(layer.channels, 0));
                }
            }
            slot.map = map;
            slots.push(slot);
        }
        assert!(inputs.next().is_none(), "a size for each input");
        Self { net: net.clone(), images, slots }
    }

    /// An image of an input layer, to be written before a pass.
    pub(crate) fn input_mut(&mut self, layer: LayerId, image: usize) -> &mut Plane {
        &mut self.slots[layer.0].value[image]
    }

    /// What a layer gave.
    #[must_use]
    pub(crate) fn value(&self, layer: LayerId, image: usize) -> &Plane {
        &self.slots[layer.0].value[image]
    }

    /// What the net gave.
    #[must_use]
    pub(crate) fn output(&self, image: usize) -> &Plane {
        &self.last().value[image]
    }

    fn last(&self) -> &Slot {
        &self.slots[self.slots.len() - 1]
    }

    /// Where the gradient of the output goes before [`backward`](Self::backward).
    pub(crate) fn output_delta(&mut self, image: usize) -> &mut Plane {
        let last = self.slots.len() - 1;
        &mut self.slots[last].delta[image]
    }

    /// The gradient of a layer's value that a pass back gave: for inputs, when it was asked for.
    #[must_use]
    pub(crate) fn delta(&self, layer: LayerId, image: usize) -> &Plane {
        &self.slots[layer.0].delta[image]
    }

    /// Images of a pass.
    #[must_use]
    pub(crate) const fn images(&self) -> usize {
        self.images
    }

    /// The net of these buffers.
    #[must_use]
    pub(crate) const fn net(&self) -> &Net {
        &self.net
    }

    /// Draws what the next passes drop.
    pub(crate) fn draw_dropout(&mut self, stream: &mut Stream) {
        for (layer, slot) in self.net.layers.iter().zip(&mut self.slots) {
            if let Kind::Dropout { rate, .. } = layer.kind {
                let factor = (1.0 - rate).recip();
                let mut draw = |_| if stream.random::<f32>() < rate { 0.0 } else { factor };
                slot.kept = slot
                    .value
                    .iter()
                    .map(|plane| (0..plane.values().len()).map(&mut draw).collect())
                    .collect();
            }
        }
    }

    /// Keeps everything from now on: for use after a training.
    pub(crate) fn keep_all(&mut self) {
        self.slots.iter_mut().for_each(|slot| slot.kept.clear());
    }

    /// The factors that a dropout drew, by image.
    #[cfg(test)]
    pub(super) fn kept(&self, layer: LayerId) -> &[Vec<f32>] {
        &self.slots[layer.0].kept
    }

    /// From the inputs to the output. `running`: where the moments of batch normalisations are mixed in.
    ///
    /// # Panics
    /// When the values are not those of the net.
    pub(crate) fn forward(&mut self, values: &[f32], mut running: Option<&mut [Moments]>) {
        assert_eq!(values.len(), self.net.value_count(), "values of this net");
        let mut normalised = 0;
        for (i, layer) in self.net.layers.iter().enumerate() {
            let (below, rest) = self.slots.split_at_mut(i);
            let slot = &mut rest[0];
            let [weights, bias, gains] = layer.places.clone().map(|place| &values[place]);
            match &layer.kind {
                Kind::Input => {}
                Kind::Conv { from, conv, kernel } => {
                    slot.read(&below[*from].value);
                    let inputs = if slot.framed.is_empty() { &below[*from].value } else { &slot.framed };
                    let leak = conv.activation.leak();
                    let Some(norm) = conv.norm else {
                        for (input, value) in inputs.iter().zip(&mut slot.value) {
                            conv.sum(kernel, input, weights, value, Finish::Activate { bias, leak });
                        }
                        bend(conv.activation, &mut slot.value);
                        continue;
                    };
                    for (input, unit) in inputs.iter().zip(&mut slot.unit) {
                        conv.sum(kernel, input, weights, unit, Finish::Store);
                    }
                    slot.scales.clear();
                    for set in norm.sets(self.images) {
                        let (unit, value) = (&mut slot.unit[set.clone()], &mut slot.value[set]);
                        let affine = Affine { gains, offsets: bias, leak };
                        let moments = norm::normalise(norm, unit, affine, value);
                        slot.scales.push(moments.scales());
                        if norm == super::Norm::Batch {
                            if let Some(running) = &mut running {
                                running[normalised]
                                    .mix(&moments, self.images * unit[0].rows() * unit[0].cols());
                            }
                            normalised += 1;
                        }
                    }
                }
                Kind::Dense { from, activation, .. } => {
                    let input = flat(&below[*from].value);
                    let mut out = Plane::zeros(self.images, 1, bias.len(), 0);
                    let finish = Finish::Activate { bias, leak: activation.leak() };
                    DOT.convolve(&input, weights, &mut out, finish);
                    unflatten(&out, &mut slot.value, false);
                    bend(*activation, &mut slot.value);
                }
                Kind::Resample { from, .. } => {
                    let map = slot.map.as_ref().expect("the map of a resampling");
                    for (from, to) in below[*from].value.iter().zip(&mut slot.value) {
                        map.forward(from, to);
                    }
                }
                Kind::Add(a, b) => add_two(&below[*a].value, &below[*b].value, &mut slot.value),
                Kind::Concat(a, b) => join(&below[*a].value, &below[*b].value, &mut slot.value),
                Kind::Dropout { from, .. } => {
                    drop_some(&below[*from].value, &slot.kept, &mut slot.value, false)
                }
            }
        }
    }

    /// From the [gradient of the output](Self::output_delta) to those of all layers: adds to `gradient` (as the net's values), and
    /// makes those of the inputs when they are asked for.
    pub(crate) fn backward(&mut self, values: &[f32], gradient: Option<&mut [f32]>, inputs: bool) {
        self.back(Way::Output, values, gradient, inputs);
    }

    fn back(&mut self, way: Way, values: &[f32], mut gradient: Option<&mut [f32]>, inputs: bool) {
        // Of each layer whether its gradient is there, and already that of what stood before the activation.
        let mut state: Vec<Option<bool>> = vec![None; self.slots.len()];
        if way == Way::Output {
            *state.last_mut().expect("a layer") = Some(false);
        }
        for (i, layer) in self.net.layers.iter().enumerate().rev() {
            let (below, rest) = self.slots.split_at_mut(i);
            let slot = &mut rest[0];
            let curved = way == Way::Tangent && layer.kind.is_curved();
            if state[i].is_none() && curved {
                slot.pair.mu.iter_mut().for_each(|mu| mu.values_mut().fill(0.0));
                state[i] = Some(true);
            }
            let Some(damped) = state[i] else { continue };
            let activation = layer.kind.activation();
            if !damped && activation != Activation::None {
                let Slot { value, delta, pair, .. } = &mut *slot;
                damp(activation, value, if way == Way::Output { delta } else { &mut pair.mu });
            }
            if curved && activation.is_curved() {
                slot.bend_further(activation);
            }
            let [weights, biases, gains] = layer.places.clone();
            match &layer.kind {
                Kind::Input => {}
                Kind::Conv { from, conv, kernel } => {
                    slot.back_through_norm(way, conv, &values[gains.clone()], self.images, |sums| {
                        if let Some(gradient) = gradient.as_deref_mut() {
                            add(&mut gradient[biases.clone()], &sums.offset);
                            add(&mut gradient[gains.clone()], &sums.gain);
                        }
                    });
                    let (read, grads) = slot.read_and_gradients(way, &below[*from].value);
                    if let Some(gradient) = gradient.as_deref_mut() {
                        if conv.norm.is_none() {
                            add(&mut gradient[biases], &channel_sums(grads));
                        }
                        for (input, grad) in read.iter().zip(grads) {
                            conv.add_weight_gradient(kernel, input, grad, &mut gradient[weights.clone()]);
                        }
                    }
                    if !inputs && self.net.layers[*from].kind == Kind::Input {
                        continue;
                    }
                    let weights = &values[weights];
                    let there = state[*from].is_some();
                    let alone = self.net.layers[*from].readers == 1;
                    let before = self.net.layers[*from].kind.activation();
                    let sum = (conv, kernel, weights);
                    let done = slot.back_into(way, sum, &mut below[*from], there, alone, before);
                    state[*from] = Some(done);
                }
                Kind::Dense { from, .. } => {
                    let grad = flat(slot.gradients(way));
                    let input = flat(&below[*from].value);
                    if let Some(gradient) = gradient.as_deref_mut() {
                        add(&mut gradient[biases], &channel_sums(std::slice::from_ref(&grad)));
                        DOT.add_weight_gradient(&input, &grad, &mut gradient[weights.clone()]);
                    }
                    let mut out = Plane::zeros(self.images, 1, input.channels(), 0);
                    DOT.input_gradient(&grad, &values[weights], &mut out, Finish::Store);
                    let there = state[*from].is_some();
                    unflatten(&out, below[*from].gradients(way), there);
                    state[*from] = Some(false);
                }
                Kind::Resample { from, .. } => {
                    let there = state[*from].replace(false).is_some();
                    let (map, grads) = slot.map_and_gradients(way);
                    for (grad, to) in grads.iter().zip(below[*from].gradients(way)) {
                        map.backward(grad, to, there);
                    }
                }
                Kind::Add(a, b) => {
                    for layer in [*a, *b] {
                        let there = state[layer].replace(false).is_some();
                        part(slot.gradients(way), 0, below[layer].gradients(way), there);
                    }
                }
                Kind::Concat(a, b) => {
                    let first = self.net.layers[*a].channels;
                    for (layer, at) in [(*a, 0), (*b, first)] {
                        let there = state[layer].replace(false).is_some();
                        part(slot.gradients(way), at, below[layer].gradients(way), there);
                    }
                }
                Kind::Dropout { from, .. } => {
                    let there = state[*from].replace(false).is_some();
                    let (kept, grads) = slot.kept_and_gradients(way);
                    drop_some(grads, kept, below[*from].gradients(way), there);
                }
            }
        }
    }

    /// Where the direction of an input goes before [`tangent`](Self::tangent).
    pub(crate) fn direction_mut(&mut self, layer: LayerId, image: usize) -> &mut Plane {
        self.prepare_pair();
        &mut self.slots[layer.0].pair.tangent[image]
    }

    fn prepare_pair(&mut self) {
        if !self.last().pair.tangent.is_empty() {
            return;
        }
        for (layer, slot) in self.net.layers.iter().zip(&mut self.slots) {
            slot.pair.tangent = slot.value.clone();
            slot.pair.mu = slot.delta.clone();
            slot.pair.framed = slot.framed.clone();
            if layer.kind.is_curved() {
                slot.pair.moved = slot.value.clone();
                slot.pair.scratch = slot.value.clone();
            }
        }
    }

    /// From the directions of the inputs to the derivative of the layers along them.
    ///
    /// The output's own is left out where [`add_tangent_gradient`](Self::add_tangent_gradient) does not need it: where
    /// it is not curved.
    ///
    /// # Panics
    /// When the values are not those of the net.
    pub(crate) fn tangent(&mut self, values: &[f32]) {
        self.prepare_pair();
        let last = self.net.layers.len() - 1;
        for (i, layer) in self.net.layers.iter().enumerate() {
            if i == last && !layer.kind.is_curved() {
                continue;
            }
            let (below, rest) = self.slots.split_at_mut(i);
            let Slot { value, map, unit, scales, kept, pair, .. } = &mut rest[0];
            let [weights, _, gains] = layer.places.clone().map(|place| &values[place]);
            match &layer.kind {
                Kind::Input => {}
                Kind::Conv { from, conv, kernel } => {
                    let from = &below[*from].pair.tangent;
                    fill_frames(map.as_ref(), from, &mut pair.framed);
                    let inputs = if pair.framed.is_empty() { from } else { &pair.framed };
                    if !layer.kind.is_curved() {
                        let all = inputs.iter().zip(value.iter()).zip(&mut pair.tangent);
                        for ((input, value), tangent) in all {
                            let finish = match conv.activation {
                                Activation::Leaky(leak) => Finish::Damp { by: value.values(), leak },
                                _ => Finish::Store,
                            };
                            conv.sum(kernel, input, weights, tangent, finish);
                        }
                        continue;
                    }
                    for (input, moved) in inputs.iter().zip(&mut pair.moved) {
                        conv.sum(kernel, input, weights, moved, Finish::Store);
                    }
                    let Some(norm) = conv.norm else {
                        bend_tangent(conv.activation, value, &pair.moved, &mut pair.tangent);
                        continue;
                    };
                    pair.projections.clear();
                    for (set, scales) in norm.sets(self.images).zip(scales.iter()) {
                        let unit = Unit { norm, values: &unit[set.clone()], scales, gains };
                        let (active, moved) = (&value[set.clone()], &mut pair.moved[set.clone()]);
                        let out = &mut pair.tangent[set];
                        pair.projections.push(unit.tangent(conv.activation.leak(), active, moved, out));
                    }
                }
                Kind::Dense { from, activation, .. } => {
                    let input = flat(&below[*from].pair.tangent);
                    let mut out = Plane::zeros(self.images, 1, layer.places[1].len(), 0);
                    DOT.convolve(&input, weights, &mut out, Finish::Store);
                    unflatten(&out, &mut pair.tangent, false);
                    if layer.kind.is_curved() {
                        pair.moved.clone_from(&pair.tangent);
                    }
                    damp(*activation, value, &mut pair.tangent);
                }
                Kind::Resample { from, .. } => {
                    let map = map.as_ref().expect("the map of a resampling");
                    for (from, to) in below[*from].pair.tangent.iter().zip(&mut pair.tangent) {
                        map.forward(from, to);
                    }
                }
                Kind::Add(a, b) => {
                    add_two(&below[*a].pair.tangent, &below[*b].pair.tangent, &mut pair.tangent);
                }
                Kind::Concat(a, b) => {
                    join(&below[*a].pair.tangent, &below[*b].pair.tangent, &mut pair.tangent);
                }
                Kind::Dropout { from, .. } => {
                    drop_some(&below[*from].pair.tangent, kept, &mut pair.tangent, false);
                }
            }
        }
    }

    /// Adds the parameters' gradient of the output's tangent, weighted as the output's gradient was in the last
    /// [`backward`](Self::backward): what that pass has left at every layer is the gradient of the tangent there, so that one sum
    /// over pixels is all there is to do; curved layers (normalised, tanh, sigmoid) send a gradient through the values below, too.
    pub(crate) fn add_tangent_gradient(&mut self, values: &[f32], gradient: &mut [f32]) {
        for (i, layer) in self.net.layers.iter().enumerate() {
            let (below, rest) = self.slots.split_at_mut(i);
            let (slot, weights) = (&rest[0], &mut gradient[layer.places[0].clone()]);
            match &layer.kind {
                Kind::Conv { from, conv, kernel } => {
                    let framed = !slot.framed.is_empty();
                    let inputs = if framed { &slot.pair.framed } else { &below[*from].pair.tangent };
                    for (input, delta) in inputs.iter().zip(&slot.delta) {
                        conv.add_weight_gradient(kernel, input, delta, weights);
                    }
                }
                Kind::Dense { from, .. } => {
                    let (input, delta) = (flat(&below[*from].pair.tangent), flat(&slot.delta));
                    DOT.add_weight_gradient(&input, &delta, weights);
                }
                _ => {}
            }
        }
        if self.net.layers.iter().any(|layer| layer.kind.is_curved()) {
            self.back(Way::Tangent, values, Some(gradient), false);
        }
    }
}
