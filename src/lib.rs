//! **monadnock** learns the style of a landscape from one digital elevation model (DEM) and turns a few drawn ridges
//! and valleys into new terrain in that style.
//!
//! The names below are enough for the whole way: [`read_dem`], [`ridges_and_valleys`], [`learn`], [`Style::generate`],
//! [`Style::amplify`], [`evaluate()`]. `docs/examples` walks it in numbered programs, up to a system of one's own
//! ([`systems::task`]).
//!
//! The rooms stand in the order in which data flows. **A room imports only rooms listed above it**
//! (`tests/architecture` enforces it), so reading them once, top to bottom, is reading the whole path.
//!
//! Rooms that the documentation leaves out are open for the project's own benchmarks alone and change without notice.
//!
//! Feature `cli` (on by default) adds the program, experiments and pictures; without it the library brings no fonts, plots,
//! progress bars or argument parser.

#![cfg_attr(
    not(feature = "cli"),
    allow(dead_code, unused_imports, reason = "some of it is called by the program alone")
)]

pub mod error;
pub(crate) mod file;
pub mod machine;
pub mod seed;
pub mod control;
pub mod checked;
pub mod arrays;
pub mod grid;
pub mod dem;
#[doc(hidden)]
pub mod flow;
pub mod sketch;
pub mod extract;
pub(crate) mod matching;
#[doc(hidden)]
pub mod interpolation;
#[doc(hidden)]
pub mod landscape;
pub mod metrics;
pub(crate) mod sparse;
#[cfg(feature = "cli")]
pub(crate) mod viz;
#[doc(hidden)]
pub mod learn;
pub mod systems;
pub mod style;
pub mod evaluate;
#[cfg(feature = "cli")]
pub(crate) mod experiment;
#[cfg(feature = "cli")]
pub mod cli;

pub use control::{Control, Progress, Stop};
pub use dem::io::{ReadOptions, WriteOptions, read as read_dem, write as write_dem};
pub use dem::{Dem, Normalization};
pub use error::{Error, Result};
pub use evaluate::evaluate;
pub use extract::{ExtractionConfig, ridges_and_valleys};
pub use grid::{Cell, Grid, Mask, Window};
pub use metrics::Scores;
pub use seed::Seed;
pub use sketch::{LineMap, Sketch, Stroke, StrokeKind, Vertex};
pub use style::{Choices, Method, Recipe, Registry, Source, Style, learn};

/// The examples of the README, compiled and run as doctests.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeExamples;
