//! SinGAN for terrain: detail that has the statistics of one exemplar (Rott Shaham et al. 2019; Liu & Benes 2025, 4.4).

mod checkpoint;
pub(crate) mod config;
mod detail;
mod network;
mod scale;
mod system;
mod train;

pub use config::DetailConfig;
pub(crate) use detail::Detail;
#[cfg(test)]
pub(crate) use detail::DetailInfo;
#[cfg(test)]
pub(crate) use train::train;

#[cfg(test)]
mod tests;
