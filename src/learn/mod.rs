//! What every trained system stands on: an ordered, seeded [`ParamStore`], [`Adam`] with its [`Schedule`], a
//! [`convolution`], [`layers`] of networks of images, what adversarial training needs ([`gan`]) and vector mathematics. The only room besides the trained systems that names `candle`.

mod checkpoints;
mod contiguous;
pub mod convolution;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
pub mod gan;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
pub mod layers;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
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
