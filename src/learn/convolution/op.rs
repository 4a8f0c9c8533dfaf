//! The convolution as a candle operation.

use super::{Finish, Image, Plane, add_weight_gradient, check_channels, convolve, turned};
use crate::error::Result;
use crate::learn::contiguous_f32;
use candle_core::{CpuStorage, CustomOp2, Layout, Shape, Storage, Tensor};
use std::hint::black_box;
use std::sync::Once;

/// A little less than the largest allocation whose release the GNU allocator learns from (32 MiB).
const LARGEST_LESSON: usize = 31 << 20;

/// The valid 3x3 convolution.
///
/// `image`: (rows, cols, channels); `weights`: (9, channels, out channels), taps row by row. Returns
/// (rows - 2, cols - 2, out channels).
///
/// # Errors
/// When shapes do not fit or [`check_channels`] refuses the channels.
pub fn convolve3(image: &Tensor, weights: &Tensor) -> Result<Tensor> {
    keep_freed_memory();
    Ok(image.contiguous()?.apply_op2(&weights.contiguous()?, Convolution)?)
}

/// Lets the GNU allocator keep up to 62 MiB that were freed, in place of returning them to the system.
///
/// Every tensor of a graph is fresh memory, and fresh pages cost as much as the convolution itself. That allocator takes what is
/// larger than a threshold from the system directly, and keeps twice the threshold; it raises the threshold to the largest such
/// piece that was freed. The piece is never touched, so it takes no memory. Other allocators have no such rule, and lose nothing.
fn keep_freed_memory() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| drop(black_box(Vec::<u8>::with_capacity(LARGEST_LESSON))));
}

struct Convolution;

impl CustomOp2 for Convolution {
    fn name(&self) -> &'static str {
        "convolution-3x3"
    }

    fn cpu_fwd(
        &self,
        image: &CpuStorage,
        image_layout: &Layout,
        weights: &CpuStorage,
        weights_layout: &Layout,
    ) -> candle_core::Result<(CpuStorage, Shape)> {
        let (rows, cols, channels) = image_layout.shape().dims3()?;
        let (taps, of, out_channels) = weights_layout.shape().dims3()?;
        if taps != 9 || of != channels || rows < 3 || cols < 3 {
            let (image, weights) = (image_layout.shape(), weights_layout.shape());
            candle_core::bail!("a 3x3 convolution of {image:?} with weights {weights:?}");
        }
        check_channels(channels, out_channels).map_err(candle_core::Error::wrap)?;
        let image = Image::new(rows, cols, channels, contiguous_f32(image, image_layout)?);
        let mut out = Plane::zeros(rows - 2, cols - 2, out_channels, 0);
        convolve(image, contiguous_f32(weights, weights_layout)?, &mut out, Finish::Store);
        Ok((CpuStorage::F32(out.into_values()), Shape::from((rows - 2, cols - 2, out_channels))))
    }

    fn bwd(
        &self,
        image: &Tensor,
        weights: &Tensor,
        _out: &Tensor,
        grad: &Tensor,
    ) -> candle_core::Result<(Option<Tensor>, Option<Tensor>)> {
        let (rows, cols, channels) = image.dims3()?;
        let out_channels = weights.dim(2)?;
        let grad = grad.contiguous()?;
        let mut delta = Plane::zeros(rows - 2, cols - 2, out_channels, 2);
        with_values(&grad, |values| {
            for (row, values) in values.chunks_exact((cols - 2) * out_channels).enumerate() {
                delta.row_mut(row).copy_from_slice(values);
            }
        })?;
        let mut d_weights = vec![0.0; weights.elem_count()];
        with_values(image, |values| {
            add_weight_gradient(Image::new(rows, cols, channels, values), &delta, &mut d_weights);
        })?;
        let d_image = with_values(weights, |taps| input_gradient(&delta, taps, channels))?;
        Ok((
            Some(Tensor::from_vec(d_image, (rows, cols, channels), image.device())?),
            Some(Tensor::from_vec(d_weights, weights.shape(), weights.device())?),
        ))
    }
}

/// Reads a contiguous tensor where it lies.
fn with_values<T>(tensor: &Tensor, read: impl FnOnce(&[f32]) -> T) -> candle_core::Result<T> {
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => Ok(read(contiguous_f32(storage, layout)?)),
        _ => candle_core::bail!("the convolution is for the CPU"),
    }
}

/// The gradient of the image. A few output channels have no kernel of their own way back from a few: zeros fill up.
fn input_gradient(delta: &Plane, weights: &[f32], channels: usize) -> Vec<f32> {
    let (rows, cols) = delta.stored();
    let mut out = Plane::zeros(rows - 2, cols - 2, channels, 0);
    if check_channels(delta.channels(), channels).is_ok() {
        convolve(delta, &turned(weights, channels, delta.channels()), &mut out, Finish::Store);
        return out.into_values();
    }
    // Three input channels: the kernel has one or two, so each alone.
    let out_channels = delta.channels();
    let mut values = vec![0.0; out.values().len()];
    for channel in 0..channels {
        let one: Vec<f32> = weights
            .chunks_exact(channels * out_channels)
            .flat_map(|tap| &tap[channel * out_channels..(channel + 1) * out_channels])
            .copied()
            .collect();
        let mut out = Plane::zeros(rows - 2, cols - 2, 1, 0);
        convolve(delta, &turned(&one, 1, out_channels), &mut out, Finish::Store);
        for (value, v) in values.iter_mut().skip(channel).step_by(channels).zip(out.values()) {
            *value = *v;
        }
    }
    values
}
