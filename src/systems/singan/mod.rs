//! SinGAN for terrain: detail that has the statistics of one exemplar (Rott Shaham et al. 2019; Liu & Benes 2025, 4.4).

mod batch_norm;
mod checkpoint;
pub mod config;
mod detail;
mod network;
mod optimizer;
mod penalty;
mod scale;
mod train;

pub use config::DetailConfig;
pub use detail::{Detail, DetailInfo, DetailRecord, ScaleInfo};
pub use train::train;

#[cfg(test)]
mod network_tests;
#[cfg(test)]
mod tests;
