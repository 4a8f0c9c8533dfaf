//! What water runs over: finite heights on valid cells.
//!
//! Heights and mask -> [`Surface`]. Wide flats get the order that heights alone cannot give: cells far from the rim of a
//! flat count as lower, by an infinitesimal amount, so that water gathers along the middle of a lake instead of crossing
//! it in parallel lines (the "away from higher ground" gradient of Garbrecht and Martz 1997, with exact distances; the
//! second gradient, towards the outlet, is not needed because routing finds the way out of any hollow by itself).
//! Linear in the cells.

use crate::error::{Error, Result};
use crate::grid::{Grid, Mask, d8, distance};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Heights that water can run over. At least one cell is valid, and valid cells are finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    heights: Grid<f32>,
    valid: Mask,
    flat_depth: Option<Grid<u32>>,
}

impl Surface {
    /// A surface of `heights` (any unit) where `valid` is true.
    ///
    /// # Errors
    /// When the shapes differ, a valid height is not finite, or no cell is valid.
    pub fn new(heights: Grid<f32>, valid: Mask) -> Result<Self> {
        Self::check(&heights, &valid)?;
        let flat_depth = flat_depth(&heights, &valid);
        Ok(Self { heights, valid, flat_depth })
    }

    /// Whether [`new`](Self::new) would accept these heights.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn check(heights: &Grid<f32>, valid: &Mask) -> Result<()> {
        if heights.shape() != valid.shape() {
            return Err(Error::value(
                "void mask",
                format!("{:?}", valid.shape()),
                format!("the heights are {:?}", heights.shape()),
            ));
        }
        if heights.len() >= u32::MAX as usize {
            return Err(Error::value("number of cells", heights.len(), "allowed: below 2^32 - 1"));
        }
        if !valid.as_slice().contains(&true) {
            return Err(Error::value("number of valid heights", 0, "at least one cell must not be void"));
        }
        let wrong = |(z, ok): (&f32, &bool)| *ok && !z.is_finite();
        if let Some(i) = heights.as_slice().iter().zip(valid.as_slice()).position(wrong) {
            let cell = heights.cell_at(i);
            let name = format!("height at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, heights[cell], "allowed: finite, or marked as void"));
        }
        Ok(())
    }

    /// The same surface upside down: its valleys are the ridges of this one.
    #[must_use]
    pub(crate) fn inverted(&self) -> Self {
        Self {
            heights: self.heights.map(|z| -z),
            valid: self.valid.clone(),
            flat_depth: self.flat_depth.clone(),
        }
    }

    /// Heights; meaningless at voids.
    #[must_use]
    pub(crate) fn heights(&self) -> &Grid<f32> {
        &self.heights
    }

    /// True where a height is known.
    #[must_use]
    pub(crate) fn valid(&self) -> &Mask {
        &self.valid
    }

    /// (rows, columns).
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        self.heights.shape()
    }

    /// The cells whose eight neighbours all have exactly their height; `None` when there are none.
    #[must_use]
    pub(crate) fn flats(&self) -> Option<Mask> {
        self.flat_depth.as_ref().map(|depth| depth.map(|&d| d > 0))
    }

    /// Squared distance of every flat cell to the nearest cell that is not flat, 0 at all other cells; `None` when no
    /// cell is flat.
    pub(super) fn flat_depth(&self) -> Option<&Grid<u32>> {
        self.flat_depth.as_ref()
    }
}

fn flat_depth(heights: &Grid<f32>, valid: &Mask) -> Option<Grid<u32>> {
    let (rows, cols) = heights.shape();
    let (z, ok) = (heights.as_slice(), valid.as_slice());
    let around = d8::OFFSETS.map(|(dr, dc)| dr * cols as isize + dc);
    let mut sloping = Grid::filled(rows, cols, true);
    let found = AtomicBool::new(false);
    sloping.as_mut_slice().par_chunks_mut(cols).enumerate().for_each(|(row, line)| {
        if row == 0 || row + 1 == rows {
            return;
        }
        for (col, slopes) in line.iter_mut().enumerate().take(cols.saturating_sub(1)).skip(1) {
            let i = row * cols + col;
            let same = |o: &isize| {
                let j = i.wrapping_add_signed(*o);
                ok[j] && z[j] == z[i]
            };
            if ok[i] && around.iter().all(same) {
                *slopes = false;
                found.store(true, Ordering::Relaxed);
            }
        }
    });
    found.into_inner().then(|| distance::squared(&sloping))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    #[test]
    fn bad_surfaces_cannot_be_built() {
        let z = Grid::filled(3, 4, 1.0f32);
        assert!(Surface::new(z.clone(), Grid::filled(4, 3, true)).is_err());
        assert!(Surface::new(z.clone(), Grid::filled(3, 4, false)).is_err());
        let mut bad = z.clone();
        bad[Cell::new(2, 1)] = f32::NAN;
        let message = Surface::new(bad.clone(), z.map(|_| true)).unwrap_err().to_string();
        assert!(message.contains("row 2, column 1"), "{message}");
        let around_it = Grid::from_fn(3, 4, |c| c != Cell::new(2, 1));
        assert!(Surface::new(bad, around_it).is_ok());
    }

    #[test]
    fn flats_are_deepest_in_the_middle() {
        let bowl =
            Grid::from_fn(
                9,
                9,
                |c| if c.row.min(c.col).min(8 - c.row).min(8 - c.col) < 2 { 5.0 } else { 1.0 },
            );
        let surface = Surface::new(bowl.clone(), bowl.map(|_| true)).unwrap();
        let depth = surface.flat_depth().unwrap();
        // The bottom is 5x5 from (2, 2); its inner 3x3 is flat.
        assert_eq!([2, 3, 4].map(|i| depth[Cell::new(4, i)]), [0, 1, 4]);
        let flats = surface.flats().unwrap();
        assert!(flats[Cell::new(3, 3)] && !flats[Cell::new(2, 4)]);
    }

    #[test]
    fn a_void_is_no_part_of_a_flat() {
        // As in a DEM at sea level, whose voids hold 0 too.
        let z = Grid::filled(7, 7, 0.0f32);
        let valid = Grid::from_fn(7, 7, |c| c != Cell::new(3, 3));
        let flats = Surface::new(z, valid).unwrap().flats().unwrap();
        assert!(flats[Cell::new(1, 1)]);
        assert!(!flats[Cell::new(2, 2)] && !flats[Cell::new(3, 3)] && !flats[Cell::new(3, 4)]);
    }
}
