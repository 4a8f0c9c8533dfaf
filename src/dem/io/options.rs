//! What the caller knows about a file, or wants of it, beyond the file itself.

use super::super::{CellSize, Normalization};

/// Which stored numbers mean "no height here". Floats that are not finite always do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Nodata {
    /// What the file declares. A file that declares nothing but holds numbers far
    /// from all its other heights that look like a marker (-9999, 65535, ...) is refused, with the advice to use one of the
    /// variants below; so is one that holds them beside the number that it declares.
    #[default]
    AsDeclared,
    /// This stored number, whatever the file declares.
    Value(f64),
    /// Either of these stored numbers, whatever the file declares.
    Either([f64; 2]),
    /// None: every finite number is a height, and masks and transparency are left aside.
    None,
    /// What the file declares, and the other numbers may be any: they are no heights, but a mask, or do not count.
    /// Nothing is said about strange ones.
    Numbers,
}

/// What the reader cannot find in the file, or shall overrule. The default takes everything from the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// PNG only: the heights of grey 0 and of the highest grey (255 or 65535). Needed unless the PNG was written by
    /// [`write`](super::write), which records the range in the file.
    pub elevation: Option<Normalization>,
    /// Cell size on the ground, metres; overrules what the file says.
    pub cell_size: Option<CellSize>,
    /// GeoTIFF only: the band to read, counted from 1. Needed when there are several.
    pub band: Option<usize>,
    /// Which stored numbers are voids; for PNG, levels.
    pub nodata: Nodata,
    /// Metres in one unit of the stored heights (0.3048 for feet); overrules the file's vertical unit (not for PNG).
    pub metres_per_unit: Option<f64>,
}

/// How GeoTIFF stores a height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleType {
    /// 32-bit float: the heights unchanged. Voids are NaN.
    #[default]
    Float32,
    /// 16-bit integer: heights rounded to whole metres, -32767 to 32767. Voids are -32768.
    Int16,
}

/// How to write. The default loses nothing, except in PNG, where heights become 65535 steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WriteOptions {
    /// GeoTIFF only.
    pub sample_type: SampleType,
    /// PNG only: the heights of the lowest and the highest grey; the range of the DEM when absent.
    pub elevation: Option<Normalization>,
}
