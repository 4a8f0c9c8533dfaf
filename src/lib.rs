//! **monadnock** learns the style of a landscape from one digital elevation model (DEM) and turns a few drawn ridges
//! and valleys into new terrain in that style.
//!
//! The rooms below stand in the order in which data flows. **A room imports only rooms listed above it**
//! (`tests/architecture.rs` enforces it), so reading them once, top to bottom, is reading the whole path.

pub mod error;
pub mod file;
pub mod machine;
pub mod seed;
pub mod control;
pub mod checked;
pub mod arrays;
pub mod grid;
pub mod dem;
pub mod flow;
pub mod sketch;
pub mod extract;
pub mod matching;
pub mod interpolation;
pub mod landscape;
pub mod metrics;
pub(crate) mod sparse;
pub mod viz;
pub mod learn;
pub mod systems;
pub mod style;
pub mod evaluate;
pub mod experiment;
pub mod cli;

pub use error::{Error, Result};

/// The examples of the README, compiled and run as doctests.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeExamples;
