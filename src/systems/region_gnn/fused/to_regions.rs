//! Regions receive from pixels: an online softmax over each task's pixels, merged in the order of the tasks.

use super::super::edges::PassEdges;
use super::block::{EdgeBlock, EdgeGradients, Enc, PIXELS, Receivers, leaky};
use super::lanes::{add_scaled, dense_rows, load, outer, store, with_registers, zero};
use super::pixel_states::PixelStates;
use crate::learn::exp;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Inputs of both passes.
#[derive(Clone, Copy)]
pub(super) struct ToRegions<'a> {
    pub(super) edges: &'a PassEdges,
    pub(super) width: usize,
    pub(super) enc: Enc<'a>,
    pub(super) states: PixelStates<'a>,
    /// (H, H) of the sending node; for table states (3, H) products.
    pub(super) node: &'a [f32],
    /// (regions) the receiver's part of the logit.
    pub(super) bias: &'a [f32],
}

impl ToRegions<'_> {
    /// (pixels of the block, H) what the sending pixels add to the hidden states.
    #[inline(always)]
    fn pixel_rows<S: Simd, const N: usize, const B: usize>(
        &self,
        simd: S,
        pixels: Range<usize>,
        out: &mut [f32],
    ) {
        match self.states {
            PixelStates::Full(values) => {
                out.fill(0.0);
                let x = &values[pixels.start * self.width..pixels.end * self.width];
                dense_rows::<S, N, B>(simd, x, self.width, self.node, out);
            }
            PixelStates::Table { class, .. } => {
                for (slot, pixel) in pixels.enumerate() {
                    store::<S, N>(out, slot, &load::<S, N>(self.node, usize::from(class[pixel])));
                }
            }
        }
    }
}

/// One task of the forward pass.
pub(super) struct Forward<'a> {
    pub(super) inputs: ToRegions<'a>,
    pub(super) pixels: Range<usize>,
    /// (room of the task's edges) whole logits, for the backward pass.
    pub(super) logits: &'a mut [f32],
}

/// The softmax sums of every region over the pixels of one task.
pub(super) struct RegionPartial {
    highest: Vec<f32>,
    total: Vec<f32>,
    /// (regions, H)
    sum: Vec<f32>,
}

impl WithSimd for Forward<'_> {
    type Output = RegionPartial;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> RegionPartial {
        let width = self.inputs.width;
        with_registers!(simd, self, width)
    }
}

impl Forward<'_> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const B: usize>(self, simd: S) -> RegionPartial {
        let inputs = self.inputs;
        let regions = inputs.bias.len();
        let mut partial = RegionPartial {
            highest: vec![f32::NEG_INFINITY; regions],
            total: vec![0.0; regions],
            sum: vec![0.0; regions * inputs.width],
        };
        let mut block = EdgeBlock::new(inputs.edges, inputs.width);
        let mut rows = vec![0.0; PIXELS * inputs.width];
        let mut start = self.pixels.start;
        while start < self.pixels.end && !self.inputs.edges.graph().stop().is_raised() {
            let pixels = start..self.pixels.end.min(start + PIXELS);
            start = pixels.end;
            block.gather(&pixels);
            let room = block.room(&pixels, &self.pixels);
            let rows = &mut rows[..pixels.len() * inputs.width];
            inputs.pixel_rows::<S, N, B>(simd, pixels, rows);
            block.encode::<S, N, B, true>(simd, &inputs.enc, rows);
            // The highest scores first, so that all weights of the block come from one reference each.
            for edge in 0..block.len() {
                let region = block.region(edge);
                block.logits[edge] += inputs.bias[region];
                let score = leaky(block.logits[edge]);
                if score > partial.highest[region] {
                    let shrink = exp(partial.highest[region] - score);
                    partial.highest[region] = score;
                    partial.total[region] *= shrink;
                    let sum = load::<S, N>(&partial.sum, region);
                    store::<S, N>(&mut partial.sum, region, &add_scaled(simd, &zero(simd), &sum, shrink));
                }
            }
            self.logits[room][..block.len()].copy_from_slice(&block.logits);
            for edge in 0..block.len() {
                block.weights[edge] = partial.highest[block.region(edge)];
            }
            block.exponentiate();
            for edge in 0..block.len() {
                let (region, weight) = (block.region(edge), block.weights[edge]);
                partial.total[region] += weight;
                let sum = load::<S, N>(&partial.sum, region);
                let hidden = load::<S, N>(&block.hidden, edge);
                store::<S, N>(&mut partial.sum, region, &add_scaled(simd, &sum, &hidden, weight));
            }
        }
        partial
    }
}

impl RegionPartial {
    /// (regions, H) means and the logarithms of the denominators; both 0 for a region that nothing reaches.
    pub(super) fn merge(partials: &[Self], width: usize, mean: &mut Vec<f32>, log_sums: &mut Vec<f32>) {
        let regions = partials[0].total.len();
        mean.clear();
        mean.resize(regions * width, 0.0);
        log_sums.clear();
        log_sums.resize(regions, 0.0);
        for region in 0..regions {
            let highest = partials.iter().fold(f32::NEG_INFINITY, |a, p| a.max(p.highest[region]));
            if highest == f32::NEG_INFINITY {
                continue;
            }
            let out = &mut mean[region * width..(region + 1) * width];
            let mut total = 0.0;
            for p in partials.iter().filter(|p| p.total[region] > 0.0) {
                let scale = exp(p.highest[region] - highest);
                total += p.total[region] * scale;
                for (o, v) in out.iter_mut().zip(&p.sum[region * width..]) {
                    *o += v * scale;
                }
            }
            out.iter_mut().for_each(|o| *o /= total);
            log_sums[region] = highest + total.ln();
        }
    }
}

/// One task of the backward pass.
pub(super) struct Backward<'a> {
    pub(super) inputs: ToRegions<'a>,
    pub(super) receivers: Receivers<'a>,
    pub(super) pixels: Range<usize>,
    /// (room of the task's edges) as forward left them.
    pub(super) logits: &'a [f32],
    /// For full states: (H, H) transposed `node` and (H) attention on the receiver in the pass back to pixels, whose
    /// logit gradients (pixels of the task) are here too.
    pub(super) node_transposed: &'a [f32],
    pub(super) attend_state: &'a [f32],
    pub(super) d_pixel_bias: &'a [f32],
    /// (pixels of the task, H) gradient of the states; empty for table states.
    pub(super) d_states: &'a mut [f32],
}

/// What one task adds to the gradients.
pub(super) struct BackwardPartial {
    /// (regions, H)
    pub(super) region: Vec<f32>,
    /// (regions)
    pub(super) bias: Vec<f32>,
    /// (features + 1, H)
    pub(super) edge: Vec<f32>,
    /// (H)
    pub(super) score: Vec<f32>,
    /// Like `ToRegions::node`.
    pub(super) node: Vec<f32>,
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
        let (regions, width) = (inputs.bias.len(), inputs.width);
        let mut sums = BackwardPartial {
            region: vec![0.0; regions * width],
            bias: vec![0.0; regions],
            edge: vec![0.0; inputs.enc.edge.len()],
            score: vec![0.0; width],
            node: vec![0.0; inputs.node.len()],
        };
        let mut block = EdgeBlock::new(inputs.edges, width);
        let (mut rows, mut d_rows) = (vec![0.0; PIXELS * width], vec![0.0; PIXELS * width]);
        let first = self.pixels.start;
        let mut start = first;
        while start < self.pixels.end && !self.inputs.edges.graph().stop().is_raised() {
            let pixels = start..self.pixels.end.min(start + PIXELS);
            start = pixels.end;
            block.gather(&pixels);
            let (rows, d_rows) = (&mut rows[..pixels.len() * width], &mut d_rows[..pixels.len() * width]);
            inputs.pixel_rows::<S, N, B>(simd, pixels.clone(), rows);
            block.encode::<S, N, B, false>(simd, &inputs.enc, rows);
            let logits = &self.logits[block.room(&pixels, &self.pixels)];
            d_rows.fill(0.0);
            let mut edge_sums = EdgeGradients {
                region: &mut sums.region,
                pixel: d_rows,
                bias: &mut sums.bias,
                edge: &mut sums.edge,
                score: &mut sums.score,
            };
            block.backward::<S, N, B, true>(simd, &inputs.enc, logits, &self.receivers, &mut edge_sums);
            match inputs.states {
                PixelStates::Full(values) => {
                    let x = &values[pixels.start * width..pixels.end * width];
                    outer::<S, N, B>(simd, x, width, d_rows, &mut sums.node);
                    let local = pixels.start - first..pixels.end - first;
                    let out = &mut self.d_states[local.start * width..local.end * width];
                    let attend = load::<S, N>(self.attend_state, 0);
                    for (slot, pixel) in local.enumerate() {
                        let d = add_scaled(simd, &zero(simd), &attend, self.d_pixel_bias[pixel]);
                        store::<S, N>(out, slot, &d);
                    }
                    dense_rows::<S, N, B>(simd, d_rows, width, self.node_transposed, out);
                }
                PixelStates::Table { class, .. } => {
                    for (slot, pixel) in pixels.enumerate() {
                        let row = usize::from(class[pixel]);
                        let sum = load::<S, N>(&sums.node, row);
                        let d = load::<S, N>(d_rows, slot);
                        store::<S, N>(&mut sums.node, row, &super::lanes::add(simd, &sum, &d));
                    }
                }
            }
        }
        sums
    }
}
