//! Greyscale PNG of 8 or 16 bits.
//!
//! In: grey levels and the heights of the lowest and the highest, from [`ReadOptions::elevation`] or from the text
//! chunk that [`write`] leaves ("monadnock": range, void level, cell size, georeference as JSON). Out: a DEM. A PNG of
//! other programs has no voids, and no cell size: 1 m unless given. Cost: one pass.
//!
//! Written with 16 bits: heights become the nearest of 65535 levels between the lowest and the highest (level 0 is kept
//! for voids), so a height comes back within range / 131068.

use super::numbers::NumberType;
use super::samples::{Rule, Samples, check_size};
use super::{CellSizeSource, Description, Format, Nodata, ReadOptions, WriteOptions};
use crate::dem::{CellSize, Dem, Georeference, Normalization};
use crate::error::{Error, Result};
use crate::file::Output;
use png::{BitDepth, ColorType, DecodingError};
use std::io::Cursor;
use std::path::Path;

/// Keyword of our text chunk.
const KEYWORD: &str = "monadnock";

/// A deflated byte becomes at most this many.
const EXPANSION: u64 = 1040;

/// What [`write`] records.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    /// Heights of levels 1 and 65535, metres.
    elevation: [f64; 2],
    /// Metres, (west-east, north-south).
    cell_size: [f64; 2],
    georeference: Option<Georeference>,
}

pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    let damaged = |e: DecodingError| Error::file(path, "PNG data", e, "the file is damaged or cut off");
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let info = decoder.read_header_info().map_err(damaged)?;
    let (rows, cols) = check_size(path, info.height.into(), info.width.into())?;
    let (colour, depth) = (info.color_type, info.bit_depth);
    if colour != ColorType::Grayscale {
        let allowed = "allowed: greyscale without alpha, one number a cell";
        return Err(Error::file(path, "colour type", format!("{colour:?}"), allowed));
    }
    let (numbers, highest) = match depth {
        BitDepth::Eight => (NumberType::U8, 255.0),
        BitDepth::Sixteen => (NumberType::U16, 65535.0),
        _ => return Err(Error::file(path, "bit depth", depth as u8, "allowed: 8 or 16")),
    };
    let size = numbers.size();
    let needed = (rows * cols * size) as u64;
    if (bytes.len() as u64).saturating_mul(EXPANSION) < needed {
        return Err(Error::file(
            path,
            "raster size",
            format!("{rows} rows x {cols} columns"),
            format!("{} bytes cannot unpack to the {needed} needed", bytes.len()),
        ));
    }
    let mut reader = decoder.read_info().map_err(damaged)?;
    let mut raw = vec![0; rows * cols * size];
    if reader.output_buffer_size() != Some(raw.len()) {
        return Err(Error::file(
            path,
            "PNG data",
            "of another size than the header says",
            "the file is damaged",
        ));
    }
    reader.next_frame(&mut raw).map_err(damaged)?;
    // Text may also follow the image.
    reader.finish().map_err(damaged)?;

    let text = reader.info().uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD);
    let record: Option<Record> = match text {
        None => None,
        Some(chunk) => Some(serde_json::from_str(&chunk.text).map_err(|e| {
            Error::file(path, format!("text chunk {KEYWORD:?}"), e, "allowed: what this program writes there")
        })?),
    };
    let (range, lowest, nodata) = match (options.elevation, &record) {
        // A range from the caller spans the same levels: with a record, level 0 still means void.
        (Some(given), None) => (given, 0.0, Nodata::None),
        (Some(given), Some(_)) => (given, 1.0, Nodata::Value(0.0)),
        (None, Some(record)) => {
            let [low, high] = record.elevation;
            (Normalization::new(low, high).map_err(|e| e.in_file(path))?, 1.0, Nodata::Value(0.0))
        }
        (None, None) => {
            return Err(Error::file(
                path,
                "elevation range",
                "not given",
                format!("a PNG holds grey levels: give the heights in metres of level 0 and level {highest}"),
            ));
        }
    };
    let per_level = (range.high() - range.low()) / (highest - lowest);
    let unit = ReadOptions { nodata, metres_per_unit: None, ..*options };
    let rule = Rule::new(path, &unit, None, 1.0)?.scaled(per_level, range.low() - lowest * per_level);
    let mut samples = Samples::new(rows, cols, rule);
    numbers.each(&raw, true, |i, level| samples.set(i, level));
    let (cell_size, cell_size_source) = match (options.cell_size, &record) {
        (Some(given), _) => (given, CellSizeSource::Caller),
        (None, Some(record)) => {
            let [x, y] = record.cell_size;
            (CellSize::new(x, y).map_err(|e| e.in_file(path))?, CellSizeSource::File)
        }
        (None, None) => (CellSize::square(1.0)?, CellSizeSource::Assumed),
    };
    let georeference = record.and_then(|r| r.georeference);
    if georeference.is_some_and(|g| g.transform.iter().any(|v| !v.is_finite())) {
        return Err(Error::file(path, "georeference", "not finite", "allowed: finite numbers"));
    }
    let description = Description {
        format: Format::Png,
        sample: numbers.name(),
        packing: "deflate".to_owned(),
        coordinates: match georeference.and_then(|g| g.epsg) {
            Some(code) => format!("EPSG:{code}"),
            None => if georeference.is_some() { "local" } else { "none" }.to_owned(),
        },
        cell_size_source,
        notes: vec![format!("levels span {} to {} m", range.low(), range.high())],
    };
    Ok((samples.into_dem(path, cell_size)?.at(georeference), description))
}

pub(super) fn write(path: &Path, out: &mut Output<'_>, dem: &Dem, options: &WriteOptions) -> Result<()> {
    let (rows, cols) = dem.shape();
    let range = options.elevation.unwrap_or_else(|| Normalization::of(dem));
    let (low, high) = dem.range();
    if f64::from(low) < range.low() || f64::from(high) > range.high() {
        let allowed = format!("it must contain the heights, {low} to {high} m");
        let found = format!("{},{}", range.low(), range.high());
        return Err(Error::value("elevation range", found, allowed));
    }
    let mut levels = Vec::with_capacity(rows * cols * 2);
    for (&z, &ok) in dem.heights().as_slice().iter().zip(dem.valid().as_slice()) {
        let level = if ok { 1 + (range.to_unit(f64::from(z)) * 65534.0).round() as u16 } else { 0 };
        levels.extend_from_slice(&level.to_be_bytes());
    }
    let record = Record {
        elevation: [range.low(), range.high()],
        cell_size: [dem.cell_size().x(), dem.cell_size().y()],
        georeference: dem.georeference().copied(),
    };
    let text = serde_json::to_string(&record)
        .map_err(|e| Error::file(path, "georeference", e, "allowed: finite numbers"))?;
    let side = |n: usize| {
        u32::try_from(n).map_err(|_| Error::file(path, "raster size", n, "allowed: below 2^31 on a side"))
    };
    let failed = |e: png::EncodingError| Error::io(path, "write the file")(e.into());
    let mut encoder = png::Encoder::new(out, side(cols)?, side(rows)?);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Sixteen);
    encoder.add_text_chunk(KEYWORD.to_owned(), text).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&levels).map_err(failed)?;
    writer.finish().map_err(failed)
}
