//! Rasters without meaning: [`Grid`], [`Cell`], [`Mask`], the one [`D8`](d8) neighbour table, and what can be done to a
//! raster whatever it shows.
//!
//! Row-major, row 0 is north, column 0 is west.

mod cell;
pub(crate) mod components;
pub mod d8;
pub(crate) mod distance;
pub(crate) mod gaussian;
pub(crate) mod morphology;
pub(crate) mod pyramid;
pub(crate) mod resample;
mod raster;
pub(crate) mod thinning;
mod window;

pub use cell::Cell;
pub(crate) use components::Components;
pub use raster::{Grid, Mask};
pub use window::Window;
