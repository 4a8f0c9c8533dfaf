//! Settings of sparse detail.

use crate::checked::Settings;
use crate::error::{Error, Result};
use crate::sparse::Disc;
use serde::{Deserialize, Serialize};

/// How atoms are learned and used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SparseConfig {
    /// Number of atoms, N (before symmetries); 0 takes every square of the exemplar, the paper's complete dictionary.
    pub(crate) atoms: usize,
    /// Atoms of a disc, s; 1 in Table 2.
    pub(crate) sparsity: usize,
    /// Radius R of a disc in cells of the map: the larger it is the less of the map and the more of the exemplar is seen (Fig. 11).
    pub(crate) radius: f64,
    /// Cells of the map from disc to disc; less than 1.41 radii.
    pub(crate) step: usize,
    /// Whether atoms are used in all eight symmetries of the square.
    pub(crate) symmetries: bool,
    /// Whether amplified terrain is the map again when it is shrunk; without it atoms take the map's place, as published.
    pub(crate) consistent: bool,
    /// Most rounds of learning.
    pub(crate) rounds: usize,
}

impl Default for SparseConfig {
    fn default() -> Self {
        Self { atoms: 256, sparsity: 1, radius: 3.0, step: 3, symmetries: true, consistent: true, rounds: 20 }
    }
}

impl Settings for SparseConfig {
    fn validate(&self) -> Result<()> {
        let number = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::value(format!("sparse.{name}"), value, format!("allowed: {low} to {high}")))
        };
        number("atoms", self.atoms, 0, 4096)?;
        number("sparsity", self.sparsity, 1, 16)?;
        number("rounds", self.rounds, 0, 1000)?;
        if !(1.0..=16.0).contains(&self.radius) {
            return Err(Error::value("sparse.radius", self.radius, "allowed: 1 to 16"));
        }
        Disc::new(self.radius, self.step).map_err(|e| e.renamed(|name| format!("sparse.{name}")))?;
        Ok(())
    }
}
