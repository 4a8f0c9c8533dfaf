//! Layer normalisation over the last dimension (Ba, Kiros, Hinton 2016).
//!
//! One pass forward and one backward; candle's primitives need about eight and its own fused version drops gradients.

use super::contiguous_f32;
use crate::error::Result;
use candle_core::{CpuStorage, CustomOp3, Layout, Shape, Tensor};
use rayon::prelude::*;

const EPSILON: f32 = 1e-5;
/// Rows of one parallel task: fixed, so that sums do not depend on the number of threads.
const ROWS: usize = 1024;

/// (x - mean) / sqrt(variance + 1e-5) * gain + offset over the last dimension.
///
/// `x`: (N, C); `gain`, `offset`: (C). Returns (N, C).
///
/// # Errors
/// When the shapes do not fit.
pub fn layer_norm(x: &Tensor, gain: &Tensor, offset: &Tensor) -> Result<Tensor> {
    Ok(x.contiguous()?.apply_op3(gain, offset, LayerNorm)?) // (N, C)
}

struct LayerNorm;

/// Mean and reciprocal deviation of a row.
fn moments(row: &[f32]) -> (f32, f32) {
    let n = row.len() as f32;
    let mean = row.iter().sum::<f32>() / n;
    let variance = row.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / n;
    (mean, (variance + EPSILON).sqrt().recip())
}

impl CustomOp3 for LayerNorm {
    fn name(&self) -> &'static str {
        "layer-norm"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        gain: &CpuStorage,
        gain_layout: &Layout,
        offset: &CpuStorage,
        offset_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let (x, gain, offset) = (
            contiguous_f32(x, x_layout)?,
            contiguous_f32(gain, gain_layout)?,
            contiguous_f32(offset, offset_layout)?,
        );
        let width = gain.len();
        let mut out = vec![0.0; x.len()];
        out.par_chunks_mut(ROWS * width).zip(x.par_chunks(ROWS * width)).for_each(|(out, x)| {
            for (out, row) in out.chunks_exact_mut(width).zip(x.chunks_exact(width)) {
                let (mean, scale) = moments(row);
                for (((o, v), g), b) in out.iter_mut().zip(row).zip(gain).zip(offset) {
                    *o = (v - mean) * scale * g + b;
                }
            }
        });
        Ok((CpuStorage::F32(out), x_layout.shape().clone()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        gain: &Tensor,
        _offset: &Tensor,
        _out: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let (xs, gains, grads) =
            (x.flatten_all()?.to_vec1::<f32>()?, gain.to_vec1::<f32>()?, grad.flatten_all()?.to_vec1::<f32>()?);
        let width = gains.len();
        let mut dx = vec![0.0f32; xs.len()];
        let partial: Vec<(Vec<f32>, Vec<f32>)> = dx
            .par_chunks_mut(ROWS * width)
            .zip(xs.par_chunks(ROWS * width))
            .zip(grads.par_chunks(ROWS * width))
            .map(|((dx, x), grad)| {
                let (mut d_gain, mut d_offset) = (vec![0.0f32; width], vec![0.0f32; width]);
                let rows = dx.chunks_exact_mut(width).zip(x.chunks_exact(width)).zip(grad.chunks_exact(width));
                for ((dx, row), grad) in rows {
                    let (mean, scale) = moments(row);
                    let (mut sum, mut dot) = (0.0f32, 0.0f32);
                    for i in 0..width {
                        let unit = (row[i] - mean) * scale;
                        d_gain[i] += grad[i] * unit;
                        d_offset[i] += grad[i];
                        let g = grad[i] * gains[i];
                        sum += g;
                        dot += g * unit;
                    }
                    let (sum, dot) = (sum / width as f32, dot / width as f32);
                    for i in 0..width {
                        let unit = (row[i] - mean) * scale;
                        dx[i] = scale * (grad[i] * gains[i] - sum - unit * dot);
                    }
                }
                (d_gain, d_offset)
            })
            .collect();
        let (mut d_gain, mut d_offset) = (vec![0.0f32; width], vec![0.0f32; width]);
        for (gain, offset) in &partial {
            for i in 0..width {
                d_gain[i] += gain[i];
                d_offset[i] += offset[i];
            }
        }
        let device = x.device();
        Ok((
            Some(Tensor::from_vec(dx, x.shape(), device)?),
            Some(Tensor::from_vec(d_gain, width, device)?),
            Some(Tensor::from_vec(d_offset, width, device)?),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::ParamStore;
    use crate::seed::Seed;
    use candle_core::D;

    #[test]
    fn equals_the_primitives_forward_and_backward() {
        let mut params = ParamStore::new(Seed(5));
        let x = params.normal("x", (2500, 8), 2.0).unwrap();
        let gain = params.normal("gain", 8, 1.0).unwrap();
        let offset = params.normal("offset", 8, 1.0).unwrap();
        let weight = ParamStore::new(Seed(6)).normal("w", (2500, 8), 1.0).unwrap();
        let plain = {
            let centred = x.broadcast_sub(&x.mean_keepdim(D::Minus1).unwrap()).unwrap();
            let variance = centred.sqr().unwrap().mean_keepdim(D::Minus1).unwrap();
            let unit = centred.broadcast_div(&(variance + f64::from(EPSILON)).unwrap().sqrt().unwrap()).unwrap();
            unit.broadcast_mul(&gain).unwrap().broadcast_add(&offset).unwrap()
        };
        let fused = layer_norm(&x, &gain, &offset).unwrap();
        let flat = |t: &Tensor| t.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let close = |a: &[f32], b: &[f32], tolerance: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * (1.0 + b.abs()));
        assert!(close(&flat(&fused), &flat(&plain), 1e-5));
        let backward = |y: &Tensor| (y * &weight).unwrap().sum_all().unwrap().backward().unwrap();
        let (a, b) = (backward(&fused), backward(&plain));
        for (_, var) in params.iter() {
            assert!(close(&flat(a.get(var).unwrap()), &flat(b.get(var).unwrap()), 1e-4));
        }
    }
}
