//! A sketch on the raster.

use super::StrokeKind;
use crate::dem::Normalization;
use crate::grid::{Cell, Grid, Mask};

/// The cells that ridges and valleys pass, one cell wide, with their heights. A cell is ridge or valley, never both.
#[derive(Clone, Debug, PartialEq)]
pub struct LineMap {
    kinds: Grid<Option<StrokeKind>>,
    heights: Grid<f32>,
}

impl LineMap {
    /// A map without lines.
    ///
    /// # Panics
    /// When a side is 0.
    #[must_use]
    pub fn empty(rows: usize, cols: usize) -> Self {
        Self { kinds: Grid::filled(rows, cols, None), heights: Grid::filled(rows, cols, 0.0) }
    }

    /// Puts a line cell.
    ///
    /// # Panics
    /// When `height` is not finite or `cell` lies outside.
    pub fn set(&mut self, cell: Cell, kind: StrokeKind, height: f32) {
        assert!(height.is_finite(), "a line's height is finite");
        self.kinds[cell] = Some(kind);
        self.heights[cell] = height;
    }

    /// What passes each cell.
    #[must_use]
    pub fn kinds(&self) -> &Grid<Option<StrokeKind>> {
        &self.kinds
    }

    /// Heights at line cells; 0 elsewhere.
    #[must_use]
    pub fn heights(&self) -> &Grid<f32> {
        &self.heights
    }

    /// (rows, columns).
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        self.kinds.shape()
    }

    /// True at the cells of one kind.
    #[must_use]
    pub fn mask_of(&self, kind: StrokeKind) -> Mask {
        self.kinds.map(|&k| k == Some(kind))
    }

    /// True at every line cell.
    #[must_use]
    pub fn mask(&self) -> Mask {
        self.kinds.map(Option::is_some)
    }

    /// Number of line cells.
    #[must_use]
    pub fn line_count(&self) -> usize {
        self.kinds.as_slice().iter().flatten().count()
    }

    /// The same lines with `f` applied to every height (for example metres to unit).
    #[must_use]
    pub fn map_heights(&self, mut f: impl FnMut(f32) -> f32) -> Self {
        let mut mapped = self.clone();
        for (z, kind) in mapped.heights.as_mut_slice().iter_mut().zip(self.kinds.as_slice()) {
            if kind.is_some() {
                *z = f(*z);
            }
        }
        mapped
    }

    /// The same lines with unit heights in metres.
    #[must_use]
    pub fn to_metres(&self, range: Normalization) -> Self {
        self.map_heights(|z| range.to_metres(f64::from(z)) as f32)
    }

    /// The same lines with heights in metres brought to the unit interval.
    #[must_use]
    pub fn to_unit(&self, range: Normalization) -> Self {
        self.map_heights(|z| range.to_unit(f64::from(z)) as f32)
    }
}
