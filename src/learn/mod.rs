//! What every trained system stands on: an ordered, seeded [`ParamStore`], [`Adam`] with its [`Schedule`], a
//! [`convolution`], [`layers`] of networks of images, what adversarial training needs ([`gan`]) and vector mathematics. The only room besides the trained systems that names `candle`.

mod checkpoints;
mod contiguous;
pub mod convolution;
pub mod gan;
pub mod layers;
mod optim;
mod param_store;
mod pool;
mod ssim;
mod vector_math;

pub use checkpoints::{Numbers, Resumable};
pub use contiguous::contiguous_f32;
pub use optim::{Adam, Average, Decay, Schedule};
pub use param_store::ParamStore;
pub use pool::in_pool;
pub use ssim::SsimLoss;
pub use vector_math::{exp, ln, sin_cos_quarter_turns, tanh};
