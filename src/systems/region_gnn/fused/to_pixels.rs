//! Pixels receive from regions: their edges are at hand, so softmax, second layer, normalisation and what follows are
//! done block by block.

use super::super::edges::PassEdges;
use super::block::{EdgeBlock, EdgeGradients, Enc, PIXELS, Receivers, leaky};
use super::lanes::{
    State, add, add_scaled, add_to, dense_rows, dot, gated, load, outer, relu, store, times, unit,
    unit_gradient, with_registers, zero,
};
use super::layout::{MessageRanges, MlpRanges};
use super::pixel_states::{INDICATORS, PixelStates};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Inputs of both passes.
#[derive(Clone, Copy)]
pub(super) struct ToPixels<'a> {
    pub(super) edges: &'a PassEdges,
    pub(super) width: usize,
    /// All parameters, and where those of this layer and of MLP_3 lie.
    pub(super) params: &'a [f32],
    pub(super) ranges: &'a MessageRanges,
    pub(super) last: &'a MlpRanges,
    pub(super) enc: Enc<'a>,
    /// The states before this pass, for the attention.
    pub(super) states: PixelStates<'a>,
    /// (regions, H) what pooled regions add to the hidden states.
    pub(super) pooled: &'a [f32],
    pub(super) mean_pooling: bool,
    /// The part of every logit that no state changes.
    pub(super) constant: f32,
}

/// Buffers of one block of pixels.
struct Scratch {
    /// (PIXELS, H) each.
    rows: Vec<f32>,
    units: Vec<f32>,
    states: Vec<f32>,
    hidden: Vec<f32>,
    /// (PIXELS) each.
    scales: [f32; PIXELS],
    bias: [f32; PIXELS],
    reached: [bool; PIXELS],
}

impl Scratch {
    fn new(width: usize) -> Self {
        let rows = || vec![0.0; PIXELS * width];
        Self {
            rows: rows(),
            units: rows(),
            states: rows(),
            hidden: rows(),
            scales: [0.0; PIXELS],
            bias: [0.0; PIXELS],
            reached: [false; PIXELS],
        }
    }
}

impl ToPixels<'_> {
    fn get(&self, range: &Range<usize>) -> &[f32] {
        &self.params[range.clone()]
    }

    /// Weight of one region among those pooled at a pixel; masked ones count as zeros.
    fn pool_weight(&self, pixel: usize) -> f32 {
        if self.mean_pooling { 1.0 / self.edges.pixel_degree(pixel).max(1) as f32 } else { 1.0 }
    }

    /// Gathers the edges of `pixels` and computes their hidden states and, when they are wanted, whole logits.
    #[inline(always)]
    fn encode<S: Simd, const N: usize, const B: usize, const LOGITS: bool>(
        &self,
        simd: S,
        block: &mut EdgeBlock<'_>,
        pixels: Range<usize>,
        scratch: &mut Scratch,
    ) {
        block.gather(&pixels);
        let attend = load::<S, N>(self.get(&self.ranges.attend_state), 0);
        for (slot, pixel) in pixels.enumerate() {
            let edges = block.edges_of(slot);
            scratch.reached[slot] = !edges.is_empty();
            let mut pooled = zero(simd);
            for edge in edges {
                pooled = add(simd, &pooled, &load::<S, N>(self.pooled, block.region(edge)));
            }
            let weight = self.pool_weight(pixel);
            store::<S, N>(&mut scratch.rows, slot, &add_scaled(simd, &zero(simd), &pooled, weight));
            if LOGITS {
                let state = load::<S, N>(self.states.row(pixel, self.width), 0);
                scratch.bias[slot] = dot(simd, &state, &attend) + self.constant;
            }
        }
        block.encode::<S, N, B, LOGITS>(simd, &self.enc, &scratch.rows);
    }

    /// From attention means to normalised states: `scratch.states`, with units and scales on the way.
    #[inline(always)]
    fn finish<S: Simd, const N: usize, const B: usize>(&self, simd: S, mean: &[f32], scratch: &mut Scratch) {
        let count = mean.len() / self.width;
        let bias = load::<S, N>(self.get(&self.ranges.out_bias), 0);
        for slot in 0..count {
            // A node that nothing reaches gathers nothing, not even a bias.
            let start = if scratch.reached[slot] { bias } else { zero(simd) };
            store::<S, N>(&mut scratch.states, slot, &start);
        }
        let states = &mut scratch.states[..mean.len()];
        dense_rows::<S, N, B>(simd, mean, self.width, self.get(&self.ranges.out), states);
        if let Some((gain, offset)) = &self.ranges.norm {
            let (gain, offset) = (load::<S, N>(self.get(gain), 0), load::<S, N>(self.get(offset), 0));
            for slot in 0..count {
                let (unit, scale) = unit(simd, &load::<S, N>(states, slot));
                scratch.scales[slot] = scale;
                store::<S, N>(&mut scratch.units, slot, &unit);
                store::<S, N>(states, slot, &add(simd, &times(simd, &unit, &gain), &offset));
            }
        }
    }

    /// The hidden layer of MLP_3 over `scratch.states`.
    #[inline(always)]
    fn last_hidden<S: Simd, const N: usize, const B: usize>(
        &self,
        simd: S,
        count: usize,
        scratch: &mut Scratch,
    ) {
        let bias = load::<S, N>(self.get(&self.last.hidden_bias), 0);
        for slot in 0..count {
            store::<S, N>(&mut scratch.hidden, slot, &bias);
        }
        let (x, out) = (&scratch.states[..count * self.width], &mut scratch.hidden[..count * self.width]);
        dense_rows::<S, N, B>(simd, x, self.width, self.get(&self.last.hidden), out);
        for slot in 0..count {
            let hidden = relu(simd, &load::<S, N>(&scratch.hidden, slot));
            store::<S, N>(&mut scratch.hidden, slot, &hidden);
        }
    }
}

/// Where the states of one task go.
pub(super) enum Next<'a> {
    /// To another round: (pixels of the task, H), and their sum at each region.
    Round(&'a mut [f32]),
    /// Through MLP_3: (pixels of the task) heights.
    Heights(&'a mut [f32]),
}

/// One task of the forward pass; returns (regions, H) sums of the new states over the pixels of each region, empty after
/// the last round.
pub(super) struct Forward<'a> {
    pub(super) inputs: ToPixels<'a>,
    pub(super) pixels: Range<usize>,
    /// (pixels of the task, H)
    pub(super) mean: &'a mut [f32],
    /// (pixels of the task)
    pub(super) log_sums: &'a mut [f32],
    /// (room of the task's edges) whole logits, for the backward pass.
    pub(super) logits: &'a mut [f32],
    pub(super) next: Next<'a>,
}

impl WithSimd for Forward<'_> {
    type Output = Vec<f32>;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let width = self.inputs.width;
        with_registers!(simd, self, width)
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const B: usize>(mut self, simd: S) -> Vec<f32> {
        let inputs = self.inputs;
        let width = inputs.width;
        let mut pool = match self.next {
            Next::Round(_) => vec![0.0; inputs.enc.region.len()],
            Next::Heights(_) => Vec::new(),
        };
        let mut block = EdgeBlock::new(inputs.edges, width);
        let mut scratch = Scratch::new(width);
        let first = self.pixels.start;
        let mut start = first;
        while start < self.pixels.end && !self.inputs.edges.graph().stop().is_raised() {
            let pixels = start..self.pixels.end.min(start + PIXELS);
            start = pixels.end;
            let (count, local) = (pixels.len(), pixels.start - first);
            let room = block.room(&pixels, &self.pixels);
            inputs.encode::<S, N, B, true>(simd, &mut block, pixels, &mut scratch);
            let mean = &mut self.mean[local * width..(local + count) * width];
            let log_sums = &mut self.log_sums[local..local + count];
            attend_pixels::<S, N>(simd, &mut block, &scratch.bias, mean, log_sums);
            self.logits[room][..block.len()].copy_from_slice(&block.logits);
            inputs.finish::<S, N, B>(simd, mean, &mut scratch);
            match &mut self.next {
                Next::Round(states) => {
                    states[local * width..(local + count) * width]
                        .copy_from_slice(&scratch.states[..count * width]);
                    for slot in 0..count {
                        let state = load::<S, N>(&scratch.states, slot);
                        for edge in block.edges_of(slot) {
                            add_to::<S, N>(simd, &mut pool, block.region(edge), &state);
                        }
                    }
                }
                Next::Heights(heights) => {
                    inputs.last_hidden::<S, N, B>(simd, count, &mut scratch);
                    let out = load::<S, N>(inputs.get(&inputs.last.out), 0);
                    let bias = inputs.params[inputs.last.out_bias.start];
                    for slot in 0..count {
                        heights[local + slot] = dot(simd, &load::<S, N>(&scratch.hidden, slot), &out) + bias;
                    }
                }
            }
        }
        pool
    }
}

/// Softmax over the edges of each pixel: attention means and logarithms of the denominators, both 0 without edges.
#[inline(always)]
fn attend_pixels<S: Simd, const N: usize>(
    simd: S,
    block: &mut EdgeBlock<'_>,
    bias: &[f32; PIXELS],
    mean: &mut [f32],
    log_sums: &mut [f32],
) {
    let mut highest = [f32::NEG_INFINITY; PIXELS];
    for slot in 0..block.pixels() {
        let edges = block.edges_of(slot);
        for logit in &mut block.logits[edges.clone()] {
            *logit += bias[slot];
            highest[slot] = highest[slot].max(leaky(*logit));
        }
        block.weights[edges].fill(highest[slot]);
    }
    block.exponentiate();
    for slot in 0..block.pixels() {
        let (mut sum, mut total) = (zero(simd), 0.0);
        for edge in block.edges_of(slot) {
            let weight = block.weights[edge];
            total += weight;
            sum = add_scaled(simd, &sum, &load::<S, N>(&block.hidden, edge), weight);
        }
        let reached = total > 0.0;
        let scale = if reached { 1.0 / total } else { 0.0 };
        store::<S, N>(mean, slot, &add_scaled(simd, &zero(simd), &sum, scale));
        log_sums[slot] = if reached { highest[slot] + total.ln() } else { 0.0 };
    }
}

/// Where the gradient of one task's new states comes from.
pub(super) enum Source<'a> {
    /// The next round: (pixels of the task, H) by the states themselves, (regions, H) by their pooled sums.
    Round { states: &'a [f32], pool: &'a [f32] },
    /// MLP_3: (pixels of the task) gradient of the heights; its first layer transposed.
    Heights { heights: &'a [f32], hidden_transposed: &'a [f32] },
}

/// One task of the backward pass.
pub(super) struct Backward<'a> {
    pub(super) inputs: ToPixels<'a>,
    pub(super) pixels: Range<usize>,
    /// (pixels of the task, H) and (pixels of the task), as forward gave them.
    pub(super) mean: &'a [f32],
    pub(super) log_sums: &'a [f32],
    /// (room of the task's edges) as forward left them.
    pub(super) logits: &'a [f32],
    pub(super) source: Source<'a>,
    /// (H, H)
    pub(super) out_transposed: &'a [f32],
    /// (pixels of the task) gradient of the receiver's part of the logits.
    pub(super) d_bias: &'a mut [f32],
}

/// What one task adds to the gradients.
pub(super) struct BackwardPartial {
    /// Parameters used here: edge, second layer, attention on the receiver, normalisation, MLP_3.
    pub(super) params: Vec<f32>,
    /// (regions, H) of `enc.region`
    pub(super) region: Vec<f32>,
    /// (regions, H)
    pub(super) pooled: Vec<f32>,
    /// (H)
    pub(super) score: Vec<f32>,
    pub(super) constant: f32,
    /// Gradient of the logits by class of a table state.
    pub(super) class_bias: [f32; INDICATORS.len()],
}

impl WithSimd for Backward<'_> {
    type Output = BackwardPartial;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> BackwardPartial {
        let width = self.inputs.width;
        with_registers!(simd, self, width)
    }
}

impl Backward<'_> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const B: usize>(self, simd: S) -> BackwardPartial {
        let inputs = self.inputs;
        let (width, regions) = (inputs.width, inputs.enc.region.len());
        let mut sums = BackwardPartial {
            params: vec![0.0; inputs.params.len()],
            region: vec![0.0; regions],
            pooled: vec![0.0; regions],
            score: vec![0.0; width],
            constant: 0.0,
            class_bias: [0.0; INDICATORS.len()],
        };
        let mut block = EdgeBlock::new(inputs.edges, width);
        let mut scratch = Scratch::new(width);
        let (mut d, mut d_rows) = (vec![0.0; PIXELS * width], vec![0.0; PIXELS * width]);
        let first = self.pixels.start;
        let mut start = first;
        while start < self.pixels.end && !self.inputs.edges.graph().stop().is_raised() {
            let pixels = start..self.pixels.end.min(start + PIXELS);
            start = pixels.end;
            let (count, local) = (pixels.len(), pixels.start - first..pixels.end - first);
            let values = local.start * width..local.end * width;
            inputs.encode::<S, N, B, false>(simd, &mut block, pixels.clone(), &mut scratch);
            let logits = &self.logits[block.room(&pixels, &self.pixels)];
            let (mean, log_sums) = (&self.mean[values.clone()], &self.log_sums[local.clone()]);
            inputs.finish::<S, N, B>(simd, mean, &mut scratch);

            let d = &mut d[..count * width];
            match &self.source {
                Source::Round { states, pool } => {
                    d.copy_from_slice(&states[values]);
                    for slot in 0..count {
                        let mut sum = load::<S, N>(d, slot);
                        for edge in block.edges_of(slot) {
                            sum = add(simd, &sum, &load::<S, N>(pool, block.region(edge)));
                        }
                        store::<S, N>(d, slot, &sum);
                    }
                }
                Source::Heights { heights, hidden_transposed } => {
                    let heights = &heights[local.clone()];
                    back_through_last::<S, N, B>(
                        simd,
                        &inputs,
                        heights,
                        hidden_transposed,
                        &mut scratch,
                        &mut sums.params,
                        d,
                    );
                }
            }
            back_through_norm::<S, N>(simd, &inputs, &scratch, d, &mut sums.params);

            let out = &mut sums.params[inputs.ranges.out.clone()];
            outer::<S, N, B>(simd, mean, width, d, out);
            let out_bias = &mut sums.params[inputs.ranges.out_bias.clone()];
            for slot in 0..count {
                if scratch.reached[slot] {
                    add_to::<S, N>(simd, out_bias, 0, &load::<S, N>(d, slot));
                }
            }
            let d_mean = &mut scratch.states[..count * width];
            d_mean.fill(0.0);
            dense_rows::<S, N, B>(simd, d, width, self.out_transposed, d_mean);
            let mut means = [0.0; PIXELS];
            for slot in 0..count {
                means[slot] = dot(simd, &load::<S, N>(d_mean, slot), &load::<S, N>(mean, slot));
            }

            let d_rows = &mut d_rows[..count * width];
            d_rows.fill(0.0);
            let d_bias = &mut self.d_bias[local];
            d_bias.fill(0.0);
            let receivers = Receivers { grad: d_mean, means: &means, log_sums };
            let mut edge_sums = EdgeGradients {
                region: &mut sums.region,
                pixel: d_rows,
                bias: d_bias,
                edge: &mut sums.params[inputs.ranges.edge.clone()],
                score: &mut sums.score,
            };
            block.backward::<S, N, B, false>(simd, &inputs.enc, logits, &receivers, &mut edge_sums);

            let attend = &mut sums.params[inputs.ranges.attend_state.clone()];
            let mut d_attend = load::<S, N>(attend, 0);
            for (slot, pixel) in pixels.enumerate() {
                let row = load::<S, N>(d_rows, slot);
                let weight = inputs.pool_weight(pixel);
                store::<S, N>(d_rows, slot, &add_scaled(simd, &zero(simd), &row, weight));
                let state = load::<S, N>(inputs.states.row(pixel, width), 0);
                d_attend = add_scaled(simd, &d_attend, &state, d_bias[slot]);
                sums.constant += d_bias[slot];
                if let PixelStates::Table { class, .. } = inputs.states {
                    sums.class_bias[usize::from(class[pixel])] += d_bias[slot];
                }
            }
            store::<S, N>(attend, 0, &d_attend);
            for slot in 0..count {
                let row = load::<S, N>(d_rows, slot);
                for edge in block.edges_of(slot) {
                    add_to::<S, N>(simd, &mut sums.pooled, block.region(edge), &row);
                }
            }
        }
        sums
    }
}

/// From the gradient of the heights to that of the states, `d`.
#[inline(always)]
fn back_through_last<S: Simd, const N: usize, const B: usize>(
    simd: S,
    inputs: &ToPixels<'_>,
    heights: &[f32],
    hidden_transposed: &[f32],
    scratch: &mut Scratch,
    params: &mut [f32],
    d: &mut [f32],
) {
    let (width, count) = (inputs.width, heights.len());
    inputs.last_hidden::<S, N, B>(simd, count, scratch);
    let out = load::<S, N>(inputs.get(&inputs.last.out), 0);
    let mut d_out = load::<S, N>(&params[inputs.last.out.clone()], 0);
    let mut d_hidden_bias = load::<S, N>(&params[inputs.last.hidden_bias.clone()], 0);
    for slot in 0..count {
        let hidden: State<S, N> = load::<S, N>(&scratch.hidden, slot);
        d_out = add_scaled(simd, &d_out, &hidden, heights[slot]);
        let d_hidden = gated(simd, &add_scaled(simd, &zero(simd), &out, heights[slot]), &hidden);
        d_hidden_bias = add(simd, &d_hidden_bias, &d_hidden);
        store::<S, N>(&mut scratch.hidden, slot, &d_hidden);
        params[inputs.last.out_bias.start] += heights[slot];
    }
    store::<S, N>(&mut params[inputs.last.out.clone()], 0, &d_out);
    store::<S, N>(&mut params[inputs.last.hidden_bias.clone()], 0, &d_hidden_bias);
    let (states, d_hidden) = (&scratch.states[..count * width], &scratch.hidden[..count * width]);
    outer::<S, N, B>(simd, states, width, d_hidden, &mut params[inputs.last.hidden.clone()]);
    d.fill(0.0);
    dense_rows::<S, N, B>(simd, d_hidden, width, hidden_transposed, d);
}

/// From the gradient of the normalised states to that of what was normalised, in place.
#[inline(always)]
fn back_through_norm<S: Simd, const N: usize>(
    simd: S,
    inputs: &ToPixels<'_>,
    scratch: &Scratch,
    d: &mut [f32],
    params: &mut [f32],
) {
    let Some((gain_range, offset_range)) = &inputs.ranges.norm else { return };
    let gain = load::<S, N>(inputs.get(gain_range), 0);
    let mut d_gain = load::<S, N>(&params[gain_range.clone()], 0);
    let mut d_offset = load::<S, N>(&params[offset_range.clone()], 0);
    for slot in 0..d.len() / inputs.width {
        let grad = load::<S, N>(d, slot);
        let unit = load::<S, N>(&scratch.units, slot);
        d_gain = add(simd, &d_gain, &times(simd, &grad, &unit));
        d_offset = add(simd, &d_offset, &grad);
        let by_unit = times(simd, &grad, &gain);
        store::<S, N>(d, slot, &unit_gradient(simd, &unit, scratch.scales[slot], &by_unit));
    }
    store::<S, N>(&mut params[gain_range.clone()], 0, &d_gain);
    store::<S, N>(&mut params[offset_range.clone()], 0, &d_offset);
}
