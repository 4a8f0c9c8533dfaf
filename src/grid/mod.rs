//! Rasters without meaning: [`Grid`], [`Cell`], [`Mask`], the one [`D8`](d8) neighbour table, and what can be done to a
//! raster whatever it shows.
//!
//! Row-major, row 0 is north, column 0 is west.

mod cell;
pub mod components;
pub mod d8;
pub mod distance;
pub mod gaussian;
pub mod morphology;
pub mod pyramid;
pub mod resample;
mod raster;
pub mod thinning;
mod window;

pub use cell::Cell;
pub use components::Components;
pub use raster::{Grid, Mask};
pub use window::Window;
