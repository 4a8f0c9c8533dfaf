//! Terrain through its lines, to the bit, without walls beside them.

use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, distance};
use crate::interpolation::{Correction, CorrectionKind, harmonic};
use crate::sketch::LineMap;

/// Sides of the coarse cells on which misses are carried away from the lines first.
const COARSE: [usize; 2] = [8, 4];
/// Cells over which such a correction falls to 1/e.
const HOLD: f32 = 26.0;

/// `heights` moved so that every line cell has its height to the bit. What is missed on the lines goes into smooth corrections
/// first, so that no crest of beads or wall of one cell stands along a line; what is left into a harmonic surface.
///
/// Linear in the cells.
///
/// # Errors
/// When there is no line, the shapes differ or a height is not finite.
pub fn pin(heights: &Grid<f32>, lines: &LineMap) -> Result<Grid<f32>> {
    let (rows, cols) = heights.shape();
    if lines.shape() != (rows, cols) {
        let allowed = format!("the lines are {:?}", lines.shape());
        return Err(Error::value("terrain to pin", format!("{:?}", (rows, cols)), allowed));
    }
    let correction = Correction::new(CorrectionKind::Harmonic, lines)?;
    let hold = distance::squared(&lines.mask()).map(|&d| (-(d as f32).sqrt() / HOLD).exp());
    let mut pinned = heights.clone();
    for side in COARSE {
        let coarse = (rows.div_ceil(side), cols.div_ceil(side));
        let mut sums = Grid::filled(coarse.0, coarse.1, (0.0f64, 0u32));
        for (cell, _) in lines.kinds().cells().filter(|(_, kind)| kind.is_some()) {
            let (sum, count) = &mut sums[Cell::new(cell.row / side, cell.col / side)];
            *sum += f64::from(lines.heights()[cell]) - f64::from(pinned[cell]);
            *count += 1;
        }
        let known = sums.map(|(_, count)| *count > 0);
        let misses = harmonic(&known, &sums.map(|&(sum, count)| sum / f64::from(count.max(1))))?;
        let whole = resample(&misses.map(|&m| m as f32), coarse.0 * side, coarse.1 * side);
        for (i, z) in pinned.as_mut_slice().iter_mut().enumerate() {
            *z += hold.as_slice()[i] * whole[Cell::new(i / cols, i % cols)];
        }
    }
    correction.apply(&pinned)
}
