//! What every trained system stands on: an ordered, seeded [`ParamStore`], [`Adam`] with its [`Schedule`], a
//! [`convolution`], [`layers`] of networks of images, what adversarial training needs ([`gan`]) and vector mathematics. The only room besides the trained systems that names `candle`.

mod checkpoints;
mod contiguous;
pub mod convolution;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
pub(crate) mod gan;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
pub(crate) mod layers;
#[allow(dead_code, unused_imports, reason = "parts for the conditional GAN and the VAE to come, tested here")]
mod optim;
mod param_store;
mod pool;
mod ssim;
mod vector_math;

pub(crate) use checkpoints::{Numbers, Resumable};
pub(crate) use contiguous::contiguous_f32;
pub(crate) use optim::Adam;
#[allow(unused_imports, reason = "for the conditional GAN to come")]
pub(crate) use optim::{Average, Decay, Schedule};
pub(crate) use param_store::ParamStore;
pub(crate) use pool::in_pool;
pub(crate) use ssim::SsimLoss;
pub(crate) use vector_math::{exp, ln, sin_cos_quarter_turns, tanh};
