//! Heights with meaning: [`Dem`] (metres, cell size, voids, georeference) and [`Normalization`].

pub mod bundled;
mod cell_size;
pub mod crs;
mod georeference;
mod heights;
pub mod io;
mod library;
pub(crate) mod manifest;
mod normalization;
mod square;

pub use cell_size::CellSize;
pub use georeference::{Georeference, RasterSpace};
pub use heights::Dem;
pub(crate) use library::{Loaded, Terrain};
pub use normalization::Normalization;
