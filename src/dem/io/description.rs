//! What a file said about itself, beside its heights.

use super::Format;
use super::place::Settled;

/// Where a cell size comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CellSizeSource {
    /// The file states it, or it follows from the file's coordinates.
    File,
    /// The caller gave it in [`ReadOptions`](super::ReadOptions).
    Caller,
    /// The file states lengths, but not of which unit: metres were assumed.
    AssumedUnit,
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
    /// Whatever a careful user would like to know: assumptions made, units converted, files beside it used or not.
    pub notes: Vec<String>,
    /// What is probably wrong: strange heights, what was there and could not be read.
    pub warnings: Vec<String>,
}

impl Description {
    /// What a reader knows; notes and warnings follow.
    pub(super) fn new(format: Format, sample: &'static str, packing: &str, settled: &Settled) -> Self {
        Self {
            format,
            sample,
            packing: packing.to_owned(),
            coordinates: settled.georeference.map_or_else(|| "none".to_owned(), |g| g.coordinates_in_words()),
            cell_size_source: settled.source,
            notes: Vec::new(),
            warnings: Vec::new(),
        }
    }
}
