//! GeoTIFF to [`Dem`].
//!
//! In: the bytes of a file. Out: heights in metres, voids, georeference. Cost: one pass; beside the raster, one strip
//! or tile at a time.

use super::super::mask::{FileMask, hide};
use super::super::place::Said;
use super::super::reading::Source;
use super::super::samples::{Rule, Samples};
use super::super::{Description, Format, Nodata, ReadOptions};
use super::directory::Directory;
use super::georeference::location;
use super::layout::Layout;
use super::masks;
use super::metadata::Metadata;
use crate::dem::Dem;
use crate::error::{Error, Result};
use std::path::Path;

pub(in super::super) fn read(
    source: &Source<'_>,
    bytes: &[u8],
    said: &mut Said,
) -> Result<(Dem, Description)> {
    let Source { path, options, sidecars } = *source;
    let directory = Directory::parse(path, bytes)?;
    let layout = Layout::parse(path, &directory, bytes.len() as u64)?;
    let alpha = masks::alpha_bands(&directory, layout.bands)?;
    let band = choose_band(path, options, &layout, &alpha)?;
    let (place, own_unit) = location(path, &directory, options, said)?;
    let metadata = Metadata::parse(path, &directory, band, options, said)?;
    let beside = sidecars.band(band);

    let unit = sidecars.metres_per_height(path, &beside, metadata.unit.or(own_unit), options, said)?;
    let rule = Rule::new(path, options, beside.nodata.or(metadata.nodata), unit)?
        .scaled(beside.scale.unwrap_or(metadata.scale), beside.offset.unwrap_or(metadata.offset))
        .single_precision(layout.numbers.name() == "f32");

    let shape = (layout.rows, layout.cols);
    let recorded =
        |transform: Option<[f64; 6]>| metadata.cell_size.zip(transform).and_then(|(r, t)| r.for_transform(t));
    let settled = place.settle(path, options, sidecars, shape, recorded, said)?;

    let mut samples = Samples::new(shape.0, shape.1, rule);
    each_number(path, bytes, &layout, band, |i, value| samples.set(i, value))?;
    if options.nodata != Nodata::None
        && let Some(known) = masks::internal(path, bytes, &directory, shape, band)?
    {
        hide(&mut samples, options, "mask in the file", |i| known[i], said);
    }
    if alpha.contains(&band) {
        said.warnings
            .push(format!("band {} is marked as transparency, and read as heights as --band says", band + 1));
    } else if let Some(&alpha) = alpha.first() {
        let mut known = vec![false; shape.0 * shape.1];
        each_number(path, bytes, &layout, alpha, |i, value| known[i] = value != 0.0)?;
        hide(&mut samples, options, &format!("band {} (transparency)", alpha + 1), |i| known[i], said);
    }
    FileMask { path, options, sidecars, shape, band }.apply(&mut samples, said)?;
    samples.flip(settled.flip_rows, settled.flip_cols);
    let dem = samples.into_dem(path, settled.cell_size, said)?.at(settled.georeference);
    Ok((dem, Description::new(Format::GeoTiff, layout.numbers.name(), &layout.packing_words(), &settled)))
}

/// The band to read, counted from 0; `alpha` are those that hold transparency.
fn choose_band(path: &Path, options: &ReadOptions, layout: &Layout, alpha: &[usize]) -> Result<usize> {
    let bands = layout.bands;
    let mut heights = (0..bands).filter(|band| !alpha.contains(band));
    match (options.band, heights.next(), heights.next()) {
        (None, Some(only), None) => Ok(only),
        (None, ..) => Err(Error::file(
            path,
            "number of bands",
            bands,
            format!("heights are one band: name the band to read, 1 to {bands}, with --band N"),
        )),
        (Some(band), ..) if (1..=bands).contains(&band) => Ok(band - 1),
        (Some(band), ..) => Err(Error::file(path, "band", band, format!("allowed: 1 to {bands}"))),
    }
}

/// Calls `place` with the position and the value of every number of a band; cells of absent strips and tiles are left out.
pub(super) fn each_number(
    path: &Path,
    bytes: &[u8],
    layout: &Layout,
    band: usize,
    mut place: impl FnMut(usize, f64),
) -> Result<()> {
    let offset = if layout.planar { 0 } else { band };
    each_chunk(path, bytes, layout, band, |chunk, raw| numbers(layout, chunk, offset, raw, &mut place))
}

/// Calls `take` with the number and the unpacked bytes of every strip or tile of a band.
pub(super) fn each_chunk(
    path: &Path,
    bytes: &[u8],
    layout: &Layout,
    band: usize,
    mut take: impl FnMut(usize, &[u8]),
) -> Result<()> {
    let packing = layout.packing;
    let first = if layout.planar { band * layout.chunks_per_band } else { 0 };
    for i in 0..layout.chunks_per_band {
        let Some(packed) = layout.chunk(first + i, bytes) else { continue };
        let raw = packing.unpack(packed, layout.unpacked_bytes(i)).map_err(|reason| {
            let field = format!("{} {}", layout.chunk_noun(), first + i);
            Error::file(path, field, format!("damaged ({reason})"), "the data must unpack whole")
        })?;
        take(i, &raw);
    }
    Ok(())
}

/// One band of a chunk, without what overhangs the raster.
fn numbers(layout: &Layout, chunk: usize, offset: usize, raw: &[u8], place: &mut impl FnMut(usize, f64)) {
    let (row, col) = layout.chunk_origin(chunk);
    let (rows, cols) = layout.chunk_shape(chunk);
    let interleaved = layout.packing.samples;
    let cell_bytes = interleaved * layout.numbers.size();
    for (i, line) in raw.chunks_exact(layout.packing.cols * cell_bytes).take(rows).enumerate() {
        let start = (row + i) * layout.cols + col;
        let line = &line[..cols * cell_bytes];
        if interleaved == 1 {
            layout.numbers.each(line, false, |j, value| place(start + j, value));
        } else {
            layout.numbers.each(line, false, |j, value| {
                if j % interleaved == offset {
                    place(start + j / interleaved, value);
                }
            });
        }
    }
}
