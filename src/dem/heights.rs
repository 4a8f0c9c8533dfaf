//! The digital elevation model.

use super::{CellSize, Georeference};
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask, Window};

/// A digital elevation model: heights in metres on a raster, with voids.
///
/// Heights are finite wherever the mask says valid; void cells hold 0 and are never to be read as heights. At least
/// one cell is valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Dem {
    heights: Grid<f32>,
    valid: Mask,
    cell_size: CellSize,
    georeference: Option<Georeference>,
}

impl Dem {
    /// A DEM whose heights are all valid.
    ///
    /// # Errors
    /// When a height is not finite.
    pub fn new(heights: Grid<f32>, cell_size: CellSize) -> Result<Self> {
        let valid = heights.map(|_| true);
        Self::with_voids(heights, valid, cell_size)
    }

    /// A DEM whose heights count only where `valid` is true; the other cells are set to 0.
    ///
    /// # Errors
    /// When the shapes differ, a valid height is not finite, or no cell is valid.
    pub fn with_voids(mut heights: Grid<f32>, valid: Mask, cell_size: CellSize) -> Result<Self> {
        if heights.shape() != valid.shape() {
            return Err(Error::value(
                "void mask",
                format!("{:?}", valid.shape()),
                format!("the heights are {:?}", heights.shape()),
            ));
        }
        let mut any = false;
        let cols = heights.cols();
        for (i, (z, &ok)) in heights.as_mut_slice().iter_mut().zip(valid.as_slice()).enumerate() {
            if ok && !z.is_finite() {
                return Err(Error::value(
                    format!("height at row {}, column {}", i / cols, i % cols),
                    *z,
                    "allowed: finite, or marked as void",
                ));
            }
            any |= ok;
            if !ok {
                *z = 0.0;
            }
        }
        if !any {
            return Err(Error::value("number of valid heights", 0, "at least one cell must not be void"));
        }
        Ok(Self { heights, valid, cell_size, georeference: None })
    }

    /// The same DEM at a place on the Earth.
    #[must_use]
    pub fn at(mut self, georeference: Option<Georeference>) -> Self {
        self.georeference = georeference;
        self
    }

    /// Heights in metres; 0 at voids.
    #[must_use]
    pub fn heights(&self) -> &Grid<f32> {
        &self.heights
    }

    /// True where a height is known.
    #[must_use]
    pub fn valid(&self) -> &Mask {
        &self.valid
    }

    /// Number of void cells.
    #[must_use]
    pub fn void_count(&self) -> usize {
        self.valid.as_slice().iter().filter(|&&ok| !ok).count()
    }

    /// Cell size on the ground.
    #[must_use]
    pub fn cell_size(&self) -> CellSize {
        self.cell_size
    }

    /// Place on the Earth, when known.
    #[must_use]
    pub fn georeference(&self) -> Option<&Georeference> {
        self.georeference.as_ref()
    }

    /// (rows, columns).
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        self.heights.shape()
    }

    /// Lowest and highest valid height, metres.
    #[must_use]
    pub fn range(&self) -> (f32, f32) {
        let known = self.heights.as_slice().iter().zip(self.valid.as_slice()).filter(|(_, ok)| **ok);
        known.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), (&z, _)| (lo.min(z), hi.max(z)))
    }

    /// What a window shows.
    ///
    /// # Errors
    /// When the window reaches past the frame or holds voids only.
    pub fn crop(&self, window: Window) -> Result<Self> {
        let heights = self.heights.crop(window)?;
        let valid = self.valid.crop(window)?;
        let georeference = self.georeference.map(|g| g.shifted(window.origin.row, window.origin.col));
        Ok(Self::with_voids(heights, valid, self.cell_size)?.at(georeference))
    }

    /// Means of `factor` x `factor` cells, without a place; void where one of them is. What is left at the south and east is cut off.
    ///
    /// # Errors
    /// When less than one such cell is left, or only voids.
    pub fn coarsened(&self, factor: usize) -> Result<Self> {
        let (rows, cols) = (self.shape().0 / factor.max(1), self.shape().1 / factor.max(1));
        if rows == 0 || cols == 0 || factor == 0 {
            return Err(Error::value("coarser", factor, format!("the terrain has {:?} cells", self.shape())));
        }
        let inside = move |cell: Cell| {
            let (row, col) = (cell.row * factor, cell.col * factor);
            (0..factor * factor).map(move |i| Cell::new(row + i / factor, col + i % factor))
        };
        let valid = Grid::from_fn(rows, cols, |cell| inside(cell).all(|c| self.valid[c]));
        let heights = Grid::from_fn(rows, cols, |cell| {
            let sum: f64 = inside(cell).map(|c| f64::from(self.heights[c])).sum();
            (sum / (factor * factor) as f64) as f32
        });
        let (x, y) = (self.cell_size.x() * factor as f64, self.cell_size.y() * factor as f64);
        Self::with_voids(heights, valid, CellSize::new(x, y)?)
    }
}
