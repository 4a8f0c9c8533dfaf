//! Any terrain file to a [`Dem`].

use super::format::is_gzip;
use super::{Description, Format, ReadOptions, ascii_grid, geotiff, hgt, npy, png};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file;
use flate2::read::MultiGzDecoder;
use std::io::Read;
use std::path::Path;

/// The largest file that is read: 4 GiB. All of it is held in memory while it is unpacked.
pub const MAX_FILE_BYTES: u64 = 1 << 32;

/// The largest content of a file packed with gzip: 1 GiB, so that a small file cannot claim all memory.
const MAX_UNPACKED_BYTES: u64 = 1 << 30;

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
    if is_gzip(path) {
        let (dem, mut description) = read_unpacked(path, &gunzip(path, bytes)?, options)?;
        let packing = std::mem::take(&mut description.packing);
        description.packing = if packing.is_empty() { "gzip".to_owned() } else { format!("gzip, {packing}") };
        return Ok((dem, description));
    }
    read_unpacked(path, bytes, options)
}

/// The content of a file packed with gzip.
fn gunzip(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let mut content = Vec::new();
    let mut unpacking = MultiGzDecoder::new(bytes).take(MAX_UNPACKED_BYTES + 1);
    unpacking.read_to_end(&mut content).map_err(|e| {
        Error::file(path, "gzip stream", e, "allowed: a whole one, as the ending .gz says: truncated?")
    })?;
    if content.len() as u64 > MAX_UNPACKED_BYTES {
        let allowed = format!("allowed: at most {MAX_UNPACKED_BYTES} bytes; unpack it first");
        return Err(Error::file(path, "unpacked size", "more", allowed));
    }
    Ok(content)
}

fn read_unpacked(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    match Format::detect(path, bytes)? {
        Format::GeoTiff => geotiff::read(path, bytes, options),
        Format::Hgt => hgt::read(path, bytes, options),
        Format::AsciiGrid => ascii_grid::read(path, bytes, options),
        Format::Png => png::read(path, bytes, options),
        Format::Npy => npy::read(path, bytes, options),
    }
}
