//! Detail on terrain in metres, and terrain made finer with it.

use crate::control::Stop;
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Mask};
use crate::interpolation::harmonic_until;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::systems::task::{DetailModel, DetailUse};

/// Most cells that [`amplify`] makes: 32,768 by 32,768.
const MOST_CELLS: usize = 1 << 30;
/// Largest factor for detail that is added to an enlarged map at once.
const LARGEST_FACTOR: usize = 16;

/// Adds detail to terrain in metres; with `lines` in metres, their heights are kept. Where `mask` is false nothing changes.
///
/// # Errors
/// When a setting is out of range, shapes differ, or the work is stopped.
#[allow(clippy::too_many_arguments, reason = "what is asked of detail, and how the work is done")]
pub fn add_detail(
    terrain: &Grid<f32>,
    detail: &dyn DetailModel,
    range: Normalization,
    lines: Option<&LineMap>,
    mask: Option<&Mask>,
    how: &DetailUse,
    seed: Seed,
    stop: &Stop,
) -> Result<Grid<f32>> {
    let unit = terrain.map(|&z| range.to_unit(f64::from(z)) as f32);
    let unit_lines = lines.map(|lines| lines.to_unit(range));
    let detailed = detail.add(&unit, unit_lines.as_ref(), mask, how, seed.derive("detail"), stop)?;
    let mut metres = range.denormalize(&detailed);
    // What stays, stays to the bit: there and back again rounds.
    for (i, z) in metres.as_mut_slice().iter_mut().enumerate() {
        if mask.is_some_and(|mask| !mask.as_slice()[i]) {
            *z = terrain.as_slice()[i];
        }
    }
    if let Some(lines) = lines {
        for (cell, height) in lines.heights().cells() {
            if lines.kinds()[cell].is_some() && mask.is_none_or(|mask| mask[cell]) {
                metres[cell] = *height;
            }
        }
    }
    Ok(metres)
}

/// Terrain `factor` times as fine in each direction, with the style's detail below its own cells. Where it has voids, so has
/// the answer; they are bridged harmonically meanwhile.
///
/// # Errors
/// When a setting is out of range, there are more than 2^30 cells to make, more than the detail model can, or the work is
/// stopped.
pub(super) fn amplify(
    dem: &Dem,
    detail: &dyn DetailModel,
    range: Normalization,
    factor: usize,
    how: &DetailUse,
    seed: Seed,
    stop: &Stop,
) -> Result<Dem> {
    let (rows, cols) = dem.shape();
    let cells = (rows * cols).saturating_mul(factor * factor);
    if factor < 2 || cells > MOST_CELLS {
        let found = format!("{factor} for {rows}x{cols} cells");
        let allowed = format!("allowed: at least 2, and at most {MOST_CELLS} cells in the end");
        return Err(Error::value("factor", found, allowed));
    }
    let valid = dem.valid();
    let known = if dem.void_count() > 0 {
        harmonic_until(valid, &dem.heights().map(|z| f64::from(*z)), stop)?.map(|z| *z as f32)
    } else {
        dem.heights().clone()
    };
    let heights = match detail.amplified(&known, factor, how, stop)? {
        Some(heights) => heights,
        None if factor > LARGEST_FACTOR => {
            return Err(Error::value("factor", factor, format!("allowed: 2 to {LARGEST_FACTOR}")));
        }
        None => {
            let large = resample(&known, rows * factor, cols * factor);
            let how = DetailUse { size: Some(factor as f64), keep: 0.0, ..how.clone() };
            add_detail(&large, detail, range, None, None, &how, seed, stop)?
        }
    };
    let valid =
        Mask::from_fn(rows * factor, cols * factor, |c| valid[Cell::new(c.row / factor, c.col / factor)]);
    let cell = dem.cell_size();
    let cell = CellSize::new(cell.x() / factor as f64, cell.y() / factor as f64)?;
    let georeference = dem.georeference().map(|g| g.on_raster((rows, cols), (rows * factor, cols * factor)));
    Ok(Dem::with_voids(heights, valid, cell)?.at(georeference))
}
