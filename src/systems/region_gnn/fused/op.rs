//! The fused pass as one operation of candle: (parameters, embedding) -> heights.

use super::super::edges::PassEdges;
use super::pass::{Given, Pass, Saved};
use crate::learn::contiguous_f32;
use candle_core::{CpuStorage, CustomOp2, Layout, Shape, Tensor};
use std::sync::{Arc, Mutex};

/// Memory handed from one pass to the next.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Buffers(Arc<Mutex<Vec<Saved>>>);

/// One application to one set of edges.
struct FusedOp {
    pass: Arc<Pass>,
    edges: Arc<PassEdges>,
    first_regions: Vec<f32>,
    buffers: Buffers,
    /// What forward left for backward.
    saved: Mutex<Saved>,
}

/// Heights of every pixel, then the height of a pixel that no message reaches: (pixels + 1).
///
/// `params`: the parameters in the order of [`Layout`](super::layout::Layout); `embedding`: (regions, embedding); `first_regions`:
/// (regions, H), E^(0).
pub(in super::super) fn fused(
    pass: &Arc<Pass>,
    edges: &Arc<PassEdges>,
    params: &Tensor,
    embedding: &Tensor,
    first_regions: Vec<f32>,
    buffers: &Buffers,
) -> candle_core::Result<Tensor> {
    let saved = lock(&buffers.0).pop().unwrap_or_default();
    let op = FusedOp {
        pass: Arc::clone(pass),
        edges: Arc::clone(edges),
        first_regions,
        buffers: buffers.clone(),
        saved: Mutex::new(saved),
    };
    params.contiguous()?.apply_op2(&embedding.contiguous()?, op)
}

/// A poisoned lock means that another thread panicked; what it holds is overwritten before it is read.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Drop for FusedOp {
    fn drop(&mut self) {
        lock(&self.buffers.0).push(std::mem::take(&mut *lock(&self.saved)));
    }
}

impl CustomOp2 for FusedOp {
    fn name(&self) -> &'static str {
        "region-gnn"
    }

    fn cpu_fwd(
        &self,
        params: &CpuStorage,
        params_layout: &Layout,
        embedding: &CpuStorage,
        embedding_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let given = Given {
            edges: &self.edges,
            params: contiguous_f32(params, params_layout)?,
            embedding: contiguous_f32(embedding, embedding_layout)?,
            first_regions: &self.first_regions,
        };
        let heights = self.pass.forward(&given, &mut lock(&self.saved));
        let shape = heights.len().into();
        Ok((CpuStorage::F32(heights), shape))
    }

    fn bwd(
        &self,
        params: &Tensor,
        embedding: &Tensor,
        _heights: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>)> {
        let flat = |t: &Tensor| t.flatten_all()?.to_vec1::<f32>();
        let (param_values, embedding_values) = (flat(params)?, flat(embedding)?);
        let given = Given {
            edges: &self.edges,
            params: &param_values,
            embedding: &embedding_values,
            first_regions: &self.first_regions,
        };
        let (d_params, d_embedding) = self.pass.backward(&given, &lock(&self.saved), &flat(grad)?);
        let device = params.device();
        Ok((
            Some(Tensor::from_vec(d_params, params.shape(), device)?),
            Some(Tensor::from_vec(d_embedding, embedding.shape(), device)?),
        ))
    }
}
