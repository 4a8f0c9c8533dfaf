//! Heights for strokes that have none, or a few: what ridges and valleys of a style are like along and beside each other.
//!
//! Exemplar [`Dem`](crate::dem::Dem) -> [`HeightModel`]; with it a sketch whose heights are partly open -> one with all of
//! them ([`HeightModel::fill`]). Ours. What is fitted:
//!
//! - valleys fall downstream: slope = k A^-theta of the drained area A (Flint 1974);
//! - ridges stand above the nearest valley by c d^p at the distance d, which depends on how far apart the valleys are that
//!   one looks at;
//! - how far both scatter, how much heights change along a ridge, and where ridges and valleys lie in the range.
//!
//! Every one of these is an equation between the heights of two points (or of one), divided by its scatter; the heights
//! are their least-squares solution, given ones staying as they are to the bit. Lengths are in cells, heights in metres.

mod equations;
mod fill;
mod fit;
mod network;
#[cfg(test)]
mod tests;

#[cfg(test)]
pub(crate) use fill::Filled;
pub use fit::{Density, HeightModel};
