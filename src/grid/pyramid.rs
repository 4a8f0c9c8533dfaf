//! Rasters at half the size and back: the steps of an image pyramid.
//!
//! Down: means of 2x2 cells, so that a coarse cell is the ground that it covers. Up: bicubic. Frames coincide when the sides
//! are even; an odd last row or column is left out on the way down. Linear.

use super::resample::resample;
use super::{Cell, Grid, Mask};
use rayon::prelude::*;

/// Means of 2x2 cells.
///
/// # Panics
/// When a side is less than 2.
#[must_use]
pub(crate) fn halved(raster: &Grid<f32>) -> Grid<f32> {
    let (rows, cols, wide) = (raster.rows() / 2, raster.cols() / 2, raster.cols());
    assert!(rows > 0 && cols > 0, "a raster of at least 2x2 cells");
    let mut out = Grid::filled(rows, cols, 0.0);
    let pairs = raster.as_slice().par_chunks(2 * wide);
    out.as_mut_slice().par_chunks_mut(cols).zip(pairs).for_each(|(out, pair)| {
        let (upper, lower) = pair.split_at(wide);
        for (out, (a, b)) in out.iter_mut().zip(upper.chunks_exact(2).zip(lower.chunks_exact(2))) {
            *out = 0.25 * ((a[0] + a[1]) + (b[0] + b[1]));
        }
    });
    out
}

/// Means of `factor` x `factor` cells; rows and columns that fill no cell are left out.
///
/// # Panics
/// When a side is less than `factor`, or that is 0.
#[must_use]
pub(crate) fn shrunk(raster: &Grid<f32>, factor: usize) -> Grid<f32> {
    let (rows, cols, wide) = (raster.rows() / factor, raster.cols() / factor, raster.cols());
    assert!(rows > 0 && cols > 0, "a raster of at least {factor}x{factor} cells");
    let share = 1.0 / (factor * factor) as f32;
    let mut out = Grid::filled(rows, cols, 0.0);
    let bands = raster.as_slice().par_chunks_exact(factor * wide);
    out.as_mut_slice().par_chunks_mut(cols).zip(bands).for_each(|(out, band)| {
        for row in band.chunks_exact(wide) {
            for (out, cells) in out.iter_mut().zip(row.chunks_exact(factor)) {
                *out += cells.iter().sum::<f32>();
            }
        }
        out.iter_mut().for_each(|z| *z *= share);
    });
    out
}

/// True where all of 2x2 cells are.
///
/// # Panics
/// When a side is less than 2.
#[must_use]
pub(crate) fn halved_mask(mask: &Mask) -> Mask {
    Grid::from_fn(mask.rows() / 2, mask.cols() / 2, |c| {
        let at = |down: usize, right: usize| mask[Cell::new(2 * c.row + down, 2 * c.col + right)];
        at(0, 0) && at(0, 1) && at(1, 0) && at(1, 1)
    })
}

/// The raster at twice the size.
#[must_use]
pub(crate) fn doubled(raster: &Grid<f32>) -> Grid<f32> {
    resample(raster, 2 * raster.rows(), 2 * raster.cols())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_means_and_planes_come_back() {
        let plane = Grid::from_fn(17, 22, |c| 3.0 * c.row as f32 - 0.5 * c.col as f32);
        let half = halved(&plane);
        assert_eq!(half.shape(), (8, 11));
        // The middle of cells (2 r, 2 c) to (2 r + 1, 2 c + 1).
        assert_eq!(half[Cell::new(3, 4)], 3.0 * 6.5 - 0.5 * 8.5);
        let back = doubled(&half);
        for (row, col) in [(4, 4), (7, 9), (10, 15)] {
            let cell = Cell::new(row, col);
            assert!((back[cell] - plane[cell]).abs() < 1e-4, "{cell:?}");
        }
    }

    #[test]
    fn shrinking_by_two_is_halving() {
        let map = Grid::from_fn(17, 22, |c| ((c.row * 37 + c.col * 61) % 23) as f32);
        for (a, b) in shrunk(&map, 2).as_slice().iter().zip(halved(&map).as_slice()) {
            assert!((a - b).abs() < 1e-5);
        }
        let third = shrunk(&map, 3);
        assert_eq!(third.shape(), (5, 7));
        let cells = (0..9).map(|i| map[Cell::new(9 + i / 3, 6 + i % 3)]);
        assert!((third[Cell::new(3, 2)] - cells.sum::<f32>() / 9.0).abs() < 1e-5);
    }

    #[test]
    fn one_void_makes_a_void() {
        let mask = Grid::from_fn(4, 6, |c| c != Cell::new(1, 2));
        let half = halved_mask(&mask);
        assert_eq!(half.shape(), (2, 3));
        assert_eq!(half.as_slice().iter().filter(|on| !**on).count(), 1);
        assert!(!half[Cell::new(0, 1)]);
    }
}
