//! The short pieces into which lines are cut (Liu & Benes 2025, 4.1).

use super::StrokeKind;
use crate::error::{Error, Result};
use crate::grid::{Cell, d8};

/// Index of a part in its list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub(crate) struct PartId(pub(crate) u32);

/// A run of consecutive 8-adjacent line cells of one kind, with a height each; 5 to 10 cells in the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct SketchPart {
    /// Ridge or valley.
    pub(crate) kind: StrokeKind,
    /// The cells in order.
    pub(crate) cells: Vec<Cell>,
    /// Height at each cell, in the unit of the map that was cut.
    pub(crate) heights: Vec<f32>,
}

impl SketchPart {
    /// Checks what [`split_parts`](super::split_parts) guarantees, for parts that come from elsewhere (a style file).
    ///
    /// # Errors
    /// When there is no cell, the heights do not match the cells or are not finite, or two consecutive cells are not
    /// neighbours.
    pub(crate) fn validate(&self) -> Result<()> {
        let (cells, heights) = (self.cells.len(), self.heights.len());
        if cells == 0 || cells != heights {
            return Err(Error::value(
                "part",
                format!("{cells} cells with {heights} heights"),
                "allowed: at least one cell, and a height for each",
            ));
        }
        if let Some(z) = self.heights.iter().find(|z| !z.is_finite()) {
            return Err(Error::value("height of a part", z, "allowed: finite"));
        }
        if let Some(w) = self.cells.windows(2).find(|w| d8::code_between(w[0], w[1]).is_none()) {
            return Err(Error::value(
                "cells of a part",
                format!("({}, {}) then ({}, {})", w[0].row, w[0].col, w[1].row, w[1].col),
                "allowed: each cell a neighbour of the one before",
            ));
        }
        Ok(())
    }

    /// The same part walked from its lower end to its higher end (Algorithm A1, lines 2 to 7); as it is when both ends
    /// are equally high.
    #[must_use]
    pub(crate) fn rising(&self) -> Self {
        let mut part = self.clone();
        if part.heights.first() > part.heights.last() {
            part.cells.reverse();
            part.heights.reverse();
        }
        part
    }

    /// The chain code: the direction of each step in [`d8`] codes, one fewer than cells.
    ///
    /// # Panics
    /// When the part is not [valid](Self::validate).
    #[must_use]
    pub(crate) fn codes(&self) -> Vec<u8> {
        let step = |w: &[Cell]| d8::code_between(w[0], w[1]).expect("consecutive cells are neighbours");
        self.cells.windows(2).map(step).collect()
    }
}
