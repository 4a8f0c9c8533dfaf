//! The hierarchy of a channel network.

use super::FlowDirections;
use crate::grid::{Grid, Mask};

/// Strahler order of each channel cell; 0 off the channels.
#[derive(Clone, Debug, PartialEq)]
pub struct StrahlerOrder(Grid<u8>);

impl StrahlerOrder {
    /// Orders.
    #[must_use]
    pub(crate) fn orders(&self) -> &Grid<u8> {
        &self.0
    }

    /// Cells of at least this order.
    #[must_use]
    pub(crate) fn at_least(&self, order: u8) -> Mask {
        self.0.map(|&o| o >= order.max(1))
    }
}

/// Orders the cells of `channels` (Strahler 1957): 1 at the sources; where channels join, the highest order of the donors,
/// plus 1 when two or more donors have it. Linear.
///
/// # Panics
/// When the shapes differ.
#[must_use]
pub fn strahler(directions: &FlowDirections, channels: &Mask) -> StrahlerOrder {
    assert_eq!(directions.shape(), channels.shape(), "one channel cell for each direction");
    let (rows, cols) = directions.shape();
    let channels = channels.as_slice();
    let mut orders = Grid::filled(rows, cols, 0u8);
    let flat = orders.as_mut_slice();
    // Until a cell is visited its order is the highest among its donors so far, and `doubled` says that two have it.
    let mut doubled = vec![false; flat.len()];
    directions.visit_downstream(
        |i| channels[i],
        |cell, receiver| {
            flat[cell] = (flat[cell] + u8::from(doubled[cell])).max(1);
            let Some(r) = receiver else { return };
            doubled[r] = if flat[cell] == flat[r] { true } else { doubled[r] && flat[cell] < flat[r] };
            flat[r] = flat[r].max(flat[cell]);
        },
    );
    StrahlerOrder(orders)
}
