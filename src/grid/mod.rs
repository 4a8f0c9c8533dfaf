//! Rasters without meaning: [`Grid`], [`Cell`], [`Mask`] and the one [`D8`](d8) neighbour table.
//!
//! Row-major, row 0 is north, column 0 is west.

mod cell;
pub mod d8;
mod raster;

pub use cell::Cell;
pub use raster::{Grid, Mask};
