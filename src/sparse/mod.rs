//! Terrain as sparse sums of a few forms: dictionaries of atoms, the pursuit that finds a sum, and learning from terrain.
//!
//! Guérin, Digne, Galin, Peytavie: *Sparse representation of terrains for procedural modeling*, Eurographics 2016 (`docs/papers/sparse.md`).
//! [`Disc`] cuts patches out of terrain and blends them; [`Dictionary`] holds atoms; [`Pursuit`] writes patches as sums of
//! atoms ([`Codes`]); [`learn`] finds atoms; [`tree`] combines such sums with operators and functions.

mod codes;
mod dictionary;
mod disc;
mod learning;
mod pursuit;
pub(crate) mod tree;

#[cfg(test)]
mod tests;

pub(crate) use codes::Codes;
pub(crate) use dictionary::Dictionary;
pub(crate) use disc::Disc;
pub(crate) use learning::{LearningConfig, Update, learn};
pub(crate) use pursuit::{Limits, Pursuit};
