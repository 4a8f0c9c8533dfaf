//! Coordinate systems: what one unit of a map's coordinates is on the ground.
//!
//! In: an EPSG code, WKT, a PROJ string, or a [`Georeference`](super::Georeference) that has one of them. Out: a [`Crs`]
//! with its kind and its units, and by [`Georeference::ground`](super::Georeference::ground) the size of cells on the ground.
//! What is not known is `None` or a note, never a guess in silence. The table of EPSG codes and the projections are those of
//! `proj-core` (`docs/decisions/0013-coordinate-systems.md`). Cost: microseconds.

mod definition;
mod ellipsoid;
mod ground;
mod inverse;
mod missing;
mod other;
#[cfg(test)]
mod tests;
mod units;

pub use definition::Crs;
pub(crate) use definition::CrsKind;
pub(in crate::dem) use definition::same_as;
pub(crate) use ellipsoid::Ellipsoid;
pub(in crate::dem) use units::unit_code;
pub(crate) use units::{linear_unit, unit_in_words, vertical_unit};
