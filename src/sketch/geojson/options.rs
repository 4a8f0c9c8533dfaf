//! What the caller of a reader knows, and wants.

use super::member::HeightUnit;
use crate::dem::Georeference;

/// What the x and y of a file are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// Model coordinates where the map has a place and the file does not describe one without; else columns and rows.
    #[default]
    AsStated,
    /// Columns and rows, whatever the file names.
    Pixels,
}

/// What to do with a vertex without a height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MissingHeights {
    /// An error that names the feature and the vertex.
    #[default]
    Refuse,
    /// Linear by length between the given heights of the same line, level beyond them. A line without any is refused.
    Interpolate,
    /// It is left open: 0 in the sketch, and false in [`SketchReading::given`](super::SketchReading::given).
    Leave,
}

/// What the caller knows about the file, or wants of it; every answer overrules what the file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// (rows, columns) of the map. Without one here and in the file, the map just holds the strokes.
    pub size: Option<(usize, usize)>,
    /// Place of the map (that of the DEM which the sketch belongs to).
    pub georeference: Option<Georeference>,
    /// What x and y are.
    pub coordinates: Coordinates,
    /// EPSG code of the system that x and y are in.
    pub epsg: Option<u32>,
    /// Unit of the heights.
    pub unit: Option<HeightUnit>,
    /// Metres in one unit of the heights (0.3048 for feet); overrules `unit`.
    pub metres_per_unit: Option<f64>,
    /// The property that tells ridges from valleys; else `kind`, or whichever says one of the two.
    pub kind_property: Option<String>,
    /// The property with the heights, which then also overrules those in the coordinates.
    pub height_property: Option<String>,
    /// Whether a line whose heights are all 0 counts as one without heights.
    pub zero_unknown: bool,
    /// What to do about missing heights.
    pub missing_heights: MissingHeights,
}
