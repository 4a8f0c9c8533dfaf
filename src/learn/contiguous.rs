//! Reading a candle tensor's memory inside a custom operation.

use candle_core::{CpuStorage, Layout};

/// The values of a contiguous f32 tensor.
///
/// # Errors
/// When the tensor is not contiguous or not f32: a custom operation does not copy behind its caller's back.
pub(crate) fn contiguous_f32<'a>(storage: &'a CpuStorage, layout: &Layout) -> candle_core::Result<&'a [f32]> {
    let values = storage.as_slice::<f32>()?;
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&values[start..end]),
        None => candle_core::bail!("a custom operation needs a contiguous tensor, not {:?}", layout.shape()),
    }
}
