//! What every trained system stands on: an ordered, seeded [`ParamStore`], [`Adam`] with its [`Schedule`], a
//! [`convolution`] and vector mathematics. The only room besides the trained systems that names `candle`.

mod adam;
mod checkpoints;
mod contiguous;
pub mod convolution;
mod param_store;
mod pool;
mod vector_math;

pub use adam::{Adam, Schedule};
pub use checkpoints::{Numbers, Resumable};
pub use contiguous::contiguous_f32;
pub use param_store::ParamStore;
pub use pool::in_pool;
pub use vector_math::{exp, ln, sin_cos_quarter_turns, tanh};
