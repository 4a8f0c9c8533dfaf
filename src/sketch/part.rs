//! The short pieces into which lines are cut (Liu & Benes 2025, 4.1).

use super::StrokeKind;
use crate::grid::Cell;

/// Index of a part in its list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct PartId(pub u32);

/// A run of consecutive 8-adjacent line cells of one kind, with a height each; 5 to 10 cells in the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct SketchPart {
    /// Ridge or valley.
    pub kind: StrokeKind,
    /// The cells in order.
    pub cells: Vec<Cell>,
    /// Height at each cell, in the unit of the map that was cut.
    pub heights: Vec<f32>,
}
