//! Least-cost routing: drainage without raising a pit.
//!
//! [`Surface`] -> [`FlowDirections`]. Ehlschlaeger 1989 (the A* search of GRASS `r.watershed`): a flood starts at the
//! outlets and always continues from the lowest cell in reach *by its true height*. A cell drains into the cell from which
//! the flood reached it, unless a lower neighbour was flooded before: then into the steepest of those. Inside a pit the
//! water therefore runs down to the bottom's thalweg and out along the lowest pass, where filling would leave arbitrary
//! lines. Outlets drain out of the map only, never along its frame. n log n for ranking, then linear.

use super::Surface;
use super::directions::{FlowDirections, OUTLET, OUTSIDE};
use super::flood::{DONE, Flood, UNSEEN};
use crate::control::Stop;
use crate::error::Result;
use crate::grid::d8;

/// Cells that are routed from one look at the stop to the next: a few milliseconds.
const BETWEEN_POLLS: usize = 1 << 16;

/// Where the water of every cell goes on a surface that keeps its pits.
///
/// # Panics
/// Never: nobody stops it.
#[must_use]
pub fn route(surface: &Surface) -> FlowDirections {
    route_until(surface, &Stop::new()).expect("nobody stops it")
}

/// As [`route`], unless it is stopped.
///
/// # Errors
/// When it is stopped.
pub fn route_until(surface: &Surface, stop: &Stop) -> Result<FlowDirections> {
    let mut flood = Flood::new(surface);
    let Flood { steps, nodes, cells, state, queue, .. } = &mut flood;
    let mut done = 0usize;
    while let Some(rank) = queue.pop() {
        if done.is_multiple_of(BETWEEN_POLLS) {
            stop.check()?;
        }
        done += 1;
        let here = cells[rank as usize] as usize;
        let height = f64::from(nodes[here].height);
        let mut steepest = 0.0;
        let mut direction = state[here];
        for code in 0..8u8 {
            let there = here.wrapping_add_signed(steps[code as usize]);
            let seen = state[there];
            if seen == UNSEEN {
                state[there] = d8::opposite(code);
                queue.insert(nodes[there].rank);
            } else if seen & DONE != 0 && seen != OUTSIDE {
                let slope = (height - f64::from(nodes[there].height)) / d8::DISTANCES[code as usize];
                if slope > steepest {
                    steepest = slope;
                    direction = code;
                }
            }
        }
        if state[here] != OUTLET {
            state[here] = direction;
        }
        state[here] |= DONE;
    }
    Ok(FlowDirections::from_codes(flood.directions()))
}
