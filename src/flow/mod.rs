//! Water on terrain: [`Surface`] -> [`FlowDirections`] -> [`Accumulation`] -> `StrahlerOrder`.
//!
//! Each arrow is one function and each product one type, so that a wrong order does not compile. There are two ways to
//! the directions: [`route`] (least-cost routing, raises nothing; our default) and `fill` then [`d8`] (depressions
//! filled to their spill level, then steepest descent; the textbook way). [`drain`] routes to chosen bases instead of the
//! frame alone and keeps the flood's order ([`Drainage`]).
//!
//! Common conventions. Cells are squares of side 1. A cell of the frame, or next to a void, is an *outlet*: water that
//! reaches it leaves the map. Voids take no part. Equal heights are ordered inside wide flats by their distance to the
//! flat's rim (the middle counts as lower, see [`Surface`]), then row by row; equal slopes by D8 code. Everything is
//! deterministic.

mod accumulation;
mod directions;
mod fill;
mod flood;
mod main_stem;
mod rank_queue;
mod routing;
mod strahler;
mod surface;
#[cfg(test)]
mod tests;

pub use accumulation::accumulate;
pub(crate) use accumulation::{Accumulation, accumulate_from};
pub use directions::{Flow, FlowDirections};
pub(crate) use fill::{POND_DEPTH, ponded_share};
pub use fill::{d8, fill};
pub(crate) use main_stem::main_stems;
pub use routing::route;
pub(crate) use routing::{Drainage, Role, drain, route_until};
pub use strahler::strahler;
pub use surface::Surface;
