//! The natural-neighbour correction inside training: heights that meet the sketch, with a gradient.
//!
//! y + N (z - y on the lines), N the Sibson weights of every pixel over the line cells
//! ([`NaturalNeighbours`]). Linear in y, so its gradient is one product with the transpose.

use crate::control::Stop;
use crate::error::Result;
use crate::interpolation::{NaturalNeighbours, SparseMatrix};
use crate::learn::contiguous_f32;
use crate::sketch::LineMap;
use candle_core::{CpuStorage, CustomOp1, Layout, Shape, Tensor};
use std::sync::Arc;

/// The correction of one sketch.
#[derive(Clone, Debug)]
pub(super) struct LineCorrection(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    /// (pixels, line cells)
    weights: SparseMatrix,
    /// (line cells, pixels)
    transposed: SparseMatrix,
    cells: Vec<u32>,
    heights: Vec<f32>,
}

impl LineCorrection {
    /// Weights for the cells of `lines`.
    ///
    /// # Errors
    /// When there is no line, or it is stopped.
    pub(super) fn new(lines: &LineMap, stop: &Stop) -> Result<Self> {
        let weights = NaturalNeighbours::new(&lines.mask())?.weights_until(stop)?;
        let transposed = weights.transpose();
        let kinds = lines.kinds().as_slice();
        let cells: Vec<u32> = (0..kinds.len()).filter(|&i| kinds[i].is_some()).map(|i| i as u32).collect();
        let heights = cells.iter().map(|&i| lines.heights().as_slice()[i as usize]).collect();
        Ok(Self(Arc::new(Parts { weights, transposed, cells, heights })))
    }

    /// Natural-neighbour interpolation of the lines: (pixels).
    pub(super) fn interpolate(&self) -> Vec<f32> {
        self.0.weights.product(&self.0.heights)
    }

    /// (pixels) -> (pixels)
    pub(super) fn apply(&self, heights: &Tensor) -> Result<Tensor> {
        Ok(heights.contiguous()?.apply_op1(self.clone())?)
    }

    /// The correction of plain numbers.
    pub(super) fn correct(&self, heights: &[f32]) -> Vec<f32> {
        let p = &self.0;
        let missing: Vec<f32> =
            p.cells.iter().zip(&p.heights).map(|(&i, z)| z - heights[i as usize]).collect();
        let mut out = p.weights.product(&missing);
        for (out, y) in out.iter_mut().zip(heights) {
            *out += y;
        }
        out
    }
}

impl CustomOp1 for LineCorrection {
    fn name(&self) -> &'static str {
        "line-correction"
    }

    fn cpu_fwd(&self, heights: &CpuStorage, layout: &Layout) -> candle_core::Result<(CpuStorage, Shape)> {
        Ok((CpuStorage::F32(self.correct(contiguous_f32(heights, layout)?)), layout.shape().clone()))
    }

    fn bwd(&self, heights: &Tensor, _out: &Tensor, grad: &Tensor) -> candle_core::Result<Option<Tensor>> {
        let mut grad = grad.flatten_all()?.to_vec1::<f32>()?;
        let on_lines = self.0.transposed.product(&grad);
        for (&cell, value) in self.0.cells.iter().zip(&on_lines) {
            grad[cell as usize] -= value;
        }
        Ok(Some(Tensor::from_vec(grad, heights.shape(), heights.device())?))
    }
}
