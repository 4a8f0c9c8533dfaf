//! What every trained system stands on: an ordered, seeded [`ParamStore`], [`Adam`] with its [`Schedule`], and layers
//! whose gradients are whole. The only room besides the trained systems that names `candle`.

mod adam;
mod contiguous;
pub mod convolution;
mod layer_norm;
mod param_store;

pub use adam::{Adam, Schedule};
pub use contiguous::contiguous_f32;
pub use layer_norm::layer_norm;
pub use param_store::ParamStore;
