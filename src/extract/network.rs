//! One kind of line, from a drained surface to thin lines.
//!
//! [`Surface`] -> [`Network`] -> [`Traced`]: route, accumulate; then for each set of limits: threshold, Strahler order,
//! closing, thinning. The source of the steps is Liu & Benes 2025, 4.1. The order is taken before closing, because it needs
//! the flow and closing only joins what is to be kept.

use super::relief::Relief;
use super::{ExtractionConfig, Routing};
use crate::control::Stop;
use crate::error::Result;
use crate::flow::{self, Accumulation, FlowDirections, Surface};
use crate::grid::{Cell, Grid, Mask, morphology, thinning};

/// Drainage of a surface.
pub(super) struct Network {
    directions: FlowDirections,
    accumulation: Accumulation,
    /// Where lines may run; `None` for everywhere.
    open: Option<Mask>,
}

/// Thin lines on the map.
pub(super) struct Traced {
    /// One cell wide.
    pub(super) lines: Mask,
    /// Strahler order at line cells, 0 elsewhere.
    pub(super) orders: Grid<u8>,
    /// Cells drained.
    pub(super) counts: Grid<u32>,
}

impl Network {
    /// Flat ground passes water on but gives none, and keeps only the main line of what crosses it: neither plains nor
    /// lakes, right way up or upside down, grow parallel lines.
    ///
    /// # Errors
    /// When it is stopped.
    pub(super) fn of(surface: &Surface, routing: Routing, stop: &Stop) -> Result<Self> {
        let directions = match routing {
            Routing::LeastCost => flow::route_until(surface, stop)?,
            Routing::Filled => flow::d8(&flow::fill(surface)),
        };
        stop.check()?;
        let Some(flats) = surface.flats() else {
            let accumulation = flow::accumulate(&directions);
            return Ok(Self { directions, accumulation, open: None });
        };
        let slopes = flats.map(|flat| !flat);
        let accumulation = flow::accumulate_from(&directions, &slopes);
        stop.check()?;
        let mut open = flow::main_stems(&directions, &accumulation, &flats);
        for (open, &slope) in open.as_mut_slice().iter_mut().zip(slopes.as_slice()) {
            *open |= slope;
        }
        Ok(Self { directions, accumulation, open: Some(open) })
    }

    /// Lines within the limits of `config`, before the filters on whole lines.
    pub(super) fn trace(&self, relief: &Relief, config: &ExtractionConfig) -> Traced {
        let channels = self.accumulation.channels(config.min_accumulation);
        let orders = flow::strahler(&self.directions, &channels);
        let kept = orders.at_least(config.min_order);
        let kept = self.open.as_ref().map_or_else(|| kept.clone(), |open| both(&kept, open));
        let closed = both(&morphology::close(&kept, config.closing), relief.surface().valid());
        // Thin again after the cut: a line that was held together from outside may have a cell too many.
        let lines = thinning::thin(&relief.crop(&thinning::thin(&closed)));
        let orders = order_of_lines(&lines, &relief.crop(orders.orders()), config);
        Traced { lines, orders, counts: relief.crop(self.accumulation.counts()) }
    }
}

/// Strahler order at line cells; a cell that closing added takes the highest order within the closing's reach.
fn order_of_lines(lines: &Mask, orders: &Grid<u8>, config: &ExtractionConfig) -> Grid<u8> {
    let (rows, cols) = lines.shape();
    let reach = config.closing;
    Grid::from_fn(rows, cols, |c| {
        if !lines[c] {
            0
        } else if orders[c] >= config.min_order {
            orders[c]
        } else {
            let near_rows = c.row.saturating_sub(reach)..(c.row + reach + 1).min(rows);
            let near_cols = c.col.saturating_sub(reach)..(c.col + reach + 1).min(cols);
            let near = near_rows.flat_map(|row| near_cols.clone().map(move |col| Cell::new(row, col)));
            // In a margin's corner of the map the reason for closing may lie outside: the lowest order that is kept.
            near.map(|there| orders[there]).max().unwrap_or(0).max(config.min_order)
        }
    })
}

fn both(a: &Mask, b: &Mask) -> Mask {
    let mut both = a.clone();
    for (x, &y) in both.as_mut_slice().iter_mut().zip(b.as_slice()) {
        *x &= y;
    }
    both
}
