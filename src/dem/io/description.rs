//! What a file said about itself, beside its heights.

use super::Format;

/// Where a cell size comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CellSizeSource {
    /// The file states it, or it follows from the file's coordinates.
    File,
    /// The caller gave it in [`ReadOptions`](super::ReadOptions).
    Caller,
    /// Neither did: 1 m was assumed.
    Assumed,
}

/// How a terrain file stores its heights; for people (`info FILE`) and logs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Description {
    /// The format.
    pub format: Format,
    /// Type of a stored number: `u8`, `i16`, `f32`, ...
    pub sample: &'static str,
    /// How the numbers are packed ("deflate, predictor 2, 16 tiles of 256x256"); empty when they are not.
    pub packing: String,
    /// The coordinate system in words ("EPSG:4326, degrees").
    pub coordinates: String,
    /// Who stated the cell size.
    pub cell_size_source: CellSizeSource,
    /// Whatever a careful user would like to know: assumptions made, units converted.
    pub notes: Vec<String>,
}
