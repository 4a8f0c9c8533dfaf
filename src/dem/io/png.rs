//! Greyscale PNG of 8 or 16 bits.
//!
//! In: grey levels and the heights of the lowest and the highest, from [`ReadOptions::elevation`] or from the text
//! chunk that [`write`] leaves ("monadnock": range, void level, cell size, georeference as JSON). Out: a DEM. In a PNG of
//! other programs, the transparent level (`tRNS`) and cells whose alpha is 0 are voids; place and cell size come from files
//! beside it, else a cell is 1 m unless given. Cost: one pass.
//!
//! Written with 16 bits: heights become the nearest of 65535 levels between the lowest and the highest (level 0 is kept
//! for voids), so a height comes back within range / 131068.

use super::mask::{FileMask, hide};
use super::numbers::NumberType;
use super::place::{Place, Said};
use super::reading::Source;
use super::samples::{Rule, Samples, check_size};
use super::{Description, Format, Nodata, ReadOptions, WriteOptions};
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

/// Levels as they are stored, and which of them are voids.
struct Levels {
    rows: usize,
    cols: usize,
    numbers: NumberType,
    highest: f64,
    /// Grey levels, big-endian.
    grey: Vec<u8>,
    /// Whether a cell is fully transparent, when the file has an alpha channel.
    transparent: Option<Vec<bool>>,
    /// The level that stands for transparency.
    transparent_level: Option<f64>,
    /// Our own text.
    text: Option<String>,
}

impl Levels {
    fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let damaged = |e: DecodingError| Error::file(path, "PNG data", e, "the file is damaged or cut off");
        let mut decoder = png::Decoder::new(Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let info = decoder.read_header_info().map_err(damaged)?;
        let (rows, cols) = check_size(path, info.height.into(), info.width.into())?;
        let (colour, depth) = (info.color_type, info.bit_depth);
        let channels = match colour {
            ColorType::Grayscale => 1,
            ColorType::GrayscaleAlpha => 2,
            _ => {
                let allowed = "allowed: greyscale, one number a cell, with or without alpha";
                return Err(Error::file(path, "colour type", format!("{colour:?}"), allowed));
            }
        };
        let (numbers, highest) = match depth {
            BitDepth::Eight => (NumberType::U8, 255.0),
            BitDepth::Sixteen => (NumberType::U16, 65535.0),
            _ => return Err(Error::file(path, "bit depth", depth as u8, "allowed: 8 or 16")),
        };
        let size = numbers.size();
        let needed = rows * cols * size * channels;
        if (bytes.len() as u64).saturating_mul(EXPANSION) < needed as u64 {
            return Err(Error::file(
                path,
                "raster size",
                format!("{rows} rows x {cols} columns"),
                format!("{} bytes cannot unpack to the {needed} needed", bytes.len()),
            ));
        }
        let mut reader = decoder.read_info().map_err(damaged)?;
        let mut raw = vec![0; needed];
        if reader.output_buffer_size() != Some(raw.len()) {
            let found = "of another size than the header says";
            return Err(Error::file(path, "PNG data", found, "the file is damaged"));
        }
        reader.next_frame(&mut raw).map_err(damaged)?;
        // Text may also follow the image.
        reader.finish().map_err(damaged)?;
        let info = reader.info();
        let text = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD);
        let level = |raw: &[u8]| raw.iter().fold(0.0, |level, byte| level * 256.0 + f64::from(*byte));
        let transparent_level = info.trns.as_deref().filter(|trns| matches!(trns.len(), 1 | 2)).map(level);
        let (grey, transparent) = if channels == 1 {
            (raw, None)
        } else {
            let cells = || raw.chunks_exact(2 * size);
            let grey = cells().flat_map(|cell| &cell[..size]).copied().collect();
            (grey, Some(cells().map(|cell| cell[size..].iter().all(|byte| *byte == 0)).collect()))
        };
        let text = text.map(|chunk| chunk.text.clone());
        Ok(Self { rows, cols, numbers, highest, grey, transparent, transparent_level, text })
    }
}

/// What we recorded; `None` for a file of another program, or with a warning when the caller gives what it should say.
fn record(path: &Path, text: Option<&str>, options: &ReadOptions, said: &mut Said) -> Result<Option<Record>> {
    let Some(text) = text else { return Ok(None) };
    let parsed = serde_json::from_str(text).map_err(|e| e.to_string()).and_then(|record: Record| {
        let [x, y] = record.cell_size;
        CellSize::new(x, y).map_err(|e| e.to_string())?;
        let sound = record.georeference.is_none_or(|g| g.transform.iter().all(|v| v.is_finite()));
        if sound { Ok(record) } else { Err("the georeference is not finite".to_owned()) }
    });
    match parsed {
        Ok(record) => Ok(Some(record)),
        Err(reason) if options.elevation.is_some() => {
            said.warnings
                .push(format!("text chunk {KEYWORD:?} is not used, as --elevation is given: {reason}"));
            Ok(None)
        }
        Err(reason) => {
            let allowed =
                "allowed: what this program writes there; or give the heights with --elevation MIN,MAX";
            Err(Error::file(path, format!("text chunk {KEYWORD:?}"), reason, allowed))
        }
    }
}

pub(super) fn read(source: &Source<'_>, bytes: &[u8], said: &mut Said) -> Result<(Dem, Description)> {
    let Source { path, options, sidecars } = *source;
    let levels = Levels::parse(path, bytes)?;
    let record = record(path, levels.text.as_deref(), options, said)?;
    // With a record, level 0 means void and heights begin at level 1.
    let lowest = if record.is_some() { 1.0 } else { 0.0 };
    let range = match (options.elevation, &record) {
        (Some(given), _) => given,
        (None, Some(record)) => {
            let [low, high] = record.elevation;
            Normalization::new(low, high).map_err(|e| e.in_file(path))?
        }
        (None, None) => {
            return Err(Error::file(
                path,
                "elevation range",
                "not given",
                format!(
                    "a PNG holds grey levels: give the heights in metres of level 0 and level {} with --elevation MIN,MAX",
                    levels.highest
                ),
            ));
        }
    };
    let per_level = (range.high() - range.low()) / (levels.highest - lowest);
    let declared =
        if record.is_some() { Some(0.0) } else { sidecars.band(0).nodata.or(levels.transparent_level) };
    let levels_only = ReadOptions { metres_per_unit: None, ..*options };
    let rule = Rule::new(path, &levels_only, declared, 1.0)?.lenient();
    let rule = rule.scaled(per_level, range.low() - lowest * per_level);
    let (rows, cols) = (levels.rows, levels.cols);
    let mut samples = Samples::new(rows, cols, rule);
    levels.numbers.each(&levels.grey, true, |i, level| samples.set(i, level));
    if let Some(transparent) = &levels.transparent {
        hide(&mut samples, options, "alpha channel", |i| !transparent[i], said);
    }
    if options.nodata != Nodata::Numbers {
        said.notes.push(format!("levels span {} to {} m", range.low(), range.high()));
    }
    if let (None, Some(level), Nodata::AsDeclared) = (&record, levels.transparent_level, options.nodata) {
        said.notes.push(format!("level {level} is transparent: void"));
    }
    let place = record.as_ref().and_then(|r| r.georeference).map_or(Place::NOWHERE, |g| Place {
        transform: Some(g.transform),
        epsg: g.epsg,
        definition: g.definition,
        raster_space: g.raster_space,
    });
    let recorded = record.and_then(|r| CellSize::new(r.cell_size[0], r.cell_size[1]).ok());
    let settled = place.settle(path, options, sidecars, (rows, cols), |_| recorded, said)?;
    let file_mask = FileMask { path, options, sidecars, shape: (rows, cols), band: 0 };
    file_mask.apply(&mut samples, said)?;
    samples.flip(settled.flip_rows, settled.flip_cols);
    let description = Description::new(Format::Png, levels.numbers.name(), "deflate", &settled);
    Ok((samples.into_dem(path, settled.cell_size, said)?.at(settled.georeference), description))
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
