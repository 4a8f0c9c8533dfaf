//! The file formats, told apart by content first and by extension where there is no magic number.

use super::ascii_grid::BYTE_ORDER_MARK;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// A terrain file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// TIFF or BigTIFF with GeoTIFF and GDAL tags.
    GeoTiff,
    /// SRTM height file: square big-endian 16-bit tile named after its south-west corner.
    Hgt,
    /// ESRI ASCII grid.
    AsciiGrid,
    /// Greyscale PNG of 8 or 16 bits.
    Png,
    /// NumPy array.
    Npy,
}

/// The extensions that can be written.
pub(super) const WRITABLE: &str = "allowed: .tif, .tiff, .png, .npy, .asc";

impl Format {
    /// The format that `path`'s extension stands for.
    #[must_use]
    pub(crate) fn of_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "tif" | "tiff" | "gtiff" => Self::GeoTiff,
            "hgt" => Self::Hgt,
            "asc" | "agr" => Self::AsciiGrid,
            "png" => Self::Png,
            "npy" => Self::Npy,
            _ => return None,
        })
    }

    /// The format that a file's first bytes show; an `.hgt` shows none.
    #[must_use]
    pub(crate) fn of_content(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::GeoTiff),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Some(Self::Npy),
            _ if starts_like_ascii_grid(bytes) => Some(Self::AsciiGrid),
            _ => None,
        }
    }

    /// The format of a file's content: by magic number, else by extension.
    pub(super) fn detect(path: &Path, bytes: &[u8]) -> Result<Self> {
        let by_magic = Self::of_content(bytes);
        let extension = Self::of_extension(&unpacked_name(path));
        match (by_magic, extension) {
            // An .hgt has no magic number, so that its first heights may look like any.
            (_, Some(Self::Hgt)) => Ok(Self::Hgt),
            (Some(format), _) => Ok(format),
            _ if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") => {
                Err(Error::file(path, "text", "in UTF-16", "allowed: UTF-8; save it in that encoding"))
            }
            _ if bytes.is_empty() => {
                Err(Error::file(path, "content", "empty", "0 bytes: nothing was written to it"))
            }
            (None, Some(Self::AsciiGrid)) => Ok(Self::AsciiGrid),
            (None, Some(claimed)) => {
                Err(Error::file(path, "first bytes", show(bytes), format!("{claimed} starts otherwise")))
            }
            (None, None) => Err(Error::file(
                path,
                "format",
                format!("unknown (the file starts with {})", show(bytes)),
                "allowed: GeoTIFF (.tif), SRTM (.hgt), ESRI ASCII grid (.asc), greyscale PNG, NumPy (.npy), also with .gz or alone in a .zip",
            )),
        }
    }
}

/// Whether a file begins as an archive of zip does.
pub(super) fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
}

/// Whether a file's name says that it is packed with gzip, as SRTM tiles are handed out (`N46E008.hgt.gz`).
pub(super) fn is_gzip(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
}

/// The name without the ending of gzip.
pub(super) fn unpacked_name(path: &Path) -> PathBuf {
    if is_gzip(path) { path.with_extension("") } else { path.to_owned() }
}

fn starts_like_ascii_grid(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let head = &bytes[..bytes.len().min(64)];
    let word: Vec<u8> = head.trim_ascii_start().iter().take(5).map(u8::to_ascii_lowercase).collect();
    word == b"ncols" || word == b"nrows"
}

fn show(bytes: &[u8]) -> String {
    format!("\"{}\"", bytes[..bytes.len().min(8)].escape_ascii())
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::GeoTiff => "GeoTIFF",
            Self::Hgt => "SRTM hgt",
            Self::AsciiGrid => "ESRI ASCII grid",
            Self::Png => "PNG",
            Self::Npy => "NumPy npy",
        })
    }
}
