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
use std::path::Path;

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
        .single_precision(layout.numbers.name() == "f32");

    let shape = (layout.rows, layout.cols);
    let placement = location.transform.map(|t| Placement::north_up(t, shape.0, shape.1));
    let georeference = placement.map(|p| Georeference {
        transform: p.transform,
        epsg: location.epsg,
        definition: None,
        raster_space: location.raster_space,
    });
    let recorded = metadata.cell_size.zip(placement).and_then(|(r, p)| r.for_transform(p.transform));
    let (cell_size, source) = match (options.cell_size, recorded, georeference) {
        (Some(given), _, _) => (given, CellSizeSource::Caller),
        (None, Some(recorded), _) => (recorded, CellSizeSource::File),
        (None, None, Some(g)) => (ground::cell_size(path, &g, location.unit, shape)?, CellSizeSource::File),
        (None, None, None) => (CellSize::square(1.0)?, CellSizeSource::Assumed),
    };

    let mut samples = Samples::new(shape.0, shape.1, rule);
    fill(path, bytes, &layout, band, &mut samples)?;
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
        sample: layout.numbers.name(),
        packing: layout.packing_words(),
        coordinates: location.words,
        cell_size_source: source,
        notes,
    };
    Ok((dem, description))
}

/// The band to read, counted from 0.
fn choose_band(path: &Path, options: &ReadOptions, layout: &Layout) -> Result<usize> {
    let bands = layout.bands;
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

fn fill(path: &Path, bytes: &[u8], layout: &Layout, band: usize, samples: &mut Samples) -> Result<()> {
    let packing = layout.packing;
    let first = if layout.planar { band * layout.chunks_per_band } else { 0 };
    let offset = if layout.planar { 0 } else { band };
    for i in 0..layout.chunks_per_band {
        let Some(packed) = layout.chunk(first + i, bytes) else { continue };
        let raw = packing.unpack(packed, layout.unpacked_bytes(i)).map_err(|reason| {
            let field = format!("{} {}", layout.chunk_noun(), first + i);
            Error::file(path, field, format!("damaged ({reason})"), "the data must unpack whole")
        })?;
        place(layout, i, offset, &raw, samples);
    }
    Ok(())
}

/// Copies one band of a chunk into the raster, without what overhangs it.
fn place(layout: &Layout, chunk: usize, offset: usize, raw: &[u8], samples: &mut Samples) {
    let (row, col) = layout.chunk_origin(chunk);
    let (rows, cols) = layout.chunk_shape(chunk);
    let interleaved = layout.packing.samples;
    let cell_bytes = interleaved * layout.numbers.size();
    for (i, line) in raw.chunks_exact(layout.packing.cols * cell_bytes).take(rows).enumerate() {
        let start = (row + i) * layout.cols + col;
        let line = &line[..cols * cell_bytes];
        if interleaved == 1 {
            layout.numbers.each(line, false, |j, value| samples.set(start + j, value));
        } else {
            layout.numbers.each(line, false, |j, value| {
                if j % interleaved == offset {
                    samples.set(start + j / interleaved, value);
                }
            });
        }
    }
}
