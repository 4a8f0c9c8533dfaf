//! The vector code of [`edge_attention`](super::edge_attention): one task each, at the widest registers of the machine.
//!
//! `pulp` picks the instruction set at run time, so no `target-cpu` flag is needed. `N` is the number of registers that a
//! hidden state fills. Loops stand where an iterator with a closure would be shorter: a closure handed to the standard
//! library is compiled for the baseline processor, and every vector operation in it becomes a call.

use super::edge_attention::Inputs;
use super::edges::Edge;
use super::pool::Toward;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// Slope of the leaky ReLU in graph attention (Velickovic et al. 2018).
pub(super) const LEAK: f32 = 0.2;
/// Edges whose hidden states are computed together, so that a row of weights is loaded once for all.
const BLOCK: usize = 4;

#[inline(always)]
fn leaky(t: f32) -> f32 {
    if t > 0.0 { t } else { LEAK * t }
}

/// Calls `$run::<S, N>` with the N that fits the width.
macro_rules! with_registers {
    ($simd:ident, $self:ident, $width:expr) => {
        match $width / S::F32_LANES {
            1 => $self.run::<S, 1>($simd),
            2 => $self.run::<S, 2>($simd),
            4 => $self.run::<S, 4>($simd),
            8 => $self.run::<S, 8>($simd),
            16 => $self.run::<S, 16>($simd),
            32 => $self.run::<S, 32>($simd),
            64 => $self.run::<S, 64>($simd),
            n => unreachable!("a width of {n} registers passed validation"),
        }
    };
}

/// A state of `N` registers.
type State<S, const N: usize> = [<S as Simd>::f32s; N];

#[inline(always)]
fn load<S: Simd, const N: usize>(values: &[f32], row: usize) -> State<S, N> {
    let lanes: &[S::f32s] = cast_slice(&values[row * N * S::F32_LANES..(row + 1) * N * S::F32_LANES]);
    let mut state = [lanes[0]; N];
    state.copy_from_slice(lanes);
    state
}

#[inline(always)]
fn add<S: Simd, const N: usize>(simd: S, values: &mut [f32], row: usize, x: &State<S, N>) {
    let lanes: &mut [S::f32s] = cast_slice_mut(&mut values[row * N * S::F32_LANES..(row + 1) * N * S::F32_LANES]);
    for i in 0..N {
        lanes[i] = simd.add_f32s(lanes[i], x[i]);
    }
}

#[inline(always)]
fn store<S: Simd, const N: usize>(values: &mut [f32], row: usize, x: &State<S, N>) {
    let lanes: &mut [S::f32s] = cast_slice_mut(&mut values[row * N * S::F32_LANES..(row + 1) * N * S::F32_LANES]);
    lanes.copy_from_slice(x);
}

#[inline(always)]
fn zero<S: Simd, const N: usize>(simd: S) -> State<S, N> {
    [simd.splat_f32s(0.0); N]
}

/// `sum + x * factor`
#[inline(always)]
fn add_scaled<S: Simd, const N: usize>(simd: S, sum: &State<S, N>, x: &State<S, N>, factor: f32) -> State<S, N> {
    let factor = simd.splat_f32s(factor);
    let mut out = *sum;
    for i in 0..N {
        out[i] = simd.mul_add_e_f32s(x[i], factor, sum[i]);
    }
    out
}

#[inline(always)]
fn dot<S: Simd, const N: usize>(simd: S, a: &State<S, N>, b: &State<S, N>) -> f32 {
    let mut sum = simd.mul_f32s(a[0], b[0]);
    for i in 1..N {
        sum = simd.mul_add_e_f32s(a[i], b[i], sum);
    }
    simd.reduce_sum_f32s(sum)
}

/// Hidden states of the edges of one pixel.
struct Hidden<'a, S: Simd, const N: usize> {
    simd: S,
    inputs: Inputs<'a>,
    score: State<S, N>,
    edges: Vec<Edge<'a>>,
    states: Vec<State<S, N>>,
}

impl<'a, S: Simd, const N: usize> Hidden<'a, S, N> {
    #[inline(always)]
    fn new(simd: S, inputs: Inputs<'a>) -> Self {
        let score = load::<S, N>(inputs.score, 0);
        Self { simd, inputs, score, edges: Vec::new(), states: Vec::new() }
    }

    /// Computes `relu(pixel + region + W f)` for the unmasked edges of `pixel`.
    #[inline(always)]
    fn of_pixel(&mut self, pixel: usize) {
        let inputs = self.inputs;
        let masked = inputs.edges.masked();
        self.edges.clear();
        for edge in inputs.edges.edges_of(pixel) {
            if !masked[edge.region] {
                self.edges.push(edge);
            }
        }
        self.states.clear();
        let base = load::<S, N>(inputs.pixel, pixel);
        let mut blocks = self.edges.chunks_exact(BLOCK);
        for block in &mut blocks {
            self.states.extend_from_slice(&hidden::<S, N, BLOCK>(self.simd, inputs, &base, block));
        }
        for edge in blocks.remainder().chunks_exact(1) {
            self.states.extend_from_slice(&hidden::<S, N, 1>(self.simd, inputs, &base, edge));
        }
    }

    /// The attention logit of edge `i` before the leaky ReLU.
    #[inline(always)]
    fn logit(&self, i: usize, bias: f32) -> f32 {
        dot(self.simd, &self.states[i], &self.score) + bias
    }
}

#[inline(always)]
fn hidden<S: Simd, const N: usize, const B: usize>(
    simd: S,
    inputs: Inputs<'_>,
    base: &State<S, N>,
    edges: &[Edge<'_>],
) -> [State<S, N>; B] {
    let feature_count = edges[0].features.len();
    let noise = load::<S, N>(inputs.weights, feature_count);
    let mut sums = [*base; B];
    for b in 0..B {
        let region = load::<S, N>(inputs.region, edges[b].region);
        for i in 0..N {
            sums[b][i] = simd.add_f32s(base[i], region[i]);
        }
        sums[b] = add_scaled(simd, &sums[b], &noise, edges[b].noise);
    }
    for f in 0..feature_count {
        let weights = load::<S, N>(inputs.weights, f);
        for b in 0..B {
            sums[b] = add_scaled(simd, &sums[b], &weights, edges[b].features[f]);
        }
    }
    let zero = simd.splat_f32s(0.0);
    for sum in &mut sums {
        for x in sum {
            *x = simd.max_f32s(*x, zero);
        }
    }
    sums
}

/// Pixels receive: their edges are at hand, so the softmax is done in place.
pub(super) struct ForwardToPixels<'a> {
    pub(super) inputs: Inputs<'a>,
    pub(super) first_pixel: usize,
    /// (pixels of the task, H)
    pub(super) out: &'a mut [f32],
    /// (pixels of the task)
    pub(super) log_sums: &'a mut [f32],
}

impl WithSimd for ForwardToPixels<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = self.inputs.width;
        with_registers!(simd, self, width);
    }
}

impl ForwardToPixels<'_> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let mut hidden = Hidden::<S, N>::new(simd, self.inputs);
        let mut scores = Vec::new();
        for i in 0..self.log_sums.len() {
            let pixel = self.first_pixel + i;
            hidden.of_pixel(pixel);
            let bias = self.inputs.bias[pixel];
            scores.clear();
            let mut highest = f32::NEG_INFINITY;
            for e in 0..hidden.states.len() {
                let score = leaky(hidden.logit(e, bias));
                highest = highest.max(score);
                scores.push(score);
            }
            let mut total = 0.0;
            let mut sum = zero::<S, N>(simd);
            for (state, score) in hidden.states.iter().zip(&scores) {
                let weight = (score - highest).exp();
                total += weight;
                sum = add_scaled(simd, &sum, state, weight);
            }
            if total > 0.0 {
                store::<S, N>(self.out, i, &add_scaled(simd, &zero::<S, N>(simd), &sum, 1.0 / total));
                self.log_sums[i] = highest + total.ln();
            }
        }
    }
}

/// Regions receive from the pixels of one task: an online softmax each, to be merged.
pub(super) struct ForwardToRegions<'a> {
    pub(super) inputs: Inputs<'a>,
    pub(super) pixels: Range<usize>,
}

/// The softmax sums of every region over the pixels of one task.
pub(super) struct RegionPartial {
    highest: Vec<f32>,
    total: Vec<f32>,
    /// (regions, H)
    sum: Vec<f32>,
}

impl WithSimd for ForwardToRegions<'_> {
    type Output = RegionPartial;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> RegionPartial {
        let width = self.inputs.width;
        with_registers!(simd, self, width)
    }
}

impl ForwardToRegions<'_> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) -> RegionPartial {
        let regions = self.inputs.bias.len();
        let mut partial = RegionPartial {
            highest: vec![f32::NEG_INFINITY; regions],
            total: vec![0.0; regions],
            sum: vec![0.0; regions * self.inputs.width],
        };
        let mut hidden = Hidden::<S, N>::new(simd, self.inputs);
        for pixel in self.pixels {
            hidden.of_pixel(pixel);
            for e in 0..hidden.states.len() {
                let region = hidden.edges[e].region;
                let score = leaky(hidden.logit(e, self.inputs.bias[region]));
                let sum = load::<S, N>(&partial.sum, region);
                if score > partial.highest[region] {
                    let shrink = (partial.highest[region] - score).exp();
                    partial.highest[region] = score;
                    partial.total[region] = partial.total[region] * shrink + 1.0;
                    store::<S, N>(&mut partial.sum, region, &add_scaled(simd, &hidden.states[e], &sum, shrink));
                } else {
                    let weight = (score - partial.highest[region]).exp();
                    partial.total[region] += weight;
                    store::<S, N>(&mut partial.sum, region, &add_scaled(simd, &sum, &hidden.states[e], weight));
                }
            }
        }
        partial
    }
}

impl RegionPartial {
    /// (regions, H) means and the logarithms of the denominators, in the order of the tasks.
    pub(super) fn merge(partials: &[Self], width: usize) -> (Vec<f32>, Vec<f32>) {
        let regions = partials[0].total.len();
        let (mut out, mut log_sums) = (vec![0.0; regions * width], vec![0.0; regions]);
        for region in 0..regions {
            let highest = partials.iter().fold(f32::NEG_INFINITY, |a, p| a.max(p.highest[region]));
            if highest == f32::NEG_INFINITY {
                continue;
            }
            let out = &mut out[region * width..(region + 1) * width];
            let mut total = 0.0;
            for p in partials.iter().filter(|p| p.total[region] > 0.0) {
                let scale = (p.highest[region] - highest).exp();
                total += p.total[region] * scale;
                for (o, v) in out.iter_mut().zip(&p.sum[region * width..]) {
                    *o += v * scale;
                }
            }
            out.iter_mut().for_each(|o| *o /= total);
            log_sums[region] = highest + total.ln();
        }
        (out, log_sums)
    }
}

/// The whole backward pass of one task's pixels, whichever side received.
pub(super) struct Backward<'a> {
    pub(super) inputs: Inputs<'a>,
    pub(super) toward: Toward,
    pub(super) first_pixel: usize,
    pub(super) log_sums: &'a [f32],
    /// (receiving nodes, H)
    pub(super) grad: &'a [f32],
    /// grad . out of each receiving node.
    pub(super) means: &'a [f32],
    /// (pixels of the task, H)
    pub(super) d_pixel: &'a mut [f32],
}

/// Gradients of what all tasks share.
pub(super) struct BackwardPartial {
    /// (regions + features + 1 + 1, H): region states, weights, score.
    pub(super) small: Vec<f32>,
    /// One value a region, or a pixel of the task.
    pub(super) bias: Vec<f32>,
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
    fn run<S: Simd, const N: usize>(self, simd: S) -> BackwardPartial {
        let inputs = self.inputs;
        let (regions, features) = (inputs.edges.graph().region_count(), inputs.edges.graph().feature_count());
        let pixels = self.d_pixel.len() / inputs.width;
        let receivers = if self.toward == Toward::Regions { regions } else { pixels };
        let mut small = vec![0.0; (regions + features + 2) * inputs.width];
        let mut bias = vec![0.0; receivers];
        let mut d_score = zero::<S, N>(simd);
        let mut hidden = Hidden::<S, N>::new(simd, inputs);
        let mut d_states: Vec<State<S, N>> = Vec::new();
        let nothing = simd.splat_f32s(0.0);
        for i in 0..pixels {
            let pixel = self.first_pixel + i;
            hidden.of_pixel(pixel);
            d_states.clear();
            let mut d_pixel = zero::<S, N>(simd);
            for e in 0..hidden.states.len() {
                let region = hidden.edges[e].region;
                let (node, slot) = if self.toward == Toward::Regions { (region, region) } else { (pixel, i) };
                let h = hidden.states[e];
                let grad = load::<S, N>(self.grad, node);
                let logit = hidden.logit(e, inputs.bias[node]);
                let weight = (leaky(logit) - self.log_sums[node]).exp();
                let d_logit = weight
                    * (dot(simd, &grad, &h) - self.means[node])
                    * if logit > 0.0 { 1.0 } else { LEAK };
                bias[slot] += d_logit;
                d_score = add_scaled(simd, &d_score, &h, d_logit);
                let through = add_scaled(simd, &zero::<S, N>(simd), &grad, weight);
                let through = add_scaled(simd, &through, &hidden.score, d_logit);
                let mut d_h = through;
                for j in 0..N {
                    d_h[j] = simd.select_f32s(simd.greater_than_f32s(h[j], nothing), through[j], nothing);
                    d_pixel[j] = simd.add_f32s(d_pixel[j], d_h[j]);
                }
                add(simd, &mut small, region, &d_h);
                d_states.push(d_h);
            }
            store::<S, N>(self.d_pixel, i, &d_pixel);
            for f in 0..features {
                let mut sum = load::<S, N>(&small, regions + f);
                for (edge, d_h) in hidden.edges.iter().zip(&d_states) {
                    sum = add_scaled(simd, &sum, d_h, edge.features[f]);
                }
                store::<S, N>(&mut small, regions + f, &sum);
            }
            let mut sum = load::<S, N>(&small, regions + features);
            for (edge, d_h) in hidden.edges.iter().zip(&d_states) {
                sum = add_scaled(simd, &sum, d_h, edge.noise);
            }
            store::<S, N>(&mut small, regions + features, &sum);
        }
        store::<S, N>(&mut small, regions + features + 1, &d_score);
        BackwardPartial { small, bias }
    }
}
