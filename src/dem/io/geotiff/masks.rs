//! Which cells of a GeoTIFF are known, where it says so apart from the heights: mask images and alpha bands.
//!
//! In: the directories of a file, or a mask file (`.msk`). Out: for every cell whether it is known. A mask is an image of the
//! raster's size whose `NewSubfileType` has bit 4 (TIFF 6.0), of 1 or 8 bits; 0 is unknown. Alpha is an extra sample of kind 1
//! or 2; 0 is unknown. Cost: one pass.

use super::decode::each_number;
use super::directory::Directory;
use super::layout::Layout;
use super::tag;
use crate::error::{Error, Result};
use std::path::Path;

/// `NewSubfileType`: a mask, and a reduced image.
const MASK: u64 = 4;
const REDUCED: u64 = 1;

/// No more directories than that are looked at: they may form a ring.
const MOST_IMAGES: usize = 64;

/// The mask among the images of a file, for a band counted from 0.
pub(super) fn internal(
    path: &Path,
    bytes: &[u8],
    first: &Directory<'_>,
    shape: (usize, usize),
    band: usize,
) -> Result<Option<Vec<bool>>> {
    let mut next = first.following()?;
    for _ in 0..MOST_IMAGES {
        let Some(directory) = next else { return Ok(None) };
        let kind = directory.one(tag::NEW_SUBFILE_TYPE)?.unwrap_or(0);
        let size = (directory.one(tag::HEIGHT)?, directory.one(tag::WIDTH)?);
        let same = size == (Some(shape.0 as u64), Some(shape.1 as u64));
        if kind & MASK != 0 && kind & REDUCED == 0 && same {
            return values(path, bytes, &directory, shape, band).map(Some);
        }
        next = directory.following()?;
    }
    Ok(None)
}

/// The cells that are known by the mask file `bytes`, for a band counted from 0.
pub(in super::super) fn read_mask(
    path: &Path,
    bytes: &[u8],
    shape: (usize, usize),
    band: usize,
) -> Result<Vec<bool>> {
    values(path, bytes, &Directory::parse(path, bytes)?, shape, band)
}

fn values(
    path: &Path,
    bytes: &[u8],
    directory: &Directory<'_>,
    shape: (usize, usize),
    band: usize,
) -> Result<Vec<bool>> {
    let refuse = |field: &str, value: String| {
        let allowed = "allowed in a mask: whole numbers, as many rows and columns as the raster; --nodata none leaves it aside";
        Error::file(path, format!("mask: {field}"), value, allowed)
    };
    let layout = Layout::of_image(path, directory, bytes.len() as u64).map_err(|e| match e {
        Error::File { field, value, .. } => refuse(&field, value),
        other => other,
    })?;
    if (layout.rows, layout.cols) != shape {
        return Err(refuse("raster size", format!("{} rows x {} columns", layout.rows, layout.cols)));
    }
    let band = if band < layout.bands { band } else { 0 };
    let mut known = vec![false; shape.0 * shape.1];
    if layout.bits {
        let reversed = directory.one(tag::FILL_ORDER)?.unwrap_or(1) == 2;
        each_bit(path, bytes, &layout, band, |i, byte, bit| {
            let shift = if reversed { bit } else { 7 - bit };
            known[i] = byte >> shift & 1 == 1;
        })?;
    } else {
        each_number(path, bytes, &layout, band, |i, value| known[i] = value != 0.0)?;
    }
    Ok(known)
}

/// Calls `place` with the position of every cell, the byte that it is in, and its place in the byte.
fn each_bit(
    path: &Path,
    bytes: &[u8],
    layout: &Layout,
    band: usize,
    mut place: impl FnMut(usize, u8, usize),
) -> Result<()> {
    super::decode::each_chunk(path, bytes, layout, band, |chunk, raw| {
        let (row, col) = layout.chunk_origin(chunk);
        let (rows, cols) = layout.chunk_shape(chunk);
        for (i, line) in raw.chunks_exact(layout.packing.cols).take(rows).enumerate() {
            for j in 0..cols {
                place((row + i) * layout.cols + col + j, line[j / 8], j % 8);
            }
        }
    })
}

/// The bands that hold transparency, counted from 0.
pub(super) fn alpha_bands(directory: &Directory<'_>, bands: usize) -> Result<Vec<usize>> {
    let extra = directory.unsigned(tag::EXTRA_SAMPLES)?.unwrap_or_default();
    let first = bands.saturating_sub(extra.len());
    Ok(extra.iter().enumerate().filter(|(_, kind)| matches!(kind, 1 | 2)).map(|(i, _)| first + i).collect())
}
