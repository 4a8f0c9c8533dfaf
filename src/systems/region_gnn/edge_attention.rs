//! Graph attention over all edges in one pass (Liu & Benes 2025, Eq. 1 and A.5), nothing stored per edge.
//!
//! The first layer of `Enc` is linear in its concatenated inputs, so it splits into a pixel part, a region part and an
//! edge part; the second layer is linear too and commutes with the attention average. What is left per edge is
//!
//! ```text
//! h_e   = relu(pixel[p] + region[r] + W f_e)        f_e: edge features and noise
//! t_e   = w . h_e + q[v]                            v: the receiving node
//! a_e   = softmax over the edges of v of leaky_relu(t_e)
//! out_v = sum a_e h_e
//! ```
//!
//! Edges of masked regions are left out; a node without edges receives zero. Cost: about 2 (features + 3) H flops an edge
//! forward, three times that backward. Both directions stream the edges in pixel order; what goes to regions is summed in
//! [`CHUNKS`] partial buffers whose number does not depend on the threads, so that every thread count gives the same bytes.

use super::edge_kernel::{Backward, ForwardToPixels, ForwardToRegions, RegionPartial};
use super::edges::PassEdges;
use super::pool::Toward;
use crate::error::Result;
use crate::learn::contiguous_f32;
use candle_core::{CpuStorage, CustomOp3, Layout, Shape, Tensor};
use pulp::Arch;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Number of parallel tasks and partial buffers.
const CHUNKS: usize = 16;

/// Attention-weighted mean of the hidden layer over the edges of each receiving node.
///
/// `pixel`: (pixels, H); `region`: (regions, H); `weights`: (features + 1, H), the last row for the noise; `score`: (H);
/// `bias`: one value a receiving node. Returns (receiving nodes, H).
pub(super) fn edge_attention(
    edges: &Arc<PassEdges>,
    toward: Toward,
    pixel: &Tensor,
    region: &Tensor,
    weights: &Tensor,
    score: &Tensor,
    bias: &Tensor,
) -> Result<Tensor> {
    let width = pixel.dims2()?.1;
    // A custom operation takes three tensors: the small ones travel as one.
    let small = Tensor::cat(&[region, weights, &score.reshape((1, width))?], 0)?;
    let op = EdgeAttention { edges: Arc::clone(edges), toward, log_sums: OnceLock::new() };
    Ok(pixel.contiguous()?.apply_op3(&small, &bias.flatten_all()?.contiguous()?, op)?)
}

struct EdgeAttention {
    edges: Arc<PassEdges>,
    toward: Toward,
    /// Logarithm of the softmax denominator of each receiving node, kept for the backward pass.
    log_sums: OnceLock<Vec<f32>>,
}

/// The inputs of one application, as slices.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub(super) edges: &'a PassEdges,
    pub(super) width: usize,
    pub(super) pixel: &'a [f32],
    pub(super) region: &'a [f32],
    pub(super) weights: &'a [f32],
    pub(super) score: &'a [f32],
    pub(super) bias: &'a [f32],
}

impl EdgeAttention {
    fn inputs<'a>(&'a self, pixel: &'a [f32], small: &'a [f32], bias: &'a [f32], width: usize) -> Inputs<'a> {
        let (region, rest) = small.split_at(self.edges.graph().region_count() * width);
        let (weights, score) = rest.split_at(rest.len() - width);
        Inputs { edges: &self.edges, width, pixel, region, weights, score, bias }
    }

    fn chunk_pixels(&self) -> usize {
        self.edges.graph().pixel_count().div_ceil(CHUNKS)
    }
}

impl CustomOp3 for EdgeAttention {
    fn name(&self) -> &'static str {
        "edge-attention"
    }

    fn cpu_fwd(
        &self,
        pixel: &CpuStorage,
        pixel_layout: &Layout,
        small: &CpuStorage,
        small_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let (pixels, width) = pixel_layout.shape().dims2()?;
        let inputs = self.inputs(
            contiguous_f32(pixel, pixel_layout)?,
            contiguous_f32(small, small_layout)?,
            contiguous_f32(bias, bias_layout)?,
            width,
        );
        let chunk = self.chunk_pixels();
        let arch = Arch::new();
        let (out, log_sums) = match self.toward {
            Toward::Pixels => {
                let (mut out, mut log_sums) = (vec![0.0; pixels * width], vec![0.0; pixels]);
                out.par_chunks_mut(chunk * width).zip(log_sums.par_chunks_mut(chunk)).enumerate().for_each(
                    |(i, (out, log_sums))| {
                        arch.dispatch(ForwardToPixels { inputs, first_pixel: i * chunk, out, log_sums });
                    },
                );
                (out, log_sums)
            }
            Toward::Regions => {
                let partials: Vec<RegionPartial> = (0..pixels.div_ceil(chunk))
                    .into_par_iter()
                    .map(|i| {
                        let pixels = i * chunk..pixels.min((i + 1) * chunk);
                        arch.dispatch(ForwardToRegions { inputs, pixels })
                    })
                    .collect();
                RegionPartial::merge(&partials, width)
            }
        };
        let nodes = log_sums.len();
        // candle runs a forward once; should that change, the first result stays valid: the inputs are the same.
        let _ = self.log_sums.set(log_sums);
        Ok((CpuStorage::F32(out), (nodes, width).into()))
    }

    fn bwd(
        &self,
        pixel: &Tensor,
        small: &Tensor,
        bias: &Tensor,
        out: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let flat = |t: &Tensor| t.flatten_all()?.to_vec1::<f32>();
        let (pixels, width) = pixel.dims2()?;
        let (pixel_values, small_values, bias_values) = (flat(pixel)?, flat(small)?, flat(bias)?);
        let (out, grad) = (flat(out)?, flat(grad)?);
        let Some(log_sums) = self.log_sums.get() else {
            candle_core::bail!("edge attention: backward before forward");
        };
        let inputs = self.inputs(&pixel_values, &small_values, &bias_values, width);
        // grad . out of each receiving node: the mean that the softmax gradient subtracts.
        let means: Vec<f32> = grad
            .chunks_exact(width)
            .zip(out.chunks_exact(width))
            .map(|(g, o)| g.iter().zip(o).map(|(g, o)| g * o).sum())
            .collect();
        let chunk = self.chunk_pixels();
        let arch = Arch::new();
        let mut d_pixel = vec![0.0; pixels * width];
        let toward = self.toward;
        let partials: Vec<_> = d_pixel
            .par_chunks_mut(chunk * width)
            .enumerate()
            .map(|(i, d_pixel)| {
                arch.dispatch(Backward {
                    inputs,
                    toward,
                    first_pixel: i * chunk,
                    log_sums,
                    grad: &grad,
                    means: &means,
                    d_pixel,
                })
            })
            .collect();
        let mut d_small = vec![0.0; small_values.len()];
        let mut d_bias = vec![0.0; bias_values.len()];
        let mut first = 0;
        for partial in &partials {
            for (sum, value) in d_small.iter_mut().zip(&partial.small) {
                *sum += value;
            }
            match toward {
                Toward::Regions => d_bias.iter_mut().zip(&partial.bias).for_each(|(sum, value)| *sum += value),
                Toward::Pixels => {
                    d_bias[first..first + partial.bias.len()].copy_from_slice(&partial.bias);
                    first += partial.bias.len();
                }
            }
        }
        let device = pixel.device();
        Ok((
            Some(Tensor::from_vec(d_pixel, pixel.shape(), device)?),
            Some(Tensor::from_vec(d_small, small.shape(), device)?),
            Some(Tensor::from_vec(d_bias, bias.shape(), device)?),
        ))
    }
}
