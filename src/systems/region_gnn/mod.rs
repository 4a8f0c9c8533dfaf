//! Liu & Benes 2025: a graph neural network that learns one piece of terrain from its ridges and valleys.
//!
//! [`DrawnExemplar`] -> [`train`] -> [`RegionGnn`] -> terrain for any lines; [`RegionNetwork`] is all of it as a part of a style. What departs from the paper, and why, is in
//! `docs/papers/region_gnn.md`.

pub(crate) mod blend;
mod checkpoint;
pub mod config;
mod correction_op;
mod edge_features;
mod edges;
mod fused;
mod generate;
mod graph;
pub(crate) mod losses;
mod nearest;
mod network;
#[cfg(test)]
mod network_tests;
mod plain;
mod record;
mod region;
mod system;
mod train;
mod trust;

pub use config::{Preset, RegionGnnConfig};
pub use edges::PassEdges;
pub use generate::{FineTuning, GenerationConfig, RegionGnn};
pub use graph::RegionGraph;
pub use network::Network;
pub(crate) use record::LossValues;
pub(crate) use system::{RegionNetwork, RegionNetworkConfig};
pub use train::{DrawnExemplar, train};
