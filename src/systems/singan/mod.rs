//! SinGAN for terrain: detail that has the statistics of one exemplar (Rott Shaham et al. 2019; Liu & Benes 2025, 4.4).

mod checkpoint;
pub mod config;
mod detail;
mod network;
mod scale;
mod system;
mod train;

pub use config::DetailConfig;
pub use detail::{Detail, DetailInfo, DetailRecord};
pub use scale::ScaleInfo;
pub use train::train;

#[cfg(test)]
mod tests;
