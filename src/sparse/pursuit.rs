//! Orthogonal matching pursuit: signals as sums of a few atoms.
//!
//! The batch form (Rubinstein, Zibulevsky, Elad: *Efficient implementation of the K-SVD algorithm using batch orthogonal matching pursuit*, 2008, algorithm
//! 1): products of all atoms with a signal are taken once, as one matrix product for many signals; from there on only the Gram matrix
//! is read, and the least squares of the chosen atoms are a Cholesky factor that grows by a row. A dictionary too large for its Gram matrix is read instead
//! of it. Cost a signal: N K products, and N s more for each of s atoms.

use super::{Codes, Dictionary};
use crate::control::Stop;
use crate::error::Result;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use rayon::prelude::*;

/// Signals of one matrix product.
const CHUNK: usize = 128;
/// Largest number of atoms with a Gram matrix: 64 MB.
const LARGEST_GRAM: usize = 4096;
/// An atom whose part beside the chosen ones has a square below this adds nothing that 32 bits hold.
const DEPENDENT: f64 = 1e-6;

/// When a pursuit ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// Most atoms of a signal, s.
    pub(crate) sparsity: usize,
    /// The residual's norm at which no atom is added any more.
    pub(crate) error: f64,
}

impl Limits {
    /// So many atoms, whatever the error.
    pub(crate) const fn atoms(sparsity: usize) -> Self {
        Self { sparsity, error: 0.0 }
    }
}

/// Every row of `signals` (n, K) as a sum of atoms.
///
/// # Errors
/// When the work is stopped.
///
/// # Panics
/// When signals and atoms have other numbers of values.
pub(crate) fn pursue(
    signals: ArrayView2<'_, f32>,
    dictionary: &Dictionary,
    limits: Limits,
    stop: &Stop,
) -> Result<Codes> {
    Pursuit::new(dictionary, limits).run(signals, stop)
}

/// A dictionary that is ready for many signals.
pub(crate) struct Pursuit<'a> {
    dictionary: &'a Dictionary,
    gram: Option<Array2<f32>>,
    limits: Limits,
}

impl<'a> Pursuit<'a> {
    /// Takes the products of atoms with each other, where they are needed.
    pub(crate) fn new(dictionary: &'a Dictionary, limits: Limits) -> Self {
        let gram = (limits.sparsity > 1 && dictionary.len() <= LARGEST_GRAM).then(|| dictionary.gram());
        Self { dictionary, gram, limits }
    }

    /// As [`pursue`].
    ///
    /// # Errors
    /// When the work is stopped.
    ///
    /// # Panics
    /// As there.
    pub(crate) fn run(&self, signals: ArrayView2<'_, f32>, stop: &Stop) -> Result<Codes> {
        assert_eq!(signals.ncols(), self.dictionary.depth(), "signals and atoms of one length");
        let chunks: Vec<_> = signals.axis_chunks_iter(Axis(0), CHUNK).collect();
        let codes = chunks.into_par_iter().map(|signals| {
            stop.check()?;
            let products = signals.dot(&self.dictionary.atoms().t());
            let mut codes = Codes::none(signals.nrows(), self.limits.sparsity);
            let mut chosen = Chosen::default();
            for (i, products) in products.axis_iter(Axis(0)).enumerate() {
                let power = signals.row(i).iter().map(|v| f64::from(*v).powi(2)).sum();
                self.one(products, power, &mut chosen);
                for (place, (atom, weight)) in chosen.atoms.iter().zip(&chosen.weights).enumerate() {
                    codes.set(i, place, *atom, *weight as f32);
                }
            }
            Ok(codes)
        });
        Ok(Codes::joined(self.limits.sparsity, codes.collect::<Result<_>>()?))
    }

    /// The atoms of a signal of that power (square of the norm), given its products with all atoms.
    fn one(&self, products: ArrayView1<'_, f32>, power: f64, chosen: &mut Chosen) {
        chosen.clear();
        let mut left = products.to_owned();
        loop {
            let explained: f64 = chosen.weights.iter().zip(&chosen.products).map(|(w, p)| w * p).sum();
            if (power - explained).max(0.0).sqrt() <= self.limits.error {
                return;
            }
            let atom = strongest(left.view());
            let inner = |other: usize| match &self.gram {
                Some(gram) => f64::from(gram[(atom, other)]),
                None => {
                    let atoms = self.dictionary.atoms();
                    f64::from(atoms.row(atom).dot(&atoms.row(other)))
                }
            };
            if left[atom] == 0.0 || chosen.atoms.contains(&atom) || !chosen.extend(atom, inner) {
                return;
            }
            chosen.products.push(f64::from(products[atom]));
            chosen.solve();
            if chosen.atoms.len() == self.limits.sparsity {
                return;
            }
            left = chosen.remaining(products, self.dictionary, self.gram.as_ref());
        }
    }
}

/// The atoms of a signal.
#[derive(Default)]
struct Chosen {
    atoms: Vec<usize>,
    /// Products of the signal with them.
    products: Vec<f64>,
    /// The Cholesky factor of their Gram matrix, row by row.
    factor: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl Chosen {
    fn clear(&mut self) {
        self.atoms.clear();
        self.products.clear();
        self.factor.clear();
        self.weights.clear();
    }

    /// Adds an atom; false where it depends on those that are there.
    fn extend(&mut self, atom: usize, inner: impl Fn(usize) -> f64) -> bool {
        let mut row: Vec<f64> = Vec::with_capacity(self.atoms.len() + 1);
        for (i, other) in self.atoms.iter().enumerate() {
            let known: f64 = row.iter().zip(&self.factor[i]).map(|(a, b)| a * b).sum();
            row.push((inner(*other) - known) / self.factor[i][i]);
        }
        let rest = 1.0 - row.iter().map(|v| v * v).sum::<f64>();
        if rest < DEPENDENT {
            return false;
        }
        row.push(rest.sqrt());
        self.factor.push(row);
        self.atoms.push(atom);
        true
    }

    /// Products of all atoms with what the chosen ones leave of the signal.
    fn remaining(
        &self,
        products: ArrayView1<'_, f32>,
        dictionary: &Dictionary,
        gram: Option<&Array2<f32>>,
    ) -> Array1<f32> {
        let both = self.atoms.iter().zip(&self.weights);
        let mut left = products.to_owned();
        match gram {
            Some(gram) => both.for_each(|(atom, weight)| left.scaled_add(-*weight as f32, &gram.row(*atom))),
            None => {
                let mut sum = Array1::<f32>::zeros(dictionary.depth());
                both.for_each(|(atom, w)| sum.scaled_add(*w as f32, &dictionary.atoms().row(*atom)));
                left -= &dictionary.atoms().dot(&sum);
            }
        }
        left
    }

    /// The weights of least squares.
    fn solve(&mut self) {
        let n = self.atoms.len();
        let mut w = self.products.clone();
        for i in 0..n {
            let known: f64 = (0..i).map(|j| self.factor[i][j] * w[j]).sum();
            w[i] = (w[i] - known) / self.factor[i][i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| self.factor[j][i] * w[j]).sum();
            w[i] = (w[i] - known) / self.factor[i][i];
        }
        self.weights = w;
    }
}

/// The place of the largest absolute value; the first of equal ones.
fn strongest(values: ArrayView1<'_, f32>) -> usize {
    // In two passes: the first of them is vector code.
    let largest = values
        .iter()
        .fold(0.0f32, |largest, value| if value.abs() > largest { value.abs() } else { largest });
    values.iter().position(|value| value.abs() == largest).unwrap_or(0)
}
