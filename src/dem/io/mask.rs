//! Validity that lies apart from the heights: mask images, alpha bands, transparent pixels.
//!
//! In: a raster being filled, and which of its cells are known. Out: the others are voids, and a note says how many. With
//! `--nodata none` every number is a height, and the mask is left aside with a note. Cost: one pass.

use super::geotiff;
use super::place::Said;
use super::samples::Samples;
use super::sidecars::Sidecars;
use super::{Nodata, ReadOptions};
use crate::error::Result;
use std::path::Path;

/// Makes the cells void that `known` denies, and says so.
pub(super) fn hide(
    samples: &mut Samples,
    options: &ReadOptions,
    what: &str,
    known: impl Fn(usize) -> bool,
    said: &mut Said,
) {
    if options.nodata == Nodata::None {
        said.notes.push(format!("{what} not used, as every number is to be a height"));
        return;
    }
    let masked = samples.mask(known);
    said.notes.push(format!("{what}: {masked} cells are void"));
}

/// The mask in a file beside the raster (`.msk`), for a band counted from 0.
pub(super) struct FileMask<'a> {
    pub(super) path: &'a Path,
    pub(super) options: &'a ReadOptions,
    pub(super) sidecars: &'a Sidecars,
    pub(super) shape: (usize, usize),
    pub(super) band: usize,
}

impl FileMask<'_> {
    /// Makes the cells void that the file denies.
    ///
    /// # Errors
    /// When there is a mask that cannot be read, or one of another size.
    pub(super) fn apply(&self, samples: &mut Samples, said: &mut Said) -> Result<()> {
        let Some(file) = &self.sidecars.mask else { return Ok(()) };
        if self.options.nodata == Nodata::None {
            hide(samples, self.options, &file.name, |_| true, said);
            return Ok(());
        }
        let known =
            geotiff::read_mask(&self.path.with_file_name(&file.name), &file.bytes, self.shape, self.band)?;
        hide(samples, self.options, &file.name, |i| known[i], said);
        Ok(())
    }
}
