//! A raster in a zip archive, as terrain is handed out (`NASADEM_HGT_n37w118.zip`).
//!
//! In: the bytes of an archive. Out: the one raster in it, and the files beside it. Cost: the raster and the small files once.

use super::reading::MAX_UNPACKED_BYTES;
use super::{Format, Sidecar};
use crate::error::{Error, Result};
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// What else in the archive is read, as it may lie beside the raster, has at most so many bytes; masks are rasters.
const LARGEST_SIDECAR: u64 = 1 << 26;

/// So many files beside the raster are looked at.
const MOST_SIDECARS: usize = 32;

/// Name and content of the one raster in an archive, and what else is in its folder.
pub(super) fn raster_in(path: &Path, bytes: &[u8]) -> Result<(String, Vec<u8>, Vec<Sidecar>)> {
    let damaged = |e: zip::result::ZipError| {
        Error::file(path, "zip archive", e, "allowed: a whole one, deflated or stored, without a password")
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    // macOS packs a shadow of every file beside it.
    let is_shadow = |name: &str| name.split('/').any(|part| part == "__MACOSX" || part.starts_with("._"));
    let names: Vec<String> =
        archive.file_names().filter(|name| !is_shadow(name)).map(str::to_owned).collect();
    let raster = |name: &&String| Format::of_extension(Path::new(name.as_str())).is_some();
    let rasters: Vec<&String> = names.iter().filter(raster).collect();
    let [name] = rasters[..] else {
        let found = match rasters.len() {
            0 => "none".to_owned(),
            n => {
                let shown: Vec<&str> = rasters.iter().take(4).map(|n| n.as_str()).collect();
                format!("{n} ({}{})", shown.join(", "), if n > 4 { ", ..." } else { "" })
            }
        };
        let allowed =
            "allowed: one (.tif, .hgt, .asc, .png, .npy); unpack the archive and name the file to read";
        return Err(Error::file(path, "number of terrain files in the archive", found, allowed));
    };
    let mut content = |name: &str, limit: u64| -> Result<Option<Vec<u8>>> {
        let entry = archive.by_name(name).map_err(damaged)?;
        let mut content = Vec::new();
        let failed = |e: std::io::Error| {
            Error::file(path, format!("{name} in the archive"), e, "the archive is damaged")
        };
        entry.take(limit + 1).read_to_end(&mut content).map_err(failed)?;
        Ok((content.len() as u64 <= limit).then_some(content))
    };
    let raster = content(name, MAX_UNPACKED_BYTES)?.ok_or_else(|| {
        let allowed = format!("allowed: at most {MAX_UNPACKED_BYTES} bytes; unpack it first");
        Error::file(path, "unpacked size", "more", allowed)
    })?;
    let base = |name: &str| PathBuf::from(name).file_name().map(|n| n.to_string_lossy().into_owned());
    let folder = |name: &str| name.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned();
    let mut beside = Vec::new();
    let neighbours = names.iter().filter(|n| *n != name && folder(n) == folder(name) && !n.ends_with('/'));
    for other in neighbours.take(MOST_SIDECARS) {
        if let (Some(name), Some(bytes)) = (base(other), content(other, LARGEST_SIDECAR)?) {
            beside.push(Sidecar { name, bytes });
        }
    }
    Ok((base(name).unwrap_or_default(), raster, beside))
}
