//! Terrain files: the only place that opens them.
//!
//! | format | read | written | cell size | voids |
//! |---|---|---|---|---|
//! | GeoTIFF | strips, tiles, BigTIFF; none, LZW, deflate, PackBits; predictors 1-3; integers, floats | float32 or int16, deflate | from the georeference | GDAL nodata, NaN, absent tiles |
//! | SRTM `.hgt` | 1201², 3601², 3601 x 1801 | no | 1 or 3 arc-seconds at the tile's latitude | -32768 |
//! | ESRI ASCII grid | corner or centre, `cellsize` or `dx` `dy` | yes | as stated, metres | `nodata_value`, `nan` |
//! | PNG | grey, 8 or 16 bits, with a range | 16 bits, range in the file | from the file if ours, option, else 1 m | level 0 if ours |
//! | `.npy` | two dimensions, integers, floats | float32 | option, else 1 m | not finite |
//!
//! Each may be packed with gzip, as in `N46E008.hgt.gz`.
//!
//! Cell sizes are metres on the ground: degrees are converted at the raster's middle latitude, web mercator is corrected
//! by its cosine, other projected coordinates count as they are, times their unit. A file without a coordinate system
//! is in metres as it says. Row 0 is turned to the north.
//!
//! Undeclared nodata corrupts terrain, so a lone -9999 or -32768 that nothing declares is an error, as are heights
//! beyond 1000 km; [`ReadOptions`] says what they mean. Nothing is allocated before the size a header claims has been
//! checked against a limit and against what the file's length can hold.

mod archive;
mod ascii_grid;
mod description;
mod format;
mod geotiff;
mod hgt;
mod markers;
mod mask;
mod npy;
mod numbers;
mod options;
mod place;
mod png;
mod reading;
mod samples;
mod sidecars;
mod writing;

pub use description::{CellSizeSource, Description};
pub use format::Format;
pub use options::{Nodata, ReadOptions, SampleType, WriteOptions};
pub(crate) use reading::MAX_FILE_BYTES;
pub use reading::{read, read_bytes, read_described, read_with_sidecars};
pub use sidecars::Sidecar;
pub(crate) use sidecars::beside as sidecars_beside;
pub(crate) use writing::check_name;
pub use writing::write;
