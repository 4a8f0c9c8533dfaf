//! The whole network forward and backward on plain buffers: per-edge work in tasks, region-sized work between them.
//!
//! In the order of Eq. 1: f^(0) of three kinds of pixels; then, T times, regions gather from pixels and pixels from
//! regions; then MLP_3. Nothing per edge is stored; a round keeps two states a pixel and a few a region.

use super::super::config::{Pooling, RegionGnnConfig};
use super::super::edges::PassEdges;
use super::block::{Enc, Receivers};
use super::layout::{Layout, MessageRanges};
use super::pixel_states::{INDICATORS, PixelStates, classes};
use super::small::{
    add, add_outer, add_product, add_rows, add_scaled, dot, normalize, normalize_gradient, transposed,
};
use super::tasks::{rooms, task_size, tasks};
use super::to_pixels::{self, Next, Source, ToPixels};
use super::to_regions::{self, RegionPartial, ToRegions};
use crate::machine;
use rayon::prelude::*;
use std::ops::Range;

/// Everything but the numbers: which network.
#[derive(Clone, Debug)]
pub(in super::super) struct Pass {
    layout: Layout,
    width: usize,
    embedding: usize,
    mean_pooling: bool,
}

/// What a forward pass leaves for the backward one. Kept between passes so that memory is not asked for again.
#[derive(Debug, Default)]
pub(super) struct Saved {
    classes: Vec<u8>,
    /// (3, regions) edges of each region by class of the pixel.
    class_counts: Vec<f32>,
    first: FirstStates,
    rounds: Vec<Round>,
}

/// f^(0) for the three classes.
#[derive(Debug, Default)]
struct FirstStates {
    /// (3, H)
    hidden: Vec<f32>,
    /// (3, H)
    states: Vec<f32>,
    /// (H) hidden layer of MLP_3 at a pixel beside the lines that no message reaches.
    far_hidden: Vec<f32>,
}

#[derive(Debug, Default)]
struct Round {
    /// (pixels, H) states that enter; empty in the first round.
    states: Vec<f32>,
    /// (regions, H) means or sums of those states.
    pooled: Vec<f32>,
    /// (regions, H) states that enter.
    regions: Vec<f32>,
    /// (regions, H), (regions)
    region_means: Vec<f32>,
    region_log_sums: Vec<f32>,
    /// (regions, H) before normalisation.
    region_sums: Vec<f32>,
    /// (regions, H) states that leave.
    regions_out: Vec<f32>,
    /// (pixels, H), (pixels)
    pixel_means: Vec<f32>,
    pixel_log_sums: Vec<f32>,
    /// (room of the edges) logits of both passes.
    region_logits: Vec<f32>,
    pixel_logits: Vec<f32>,
}

/// The region's share of one message layer: all that hidden states and logits take besides pixels and edges.
struct RegionSide {
    /// (regions, H)
    rows: Vec<f32>,
    /// (H)
    score: Vec<f32>,
    constant: f32,
}

/// What one pass works on.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub(super) edges: &'a PassEdges,
    /// In the order of [`Layout`].
    pub(super) params: &'a [f32],
    /// (regions, embedding)
    pub(super) embedding: &'a [f32],
    /// (regions, H)
    pub(super) first_regions: &'a [f32],
}

impl Pass {
    pub(in super::super) fn new(config: &RegionGnnConfig, layout: Layout) -> Self {
        Self {
            layout,
            width: config.width,
            embedding: config.embedding,
            mean_pooling: config.pooling == Pooling::Mean,
        }
    }

    /// (pixels + 1) heights, the last one that of a pixel which no message reaches.
    pub(super) fn forward(&self, given: &Given<'_>, saved: &mut Saved) -> Vec<f32> {
        let graph = given.edges.graph();
        let (pixels, h) = (graph.pixel_count(), self.width);
        saved.classes = classes(graph.indicator());
        saved.class_counts = class_counts(given.edges, &saved.classes);
        saved.rounds.resize_with(self.layout.rounds.len(), Round::default);
        saved.first = self.first_states(given.params);
        let mut heights = vec![0.0; pixels + 1];
        heights[pixels] = self.far_height(given.params, &saved.first);
        saved.rounds[0].regions = given.first_regions.to_vec();
        saved.rounds[0].pooled = self.pooled_classes(given.edges, &saved.class_counts, &saved.first.states);
        for t in 0..saved.rounds.len() {
            let (done, rest) = saved.rounds.split_at_mut(t + 1);
            let round = &mut done[t];
            let states = self.states(t, &saved.classes, &saved.first, &round.states);
            let [to_regions, to_pixels] = &self.layout.rounds[t];

            let side = self.region_side(given, to_regions, &round.pooled, &to_regions.pool);
            let bias = self.region_bias(given.params, to_regions, &round.regions, side.constant);
            let node = self.sent_by_pixels(given.params, to_regions, &states);
            let inputs = self.to_regions(given, to_regions, &side, states, &node, &bias);
            let room = given.edges.room(&(0..pixels)).len();
            round.region_logits.resize(room, 0.0);
            round.pixel_logits.resize(room, 0.0);
            let partials: Vec<RegionPartial> = tasks(pixels)
                .into_par_iter()
                .zip(rooms(given.edges, &mut round.region_logits))
                .map(|(pixels, logits)| {
                    machine::arch().dispatch(to_regions::Forward { inputs, pixels, logits })
                })
                .collect();
            RegionPartial::merge(&partials, h, &mut round.region_means, &mut round.region_log_sums);
            round.region_sums = self.gathered(given, to_regions, &round.regions, &round.region_means);
            round.regions_out.clone_from(&round.region_sums);
            if let Some((gain, offset)) = &to_regions.norm {
                let (gain, offset) = (&given.params[gain.clone()], &given.params[offset.clone()]);
                normalize(&mut round.regions_out, gain, offset);
            }

            let side = self.region_side(given, to_pixels, &round.regions_out, &to_pixels.node);
            let mut pooled = vec![0.0; round.regions_out.len()];
            add_product(&round.regions_out, &given.params[to_pixels.pool.clone()], h, &mut pooled);
            let inputs = self.to_pixels(given, to_pixels, &side, states, &pooled);
            round.pixel_means.resize(pixels * h, 0.0);
            round.pixel_log_sums.resize(pixels, 0.0);
            let task = task_size(pixels);
            let outputs = round.pixel_means.par_chunks_mut(task * h);
            let outputs = outputs.zip(round.pixel_log_sums.par_chunks_mut(task)).zip(tasks(pixels));
            let outputs = outputs.zip(rooms(given.edges, &mut round.pixel_logits));
            let forward = |(((mean, log_sums), pixels), logits): (((_, _), Range<usize>), _),
                           next: Next<'_>| {
                machine::arch().dispatch(to_pixels::Forward { inputs, pixels, mean, log_sums, logits, next })
            };
            match rest.first_mut() {
                Some(next) => {
                    next.states.resize(pixels * h, 0.0);
                    let partials: Vec<Vec<f32>> = outputs
                        .zip(next.states.par_chunks_mut(task * h))
                        .map(|(out, states)| forward(out, Next::Round(states)))
                        .collect();
                    next.regions.clone_from(&round.regions_out);
                    next.pooled.clear();
                    next.pooled.resize(round.regions_out.len(), 0.0);
                    partials.iter().for_each(|partial| add(&mut next.pooled, partial));
                    self.scale_by_degree(given.edges, &mut next.pooled);
                }
                None => outputs
                    .zip(heights[..pixels].par_chunks_mut(task))
                    .for_each(|(out, heights)| drop(forward(out, Next::Heights(heights)))),
            }
        }
        heights
    }

    /// Gradients by the parameters and by the embedding, from the gradient by what [`forward`](Self::forward) gave.
    pub(super) fn backward(
        &self,
        given: &Given<'_>,
        saved: &Saved,
        d_heights: &[f32],
    ) -> (Vec<f32>, Vec<f32>) {
        let graph = given.edges.graph();
        let (pixels, h) = (graph.pixel_count(), self.width);
        let task = task_size(pixels);
        let params = given.params;
        let mut d = vec![0.0; self.layout.len];
        let mut d_embedding = vec![0.0; given.embedding.len()];
        // (3, H)
        let mut d_first = vec![0.0; INDICATORS.len() * h];
        self.back_through_far(given.params, &saved.first, d_heights[pixels], &mut d, &mut d_first);
        let last_transposed = transposed(&params[self.layout.last.hidden.clone()], h);
        // Gradients of the states that leave a round: by the pixels, by their pooled sums, by the regions.
        let mut d_states = Vec::new();
        let mut d_pool = Vec::new();
        let mut d_regions = vec![0.0; graph.region_count() * h];
        let mut d_bias = vec![0.0; pixels];
        for t in (0..saved.rounds.len()).rev() {
            let round = &saved.rounds[t];
            let states = self.states(t, &saved.classes, &saved.first, &round.states);
            let [to_regions, to_pixels] = &self.layout.rounds[t];

            // Regions to pixels.
            let side = self.region_side(given, to_pixels, &round.regions_out, &to_pixels.node);
            let mut pooled = vec![0.0; round.regions_out.len()];
            add_product(&round.regions_out, &params[to_pixels.pool.clone()], h, &mut pooled);
            let inputs = self.to_pixels(given, to_pixels, &side, states, &pooled);
            let out_transposed = transposed(&params[to_pixels.out.clone()], h);
            let last = t + 1 == saved.rounds.len();
            let partials: Vec<to_pixels::BackwardPartial> = tasks(pixels)
                .into_par_iter()
                .zip(d_bias.par_chunks_mut(task))
                .map(|(pixels, d_bias)| {
                    let values = pixels.start * h..pixels.end * h;
                    let source = if last {
                        let heights = &d_heights[pixels.clone()];
                        Source::Heights { heights, hidden_transposed: &last_transposed }
                    } else {
                        Source::Round { states: &d_states[values.clone()], pool: &d_pool }
                    };
                    machine::arch().dispatch(to_pixels::Backward {
                        inputs,
                        mean: &round.pixel_means[values],
                        log_sums: &round.pixel_log_sums[pixels.clone()],
                        logits: &round.pixel_logits[given.edges.room(&pixels)],
                        source,
                        out_transposed: &out_transposed,
                        d_bias,
                        pixels,
                    })
                })
                .collect();
            let mut d_side =
                RegionSide { rows: vec![0.0; side.rows.len()], score: vec![0.0; h], constant: 0.0 };
            let mut d_pooled = vec![0.0; pooled.len()];
            for partial in &partials {
                add(&mut d, &partial.params);
                add(&mut d_side.rows, &partial.region);
                add(&mut d_side.score, &partial.score);
                add(&mut d_pooled, &partial.pooled);
                d_side.constant += partial.constant;
                let attend = &params[to_pixels.attend_state.clone()];
                for (d_first, bias) in d_first.chunks_exact_mut(h).zip(partial.class_bias) {
                    add_scaled(d_first, attend, bias);
                }
            }
            drop(partials);
            add_outer(&round.regions_out, &d_pooled, h, &mut d[to_pixels.pool.clone()]);
            add_product(&d_pooled, &transposed(&params[to_pixels.pool.clone()], h), h, &mut d_regions);
            let by_sent = self.back_through_side(
                given,
                to_pixels,
                (&round.regions_out, &to_pixels.node),
                &d_side,
                &mut d,
                &mut d_embedding,
            );
            add(&mut d_regions, &by_sent);

            // The regions' own end of the pass to them.
            let mut d_sums = d_regions.clone();
            if let Some((gain, offset)) = &to_regions.norm {
                let (mut d_gain, mut d_offset) = (vec![0.0; h], vec![0.0; h]);
                let gains = &params[gain.clone()];
                normalize_gradient(&round.region_sums, gains, &mut d_sums, &mut d_gain, &mut d_offset);
                add(&mut d[gain.clone()], &d_gain);
                add(&mut d[offset.clone()], &d_offset);
            }
            add_outer(&round.region_means, &d_sums, h, &mut d[to_regions.out.clone()]);
            let reached = given.edges.reached_regions();
            for (row, reached) in d_sums.chunks_exact(h).zip(&reached) {
                add_scaled(&mut d[to_regions.out_bias.clone()], row, *reached);
            }
            let mut d_means = vec![0.0; d_sums.len()];
            add_product(&d_sums, &transposed(&params[to_regions.out.clone()], h), h, &mut d_means);
            let products: Vec<f32> = d_means
                .chunks_exact(h)
                .zip(round.region_means.chunks_exact(h))
                .map(|(d, mean)| dot(d, mean))
                .collect();

            // Pixels to regions.
            let side = self.region_side(given, to_regions, &round.pooled, &to_regions.pool);
            let bias = self.region_bias(params, to_regions, &round.regions, side.constant);
            let node = self.sent_by_pixels(params, to_regions, &states);
            let inputs = self.to_regions(given, to_regions, &side, states, &node, &bias);
            let receivers = Receivers { grad: &d_means, means: &products, log_sums: &round.region_log_sums };
            let full = matches!(states, PixelStates::Full(_));
            d_states.resize(if full { pixels * h } else { 0 }, 0.0);
            let node_transposed = if full { transposed(&node, h) } else { Vec::new() };
            let back = |pixels: Range<usize>, d_states: &mut [f32]| {
                machine::arch().dispatch(to_regions::Backward {
                    inputs,
                    receivers,
                    node_transposed: &node_transposed,
                    attend_state: &params[to_pixels.attend_state.clone()],
                    d_pixel_bias: &d_bias[pixels.clone()],
                    d_states,
                    logits: &round.region_logits[given.edges.room(&pixels)],
                    pixels,
                })
            };
            let partials: Vec<to_regions::BackwardPartial> = if full {
                let states = d_states.par_chunks_mut(task * h);
                tasks(pixels).into_par_iter().zip(states).map(|(p, d)| back(p, d)).collect()
            } else {
                tasks(pixels).into_par_iter().map(|p| back(p, &mut [])).collect()
            };
            let mut d_side =
                RegionSide { rows: vec![0.0; side.rows.len()], score: vec![0.0; h], constant: 0.0 };
            let (mut d_region_bias, mut d_node) = (vec![0.0; bias.len()], vec![0.0; node.len()]);
            for partial in &partials {
                add(&mut d_side.rows, &partial.region);
                add(&mut d_side.score, &partial.score);
                add(&mut d_region_bias, &partial.bias);
                add(&mut d[to_regions.edge.clone()], &partial.edge);
                add(&mut d_node, &partial.node);
            }
            d_side.constant = d_region_bias.iter().sum();
            if full {
                add(&mut d[to_regions.node.clone()], &d_node);
            } else {
                add_outer(&saved.first.states, &d_node, h, &mut d[to_regions.node.clone()]);
                let weights = transposed(&params[to_regions.node.clone()], h);
                add_product(&d_node, &weights, h, &mut d_first);
            }
            // What enters the round: e = e + gathered, and the receiver's part of the logits.
            d_regions.copy_from_slice(&d_sums);
            let attend = &params[to_regions.attend_state.clone()];
            let rows = round.regions.chunks_exact(h).zip(d_regions.chunks_exact_mut(h));
            for ((state, d_state), bias) in rows.zip(&d_region_bias) {
                add_scaled(&mut d[to_regions.attend_state.clone()], state, *bias);
                add_scaled(d_state, attend, *bias);
            }
            d_pool = self.back_through_side(
                given,
                to_regions,
                (&round.pooled, &to_regions.pool),
                &d_side,
                &mut d,
                &mut d_embedding,
            );
            self.scale_by_degree(given.edges, &mut d_pool);
        }
        let regions = graph.region_count();
        for (class, d_first) in d_first.chunks_exact_mut(h).enumerate() {
            let counts = &saved.class_counts[class * regions..(class + 1) * regions];
            for (d_pool, count) in d_pool.chunks_exact(h).zip(counts) {
                add_scaled(d_first, d_pool, *count);
            }
        }
        self.back_through_first(params, &saved.first, &d_first, &mut d);
        (d, d_embedding)
    }

    fn states<'a>(
        &self,
        t: usize,
        class: &'a [u8],
        first: &'a FirstStates,
        full: &'a [f32],
    ) -> PixelStates<'a> {
        if t == 0 { PixelStates::Table { class, rows: &first.states } } else { PixelStates::Full(full) }
    }

    fn to_regions<'a>(
        &self,
        given: &Given<'a>,
        ranges: &MessageRanges,
        side: &'a RegionSide,
        states: PixelStates<'a>,
        node: &'a [f32],
        bias: &'a [f32],
    ) -> ToRegions<'a> {
        let edge = &given.params[ranges.edge.clone()];
        let enc = Enc { region: &side.rows, edge, score: &side.score };
        ToRegions { edges: given.edges, width: self.width, enc, states, node, bias }
    }

    fn to_pixels<'a>(
        &'a self,
        given: &Given<'a>,
        ranges: &'a MessageRanges,
        side: &'a RegionSide,
        states: PixelStates<'a>,
        pooled: &'a [f32],
    ) -> ToPixels<'a> {
        let edge = &given.params[ranges.edge.clone()];
        ToPixels {
            edges: given.edges,
            width: self.width,
            params: given.params,
            ranges,
            last: &self.layout.last,
            enc: Enc { region: &side.rows, edge, score: &side.score },
            states,
            pooled,
            mean_pooling: self.mean_pooling,
            constant: side.constant,
        }
    }

    /// Kind, bias, embedding, and what the regions send or have pooled, `x` times the parameter at `by`. The second layer
    /// of `Enc` is pulled through the attention: a . (out h + b) = (out a) . h + a . b.
    fn region_side(
        &self,
        given: &Given<'_>,
        layer: &MessageRanges,
        x: &[f32],
        by: &Range<usize>,
    ) -> RegionSide {
        let h = self.width;
        let p = |range: &Range<usize>| &given.params[range.clone()];
        let mut rows = vec![0.0; x.len()];
        add_product(&given.edges.graph().kind_indicators(), p(&layer.kind), h, &mut rows);
        for row in rows.chunks_exact_mut(h) {
            add(row, p(&layer.bias));
        }
        if let Some(weights) = &layer.embedding {
            add_product(given.embedding, p(weights), h, &mut rows);
        }
        add_product(x, p(by), h, &mut rows);
        let attend = p(&layer.attend_message);
        let score = p(&layer.out).chunks_exact(h).map(|row| dot(row, attend)).collect();
        RegionSide { rows, score, constant: dot(p(&layer.out_bias), attend) }
    }

    /// Back through [`region_side`](Self::region_side): adds to the gradients, returns that of `x`.
    fn back_through_side(
        &self,
        given: &Given<'_>,
        layer: &MessageRanges,
        (x, by): (&[f32], &Range<usize>),
        d_side: &RegionSide,
        d: &mut [f32],
        d_embedding: &mut [f32],
    ) -> Vec<f32> {
        let h = self.width;
        let p = |range: &Range<usize>| &given.params[range.clone()];
        add_outer(&given.edges.graph().kind_indicators(), &d_side.rows, h, &mut d[layer.kind.clone()]);
        add_rows(&d_side.rows, &mut d[layer.bias.clone()]);
        if let Some(weights) = &layer.embedding {
            add_outer(given.embedding, &d_side.rows, h, &mut d[weights.clone()]);
            add_product(&d_side.rows, &transposed(p(weights), h), self.embedding, d_embedding);
        }
        add_outer(x, &d_side.rows, h, &mut d[by.clone()]);
        let attend = p(&layer.attend_message);
        add_outer(&d_side.score, attend, h, &mut d[layer.out.clone()]);
        add_product(&d_side.score, p(&layer.out), h, &mut d[layer.attend_message.clone()]);
        add_scaled(&mut d[layer.attend_message.clone()], p(&layer.out_bias), d_side.constant);
        add_scaled(&mut d[layer.out_bias.clone()], attend, d_side.constant);
        let mut d_x = vec![0.0; x.len()];
        add_product(&d_side.rows, &transposed(p(by), h), h, &mut d_x);
        d_x
    }

    /// (regions) the receiver's part of the logits.
    fn region_bias(&self, params: &[f32], layer: &MessageRanges, states: &[f32], constant: f32) -> Vec<f32> {
        let attend = &params[layer.attend_state.clone()];
        states.chunks_exact(self.width).map(|state| dot(state, attend) + constant).collect()
    }

    /// The weights of the sending pixels, applied already where the states are a table.
    fn sent_by_pixels(&self, params: &[f32], layer: &MessageRanges, states: &PixelStates<'_>) -> Vec<f32> {
        let weights = &params[layer.node.clone()];
        match states {
            PixelStates::Full(_) => weights.to_vec(),
            PixelStates::Table { rows, .. } => {
                let mut out = vec![0.0; rows.len()];
                add_product(rows, weights, self.width, &mut out);
                out
            }
        }
    }

    /// e + gathered: (regions, H).
    fn gathered(&self, given: &Given<'_>, layer: &MessageRanges, e: &[f32], means: &[f32]) -> Vec<f32> {
        let h = self.width;
        let mut sums = e.to_vec();
        add_product(means, &given.params[layer.out.clone()], h, &mut sums);
        let bias = &given.params[layer.out_bias.clone()];
        for (row, reached) in sums.chunks_exact_mut(h).zip(given.edges.reached_regions()) {
            add_scaled(row, bias, reached);
        }
        sums
    }

    /// Sums over the pixels of each region to means, where the configuration says so.
    fn scale_by_degree(&self, edges: &PassEdges, rows: &mut [f32]) {
        if self.mean_pooling {
            for (region, row) in rows.chunks_exact_mut(self.width).enumerate() {
                let factor = 1.0 / edges.region_degree(region).max(1) as f32;
                row.iter_mut().for_each(|v| *v *= factor);
            }
        }
    }

    /// (regions, H) pooled first states.
    fn pooled_classes(&self, edges: &PassEdges, counts: &[f32], table: &[f32]) -> Vec<f32> {
        let h = self.width;
        let regions = edges.graph().region_count();
        let mut pooled = vec![0.0; regions * h];
        for (state, counts) in table.chunks_exact(h).zip(counts.chunks_exact(regions)) {
            for (row, count) in pooled.chunks_exact_mut(h).zip(counts) {
                add_scaled(row, state, *count);
            }
        }
        self.scale_by_degree(edges, &mut pooled);
        pooled
    }

    fn first_states(&self, params: &[f32]) -> FirstStates {
        let h = self.width;
        let first = &self.layout.first;
        let p = |range: &Range<usize>| &params[range.clone()];
        let biased = |bias: &[f32]| bias.repeat(INDICATORS.len());
        let mut hidden = biased(p(&first.hidden_bias));
        add_product(&INDICATORS, p(&first.hidden), h, &mut hidden);
        hidden.iter_mut().for_each(|v| *v = v.max(0.0));
        let mut states = biased(p(&first.out_bias));
        add_product(&hidden, p(&first.out), h, &mut states);
        let mut far_hidden = p(&self.layout.last.hidden_bias).to_vec();
        add_product(&states[..h], p(&self.layout.last.hidden), h, &mut far_hidden);
        far_hidden.iter_mut().for_each(|v| *v = v.max(0.0));
        FirstStates { hidden, states, far_hidden }
    }

    fn back_through_first(&self, params: &[f32], saved: &FirstStates, d_first: &[f32], d: &mut [f32]) {
        let h = self.width;
        let first = &self.layout.first;
        add_rows(d_first, &mut d[first.out_bias.clone()]);
        add_outer(&saved.hidden, d_first, h, &mut d[first.out.clone()]);
        let mut d_hidden = vec![0.0; d_first.len()];
        add_product(d_first, &transposed(&params[first.out.clone()], h), h, &mut d_hidden);
        gate(&mut d_hidden, &saved.hidden);
        add_rows(&d_hidden, &mut d[first.hidden_bias.clone()]);
        add_outer(&INDICATORS, &d_hidden, h, &mut d[first.hidden.clone()]);
    }

    fn far_height(&self, params: &[f32], first: &FirstStates) -> f32 {
        dot(&first.far_hidden, &params[self.layout.last.out.clone()])
            + params[self.layout.last.out_bias.start]
    }

    fn back_through_far(
        &self,
        params: &[f32],
        saved: &FirstStates,
        d_height: f32,
        d: &mut [f32],
        d_first: &mut [f32],
    ) {
        let h = self.width;
        let last = &self.layout.last;
        add_scaled(&mut d[last.out.clone()], &saved.far_hidden, d_height);
        d[last.out_bias.start] += d_height;
        let mut d_hidden: Vec<f32> = params[last.out.clone()].iter().map(|w| w * d_height).collect();
        gate(&mut d_hidden, &saved.far_hidden);
        add(&mut d[last.hidden_bias.clone()], &d_hidden);
        add_outer(&saved.states[..h], &d_hidden, h, &mut d[last.hidden.clone()]);
        add_product(&d_hidden, &transposed(&params[last.hidden.clone()], h), h, &mut d_first[..h]);
    }
}

/// Keeps a gradient where the ReLU's value is positive.
fn gate(d: &mut [f32], value: &[f32]) {
    for (d, v) in d.iter_mut().zip(value) {
        *d = if *v > 0.0 { *d } else { 0.0 };
    }
}

/// (3, regions) unmasked edges of each region by class of the pixel.
fn class_counts(edges: &PassEdges, classes: &[u8]) -> Vec<f32> {
    let regions = edges.graph().region_count();
    let of_region = |region| {
        let mut counts = [0.0f32; INDICATORS.len()];
        edges.pixels_of(region).for_each(|pixel| counts[usize::from(classes[pixel])] += 1.0);
        counts
    };
    let by_region: Vec<_> = (0..regions).into_par_iter().with_min_len(32).map(of_region).collect();
    let class = |class: usize| by_region.iter().map(move |counts| counts[class]);
    (0..INDICATORS.len()).flat_map(class).collect()
}
