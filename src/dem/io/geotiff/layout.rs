//! How a TIFF lays out its raster: types, packing, strips or tiles; each field checked before anything is allocated.

use super::directory::Directory;
use super::tag;
use super::unpack::Packing;
use crate::dem::io::numbers::{NumberKind, NumberType};
use crate::dem::io::samples::check_size;
use crate::error::{Error, Result};
use std::path::Path;

/// A compression that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    None,
    Lzw,
    Deflate,
    PackBits,
}

impl Method {
    const fn name(self) -> &'static str {
        match self {
            Self::None => "uncompressed",
            Self::Lzw => "LZW",
            Self::Deflate => "deflate",
            Self::PackBits => "PackBits",
        }
    }

    /// The most bytes that one compressed byte can become, rounded up.
    const fn expansion(self) -> u64 {
        match self {
            Self::None => 1,
            // A 12-bit code stands for 3837 bytes at best.
            Self::Lzw => 2600,
            // A match of 258 bytes takes 2 bits at best.
            Self::Deflate => 1040,
            // 128 bytes from two.
            Self::PackBits => 64,
        }
    }
}

/// What was done to the numbers before compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    None = 1,
    Horizontal = 2,
    FloatingPoint = 3,
}

/// The layout of the first image.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) bands: usize,
    pub(super) numbers: NumberType,
    pub(super) packing: Packing,
    /// Each band has strips or tiles of its own.
    pub(super) planar: bool,
    /// Eight cells a byte, as masks have it; `numbers` are the bytes then.
    pub(super) bits: bool,
    tiled: bool,
    chunk_rows: usize,
    chunk_cols: usize,
    chunks_across: usize,
    pub(super) chunks_per_band: usize,
    offsets: Vec<u64>,
    byte_counts: Vec<u64>,
}

impl Layout {
    /// Reads and checks the layout of `directory`, a part of a file of `file_length` bytes.
    pub(super) fn parse(path: &Path, directory: &Directory<'_>, file_length: u64) -> Result<Self> {
        check_colours(path, directory)?;
        Self::of_image(path, directory, file_length)
    }

    /// Like [`parse`](Self::parse), of an image that need not hold heights.
    pub(super) fn of_image(path: &Path, directory: &Directory<'_>, file_length: u64) -> Result<Self> {
        let (height, width) = (directory.required(tag::HEIGHT)?, directory.required(tag::WIDTH)?);
        let (rows, cols) = check_size(path, height, width)?;
        let samples = directory.one(tag::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        if !(1..=1024).contains(&samples) {
            return Err(Error::file(path, "SamplesPerPixel", samples, "allowed: 1 to 1024 bands"));
        }
        let bits = directory.one(tag::BITS_PER_SAMPLE)?.unwrap_or(1) == 1
            && directory.one(tag::PHOTOMETRIC)? == Some(4);
        let (kind, numbers) =
            if bits { (NumberKind::Unsigned, NumberType::U8) } else { number_type(path, directory)? };
        let method = compression(path, directory.one(tag::COMPRESSION)?.unwrap_or(1))?;
        let predictor = match (directory.one(tag::PREDICTOR)?.unwrap_or(1), kind) {
            (1, _) => Predictor::None,
            (2, _) => Predictor::Horizontal,
            (3, NumberKind::Float) => Predictor::FloatingPoint,
            (3, _) => return Err(Error::file(path, "Predictor", 3, "allowed: 1 or 2 for integers")),
            (other, _) => return Err(Error::file(path, "Predictor", other, "allowed: 1, 2 or 3")),
        };
        let planar = match directory.one(tag::PLANAR_CONFIGURATION)?.unwrap_or(1) {
            1 => false,
            2 => true,
            other => return Err(Error::file(path, "PlanarConfiguration", other, "allowed: 1 or 2")),
        };
        if bits && samples > 1 && !planar {
            return Err(Error::file(
                path,
                "SamplesPerPixel",
                samples,
                "allowed with 1 bit: 1, or each band apart",
            ));
        }
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
        let packing = Packing {
            method,
            predictor,
            big_endian: directory.is_big_endian(),
            size: numbers.size(),
            samples: if planar { 1 } else { samples as usize },
            cols: if bits { chunk_cols.div_ceil(8) as usize } else { chunk_cols as usize },
        };
        let layout = Self {
            rows,
            cols,
            bands: samples as usize,
            numbers,
            packing,
            planar,
            bits,
            tiled,
            chunk_rows: chunk_rows as usize,
            chunk_cols: chunk_cols as usize,
            chunks_across: chunks_across as usize,
            chunks_per_band: chunks_per_band as usize,
            offsets,
            byte_counts,
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
            let needed = self.unpacked_bytes(i % self.chunks_per_band) as u64;
            let possible = count.saturating_mul(self.packing.method.expansion());
            if possible < needed {
                return Err(Error::file(
                    path,
                    format!("length of {} {i}", self.chunk_noun()),
                    format!("{count} bytes"),
                    format!("{} cannot unpack that to the {needed} bytes needed", self.packing.method.name()),
                ));
            }
        }
        Ok(())
    }

    /// GDAL leaves out strips and tiles that hold nodata only.
    fn is_absent(&self, chunk: usize) -> bool {
        self.offsets[chunk] == 0 && self.byte_counts[chunk] == 0
    }

    /// The packed bytes of a chunk; `None` when it is absent.
    pub(super) fn chunk<'a>(&self, chunk: usize, file: &'a [u8]) -> Option<&'a [u8]> {
        if self.is_absent(chunk) {
            return None;
        }
        // Inside the file: checked by `check_chunks`.
        let start = self.offsets[chunk] as usize;
        Some(&file[start..start + self.byte_counts[chunk] as usize])
    }

    /// What a chunk unpacks to, by its number within a band: a tile whole, the last strip as far as the raster goes.
    pub(super) fn unpacked_bytes(&self, chunk: usize) -> usize {
        let rows = if self.tiled { self.chunk_rows } else { self.chunk_shape(chunk).0 };
        // At most 2^28 cells in a strip, 2^32 in a tile, of 2^10 samples of 2^3 bytes: below 2^46.
        rows * self.packing.cols * self.packing.samples * self.packing.size
    }

    /// "strip" or "tile".
    pub(super) fn chunk_noun(&self) -> &'static str {
        if self.tiled { "tile" } else { "strip" }
    }

    /// Row and column of a chunk's first cell, by its number within a band.
    pub(super) fn chunk_origin(&self, chunk: usize) -> (usize, usize) {
        let (down, across) = (chunk / self.chunks_across, chunk % self.chunks_across);
        (down * self.chunk_rows, across * self.chunk_cols)
    }

    /// Rows and columns of the raster that a chunk covers, by its number within a band.
    pub(super) fn chunk_shape(&self, chunk: usize) -> (usize, usize) {
        let (row, col) = self.chunk_origin(chunk);
        ((self.rows - row).min(self.chunk_rows), (self.cols - col).min(self.chunk_cols))
    }

    /// The packing in words.
    pub(super) fn packing_words(&self) -> String {
        let (Packing { method, predictor, .. }, cols) = (self.packing, self.chunk_cols);
        let plural = if self.chunks_per_band == 1 { "" } else { "s" };
        format!(
            "{}, predictor {}, {} {}{plural} of {cols}x{}",
            method.name(),
            predictor as u8,
            self.chunks_per_band,
            self.chunk_noun(),
            self.chunk_rows
        )
    }
}

fn number_type(path: &Path, directory: &Directory<'_>) -> Result<(NumberKind, NumberType)> {
    let kind = match directory.one(tag::SAMPLE_FORMAT)?.unwrap_or(1) {
        1 => NumberKind::Unsigned,
        2 => NumberKind::Signed,
        3 => NumberKind::Float,
        other => {
            let allowed = "allowed: 1 (unsigned), 2 (signed) or 3 (float)";
            return Err(Error::file(path, "SampleFormat", other, allowed));
        }
    };
    let bits = directory.one(tag::BITS_PER_SAMPLE)?.unwrap_or(1);
    let numbers = (bits <= 64 && bits % 8 == 0).then(|| NumberType::new(kind, bits as usize / 8)).flatten();
    let numbers = numbers.ok_or_else(|| {
        let allowed = if kind == NumberKind::Float { "16, 32 or 64 for floats" } else { "8, 16, 32 or 64" };
        Error::file(
            path,
            "BitsPerSample",
            bits,
            format!("allowed: {allowed} (gdal_translate -ot Float32 converts)"),
        )
    })?;
    Ok((kind, numbers))
}

fn compression(path: &Path, code: u64) -> Result<Method> {
    match code {
        1 => Ok(Method::None),
        5 => Ok(Method::Lzw),
        8 | 32946 => Ok(Method::Deflate),
        32773 => Ok(Method::PackBits),
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
            Err(Error::file(
                path,
                "Compression",
                format!("{code}{known}"),
                "allowed: none, LZW, deflate, PackBits (gdal_translate -co COMPRESS=DEFLATE converts)",
            ))
        }
    }
}

/// Grey, either way round (the numbers are heights, not shades), or RGB, of which a band may be chosen.
fn check_colours(path: &Path, directory: &Directory<'_>) -> Result<()> {
    let known = match directory.required(tag::PHOTOMETRIC)? {
        0..=2 => return Ok(()),
        3 => "3 (palette)".to_owned(),
        4 => "4 (mask)".to_owned(),
        5 => "5 (CMYK)".to_owned(),
        6 => "6 (YCbCr)".to_owned(),
        other => other.to_string(),
    };
    Err(Error::file(path, "PhotometricInterpretation", known, "allowed: 0 or 1 (grey), 2 (RGB)"))
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
        let bound = Method::Deflate.expansion();
        assert!(packed * bound >= zeros.len() as u64, "{packed}");
        let mut lzw = weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8);
        let packed = lzw.encode(&zeros).unwrap().len() as u64;
        assert!(packed * Method::Lzw.expansion() >= zeros.len() as u64, "{packed}");
    }
}
