//! A [`Dem`] to a terrain file.

use super::format::WRITABLE;
use super::{Format, WriteOptions, ascii_grid, geotiff, npy, png};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file::write_atomically;
use std::path::Path;

/// The format that a file of this name is written in: to be asked before the work whose result is written.
///
/// # Errors
/// When the extension is none that can be written.
pub(crate) fn check_name(path: &Path) -> Result<Format> {
    let unknown = || {
        let extension = path.extension().map_or("absent".to_owned(), |e| format!(".{}", e.display()));
        Error::file(path, "file extension", extension, WRITABLE)
    };
    match Format::of_extension(path) {
        Some(format) if format != Format::Hgt => Ok(format),
        _ => Err(unknown()),
    }
}

/// Writes a terrain file in the format of `path`'s extension: `.tif`, `.tiff`, `.png` (16 bits), `.npy` or `.asc`.
///
/// The file appears whole or not at all. [`read`](super::read) gives back the same heights (from PNG: within half a
/// level), voids and cell size, and from GeoTIFF and PNG the same georeference; a GeoTIFF of a DEM without one is
/// placed at the origin of a local metric system.
///
/// # Errors
/// When the extension is none of these, a height does not fit [`WriteOptions`], or the file cannot be written.
pub fn write(dem: &Dem, path: &Path, options: &WriteOptions) -> Result<()> {
    let format = check_name(path)?;
    write_atomically(path, |out| match format {
        Format::GeoTiff => geotiff::write(path, out, dem, options),
        Format::AsciiGrid => ascii_grid::write(path, out, dem),
        Format::Png => png::write(path, out, dem, options),
        Format::Npy => npy::write(path, out, dem),
        Format::Hgt => unreachable!("refused by its name"),
    })
}
