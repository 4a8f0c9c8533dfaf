//! GeoTIFF to [`Dem`].
//!
//! In: the bytes of a file. Out: heights in metres, voids, georeference. Cost: one pass; beside the raster, one strip
//! or tile at a time.

use super::super::ground::{self, Placement};
use super::super::samples::{Rule, Samples};
use super::super::{CellSizeSource, Description, Format, ReadOptions};
use super::directory::Directory;
use super::georeference::Location;
use super::layout::Layout;
use super::metadata::Metadata;
use crate::dem::{CellSize, Dem, Georeference};
use crate::error::{Error, Result};
use std::io::Cursor;
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult, Limits};

pub(in super::super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(Dem, Description)> {
    let directory = Directory::parse(path, bytes)?;
    let layout = Layout::parse(path, &directory, bytes.len() as u64)?;
    let band = choose_band(path, options, &layout)?;
    let location = Location::parse(path, &directory, options)?;
    let metadata = Metadata::parse(path, &directory, band, options)?;

    let mut notes = Vec::new();
    let unit = metadata.unit.or(location.vertical_unit).unwrap_or(1.0);
    if unit != 1.0 && options.metres_per_unit.is_none() {
        notes.push(format!("heights converted to metres: 1 unit is {unit} m"));
    }
    let rule = Rule::new(path, options, metadata.nodata, unit)?
        .scaled(metadata.scale, metadata.offset)
        .single_precision(layout.sample_name() == "f32");

    let shape = (layout.rows, layout.cols);
    let placement = location.transform.map(|t| Placement::north_up(t, shape.0, shape.1));
    let georeference = placement.map(|p| Georeference {
        transform: p.transform,
        epsg: location.epsg,
        raster_space: location.raster_space,
    });
    let (cell_size, source) = match (options.cell_size, metadata.cell_size, georeference) {
        (Some(given), _, _) => (given, CellSizeSource::Caller),
        (None, Some(recorded), _) => (recorded, CellSizeSource::File),
        (None, None, Some(g)) => (ground::cell_size(path, &g, location.unit, shape)?, CellSizeSource::File),
        (None, None, None) => (CellSize::square(1.0)?, CellSizeSource::Assumed),
    };

    let mut samples = Samples::new(shape.0, shape.1, rule);
    unpack(path, bytes, &layout, band, &mut samples)?;
    if let Some(p) = placement {
        samples.flip(p.flip_rows, p.flip_cols);
        if p.flip_rows || p.flip_cols {
            notes.push("turned so that row 0 is north".to_owned());
        }
    }
    let dem = samples.into_dem(path, cell_size)?.at(georeference);
    notes.extend(location.notes);
    let description = Description {
        format: Format::GeoTiff,
        sample: layout.sample_name(),
        packing: layout.packing(),
        coordinates: location.words,
        cell_size_source: source,
        notes,
    };
    Ok((dem, description))
}

/// The band to read, counted from 0.
fn choose_band(path: &Path, options: &ReadOptions, layout: &Layout) -> Result<usize> {
    let bands = layout.samples;
    match options.band {
        None if bands == 1 => Ok(0),
        None => Err(Error::file(
            path,
            "number of bands",
            bands,
            format!("heights are one band: name the band to read, 1 to {bands}"),
        )),
        Some(band) if (1..=bands).contains(&band) => Ok(band - 1),
        Some(band) => Err(Error::file(path, "band", band, format!("allowed: 1 to {bands}"))),
    }
}

fn unpack(path: &Path, bytes: &[u8], layout: &Layout, band: usize, samples: &mut Samples) -> Result<()> {
    let structure = |e: tiff::TiffError| Error::file(path, "TIFF structure", e, "the file is damaged");
    let mut limits = Limits::default();
    // Each strip or tile has been checked to fit what the file can hold.
    limits.decoding_buffer_size = usize::MAX;
    limits.intermediate_buffer_size = usize::MAX;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(structure)?.with_limits(limits);

    let first = if layout.planar { band * layout.chunks_per_band } else { 0 };
    let (stride, skip) = if layout.planar { (1, 0) } else { (layout.samples, band) };
    for i in 0..layout.chunks_per_band {
        let chunk = first + i;
        if layout.is_absent(chunk) {
            continue;
        }
        let damaged = |value: String| {
            Error::file(
                path,
                format!("{} {chunk}", layout.chunk_noun()),
                value,
                "the data are damaged or cut off: they do not unpack",
            )
        };
        let index = u32::try_from(chunk).map_err(|_| damaged("beyond 2^32".to_owned()))?;
        let data = decoder.read_chunk(index).map_err(|e| damaged(e.to_string()))?;
        let (rows, cols) = layout.chunk_shape(i);
        let expected = rows * cols * stride;
        let target =
            Window { origin: layout.chunk_origin(i), cols, raster_cols: layout.cols, stride, skip, expected };
        let found = match data {
            DecodingResult::U8(v) => target.place(&v, samples, f64::from),
            DecodingResult::U16(v) => target.place(&v, samples, f64::from),
            DecodingResult::U32(v) => target.place(&v, samples, f64::from),
            DecodingResult::U64(v) => target.place(&v, samples, |x| x as f64),
            DecodingResult::I8(v) => target.place(&v, samples, f64::from),
            DecodingResult::I16(v) => target.place(&v, samples, f64::from),
            DecodingResult::I32(v) => target.place(&v, samples, f64::from),
            DecodingResult::I64(v) => target.place(&v, samples, |x| x as f64),
            DecodingResult::F16(v) => target.place(&v, samples, |x| x.to_f64()),
            DecodingResult::F32(v) => target.place(&v, samples, f64::from),
            DecodingResult::F64(v) => target.place(&v, samples, |x| x),
        };
        if found != expected {
            return Err(damaged(format!("{found} numbers instead of {expected}")));
        }
    }
    Ok(())
}

/// Where in the raster a chunk belongs.
struct Window {
    origin: (usize, usize),
    cols: usize,
    raster_cols: usize,
    stride: usize,
    skip: usize,
    expected: usize,
}

impl Window {
    /// Copies one band of a chunk if it has the expected size; returns how many numbers it held.
    fn place<T: Copy>(&self, data: &[T], samples: &mut Samples, number: impl Fn(T) -> f64) -> usize {
        if data.len() != self.expected {
            return data.len();
        }
        for (i, line) in data.chunks_exact(self.cols * self.stride).enumerate() {
            let start = (self.origin.0 + i) * self.raster_cols + self.origin.1;
            for (j, pixel) in line.chunks_exact(self.stride).enumerate() {
                samples.set(start + j, number(pixel[self.skip]));
            }
        }
        data.len()
    }
}
