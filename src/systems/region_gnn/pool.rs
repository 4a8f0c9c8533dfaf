//! The pooled neighbours inside `Enc` (Liu & Benes 2025, A.5), as one sparse product each way.

use super::config::Pooling;
use super::edges::PassEdges;
use crate::error::Result;
use crate::learn::contiguous_f32;
use candle_core::{CpuStorage, CustomOp1, Layout, Shape, Tensor};
use rayon::prelude::*;
use std::sync::Arc;

/// Which side of the bipartite graph receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Toward {
    /// Pixels to regions.
    Regions,
    /// Regions to pixels; masked regions send nothing.
    Pixels,
}

/// Mean or sum of the states at the other end of every edge; a mean counts masked ends as zero.
///
/// `states`: (pixels, H) toward regions, (regions, H) toward pixels. Returns (regions, H) or (pixels, H).
pub(super) fn pool(states: &Tensor, edges: &Arc<PassEdges>, toward: Toward, pooling: Pooling) -> Result<Tensor> {
    Ok(states.contiguous()?.apply_op1(Pool { edges: Arc::clone(edges), toward, pooling })?)
}

struct Pool {
    edges: Arc<PassEdges>,
    toward: Toward,
    pooling: Pooling,
}

impl Pool {
    fn weight(&self, degree: usize) -> f32 {
        match self.pooling {
            Pooling::Mean => 1.0 / degree.max(1) as f32,
            Pooling::Sum => 1.0,
        }
    }

    fn counts(&self) -> (usize, usize) {
        let graph = self.edges.graph();
        (graph.pixel_count(), graph.region_count())
    }

    /// (pixels, H) -> (regions, H): each region sums its pixels, weighted by `weight(region, pixel)`.
    fn onto_regions(&self, x: &[f32], width: usize, weight: impl Fn(usize, usize) -> f32 + Sync) -> Vec<f32> {
        let mut out = vec![0.0; self.counts().1 * width];
        out.par_chunks_mut(width).enumerate().for_each(|(region, out)| {
            for pixel in self.edges.pixels_of(region) {
                add_scaled(out, &x[pixel * width..(pixel + 1) * width], weight(region, pixel));
            }
        });
        out
    }

    /// (regions, H) -> (pixels, H): each pixel sums its regions.
    fn onto_pixels(&self, x: &[f32], width: usize, weight: impl Fn(usize, usize) -> f32 + Sync) -> Vec<f32> {
        let mut out = vec![0.0; self.counts().0 * width];
        out.par_chunks_mut(width * 256).enumerate().for_each(|(chunk, out)| {
            for (i, out) in out.chunks_exact_mut(width).enumerate() {
                let pixel = chunk * 256 + i;
                for region in self.edges.regions_of(pixel) {
                    add_scaled(out, &x[region * width..(region + 1) * width], weight(region, pixel));
                }
            }
        });
        out
    }

    /// Weight of the edge region - pixel.
    fn edge_weight(&self, region: usize, pixel: usize) -> f32 {
        match self.toward {
            Toward::Regions => self.weight(self.edges.region_degree(region)),
            Toward::Pixels if self.edges.masked()[region] => 0.0,
            Toward::Pixels => self.weight(self.edges.pixel_degree(pixel)),
        }
    }
}

fn add_scaled(out: &mut [f32], x: &[f32], weight: f32) {
    for (o, v) in out.iter_mut().zip(x) {
        *o += v * weight;
    }
}

impl CustomOp1 for Pool {
    fn name(&self) -> &'static str {
        "pool"
    }

    fn cpu_fwd(&self, x: &CpuStorage, layout: &Layout) -> candle_core::Result<(CpuStorage, Shape)> {
        let (_, width) = layout.shape().dims2()?;
        let x = contiguous_f32(x, layout)?;
        let (pixels, regions) = self.counts();
        let (out, rows) = match self.toward {
            Toward::Regions => (self.onto_regions(x, width, |r, p| self.edge_weight(r, p)), regions),
            Toward::Pixels => (self.onto_pixels(x, width, |r, p| self.edge_weight(r, p)), pixels),
        };
        Ok((CpuStorage::F32(out), (rows, width).into()))
    }

    fn bwd(&self, x: &Tensor, _out: &Tensor, grad: &Tensor) -> candle_core::Result<Option<Tensor>> {
        let (_, width) = x.dims2()?;
        let grad = grad.flatten_all()?.to_vec1::<f32>()?;
        let out = match self.toward {
            Toward::Regions => self.onto_pixels(&grad, width, |r, p| self.edge_weight(r, p)),
            Toward::Pixels => self.onto_regions(&grad, width, |r, p| self.edge_weight(r, p)),
        };
        Ok(Some(Tensor::from_vec(out, x.shape(), x.device())?))
    }
}
