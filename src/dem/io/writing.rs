//! A [`Dem`] to a terrain file.

use super::format::WRITABLE;
use super::{Format, WriteOptions, ascii_grid, geotiff, npy, png};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file::write_atomically;
use std::path::Path;

/// Writes a terrain file in the format of `path`'s extension: `.tif`, `.tiff`, `.png` (16 bits), `.npy` or `.asc`.
///
/// The file appears whole or not at all. [`read`](super::read) gives back the same heights (from PNG: within half a
/// level), voids and cell size, and from GeoTIFF and PNG the same georeference; a GeoTIFF of a DEM without one is
/// placed at the origin of a local metric system.
///
/// # Errors
/// When the extension is none of these, a height does not fit [`WriteOptions`], or the file cannot be written.
pub fn write(dem: &Dem, path: &Path, options: &WriteOptions) -> Result<()> {
    let unknown = || {
        let extension = path.extension().map_or("absent".to_owned(), |e| format!(".{}", e.display()));
        Error::file(path, "file extension", extension, WRITABLE)
    };
    let format = Format::of_extension(path).ok_or_else(unknown)?;
    if format == Format::Hgt {
        return Err(unknown());
    }
    write_atomically(path, |out| match format {
        Format::GeoTiff => geotiff::write(path, out, dem, options),
        Format::AsciiGrid => ascii_grid::write(path, out, dem),
        Format::Png => png::write(path, out, dem, options),
        Format::Npy => npy::write(path, out, dem),
        Format::Hgt => Err(unknown()),
    })
}
