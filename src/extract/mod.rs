//! From terrain to the lines that a hand would draw: ridges and valleys of a DEM (Liu & Benes 2025, 4.1).
//!
//! The paper calls these lines "DEM contours"; in terrain work a contour is an isoline, so we say ridges and valleys.

mod config;
mod context;
mod lines;
mod main_lines;
mod network;
pub(crate) mod random;
mod relief;
#[cfg(test)]
mod tests;
mod variants;

pub use config::ExtractionConfig;
pub(crate) use config::Routing;
pub(crate) use context::crop_lines;
#[cfg(test)]
pub(crate) use lines::Extraction;
#[cfg(test)]
pub(crate) use lines::extract;
pub use lines::{ridges_and_valleys, ridges_and_valleys_until};
pub(crate) use main_lines::{MainLines, MainLinesConfig};
pub(crate) use variants::variants;
