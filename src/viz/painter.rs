//! Terrain in unit heights as pictures for one sheet, all in the colours of one reference.

use super::{ColorBar, Palette, Picture, Relief, Sheet};
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::Result;
use crate::grid::{Grid, Mask};

/// Unit heights as pictures in colours that are the same for all of a sheet.
pub(crate) struct Painter {
    relief: Relief,
    range: Normalization,
    cell_size: CellSize,
}

impl Painter {
    /// Pixels per cell.
    pub(crate) const SCALE: usize = 2;

    /// In the colours of `reference`, for heights in its range.
    pub(crate) fn of(reference: &Dem) -> Self {
        let relief = Relief::with_palette(Palette::Alpine).scaled(Self::SCALE).fixed_for(reference);
        Self { relief, range: Normalization::of(reference), cell_size: reference.cell_size() }
    }

    pub(crate) fn draw(&self, unit: &Grid<f32>, valid: &Mask) -> Result<Picture> {
        let heights = self.range.denormalize(unit);
        self.relief.draw(&Dem::with_voids(heights, valid.clone(), self.cell_size)?)
    }

    pub(crate) fn draw_whole(&self, unit: &Grid<f32>) -> Result<Picture> {
        self.draw(unit, &unit.map(|_| true))
    }

    /// The sheet with the scales of colours and lengths.
    pub(crate) fn finish(&self, sheet: Sheet) -> Result<Picture> {
        let bar = ColorBar::new(self.relief.palette, self.range.low(), self.range.high(), "Height, m")?;
        sheet.color_bar(bar).scale_bar(self.cell_size.x() / Self::SCALE as f64).draw()
    }
}
