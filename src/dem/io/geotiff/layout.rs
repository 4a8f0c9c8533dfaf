//! How a TIFF lays out its raster: types, packing, strips or tiles; each field checked before anything is allocated.

use super::directory::Directory;
use super::tag;
use crate::dem::io::samples::check_size;
use crate::error::{Error, Result};
use std::path::Path;

/// What the numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleKind {
    Unsigned,
    Signed,
    Float,
}

/// A compression that is read, with the most bytes that one compressed byte can become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Compression {
    pub(super) name: &'static str,
    expansion: u64,
}

/// The layout of the first image.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) samples: usize,
    pub(super) bits: u64,
    pub(super) kind: SampleKind,
    pub(super) compression: Compression,
    pub(super) predictor: u64,
    pub(super) planar: bool,
    pub(super) tiled: bool,
    pub(super) chunk_rows: u64,
    pub(super) chunk_cols: u64,
    pub(super) chunks_across: usize,
    pub(super) chunks_per_band: usize,
    pub(super) byte_counts: Vec<u64>,
    offsets: Vec<u64>,
}

impl Layout {
    /// Reads and checks the layout of `directory`, a part of a file of `file_length` bytes.
    pub(super) fn parse(path: &Path, directory: &Directory<'_>, file_length: u64) -> Result<Self> {
        let (height, width) = (directory.required(tag::HEIGHT)?, directory.required(tag::WIDTH)?);
        let (rows, cols) = check_size(path, height, width)?;
        let samples = directory.one(tag::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        if !(1..=1024).contains(&samples) {
            return Err(Error::file(path, "SamplesPerPixel", samples, "allowed: 1 to 1024 bands"));
        }
        let (kind, bits) = sample_type(path, directory)?;
        let compression = compression(path, directory.one(tag::COMPRESSION)?.unwrap_or(1))?;
        let predictor = directory.one(tag::PREDICTOR)?.unwrap_or(1);
        match (predictor, kind) {
            (1 | 2, _) | (3, SampleKind::Float) => {}
            (3, _) => return Err(Error::file(path, "Predictor", 3, "allowed: 1 or 2 for integers")),
            _ => return Err(Error::file(path, "Predictor", predictor, "allowed: 1, 2 or 3")),
        }
        let planar = match directory.one(tag::PLANAR_CONFIGURATION)?.unwrap_or(1) {
            1 => false,
            2 => true,
            other => return Err(Error::file(path, "PlanarConfiguration", other, "allowed: 1 or 2")),
        };
        check_colours(path, directory, samples, planar)?;
        let tiled = directory.has(tag::TILE_OFFSETS);
        let (chunk_rows, chunk_cols) = if tiled {
            (directory.required(tag::TILE_LENGTH)?, directory.required(tag::TILE_WIDTH)?)
        } else {
            (directory.one(tag::ROWS_PER_STRIP)?.unwrap_or(height).min(height), width)
        };
        // A tile may overhang the raster, but not without end.
        let largest = 1 << 16;
        if chunk_rows == 0 || chunk_cols == 0 || (tiled && chunk_rows.max(chunk_cols) > largest) {
            let size = format!("{chunk_rows} rows x {chunk_cols} columns");
            return Err(Error::file(
                path,
                "size of a strip or tile",
                size,
                "allowed: 1 to 65536 on each side",
            ));
        }
        let chunks_across = width.div_ceil(chunk_cols);
        let chunks_per_band = chunks_across * height.div_ceil(chunk_rows);
        let planes = if planar { samples } else { 1 };
        let (offset_tag, count_tag) = if tiled {
            (tag::TILE_OFFSETS, tag::TILE_BYTE_COUNTS)
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_BYTE_COUNTS)
        };
        let needed = u128::from(chunks_per_band) * u128::from(planes);
        for t in [offset_tag, count_tag] {
            if directory.count(t) as u128 != needed {
                let found = format!("{} values", directory.count(t));
                return Err(Error::file(
                    path,
                    tag::name(t),
                    found,
                    format!("{needed} strips or tiles are needed"),
                ));
            }
        }
        let offsets = directory.unsigned(offset_tag)?.unwrap_or_default();
        let byte_counts = directory.unsigned(count_tag)?.unwrap_or_default();
        let layout = Self {
            rows,
            cols,
            samples: samples as usize,
            bits,
            kind,
            compression,
            predictor,
            planar,
            tiled,
            chunk_rows,
            chunk_cols,
            chunks_across: chunks_across as usize,
            chunks_per_band: chunks_per_band as usize,
            byte_counts,
            offsets,
        };
        layout.check_chunks(path, file_length)?;
        Ok(layout)
    }

    /// Every strip or tile lies inside the file, and is large enough to hold what it must expand to.
    fn check_chunks(&self, path: &Path, file_length: u64) -> Result<()> {
        for (i, (&offset, &count)) in self.offsets.iter().zip(&self.byte_counts).enumerate() {
            if self.is_absent(i) {
                continue;
            }
            if offset.checked_add(count).is_none_or(|end| end > file_length) {
                return Err(Error::file(
                    path,
                    format!("position of {} {i}", self.chunk_noun()),
                    format!("byte {offset}, {count} bytes long"),
                    format!("the file ends at {file_length}: truncated?"),
                ));
            }
            let rows = if self.tiled { self.chunk_rows } else { self.chunk_shape(i).0 as u64 };
            let samples = if self.planar { 1 } else { self.samples as u64 };
            // At most 2^16 x 2^28 x 2^10 x 2^3: no overflow.
            let needed = rows * self.chunk_cols * samples * (self.bits / 8);
            let possible = count.saturating_mul(self.compression.expansion);
            if possible < needed {
                return Err(Error::file(
                    path,
                    format!("length of {} {i}", self.chunk_noun()),
                    format!("{count} bytes"),
                    format!("{} cannot unpack that to the {needed} bytes needed", self.compression.name),
                ));
            }
        }
        Ok(())
    }

    /// GDAL leaves out strips and tiles that hold nodata only.
    pub(super) fn is_absent(&self, chunk: usize) -> bool {
        self.offsets[chunk] == 0 && self.byte_counts[chunk] == 0
    }

    /// "strip" or "tile".
    pub(super) fn chunk_noun(&self) -> &'static str {
        if self.tiled { "tile" } else { "strip" }
    }

    /// Row and column of a chunk's first cell, by its number within a band.
    pub(super) fn chunk_origin(&self, chunk: usize) -> (usize, usize) {
        let (down, across) = (chunk / self.chunks_across, chunk % self.chunks_across);
        (down * self.chunk_rows as usize, across * self.chunk_cols as usize)
    }

    /// Rows and columns of the raster that a chunk covers, by its number within a band.
    pub(super) fn chunk_shape(&self, chunk: usize) -> (usize, usize) {
        let (row, col) = self.chunk_origin(chunk % self.chunks_per_band);
        ((self.rows - row).min(self.chunk_rows as usize), (self.cols - col).min(self.chunk_cols as usize))
    }

    /// The type's short name.
    pub(super) fn sample_name(&self) -> &'static str {
        match (self.kind, self.bits) {
            (SampleKind::Unsigned, 8) => "u8",
            (SampleKind::Unsigned, 16) => "u16",
            (SampleKind::Unsigned, 32) => "u32",
            (SampleKind::Unsigned, _) => "u64",
            (SampleKind::Signed, 8) => "i8",
            (SampleKind::Signed, 16) => "i16",
            (SampleKind::Signed, 32) => "i32",
            (SampleKind::Signed, _) => "i64",
            (SampleKind::Float, 16) => "f16",
            (SampleKind::Float, 32) => "f32",
            (SampleKind::Float, _) => "f64",
        }
    }

    /// The packing in words.
    pub(super) fn packing(&self) -> String {
        let Self { compression, predictor, chunks_per_band, chunk_rows, chunk_cols, .. } = self;
        let plural = if *chunks_per_band == 1 { "" } else { "s" };
        let noun = self.chunk_noun();
        format!(
            "{}, predictor {predictor}, {chunks_per_band} {noun}{plural} of {chunk_cols}x{chunk_rows}",
            compression.name
        )
    }
}

fn sample_type(path: &Path, directory: &Directory<'_>) -> Result<(SampleKind, u64)> {
    let kind = match directory.one(tag::SAMPLE_FORMAT)?.unwrap_or(1) {
        1 => SampleKind::Unsigned,
        2 => SampleKind::Signed,
        3 => SampleKind::Float,
        other => {
            let allowed = "allowed: 1 (unsigned), 2 (signed) or 3 (float)";
            return Err(Error::file(path, "SampleFormat", other, allowed));
        }
    };
    let bits = directory.one(tag::BITS_PER_SAMPLE)?.unwrap_or(1);
    match (kind, bits) {
        (SampleKind::Float, 16 | 32 | 64) | (SampleKind::Unsigned | SampleKind::Signed, 8 | 16 | 32 | 64) => {
            Ok((kind, bits))
        }
        (SampleKind::Float, _) => {
            Err(Error::file(path, "BitsPerSample", bits, "allowed: 16, 32 or 64 for floats"))
        }
        _ => Err(Error::file(path, "BitsPerSample", bits, "allowed: 8, 16, 32 or 64")),
    }
}

fn compression(path: &Path, code: u64) -> Result<Compression> {
    // Deflate: a match of 258 bytes takes 2 bits at best. LZW: a 12-bit code stands for 3837 bytes at best.
    let (name, expansion) = match code {
        1 => ("uncompressed", 1),
        5 => ("LZW", 2600),
        8 | 32946 => ("deflate", 1040),
        32773 => ("PackBits", 64),
        _ => {
            let known = match code {
                2..=4 => " (fax)",
                6 | 7 => " (JPEG)",
                34887 => " (LERC)",
                34925 => " (LZMA)",
                50000 => " (Zstandard)",
                50001 => " (WebP)",
                50002 => " (JPEG XL)",
                _ => "",
            };
            return Err(Error::file(
                path,
                "Compression",
                format!("{code}{known}"),
                "allowed: none, LZW, deflate, PackBits (gdal_translate -co COMPRESS=DEFLATE converts)",
            ));
        }
    };
    Ok(Compression { name, expansion })
}

/// Only colour models whose samples come out of the `tiff` crate as they are stored.
fn check_colours(path: &Path, directory: &Directory<'_>, samples: u64, planar: bool) -> Result<()> {
    let photometric = directory.required(tag::PHOTOMETRIC)?;
    let extra = directory.count(tag::EXTRA_SAMPLES) as u64;
    if extra >= samples.max(1) {
        let allowed = format!("allowed: fewer than the {samples} bands");
        return Err(Error::file(path, "ExtraSamples", format!("{extra} values"), allowed));
    }
    // Without an alpha channel the crate drops the fourth sample.
    let alpha = match directory.unsigned(tag::EXTRA_SAMPLES)?.as_deref() {
        None => true,
        Some([1 | 2]) => !planar,
        _ => false,
    };
    match photometric {
        1 => Ok(()),
        2 if samples == 3 && extra == 0 => Ok(()),
        2 if samples == 4 && alpha => Ok(()),
        2 => {
            let layout = format!("RGB with {samples} samples, {extra} of them extra");
            Err(Error::file(path, "bands", layout, "allowed: one band of heights"))
        }
        other => {
            let known = match other {
                0 => " (white is zero)",
                3 => " (palette)",
                4 => " (mask)",
                5 => " (CMYK)",
                6 => " (YCbCr)",
                _ => "",
            };
            let found = format!("{other}{known}");
            Err(Error::file(path, "PhotometricInterpretation", found, "allowed: 1 (black is zero)"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_expansion_bounds_hold_for_zeros() {
        use std::io::Write;
        let zeros = vec![0; 1 << 24];
        let mut deflate = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        deflate.write_all(&zeros).unwrap();
        let packed = deflate.finish().unwrap().len() as u64;
        let bound = compression(Path::new("x"), 8).unwrap().expansion;
        assert!(packed * bound >= zeros.len() as u64, "{packed}");
    }
}
