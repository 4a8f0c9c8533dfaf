//! What terrain from noise alone is asked for, the same for every model of detail.

use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};

/// Terrain to draw from noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleUse {
    /// Rows of the map: at least 16.
    pub rows: usize,
    /// Columns of the map: at least 16.
    pub cols: usize,
    /// How far the large forms are from the exemplar's: at 0 they are its own, in the middle of the map where that is larger,
    /// and only small forms are drawn; at 1 nothing of its layout is left.
    pub variety: f32,
}

impl SampleUse {
    /// Smallest side of a map, cells.
    pub const SMALLEST: usize = 16;

    /// A map of so many cells with a layout of its own.
    #[must_use]
    pub const fn new(rows: usize, cols: usize) -> Self {
        Self { rows, cols, variety: 1.0 }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// Names the field that is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.rows.min(self.cols) < Self::SMALLEST {
            let allowed = format!("allowed: at least {0}x{0}", Self::SMALLEST);
            return Err(Error::value("size to sample", format!("{}x{}", self.rows, self.cols), allowed));
        }
        if !(0.0..=1.0).contains(&self.variety) {
            return Err(Error::value("variety", self.variety, "allowed: 0 to 1"));
        }
        Ok(())
    }

    /// Mixes the exemplar's `layout` into the middle of `fresh`. For independent values of one variance the mixture has it too.
    pub(in crate::systems) fn mix(&self, fresh: &mut Grid<f32>, layout: &Grid<f32>) {
        if self.variety >= 1.0 {
            return;
        }
        let kept = (1.0 - self.variety * self.variety).sqrt();
        let (rows, cols) = fresh.shape();
        let inside =
            |i: usize, side: usize, own: usize| (i + own / 2).checked_sub(side / 2).filter(|i| *i < own);
        for row in 0..rows {
            for col in 0..cols {
                let own = (inside(row, rows, layout.rows()), inside(col, cols, layout.cols()));
                if let (Some(r), Some(c)) = own {
                    let z = &mut fresh[Cell::new(row, col)];
                    *z = self.variety * *z + kept * layout[Cell::new(r, c)];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_centred_and_keeps_the_variance() {
        let layout = Grid::from_fn(4, 6, |c| (10 * c.row + c.col) as f32);
        let mixed = |rows, cols, variety| {
            let mut map = Grid::filled(rows, cols, -1.0);
            SampleUse { rows, cols, variety }.mix(&mut map, &layout);
            map
        };
        assert_eq!(mixed(4, 6, 0.0), layout);
        assert_eq!(mixed(4, 6, 1.0), Grid::filled(4, 6, -1.0));
        let larger = mixed(8, 7, 0.0);
        assert_eq!((larger[Cell::new(2, 0)], larger[Cell::new(5, 5)]), (0.0, 35.0));
        assert_eq!((larger[Cell::new(1, 0)], larger[Cell::new(2, 6)]), (-1.0, -1.0));
        let smaller = mixed(2, 2, 0.0);
        assert_eq!((smaller[Cell::new(0, 0)], smaller[Cell::new(1, 1)]), (12.0, 23.0));
        assert!((mixed(4, 6, 0.6)[Cell::new(1, 1)] - (0.8 * 11.0 - 0.6)).abs() < 1e-6);
    }

    #[test]
    fn what_cannot_be_drawn_is_named() {
        let fails =
            |rows, cols, variety| SampleUse { rows, cols, variety }.validate().unwrap_err().to_string();
        assert!(fails(8, 80, 1.0).contains("8x80"));
        assert!(fails(80, 80, 1.5).contains("variety is 1.5"));
        assert!(fails(80, 80, f32::NAN).contains("variety"));
        SampleUse::new(16, 16).validate().unwrap();
    }
}
