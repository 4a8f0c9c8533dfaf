//! Dictionaries learned from signals: K-SVD, and its constrained form whose atoms are signals (Guérin et al. 2016, 4.4, Eqs. 1 and 2).
//!
//! Both alternate between the pursuit and a sweep over the atoms. A signal keeps its old code where the pursuit, which is greedy, finds a worse one,
//! and a sweep only ever lowers the error: the error falls from round to round. Constrained candidates are compared by Gram matrices: with
//! E_i what signal i lacks without atom j, a candidate d explains sum_i <E_i, d>^2 of it, which needs no product of vectors.

use super::dictionary::norm;
use super::pursuit::{Limits, pursue};
use super::{Codes, Dictionary};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::seed::Seed;
use ndarray::{Array1, Array2, ArrayView2, Axis, Zip};
use rand::seq::index;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Power iterations that find the first singular vector of an atom's errors. Each lowers the error, so that few suffice (Rubinstein 2008 takes one).
const POWER: usize = 4;
/// Share by which a round must lower the error to be followed by another.
const CONVERGED: f64 = 1e-4;
/// Largest number of signals of the constrained form: their Gram matrix has 64 MB.
const LARGEST_CONSTRAINED: usize = 4096;

/// How an atom is replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Update {
    /// By the first singular vector of what its signals lack without it (K-SVD, Eq. 1).
    SingularVector,
    /// By the signal that explains most of that (Eq. 2).
    Signal,
}

/// How atoms are learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LearningConfig {
    /// Number of atoms, N.
    pub(crate) atoms: usize,
    /// Atoms of a signal, s.
    pub(crate) sparsity: usize,
    /// Most rounds.
    pub(crate) rounds: usize,
    /// How an atom is replaced.
    pub(crate) update: Update,
}

/// What was learned.
#[derive(Clone, Debug)]
pub(crate) struct Learned {
    /// The atoms.
    pub(crate) dictionary: Dictionary,
    /// The signal that each atom is; constrained form only.
    pub(crate) chosen: Option<Vec<usize>>,
    /// Squared error of all signals after every round, the first with the signals that were drawn.
    pub(crate) errors: Vec<f64>,
}

/// Learns atoms of `signals` (n, K), starting with some of them. Signals of length 0 are no atoms. `heard` is told the round and the squared
/// error. With a `budget` the rounds end with it.
///
/// # Errors
/// When fewer signals than atoms have a length, there are too many for the constrained form, or the work is stopped.
pub(crate) fn learn(
    signals: ArrayView2<'_, f32>,
    config: LearningConfig,
    seed: Seed,
    budget: Option<Duration>,
    stop: &Stop,
    heard: &mut dyn FnMut(usize, f64),
) -> Result<Learned> {
    let started = Instant::now();
    let lengths: Vec<f64> = signals.axis_iter(Axis(0)).map(norm).collect();
    let usable: Vec<usize> = (0..lengths.len()).filter(|i| lengths[*i] > 0.0).collect();
    if config.atoms == 0 || usable.len() < config.atoms {
        let allowed = format!("allowed: 1 to {}, the number of patches with relief", usable.len());
        return Err(Error::value("number of atoms", config.atoms, allowed));
    }
    if config.update == Update::Signal && lengths.len() > LARGEST_CONSTRAINED {
        let allowed = format!("allowed: at most {LARGEST_CONSTRAINED} when atoms are patches");
        return Err(Error::value("number of signals", lengths.len(), allowed));
    }
    let drawn = index::sample(&mut seed.stream("first atoms"), usable.len(), config.atoms);
    let mut chosen: Vec<usize> = drawn.into_iter().map(|i| usable[i]).collect();
    chosen.sort_unstable();
    let mut dictionary = Dictionary::new(signals.select(Axis(0), &chosen))?;
    let limits = Limits::atoms(config.sparsity);
    let mut codes = pursue(signals, &dictionary, limits, stop)?;
    let mut left = residuals(signals, &dictionary, &codes);
    let mut errors = vec![power(&left)];
    heard(0, errors[0]);
    let inner = match config.update {
        Update::Signal => Some(inner_products(signals)),
        Update::SingularVector => None,
    };
    for round in 1..=config.rounds {
        stop.check()?;
        if budget.is_some_and(|budget| started.elapsed() >= budget) {
            break;
        }
        match &inner {
            None => replace_by_vectors(&mut dictionary, &mut codes, &mut left),
            Some(inner) => replace_by_signals(inner, &lengths, &mut chosen, &mut codes),
        }
        if inner.is_some() {
            dictionary = Dictionary::new(signals.select(Axis(0), &chosen))?;
            left = residuals(signals, &dictionary, &codes);
        }
        let fresh = pursue(signals, &dictionary, limits, stop)?;
        let fresh_left = residuals(signals, &dictionary, &fresh);
        for (i, mut old) in left.axis_iter_mut(Axis(0)).enumerate() {
            let new = fresh_left.row(i);
            if norm(new) < norm(old.view()) {
                codes.copy_signal(i, &fresh);
                old.assign(&new);
            }
        }
        errors.push(power(&left));
        let [.., before, now] = errors[..] else { break };
        heard(round, now);
        if before - now <= CONVERGED * before {
            break;
        }
    }
    let chosen = inner.is_some().then_some(chosen);
    Ok(Learned { dictionary, chosen, errors })
}

/// What the codes leave of the signals, (n, K).
pub(super) fn residuals(signals: ArrayView2<'_, f32>, dictionary: &Dictionary, codes: &Codes) -> Array2<f32> {
    let mut left = signals.to_owned();
    left.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(i, mut left)| {
        for (atom, weight) in codes.of(i) {
            left.scaled_add(-weight, &dictionary.atoms().row(atom));
        }
    });
    left
}

fn power(left: &Array2<f32>) -> f64 {
    left.axis_iter(Axis(0)).map(|row| norm(row).powi(2)).sum()
}

/// A sweep of K-SVD: every atom and its weights become the best approximation of rank 1 to what the atom's signals lack without it.
fn replace_by_vectors(dictionary: &mut Dictionary, codes: &mut Codes, left: &mut Array2<f32>) {
    for atom in 0..dictionary.len() {
        let uses = &codes.uses_of(atom);
        if uses.is_empty() {
            // Nobody misses it: the signal that is represented worst takes its place.
            let worst = (0..left.nrows()).fold((0, -1.0), |worst, i| {
                let length = norm(left.row(i));
                if length > worst.1 { (i, length) } else { worst }
            });
            if worst.1 > 0.0 {
                let unit = left.row(worst.0).mapv(|v| (f64::from(v) / worst.1) as f32);
                dictionary.replace(atom, unit.view());
            }
            continue;
        }
        let old = dictionary.atoms().row(atom).to_owned();
        let rows: Vec<usize> = uses.iter().map(|(signal, _)| *signal).collect();
        let mut lacking = left.select(Axis(0), &rows);
        let mut weights: Array1<f32> =
            uses.iter().map(|(signal, place)| codes.weight(*signal, *place)).collect();
        Zip::from(lacking.rows_mut()).and(&weights).for_each(|mut row, weight| row.scaled_add(*weight, &old));
        let mut unit = old;
        for _ in 0..POWER {
            let vector = weights.dot(&lacking);
            let length = norm(vector.view());
            if length <= 0.0 {
                break;
            }
            unit = vector.mapv(|v| (f64::from(v) / length) as f32);
            weights = lacking.dot(&unit);
        }
        for ((row, (signal, place)), weight) in lacking.axis_iter(Axis(0)).zip(uses).zip(&weights) {
            codes.set(*signal, *place, atom, *weight);
            let mut left = left.row_mut(*signal);
            left.assign(&row);
            left.scaled_add(-weight, &unit);
        }
        dictionary.replace(atom, unit.view());
    }
}

/// Products of all signals (rows) with all signals at length 1 (columns), (n, n).
fn inner_products(signals: ArrayView2<'_, f32>) -> Array2<f32> {
    let mut units = signals.to_owned();
    for mut row in units.rows_mut() {
        let length = norm(row.view());
        if length > 0.0 {
            row.mapv_inplace(|v| (f64::from(v) / length) as f32);
        }
    }
    let n = signals.nrows();
    let mut all = Array2::zeros((n, n));
    all.axis_chunks_iter_mut(Axis(0), 256)
        .into_par_iter()
        .zip(signals.axis_chunks_iter(Axis(0), 256))
        .for_each(|(mut out, rows)| out.assign(&rows.dot(&units.t())));
    all
}

/// A sweep of the constrained form: every atom becomes the signal that explains most of what the atom's signals lack without it.
fn replace_by_signals(inner: &Array2<f32>, lengths: &[f64], chosen: &mut [usize], codes: &mut Codes) {
    for atom in 0..chosen.len() {
        let uses = codes.uses_of(atom);
        // What candidates have of each signal's lack, one row a use.
        let products: Vec<Array1<f32>> = uses
            .par_iter()
            .map(|(signal, place)| {
                let mut products = inner.row(*signal).to_owned();
                for (other, weight) in codes.of_except(*signal, *place) {
                    let scale = weight / lengths[chosen[other]] as f32;
                    products.scaled_add(-scale, &inner.row(chosen[other]));
                }
                products
            })
            .collect();
        let mut explained = vec![0.0f64; inner.ncols()];
        for products in &products {
            explained.iter_mut().zip(products).for_each(|(sum, p)| *sum += f64::from(*p).powi(2));
        }
        let own = explained[chosen[atom]];
        let best = (0..explained.len()).fold((chosen[atom], own), |best, candidate| {
            let is_free = explained[candidate] > best.1 && !chosen.contains(&candidate);
            if is_free { (candidate, explained[candidate]) } else { best }
        });
        chosen[atom] = best.0;
        for ((signal, place), products) in uses.iter().zip(&products) {
            codes.set(*signal, *place, atom, products[best.0]);
        }
    }
}
