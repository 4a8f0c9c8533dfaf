//! Any terrain file to a [`Dem`].

use super::{Description, Format, ReadOptions, ascii_grid, geotiff, hgt, npy, png};
use crate::dem::Dem;
use crate::error::Result;
use crate::file;
use std::path::Path;

/// The largest file that is read: 4 GiB. All of it is held in memory while it is unpacked.
pub const MAX_FILE_BYTES: u64 = 1 << 32;

/// Reads a terrain file; see the [room's table](super) for the formats and what each must say.
///
/// # Errors
/// When the file cannot be read, its format is unknown, or its content is not what the format allows; the message
/// names the file, the field, the value found and what is allowed.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Dem> {
    read_described(path, options).map(|(dem, _)| dem)
}

/// Like [`read`], with what the file said about itself.
///
/// # Errors
/// As [`read`].
pub fn read_described(path: &Path, options: &ReadOptions) -> Result<(Dem, Description)> {
    read_bytes(path, &file::read_whole(path, MAX_FILE_BYTES)?, options)
}

/// Like [`read_described`], from a file's content in memory. `path` need not exist: its name stands in messages, its
/// extension tells formats without a magic number apart, and the name of an `.hgt` its place.
///
/// # Errors
/// As [`read`], except for the file system.
pub fn read_bytes(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    match Format::detect(path, bytes)? {
        Format::GeoTiff => geotiff::read(path, bytes, options),
        Format::Hgt => hgt::read(path, bytes, options),
        Format::AsciiGrid => ascii_grid::read(path, bytes, options),
        Format::Png => png::read(path, bytes, options),
        Format::Npy => npy::read(path, bytes, options),
    }
}
