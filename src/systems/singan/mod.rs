//! SinGAN for terrain: detail that has the statistics of one exemplar (Rott Shaham et al. 2019; Liu & Benes 2025, 4.4).

mod batch_norm;
mod network;
mod penalty;

#[cfg(test)]
mod network_tests;
