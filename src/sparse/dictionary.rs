//! Atoms: vectors of norm 1.

use crate::error::{Error, Result};
use ndarray::{Array2, ArrayView1, Axis};

/// N atoms of K values and norm 1; the matrix D of Guérin et al. (2016), transposed: one atom a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dictionary {
    /// (N, K)
    atoms: Array2<f32>,
}

impl Dictionary {
    /// Atoms along `vectors` (N, K), of any length but 0.
    ///
    /// # Errors
    /// When there is no vector, or one is 0 or not finite.
    pub(crate) fn new(mut vectors: Array2<f32>) -> Result<Self> {
        if vectors.is_empty() {
            return Err(Error::value("number of atoms", 0, "allowed: at least 1"));
        }
        for (i, mut vector) in vectors.axis_iter_mut(Axis(0)).enumerate() {
            let length = norm(vector.view());
            if !(length.is_finite() && length > 0.0) {
                return Err(Error::value(format!("length of atom {i}"), length, "allowed: finite, above 0"));
            }
            vector.mapv_inplace(|v| (f64::from(v) / length) as f32);
        }
        Ok(Self { atoms: vectors })
    }

    /// (N, K)
    pub(crate) const fn atoms(&self) -> &Array2<f32> {
        &self.atoms
    }

    /// Number of atoms, N.
    pub(crate) fn len(&self) -> usize {
        self.atoms.nrows()
    }

    /// Number of values of an atom, K.
    pub(crate) fn depth(&self) -> usize {
        self.atoms.ncols()
    }

    /// The inner products of all atoms, (N, N).
    pub(crate) fn gram(&self) -> Array2<f32> {
        self.atoms.dot(&self.atoms.t())
    }

    /// Puts another vector of norm 1 in the place of an atom.
    pub(super) fn replace(&mut self, atom: usize, unit: ArrayView1<'_, f32>) {
        self.atoms.row_mut(atom).assign(&unit);
    }
}

/// Euclidean norm.
pub(super) fn norm(vector: ArrayView1<'_, f32>) -> f64 {
    vector.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt()
}
