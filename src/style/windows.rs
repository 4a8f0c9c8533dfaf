//! Which pieces of a DEM are learned from and which are tested on.

use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::{Cell, Window};

/// Side of a patch in cells (Liu & Benes 2025, 4).
pub const PATCH: usize = 128;

/// North-west cells of all whole patches, row by row from the north-west corner.
#[must_use]
pub fn patch_cells(dem: &Dem) -> Vec<Cell> {
    let (rows, cols) = dem.shape();
    let starts = |side: usize| (0..side / PATCH).map(|i| i * PATCH);
    starts(rows).flat_map(|row| starts(cols).map(move |col| Cell::new(row, col))).collect()
}

/// The patch that represents a DEM: of those within a quarter of the sides from the middle the one whose heights vary most,
/// void-free ones first (the rule of the study behind `docs/papers/region_gnn.md`).
///
/// # Errors
/// When the DEM holds no whole patch.
pub fn choose_exemplar(dem: &Dem) -> Result<Cell> {
    let (rows, cols) = dem.shape();
    let (down, across) = (rows / PATCH, cols / PATCH);
    let near = |start: usize, count: usize| {
        let middle = (count as f64 - 1.0) / 2.0;
        ((start / PATCH) as f64 - middle).abs() <= (count as f64 / 4.0).max(0.5)
    };
    let mut best: Option<((bool, f64), Cell)> = None;
    for cell in patch_cells(dem).into_iter().filter(|c| near(c.row, down) && near(c.col, across)) {
        // A patch of voids only has nothing to teach.
        let Ok(patch) = dem.crop(Window::square(cell, PATCH)) else { continue };
        let key = (patch.void_count() == 0, variance(&patch));
        if best.is_none_or(|(b, _)| key.0 && !b.0 || key.0 == b.0 && key.1 > b.1) {
            best = Some((key, cell));
        }
    }
    best.map(|(_, cell)| cell).ok_or_else(|| {
        let allowed = format!("a patch needs {PATCH}x{PATCH} cells, not all void; name a smaller window");
        Error::value("size of the DEM", format!("{rows}x{cols}"), allowed)
    })
}

fn variance(dem: &Dem) -> f64 {
    let known = || {
        let pairs = dem.heights().as_slice().iter().zip(dem.valid().as_slice());
        pairs.filter(|(_, ok)| **ok).map(|(z, _)| f64::from(*z))
    };
    let n = known().count() as f64;
    let mean = known().sum::<f64>() / n;
    known().map(|z| (z - mean).powi(2)).sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::CellSize;
    use crate::grid::Grid;

    #[test]
    fn the_most_varied_central_patch_is_chosen() {
        let bumpy = Cell::new(256, 128);
        let heights = Grid::from_fn(640, 640, |c| {
            let scale = if c.row / PATCH == 2 && c.col / PATCH == 1 { 5.0 } else { 1.0 };
            // The corner is wilder still, but not central.
            let scale = if c.row < PATCH && c.col < PATCH { 50.0 } else { scale };
            scale * ((c.row * 7 + c.col * 3) % 11) as f32
        });
        let dem = Dem::new(heights, CellSize::square(30.0).unwrap()).unwrap();
        assert_eq!(choose_exemplar(&dem).unwrap(), bumpy);
        assert_eq!(patch_cells(&dem).len(), 25);
        let small = dem.crop(Window::new(Cell::new(0, 0), 100, 300)).unwrap();
        assert!(choose_exemplar(&small).unwrap_err().to_string().contains("100x300"));
    }
}
