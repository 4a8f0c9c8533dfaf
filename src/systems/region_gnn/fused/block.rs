//! The edges of a few pixels, gathered into dense rows, and their hidden states.

use super::super::edge_features::EdgeFeatures;
use super::super::edges::PassEdges;
use super::lanes::{
    State, add, add_scaled, add_to, dense_columns, dot, gated, load, outer_columns, relu, store, zero,
};
use crate::learn::exp;
use pulp::Simd;
use std::ops::Range;

pub(super) use super::super::edges::BLOCK as PIXELS;
/// Slope of the leaky ReLU in graph attention (Velickovic et al. 2018).
pub(in super::super) const LEAK: f32 = 0.2;

/// Unmasked edges of up to [`PIXELS`] pixels, in pixel order.
pub(super) struct EdgeBlock {
    width: usize,
    features: EdgeFeatures,
    /// Room for edges: the length of a row of `columns`.
    stride: usize,
    /// (stored, stride)
    stored: Vec<f32>,
    /// (features + 1, stride), the last row for the noise.
    columns: Vec<f32>,
    /// (edges)
    pub(super) regions: Vec<u32>,
    /// (edges) which pixel of the block.
    pub(super) slots: Vec<u32>,
    /// (edges, H) hidden states `relu(pixel + region + W f)`.
    pub(super) hidden: Vec<f32>,
    /// (edges) attention logits before the leaky ReLU.
    pub(super) logits: Vec<f32>,
    /// (edges) attention weights.
    pub(super) weights: Vec<f32>,
    /// (edges) gradients of the logits.
    pulls: Vec<f32>,
}

/// What the hidden state of an edge is made of.
#[derive(Clone, Copy)]
pub(super) struct Enc<'a> {
    /// (regions, H) all that depends on the region.
    pub(super) region: &'a [f32],
    /// (features + 1, H), the last row for the noise.
    pub(super) edge: &'a [f32],
    /// (H) attention on the hidden state.
    pub(super) score: &'a [f32],
}

impl EdgeBlock {
    pub(super) fn new(edges: &PassEdges, width: usize) -> Self {
        let features = edges.graph().features();
        let stride = edges.most_edges_of_a_block().next_multiple_of(16);
        Self {
            width,
            features,
            stride,
            stored: vec![0.0; features.stored_count() * stride],
            columns: vec![0.0; (features.feature_count() + 1) * stride],
            regions: Vec::with_capacity(stride),
            slots: Vec::with_capacity(stride),
            hidden: Vec::with_capacity(stride * width),
            logits: Vec::with_capacity(stride),
            weights: Vec::with_capacity(stride),
            pulls: Vec::with_capacity(stride),
        }
    }

    /// Number of edges.
    pub(super) fn len(&self) -> usize {
        self.regions.len()
    }

    /// Collects the unmasked edges of `pixels` and makes their features.
    #[inline(always)]
    pub(super) fn gather(&mut self, edges: &PassEdges, pixels: Range<usize>) {
        self.regions.clear();
        self.slots.clear();
        let (made, noises) = self.columns.split_at_mut(self.features.feature_count() * self.stride);
        for (slot, pixel) in pixels.enumerate() {
            edges.each_of(pixel, |region, noise, stored| {
                let edge = self.regions.len();
                self.regions.push(region);
                self.slots.push(slot as u32);
                noises[edge] = noise;
                for (column, value) in self.stored.chunks_exact_mut(self.stride).zip(stored) {
                    column[edge] = *value;
                }
            });
        }
        self.features.expand(&self.stored, self.stride, made);
    }

    /// Hidden states, and the logits without their receiver's part. `pixel`: (pixels of the block, H).
    #[inline(always)]
    pub(super) fn encode<S: Simd, const N: usize, const B: usize>(
        &mut self,
        simd: S,
        enc: &Enc<'_>,
        pixel: &[f32],
    ) {
        let edges = self.len();
        self.hidden.resize(edges * self.width, 0.0);
        self.logits.resize(edges, 0.0);
        self.weights.resize(edges, 0.0);
        let score = load::<S, N>(enc.score, 0);
        let mut edge = 0;
        while edge + B <= edges {
            self.encode_some::<S, N, B>(simd, enc, pixel, &score, edge);
            edge += B;
        }
        while edge < edges {
            self.encode_some::<S, N, 1>(simd, enc, pixel, &score, edge);
            edge += 1;
        }
    }

    #[inline(always)]
    fn encode_some<S: Simd, const N: usize, const B: usize>(
        &mut self,
        simd: S,
        enc: &Enc<'_>,
        pixel: &[f32],
        score: &State<S, N>,
        first: usize,
    ) {
        let mut sums = [zero::<S, N>(simd); B];
        for b in 0..B {
            let base = load::<S, N>(pixel, self.slots[first + b] as usize);
            let region = load::<S, N>(enc.region, self.regions[first + b] as usize);
            sums[b] = add(simd, &base, &region);
        }
        dense_columns::<S, N, B>(simd, &mut sums, &self.columns, self.stride, first, enc.edge);
        for b in 0..B {
            let hidden = relu(simd, &sums[b]);
            self.logits[first + b] = dot(simd, &hidden, score);
            store::<S, N>(&mut self.hidden, first + b, &hidden);
        }
    }

    /// Turns `weights`, holding what is taken from each score, into `exp(leaky(logit) - weight)`.
    #[inline(always)]
    pub(super) fn exponentiate(&mut self) {
        for (weight, logit) in self.weights.iter_mut().zip(&self.logits) {
            *weight = exp(leaky(*logit) - *weight);
        }
    }

    /// Back through attention and hidden states of an encoded block; the hidden states are lost.
    ///
    /// A receiving node is the region of an edge, or its pixel within the block.
    #[inline(always)]
    pub(super) fn backward<S: Simd, const N: usize, const B: usize, const TO_REGIONS: bool>(
        &mut self,
        simd: S,
        enc: &Enc<'_>,
        receivers: &Receivers<'_>,
        sums: &mut EdgeGradients<'_>,
    ) {
        let edges = self.len();
        self.pulls.resize(edges, 0.0);
        for edge in 0..edges {
            let node = if TO_REGIONS { self.regions[edge] } else { self.slots[edge] } as usize;
            let hidden = load::<S, N>(&self.hidden, edge);
            let grad = load::<S, N>(receivers.grad, node);
            self.pulls[edge] = dot(simd, &grad, &hidden) - receivers.means[node];
            self.logits[edge] += receivers.bias[node];
            self.weights[edge] = receivers.log_sums[node];
        }
        self.exponentiate();
        for ((pull, weight), logit) in self.pulls.iter_mut().zip(&self.weights).zip(&self.logits) {
            *pull *= weight * if *logit > 0.0 { 1.0 } else { LEAK };
        }
        let score = load::<S, N>(enc.score, 0);
        let mut d_score = load::<S, N>(sums.score, 0);
        for edge in 0..edges {
            let (region, slot) = (self.regions[edge] as usize, self.slots[edge] as usize);
            let node = if TO_REGIONS { region } else { slot };
            let hidden = load::<S, N>(&self.hidden, edge);
            let grad = load::<S, N>(receivers.grad, node);
            let d_logit = self.pulls[edge];
            sums.bias[node] += d_logit;
            d_score = add_scaled(simd, &d_score, &hidden, d_logit);
            let d = add_scaled(simd, &zero(simd), &grad, self.weights[edge]);
            let d = gated(simd, &add_scaled(simd, &d, &score, d_logit), &hidden);
            add_to::<S, N>(simd, sums.region, region, &d);
            add_to::<S, N>(simd, sums.pixel, slot, &d);
            store::<S, N>(&mut self.hidden, edge, &d);
        }
        store::<S, N>(sums.score, 0, &d_score);
        outer_columns::<S, N, B>(simd, &self.columns, self.stride, &self.hidden, sums.edge);
    }
}

/// The receiving nodes of a backward pass.
#[derive(Clone, Copy)]
pub(super) struct Receivers<'a> {
    /// (nodes, H) gradient of the attention mean.
    pub(super) grad: &'a [f32],
    /// (nodes) grad . mean: what the softmax gradient takes off.
    pub(super) means: &'a [f32],
    /// (nodes) the node's part of the logit.
    pub(super) bias: &'a [f32],
    /// (nodes) logarithm of the softmax denominator.
    pub(super) log_sums: &'a [f32],
}

/// Where the gradients of a block's edges are summed.
pub(super) struct EdgeGradients<'a> {
    /// (regions, H)
    pub(super) region: &'a mut [f32],
    /// (pixels of the block, H)
    pub(super) pixel: &'a mut [f32],
    /// (receiving nodes)
    pub(super) bias: &'a mut [f32],
    /// (features + 1, H)
    pub(super) edge: &'a mut [f32],
    /// (H)
    pub(super) score: &'a mut [f32],
}

#[inline(always)]
pub(super) fn leaky(t: f32) -> f32 {
    if t > 0.0 { t } else { LEAK * t }
}
