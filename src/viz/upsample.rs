//! A raster drawn at several pixels per cell, smoothly.
//!
//! Grid -> `factor` x larger grid through every cell's value, by the cubic of Catmull and Rom along rows, then columns.
//! Bilinear interpolation would show each cell as a facet once the surface is shaded, because its slope jumps at cell
//! borders; this one has a continuous slope. Cost: O(pixels).

use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};
use rayon::prelude::*;

/// Largest number of pixels that enlarging may make: 2^27, a square of 11,585.
const MOST_PIXELS: usize = 1 << 27;

/// Refuses a number of pixels per cell that no picture of `rows` x `cols` cells should have. At one pixel per cell the
/// picture is as large as the raster, which fits into memory already.
pub(super) fn check_scale(rows: usize, cols: usize, scale: usize) -> Result<()> {
    let pixels = (rows * scale).checked_mul(cols * scale);
    if scale == 0 || scale > 64 || (scale > 1 && pixels.is_none_or(|n| n > MOST_PIXELS)) {
        let allowed = format!("allowed: 1 to 64, and {MOST_PIXELS} pixels in all for {rows}x{cols} cells");
        return Err(Error::value("pixels per cell", scale, allowed));
    }
    Ok(())
}

/// The values at `factor` pixels per cell. Pixel i lies at (i + 0.5) / factor - 0.5 cells; past the outermost cell
/// centres the border value goes on. Void cells first take the mean of their valid neighbours (two rings deep, 0
/// beyond), so that they do not bleed into the ground beside them.
///
/// # Panics
/// When `factor` is 0 or the shapes differ.
pub(super) fn upsample(grid: &Grid<f32>, valid: &Mask, factor: usize) -> Grid<f32> {
    assert!(factor > 0, "at least one pixel per cell");
    assert_eq!(grid.shape(), valid.shape(), "values and mask have one shape");
    if factor == 1 {
        return grid.clone();
    }
    let filled = bridge_voids(grid, valid);
    let (rows, cols) = grid.shape();
    let (wide, tall) = (cols * factor, rows * factor);
    let across = taps(cols, factor);
    let mut stretched = vec![0.0f32; rows * wide];
    stretched.par_chunks_mut(wide).enumerate().for_each(|(row, line)| {
        let source = &filled.as_slice()[row * cols..(row + 1) * cols];
        for (value, tap) in line.iter_mut().zip(&across) {
            *value = (0..4).map(|i| tap.weights[i] * source[tap.cells[i]]).sum();
        }
    });
    let down = taps(rows, factor);
    let mut pixels = Grid::filled(tall, wide, 0.0f32);
    pixels.as_mut_slice().par_chunks_mut(wide).zip(&down).for_each(|(line, tap)| {
        for (col, value) in line.iter_mut().enumerate() {
            *value = (0..4).map(|i| tap.weights[i] * stretched[tap.cells[i] * wide + col]).sum();
        }
    });
    pixels
}

/// Four cells and their weights.
struct Tap {
    cells: [usize; 4],
    weights: [f32; 4],
}

fn taps(cells: usize, factor: usize) -> Vec<Tap> {
    let tap = |pixel: usize| {
        let x = ((pixel as f64 + 0.5) / factor as f64 - 0.5).clamp(0.0, (cells - 1) as f64);
        let (base, t) = (x.floor() as isize, (x - x.floor()) as f32);
        let inside = |i: isize| (base + i).clamp(0, cells as isize - 1) as usize;
        let (t2, t3) = (t * t, t * t * t);
        Tap {
            cells: [inside(-1), inside(0), inside(1), inside(2)],
            weights: [
                0.5 * (-t3 + 2.0 * t2 - t),
                0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
                0.5 * (-3.0 * t3 + 4.0 * t2 + t),
                0.5 * (t3 - t2),
            ],
        }
    };
    (0..cells * factor).map(tap).collect()
}

fn bridge_voids(grid: &Grid<f32>, valid: &Mask) -> Grid<f32> {
    let (mut values, mut known) = (grid.clone(), valid.clone());
    for _ in 0..2 {
        let (old, before) = (values.clone(), known.clone());
        for (cell, &ok) in before.cells() {
            if ok {
                continue;
            }
            let (mut sum, mut count) = (0.0, 0.0);
            for row in cell.row.saturating_sub(1)..(cell.row + 2).min(grid.rows()) {
                for col in cell.col.saturating_sub(1)..(cell.col + 2).min(grid.cols()) {
                    let there = Cell::new(row, col);
                    if before[there] {
                        sum += old[there];
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 {
                values[cell] = sum / count;
                known[cell] = true;
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn planes_stay_planes_and_odd_factors_keep_cells() {
        let grid = Grid::from_fn(6, 8, |c| 2.0 * c.row as f32 - 3.0 * c.col as f32);
        let valid = grid.map(|_| true);
        let large = upsample(&grid, &valid, 3);
        assert_eq!(large.shape(), (18, 24));
        for (cell, &z) in grid.cells() {
            assert_abs_diff_eq!(large[Cell::new(3 * cell.row + 1, 3 * cell.col + 1)], z, epsilon = 1e-4);
        }
        for row in 4..14 {
            for col in 4..20 {
                let (y, x) = ((row as f32 + 0.5) / 3.0 - 0.5, (col as f32 + 0.5) / 3.0 - 0.5);
                assert_abs_diff_eq!(large[Cell::new(row, col)], 2.0 * y - 3.0 * x, epsilon = 1e-4);
            }
        }
    }

    #[test]
    fn a_picture_too_large_is_refused_before_it_is_made() {
        assert!(check_scale(3601, 3601, 3).is_ok() && check_scale(100_000, 100_000, 1).is_ok());
        for (side, scale) in [(3601, 4), (128, 65), (128, 0), (1 << 40, 2)] {
            assert!(check_scale(side, side, scale).unwrap_err().to_string().contains("pixels per cell"));
        }
    }

    #[test]
    fn a_void_does_not_bleed() {
        let mut grid = Grid::filled(7, 7, 500.0f32);
        let mut valid = grid.map(|_| true);
        for cell in [Cell::new(3, 3), Cell::new(3, 4), Cell::new(0, 0)] {
            grid[cell] = 0.0;
            valid[cell] = false;
        }
        for &z in upsample(&grid, &valid, 4).as_slice() {
            assert_abs_diff_eq!(z, 500.0, epsilon = 1e-3);
        }
    }
}
