//! [`Dem`] to GeoTIFF.
//!
//! In: a DEM. Out: a classic TIFF of deflated strips, with a horizontal (integers) or floating-point (floats)
//! predictor, georeference and nodata; readable by GDAL and everything built on it. The `tiff` crate writes the
//! container; its own image encoder has no floating-point predictor, so strips are packed here, in parallel.
//!
//! Without a georeference the DEM is placed at the origin of a local metric system. Cost: one pass, and the packed
//! strips in memory.

use super::super::{SampleType, WriteOptions};
use super::georeference::WORDS;
use super::{key, metadata, projection, tag};
use crate::dem::crs::{Crs, CrsKind, Ellipsoid, same_as, unit_code};
use crate::dem::{Dem, Georeference, RasterSpace};
use crate::error::{Error, Result};
use crate::file::Output;
use flate2::{Compression, write::ZlibEncoder};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;
use tiff::encoder::TiffEncoder;
use tiff::tags::Tag;

/// Raw bytes in a strip, about: small enough to read a window cheaply, large enough to pack well.
const STRIP_BYTES: usize = 1 << 18;

/// Nodata of 16-bit files; of float files it is NaN, which no program can take for a height.
const NODATA_INT16: i16 = i16::MIN;

pub(in super::super) fn write(
    path: &Path,
    out: &mut Output<'_>,
    dem: &Dem,
    options: &WriteOptions,
) -> Result<()> {
    let (rows, cols) = dem.shape();
    let size = |n: usize| {
        u32::try_from(n).map_err(|_| Error::file(path, "raster size", n, "allowed: below 2^32 on a side"))
    };
    let (height, width) = (size(rows)?, size(cols)?);
    let (bytes, format, predictor, nodata) = match options.sample_type {
        SampleType::Float32 => (4, 3u16, 3u16, "nan".to_owned()),
        SampleType::Int16 => (2, 2, 2, NODATA_INT16.to_string()),
    };
    let strip_rows = (STRIP_BYTES / (cols * bytes)).clamp(1, rows);
    let heights: Vec<&[f32]> = dem.heights().as_slice().chunks(strip_rows * cols).collect();
    let valid: Vec<&[bool]> = dem.valid().as_slice().chunks(strip_rows * cols).collect();
    let strips: Vec<Vec<u8>> = (0..heights.len())
        .into_par_iter()
        .map(|i| {
            let raw = match options.sample_type {
                SampleType::Float32 => float_rows(heights[i], valid[i], cols),
                SampleType::Int16 => int16_rows(path, heights[i], valid[i], cols)?,
            };
            deflate(&raw).map_err(Error::io(path, "compress a strip"))
        })
        .collect::<Result<_>>()?;

    let failed = |e: tiff::TiffError| match e {
        tiff::TiffError::IoError(source) => Error::io(path, "write the file")(source),
        other => Error::file(path, "TIFF", other, "the raster does not fit the format"),
    };
    let mut container = TiffEncoder::new(out).map_err(failed)?;
    let mut directory = container.image_directory().map_err(failed)?;
    let (mut offsets, mut counts) = (Vec::new(), Vec::new());
    for strip in &strips {
        let offset = directory.write_data(&strip[..]).map_err(failed)?;
        let beyond = |n: u64| {
            u32::try_from(n).map_err(|_| Error::file(path, "file size", n, "allowed: below 4 GiB for a TIFF"))
        };
        offsets.push(beyond(offset)?);
        counts.push(beyond(strip.len() as u64)?);
    }
    let placed = placed(dem);
    let keys = Keys::of(&placed);
    let mut put = |number: u16, value: Value<'_>| {
        let tag = Tag::from_u16_exhaustive(number);
        match value {
            Value::Short(v) => directory.write_tag(tag, v),
            Value::Long(v) => directory.write_tag(tag, v),
            Value::Shorts(v) => directory.write_tag(tag, v),
            Value::Longs(v) => directory.write_tag(tag, v),
            Value::Doubles(v) => directory.write_tag(tag, v),
            Value::Text(v) => directory.write_tag(tag, v),
        }
        .map_err(failed)
    };
    put(tag::WIDTH, Value::Long(width))?;
    put(tag::HEIGHT, Value::Long(height))?;
    put(tag::BITS_PER_SAMPLE, Value::Short(8 * bytes as u16))?;
    put(tag::COMPRESSION, Value::Short(8))?;
    put(tag::PHOTOMETRIC, Value::Short(1))?;
    put(tag::STRIP_OFFSETS, Value::Longs(&offsets))?;
    put(tag::SAMPLES_PER_PIXEL, Value::Short(1))?;
    put(tag::ROWS_PER_STRIP, Value::Long(size(strip_rows)?))?;
    put(tag::STRIP_BYTE_COUNTS, Value::Longs(&counts))?;
    put(tag::PREDICTOR, Value::Short(predictor))?;
    put(tag::SAMPLE_FORMAT, Value::Short(format))?;
    for (number, values) in &transform_tags(&placed) {
        put(*number, Value::Doubles(values))?;
    }
    put(tag::GEO_KEY_DIRECTORY, Value::Shorts(&keys.directory()))?;
    if !keys.doubles.is_empty() {
        put(tag::GEO_DOUBLE_PARAMS, Value::Doubles(&keys.doubles))?;
    }
    if !keys.text.is_empty() {
        put(tag::GEO_ASCII_PARAMS, Value::Text(&keys.text))?;
    }
    let derived = placed.ground((rows, cols)).ok().map(|ground| ground.cell_size);
    if derived != Some(dem.cell_size()) {
        put(tag::GDAL_METADATA, Value::Text(&metadata::record_cell_size(dem.cell_size(), placed.transform)))?;
    }
    put(tag::GDAL_NODATA, Value::Text(&nodata))?;
    directory.finish().map_err(failed)
}

enum Value<'a> {
    Short(u16),
    Long(u32),
    Shorts(&'a [u16]),
    Longs(&'a [u32]),
    Doubles(&'a [f64]),
    Text(&'a str),
}

/// Floating-point predictor (Adobe Photoshop TIFF technical note 3): a row's bytes by significance, differenced.
fn float_rows(heights: &[f32], valid: &[bool], cols: usize) -> Vec<u8> {
    let mut raw = Vec::with_capacity(heights.len() * 4);
    for (row, known) in heights.chunks(cols).zip(valid.chunks(cols)) {
        let start = raw.len();
        raw.resize(start + cols * 4, 0);
        let line = &mut raw[start..];
        for (i, (&z, &ok)) in row.iter().zip(known).enumerate() {
            let stored = if ok { z } else { f32::NAN };
            for (plane, byte) in stored.to_be_bytes().into_iter().enumerate() {
                line[plane * cols + i] = byte;
            }
        }
        for i in (1..line.len()).rev() {
            line[i] = line[i].wrapping_sub(line[i - 1]);
        }
    }
    raw
}

/// Whole metres with a horizontal predictor.
fn int16_rows(path: &Path, heights: &[f32], valid: &[bool], cols: usize) -> Result<Vec<u8>> {
    let mut raw = Vec::with_capacity(heights.len() * 2);
    for (row, known) in heights.chunks(cols).zip(valid.chunks(cols)) {
        let mut before = 0i16;
        for (&z, &ok) in row.iter().zip(known) {
            let rounded = z.round();
            if ok && !(-32767.0..=32767.0).contains(&rounded) {
                return Err(Error::file(path, "height", z, "allowed in 16 bits: -32767 to 32767 m"));
            }
            let stored = if ok { rounded as i16 } else { NODATA_INT16 };
            raw.extend_from_slice(&stored.wrapping_sub(before).to_ne_bytes());
            before = stored;
        }
    }
    Ok(raw)
}

fn deflate(raw: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(raw)?;
    encoder.finish()
}

/// A place for a DEM that has none: south-west corner at (0, 0), metres.
fn local(dem: &Dem) -> Georeference {
    let size = dem.cell_size();
    let north = size.y() * dem.shape().0 as f64;
    Georeference {
        transform: [size.x(), 0.0, 0.0, 0.0, -size.y(), north],
        epsg: None,
        definition: Crs::local(1.0).ok(),
        raster_space: RasterSpace::PixelIsArea,
    }
}

/// The place that is written. Coordinates of no stated unit whose steps are the cell size are metres.
fn placed(dem: &Dem) -> Georeference {
    let Some(g) = dem.georeference() else { return local(dem) };
    let ([a, b, _, d, e, _], size) = (g.transform, dem.cell_size());
    let same = |step: f64, metres: f64| (step / metres - 1.0).abs() < 1e-9;
    let metres = same(a.hypot(d), size.x()) && same(b.hypot(e), size.y());
    let definition = match g.crs() {
        None if g.epsg.is_none() && metres => Crs::local(1.0).ok(),
        _ => g.definition,
    };
    Georeference { definition, ..*g }
}

/// The GeoKeys: directory, doubles and texts.
#[derive(Default)]
struct Keys {
    entries: Vec<[u16; 4]>,
    doubles: Vec<f64>,
    text: String,
}

impl Keys {
    fn short(&mut self, key: u16, value: u16) {
        self.entries.push([key, 0, 1, value]);
    }

    fn double(&mut self, key: u16, value: f64) {
        self.entries.push([key, tag::GEO_DOUBLE_PARAMS, 1, self.doubles.len() as u16]);
        self.doubles.push(value);
    }

    fn text(&mut self, key: u16, value: &str) {
        let start = self.text.len() as u16;
        self.text += value;
        self.text.push('|');
        self.entries.push([key, tag::GEO_ASCII_PARAMS, self.text.len() as u16 - start, start]);
    }

    /// All that is known about the coordinates.
    fn of(g: &Georeference) -> Self {
        let mut keys = Self::default();
        let space = match g.raster_space {
            RasterSpace::PixelIsArea => key::PIXEL_IS_AREA,
            RasterSpace::PixelIsPoint => key::PIXEL_IS_POINT,
        };
        keys.short(key::RASTER_TYPE, space);
        let code = g.epsg.map(same_as).and_then(|code| u16::try_from(code).ok());
        match (g.crs(), code) {
            (Some(crs), code) => keys.system(&crs, code),
            // Most codes are of projected systems, and its table must be looked up in any case.
            (None, Some(code)) => {
                keys.short(key::MODEL_TYPE, key::PROJECTED);
                keys.short(key::PROJECTED_CRS, code);
            }
            (None, None) => {}
        }
        keys.entries.sort_unstable();
        keys
    }

    fn system(&mut self, crs: &Crs, code: Option<u16>) {
        match (crs.kind(), crs.metres_per_unit()) {
            (CrsKind::Geographic, _) | (_, None) => {
                self.short(key::MODEL_TYPE, key::GEOGRAPHIC);
                self.geographic(crs, code);
            }
            (CrsKind::Projected, Some(metres)) => {
                let keys = crs.method().and_then(|method| projection::keys(method, metres));
                match (code, keys) {
                    (Some(code), _) => {
                        self.short(key::MODEL_TYPE, key::PROJECTED);
                        self.short(key::PROJECTED_CRS, code);
                    }
                    (None, Some((projection, parameters))) => {
                        self.short(key::MODEL_TYPE, key::PROJECTED);
                        self.geographic(crs, crs.base_epsg().and_then(|code| u16::try_from(code).ok()));
                        self.short(key::PROJECTED_CRS, key::USER_DEFINED);
                        self.short(key::PROJECTION_CRS, key::USER_DEFINED);
                        self.short(key::PROJECTION, projection);
                        parameters.into_iter().for_each(|(key, value)| self.double(key, value));
                    }
                    // No keys say what it is: its lengths are kept, and its words.
                    (None, None) => {
                        self.short(key::MODEL_TYPE, key::USER_DEFINED);
                        let words = crs.wkt().map(|words| words.replace('|', " "));
                        match (crs.own_words(), words) {
                            // As it was given: the library's words are not those of GDAL for all of its projections.
                            (Some(own), Ok(words)) if own.starts_with("PROJCS[") => {
                                self.text(key::PROJECTED_CITATION, &format!("{WORDS}{words}"));
                            }
                            (_, Ok(words)) => self.text(key::CITATION, &words),
                            (_, Err(_)) => {}
                        }
                    }
                }
                self.linear_unit(metres);
            }
            (CrsKind::Local, Some(metres)) => {
                self.short(key::MODEL_TYPE, key::USER_DEFINED);
                self.linear_unit(metres);
            }
        }
    }

    fn geographic(&mut self, crs: &Crs, code: Option<u16>) {
        self.short(key::GEODETIC_CRS, code.unwrap_or(key::USER_DEFINED));
        self.short(key::ANGULAR_UNITS, key::DEGREE);
        if code.is_none() {
            if let Some(datum) = crs.datum_epsg().and_then(|code| u16::try_from(code).ok()) {
                self.short(key::GEODETIC_DATUM, datum);
            }
            let Ellipsoid { semi_major, flattening } = crs.ellipsoid();
            self.double(key::SEMI_MAJOR_AXIS, semi_major);
            self.double(key::INVERSE_FLATTENING, if flattening == 0.0 { 0.0 } else { 1.0 / flattening });
        }
    }

    fn linear_unit(&mut self, metres: f64) {
        let code = unit_code(metres);
        self.short(key::LINEAR_UNITS, code.unwrap_or(key::USER_DEFINED));
        if code.is_none() {
            self.double(key::LINEAR_UNIT_SIZE, metres);
        }
    }

    /// The tag of the directory.
    fn directory(&self) -> Vec<u16> {
        let mut directory = vec![1, 1, 0, self.entries.len() as u16];
        directory.extend(self.entries.iter().flatten());
        directory
    }
}

/// Pixel scale and tiepoint, or the transformation matrix when the raster is rotated.
fn transform_tags(g: &Georeference) -> Vec<(u16, Vec<f64>)> {
    let [a, b, c, d, e, f] = g.transform;
    let half = match g.raster_space {
        RasterSpace::PixelIsArea => 0.0,
        RasterSpace::PixelIsPoint => 0.5,
    };
    let (x, y) = (undo(c, half * (a + b)), undo(f, half * (d + e)));
    if b == 0.0 && d == 0.0 && a > 0.0 && e < 0.0 {
        return vec![
            (tag::MODEL_PIXEL_SCALE, vec![a, -e, 0.0]),
            (tag::MODEL_TIEPOINT, vec![0.0, 0.0, 0.0, x, y, 0.0]),
        ];
    }
    let matrix = vec![a, b, 0.0, x, d, e, 0.0, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    vec![(tag::MODEL_TRANSFORMATION, matrix)]
}

/// The number from which subtracting `step` gives `value` back to the last bit, where there is one.
fn undo(value: f64, step: f64) -> f64 {
    let near = value + step;
    [near, near.next_up(), near.next_down()].into_iter().find(|v| v - step == value).unwrap_or(near)
}
