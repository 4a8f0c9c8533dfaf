//! [`Dem`] to GeoTIFF.
//!
//! In: a DEM. Out: a classic TIFF of deflated strips, with a horizontal (integers) or floating-point (floats)
//! predictor, georeference and nodata; readable by GDAL and everything built on it. The `tiff` crate writes the
//! container; its own image encoder has no floating-point predictor, so strips are packed here, in parallel.
//!
//! Without a georeference the DEM is placed at the origin of a local metric system. Cost: one pass, and the packed
//! strips in memory.

use super::super::ground::{self, Ellipsoid, MapUnit};
use super::super::{SampleType, WriteOptions};
use super::{key, metadata, tag};
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
    let keys = geo_keys(dem);
    let placed = dem.georeference().copied().unwrap_or_else(|| local(dem));
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
    let (transform_tags, raster_space) = (transform_tags(&placed), placed.raster_space);
    debug_assert!(keys.is_some() || raster_space == RasterSpace::PixelIsArea);
    for (number, values) in &transform_tags {
        put(*number, Value::Doubles(values))?;
    }
    if let Some(keys) = &keys {
        put(tag::GEO_KEY_DIRECTORY, Value::Shorts(keys))?;
    }
    let derived = ground::cell_size(path, &placed, map_unit(dem), (rows, cols)).ok();
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
        definition: None,
        raster_space: RasterSpace::PixelIsArea,
    }
}

/// What the georeference's unit must be, judged by the cell size beside it: one degree is about 10^5 metres (on Earth;
/// 3 x 10^4 on the Moon), and no linear unit is nearly as long.
fn map_unit(dem: &Dem) -> MapUnit {
    let Some(g) = dem.georeference() else { return MapUnit::Unstated };
    let [_, b, _, _, e, _] = g.transform;
    let metres = dem.cell_size().y() / b.hypot(e);
    if metres > 5000.0 {
        MapUnit::Degrees(1.0, Ellipsoid::WGS84)
    } else if g.epsg == Some(3857) {
        MapUnit::WebMercator
    } else {
        let known = [0.3048, 1200.0 / 3937.0, 1000.0];
        let near = known.into_iter().find(|unit| (metres / unit - 1.0).abs() < 1e-7);
        if g.epsg.is_none() && near.is_none() {
            MapUnit::Unstated
        } else {
            MapUnit::Metres(near.unwrap_or(1.0))
        }
    }
}

/// The GeoKey directory, when there is anything to say.
fn geo_keys(dem: &Dem) -> Option<Vec<u16>> {
    let g = dem.georeference()?;
    let code = g.epsg.and_then(|code| u16::try_from(code).ok()).unwrap_or(key::USER_DEFINED);
    let space = match g.raster_space {
        RasterSpace::PixelIsArea => key::PIXEL_IS_AREA,
        RasterSpace::PixelIsPoint => key::PIXEL_IS_POINT,
    };
    let keys = match map_unit(dem) {
        MapUnit::Degrees(..) => vec![
            (key::MODEL_TYPE, key::GEOGRAPHIC),
            (key::RASTER_TYPE, space),
            (key::GEODETIC_CRS, code),
            (key::ANGULAR_UNITS, key::DEGREE),
        ],
        MapUnit::Unstated if g.raster_space == RasterSpace::PixelIsArea => return None,
        MapUnit::Unstated => vec![(key::RASTER_TYPE, space)],
        MapUnit::Metres(factor) => vec![
            (key::MODEL_TYPE, key::PROJECTED),
            (key::RASTER_TYPE, space),
            (key::PROJECTED_CRS, code),
            (key::LINEAR_UNITS, linear_unit_code(factor)),
        ],
        MapUnit::WebMercator => vec![
            (key::MODEL_TYPE, key::PROJECTED),
            (key::RASTER_TYPE, space),
            (key::PROJECTED_CRS, code),
            (key::LINEAR_UNITS, key::METRE),
        ],
    };
    let mut directory = vec![1, 1, 0, keys.len() as u16];
    directory.extend(keys.into_iter().flat_map(|(key, value)| [key, 0, 1, value]));
    Some(directory)
}

fn linear_unit_code(metres: f64) -> u16 {
    match metres {
        0.3048 => 9002,
        1000.0 => 9036,
        m if m == 1200.0 / 3937.0 => 9003,
        _ => key::METRE,
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
