//! Any terrain file to a [`Dem`].

use super::format::{is_gzip, is_zip};
use super::place::Said;
use super::sidecars::{self, Sidecar, Sidecars};
use super::{Description, Format, ReadOptions, archive, ascii_grid, geotiff, hgt, npy, png};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file;
use flate2::read::MultiGzDecoder;
use std::io::Read;
use std::path::Path;

/// The largest file that is read: 4 GiB. All of it is held in memory while it is unpacked.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 32;

/// The largest content of a file packed with gzip or zip: 1 GiB, so that a small file cannot claim all memory.
pub(super) const MAX_UNPACKED_BYTES: u64 = 1 << 30;

/// What a reader is handed beside the bytes.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) options: &'a ReadOptions,
    pub(super) sidecars: &'a Sidecars,
}

/// Reads a terrain file; see the [room's table](super) for the formats and what each must say.
///
/// # Errors
/// When the file cannot be read, its format is unknown, or its content is not what the format allows; the message
/// names the file, the field, the value found and what is allowed.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Dem> {
    read_described(path, options).map(|(dem, _)| dem)
}

/// Like [`read`], with what the file and the files beside it said.
///
/// # Errors
/// As [`read`].
pub fn read_described(path: &Path, options: &ReadOptions) -> Result<(Dem, Description)> {
    let bytes = file::read_whole(path, MAX_FILE_BYTES)?;
    read_with_sidecars(path, &bytes, &sidecars::beside(path)?, options)
}

/// Like [`read_described`], from a file's content in memory, without the files beside it. `path` need not exist: its name
/// stands in messages, its extension tells formats without a magic number apart, and the name of an `.hgt` its place.
///
/// # Errors
/// As [`read`], except for the file system.
pub fn read_bytes(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    read_with_sidecars(path, bytes, &[], options)
}

/// Like [`read_bytes`], with the files beside it (world file, `.prj`, `.aux.xml`, `.msk`).
///
/// # Errors
/// As [`read_bytes`].
pub fn read_with_sidecars(
    path: &Path,
    bytes: &[u8],
    files: &[Sidecar],
    options: &ReadOptions,
) -> Result<(Dem, Description)> {
    let packed = |packer: &str, (dem, mut description): (Dem, Description)| {
        let packing = std::mem::take(&mut description.packing);
        description.packing =
            if packing.is_empty() { packer.to_owned() } else { format!("{packer}, {packing}") };
        (dem, description)
    };
    if is_gzip(path) {
        return Ok(packed("gzip", read_unpacked(path, &gunzip(path, bytes)?, files, options)?));
    }
    if is_zip(bytes) {
        let (name, raster, files) = archive::raster_in(path, bytes)?;
        // The name inside the archive tells format and place; messages name both.
        return Ok(packed("zip", read_unpacked(&path.join(name), &raster, &files, options)?));
    }
    read_unpacked(path, bytes, files, options)
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

fn read_unpacked(
    path: &Path,
    bytes: &[u8],
    files: &[Sidecar],
    options: &ReadOptions,
) -> Result<(Dem, Description)> {
    let format = Format::detect(path, bytes)?;
    let mut said = Said::default();
    let sidecars = Sidecars::parse(path, files, &mut said);
    let source = Source { path, options, sidecars: &sidecars };
    let (dem, mut description) = match format {
        Format::GeoTiff => geotiff::read(&source, bytes, &mut said),
        Format::Hgt => hgt::read(&source, bytes, &mut said),
        Format::AsciiGrid => ascii_grid::read(&source, bytes, &mut said),
        Format::Png => png::read(&source, bytes, &mut said),
        Format::Npy => npy::read(&source, bytes, &mut said),
    }?;
    (description.notes, description.warnings) = (said.notes, said.warnings);
    Ok((dem, description))
}
