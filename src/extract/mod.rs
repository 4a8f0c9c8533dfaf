//! From terrain to the lines that a hand would draw: ridges and valleys of a DEM (Liu & Benes 2025, 4.1).
//!
//! The paper calls these lines "DEM contours"; in terrain work a contour is an isoline, so we say ridges and valleys.

mod config;
mod context;
mod lines;
mod main_lines;
mod network;
pub mod random;
mod relief;
#[cfg(test)]
mod tests;
mod variants;

pub use config::{ExtractionConfig, Routing};
pub use context::crop_lines;
pub use lines::{Extraction, extract, ridges_and_valleys, ridges_and_valleys_until};
pub use main_lines::{MainLines, MainLinesConfig};
pub use variants::variants;
