//! The edges of a few pixels, gathered into dense rows, and their hidden states.

use super::super::edge_features::EdgeFeatures;
use super::super::edges::{BlockEdges, PassEdges};
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
pub(super) struct EdgeBlock<'a> {
    all: &'a PassEdges,
    /// Those of the block.
    edges: BlockEdges<'a>,
    width: usize,
    features: EdgeFeatures,
    /// (stride) pixel within the block and size of the part of every edge.
    slots: Vec<u32>,
    sizes: Vec<f32>,
    /// (features + 1, stride), the last row for the noise.
    columns: Vec<f32>,
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

impl<'a> EdgeBlock<'a> {
    /// Takes up the first block.
    pub(super) fn new(all: &'a PassEdges, width: usize) -> Self {
        let features = all.graph().features();
        let most = all.longest_stride();
        Self {
            all,
            edges: all.block(0),
            width,
            features,
            slots: vec![0; most],
            sizes: vec![0.0; most],
            columns: vec![0.0; (features.feature_count() + 1) * most],
            hidden: Vec::with_capacity(most * width),
            logits: Vec::with_capacity(most),
            weights: Vec::with_capacity(most),
            pulls: Vec::with_capacity(most),
        }
    }

    /// Number of edges.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.edges.len
    }

    /// Region of an edge.
    #[inline(always)]
    pub(super) fn region(&self, edge: usize) -> usize {
        self.edges.regions[edge] as usize
    }

    /// Number of pixels.
    #[inline(always)]
    pub(super) fn pixels(&self) -> usize {
        self.edges.ends.len()
    }

    /// Edges of a pixel of the block.
    #[inline(always)]
    pub(super) fn edges_of(&self, slot: usize) -> Range<usize> {
        let start = if slot == 0 { 0 } else { self.edges.ends[slot - 1] };
        start as usize..self.edges.ends[slot] as usize
    }

    /// Where the edges of `pixels` lie in a list with room for those of a task.
    #[inline(always)]
    pub(super) fn room(&self, pixels: &Range<usize>, task: &Range<usize>) -> Range<usize> {
        let (room, first) = (self.all.room(pixels), self.all.room(task).start);
        room.start - first..room.end - first
    }

    /// (features + 1, stride)
    #[inline(always)]
    fn columns(&self) -> &[f32] {
        &self.columns[..(self.features.feature_count() + 1) * self.edges.stride]
    }

    /// Takes up the edges of `pixels`, which begin at a multiple of [`PIXELS`], and makes their features.
    #[inline(always)]
    pub(super) fn gather(&mut self, pixels: &Range<usize>) {
        self.edges = self.all.block(pixels.start / PIXELS);
        let stride = self.edges.stride;
        for slot in 0..self.pixels() {
            let edges = self.edges_of(slot);
            self.slots[edges].fill(slot as u32);
        }
        // Beyond the edges any pixel of the block will do.
        self.slots[self.edges.len..].fill(0);
        let sizes = self.all.graph().sizes();
        for (size, region) in self.sizes.iter_mut().zip(self.edges.regions) {
            *size = sizes[*region as usize];
        }
        let (stored, noise) = self.edges.columns.split_at(self.features.stored_count() * stride);
        let (made, rest) = self.columns.split_at_mut(self.features.feature_count() * stride);
        self.features.expand(stored, &self.sizes, stride, made);
        rest[..stride].copy_from_slice(noise);
    }

    /// Hidden states and, when they are wanted, the logits without their receiver's part. `pixel`: (pixels of the block, H).
    #[inline(always)]
    pub(super) fn encode<S: Simd, const N: usize, const B: usize, const LOGITS: bool>(
        &mut self,
        simd: S,
        enc: &Enc<'_>,
        pixel: &[f32],
    ) {
        // Whole groups: beyond the edges there is room up to a multiple of every group's size.
        let room = self.len().next_multiple_of(B);
        self.hidden.resize(room * self.width, 0.0);
        self.logits.resize(room, 0.0);
        let score = load::<S, N>(enc.score, 0);
        for first in (0..room).step_by(B) {
            self.encode_some::<S, N, B, LOGITS>(simd, enc, pixel, &score, first);
        }
        self.hidden.truncate(self.len() * self.width);
        self.logits.truncate(self.len());
        self.weights.resize(self.len(), 0.0);
    }

    #[inline(always)]
    fn encode_some<S: Simd, const N: usize, const B: usize, const LOGITS: bool>(
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
            let region = load::<S, N>(enc.region, self.region(first + b));
            sums[b] = add(simd, &base, &region);
        }
        dense_columns::<S, N, B>(simd, &mut sums, self.columns(), self.edges.stride, first, enc.edge);
        for b in 0..B {
            let hidden = relu(simd, &sums[b]);
            if LOGITS {
                self.logits[first + b] = dot(simd, &hidden, score);
            }
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

    /// Back through attention and hidden states of an encoded block; the hidden states are lost. `logits`: (edges) whole ones, as
    /// the forward pass left them.
    ///
    /// A receiving node is the region of an edge, or its pixel within the block.
    #[inline(always)]
    pub(super) fn backward<S: Simd, const N: usize, const B: usize, const TO_REGIONS: bool>(
        &mut self,
        simd: S,
        enc: &Enc<'_>,
        logits: &[f32],
        receivers: &Receivers<'_>,
        sums: &mut EdgeGradients<'_>,
    ) {
        let logits = &logits[..self.len()];
        self.logits.copy_from_slice(logits);
        self.pulls.resize(self.len(), 0.0);
        for slot in 0..self.pixels() {
            for edge in self.edges_of(slot) {
                let node = if TO_REGIONS { self.region(edge) } else { slot };
                let hidden = load::<S, N>(&self.hidden, edge);
                let grad = load::<S, N>(receivers.grad, node);
                self.pulls[edge] = dot(simd, &grad, &hidden) - receivers.means[node];
                self.weights[edge] = receivers.log_sums[node];
            }
        }
        self.exponentiate();
        for ((pull, weight), logit) in self.pulls.iter_mut().zip(&self.weights).zip(&self.logits) {
            *pull *= weight * if *logit > 0.0 { 1.0 } else { LEAK };
        }
        let score = load::<S, N>(enc.score, 0);
        let mut d_score = load::<S, N>(sums.score, 0);
        for slot in 0..self.pixels() {
            let mut d_pixel = load::<S, N>(sums.pixel, slot);
            for edge in self.edges_of(slot) {
                let region = self.region(edge);
                let node = if TO_REGIONS { region } else { slot };
                let hidden = load::<S, N>(&self.hidden, edge);
                let grad = load::<S, N>(receivers.grad, node);
                let d_logit = self.pulls[edge];
                sums.bias[node] += d_logit;
                d_score = add_scaled(simd, &d_score, &hidden, d_logit);
                let d = add_scaled(simd, &zero(simd), &grad, self.weights[edge]);
                let d = gated(simd, &add_scaled(simd, &d, &score, d_logit), &hidden);
                add_to::<S, N>(simd, sums.region, region, &d);
                d_pixel = add(simd, &d_pixel, &d);
                store::<S, N>(&mut self.hidden, edge, &d);
            }
            store::<S, N>(sums.pixel, slot, &d_pixel);
        }
        store::<S, N>(sums.score, 0, &d_score);
        outer_columns::<S, N>(simd, self.columns(), self.edges.stride, &self.hidden, sums.edge);
    }
}

/// The receiving nodes of a backward pass.
#[derive(Clone, Copy)]
pub(super) struct Receivers<'a> {
    /// (nodes, H) gradient of the attention mean.
    pub(super) grad: &'a [f32],
    /// (nodes) grad . mean: what the softmax gradient takes off.
    pub(super) means: &'a [f32],
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
