//! From terrain to sparse primitives: compact representation (Guérin et al. 2016, 5.1) and inverse procedural modelling (5.2).

use super::field::{Field, FunctionAtom};
use super::noise::NoiseKind;
use crate::control::Stop;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::harmonic_until;
use crate::seed::Seed;
use crate::sparse::{Codes, Dictionary, Disc, LearningConfig, Limits, Pursuit, Update, learn};
use ndarray::{Array2, Axis};
use rand::RngExt;
use rand::seq::index;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Signals from which K-SVD learns.
const SIGNALS: usize = 16_384;
/// Signals of the constrained form.
const CONSTRAINED: usize = 4096;
/// Functions among which atoms are chosen.
const FUNCTIONS: usize = 4096;
/// Wavelengths of functions in radii: the least, and the ratio of the largest to it.
const WAVELENGTHS: (f64, f64) = (1.0, 8.0);

/// Where atoms come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AtomSource {
    /// Learned from the terrain (K-SVD).
    Learned,
    /// Patches of the terrain (Eq. 2).
    Patches,
    /// Functions.
    Noise(NoiseKind),
}

/// How terrain becomes sparse primitives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FitConfig {
    /// Number of atoms, N; of functions all that are used when it is 0.
    pub(crate) atoms: usize,
    /// Atoms of a primitive, s.
    pub(crate) sparsity: usize,
    /// Radius R, cells.
    pub(crate) radius: f64,
    /// Cells from primitive to primitive.
    pub(crate) step: usize,
    /// Where atoms come from.
    pub(crate) source: AtomSource,
    /// Most rounds of learning.
    pub(crate) rounds: usize,
}

/// Fits primitives to a DEM; its voids stay. `heard` is told rounds of learning and their error as a share of the relief inside discs.
///
/// # Errors
/// When a setting is out of range or the work is stopped.
pub(crate) fn fit(
    dem: &Dem,
    config: &FitConfig,
    seed: Seed,
    stop: &Stop,
    heard: &mut dyn FnMut(usize, f64),
) -> Result<Field> {
    let disc = Disc::new(config.radius, config.step)?;
    if !(1..=64).contains(&config.sparsity) {
        return Err(Error::value("sparsity", config.sparsity, "allowed: 1 to 64"));
    }
    if config.atoms > 4096 {
        return Err(Error::value("number of atoms", config.atoms, "allowed: at most 4096"));
    }
    let heights = if dem.void_count() > 0 {
        harmonic_until(dem.valid(), &dem.heights().map(|z| f64::from(*z)), stop)?.map(|z| *z as f32)
    } else {
        dem.heights().clone()
    };
    let (signals, means) = signals(&heights, disc);
    let limits = Limits::atoms(config.sparsity);
    let (mut grids, mut functions) = (Vec::new(), Vec::new());
    let dictionary = match config.source {
        AtomSource::Noise(kind) => {
            let (all, dictionary) = functions_of(kind, disc, seed)?;
            let (kept, dictionary) = most_used(&signals, dictionary, config, stop)?;
            functions = kept.into_iter().map(|i| all[i]).collect();
            dictionary
        }
        AtomSource::Learned | AtomSource::Patches => {
            let (update, most) = match config.source {
                AtomSource::Patches => (Update::Signal, CONSTRAINED),
                _ => (Update::SingularVector, SIGNALS),
            };
            let mut drawn: Vec<usize> =
                index::sample(&mut seed.stream("signals"), signals.nrows(), most.min(signals.nrows()))
                    .into_vec();
            drawn.sort_unstable();
            let some = signals.select(Axis(0), &drawn);
            let whole: f64 = some.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().max(f64::MIN_POSITIVE);
            let what = LearningConfig {
                atoms: config.atoms,
                sparsity: config.sparsity,
                rounds: config.rounds,
                update,
            };
            let mut share = |round: usize, error: f64| heard(round, error / whole);
            let learned = learn(some.view(), what, seed, None, stop, &mut share)?;
            let (inside, side) = (disc.inside(), disc.side());
            for atom in learned.dictionary.atoms().rows() {
                // Beyond the disc an atom has no weight; bicubic taps at its rim read the nearest cell inside.
                let mut square = Grid::filled(side, side, f32::NAN);
                inside.iter().zip(atom).for_each(|(place, v)| square.as_mut_slice()[*place] = *v);
                grids.push(filled(square, disc));
            }
            learned.dictionary
        }
    };
    let codes: Codes = Pursuit::new(&dictionary, limits).run(signals.view(), stop)?;
    let voids = (dem.void_count() > 0).then(|| dem.valid().map(|valid| !valid));
    let cell = dem.cell_size().mean();
    Ok(Field { shape: dem.shape(), cell, disc, grids, functions, means, codes, voids })
}

/// What all discs see (n, K), and their means.
fn signals(heights: &Grid<f32>, disc: Disc) -> (Array2<f32>, Vec<f32>) {
    let (inside, (down, right)) = (disc.inside(), disc.centres(heights.shape()));
    let mut signals = Array2::zeros((down * right, inside.len()));
    let means = signals.axis_iter_mut(Axis(0)).into_par_iter().enumerate().map(|(i, mut signal)| {
        let mut square = vec![0.0; disc.side() * disc.side()];
        disc.square(heights, (i / right, i % right), &mut square);
        Disc::signal(&square, &inside, signal.as_slice_mut().unwrap_or_default())
    });
    let means = means.collect();
    (signals, means)
}

/// Cells that are not numbers take the value of the nearest ray inwards.
fn filled(square: Grid<f32>, disc: Disc) -> Grid<f32> {
    let middle = (disc.side() as f64 - 1.0) / 2.0;
    let inner = |cell: crate::grid::Cell| {
        let (row, col) = (cell.row as f64 - middle, cell.col as f64 - middle);
        (1..).map(|k| 1.0 - 0.02 * f64::from(k)).take(50).find_map(|t| {
            let at = |v: f64| (middle + t * v).round() as usize;
            Some(square[crate::grid::Cell::new(at(row), at(col))]).filter(|v| v.is_finite())
        })
    };
    Grid::from_fn(square.rows(), square.cols(), |c| {
        if square[c].is_finite() { square[c] } else { inner(c).unwrap_or(0.0) }
    })
}

/// A sample of noise functions, and what a disc sees of each.
fn functions_of(kind: NoiseKind, disc: Disc, seed: Seed) -> Result<(Vec<FunctionAtom>, Dictionary)> {
    let inside = disc.inside();
    let half = disc.side() as f64 / 2.0;
    let place = |i: &usize| [(i % disc.side()) as f64 + 0.5 - half, (i / disc.side()) as f64 + 0.5 - half];
    let mut stream = seed.stream("functions");
    let mut functions = Vec::with_capacity(FUNCTIONS);
    let mut values = Vec::with_capacity(FUNCTIONS * inside.len());
    for seed in 0..FUNCTIONS as u32 {
        let (least, ratio) = WAVELENGTHS;
        let mut function = FunctionAtom {
            kind,
            seed: seed.wrapping_mul(64),
            // As files keep them.
            wavelength: f64::from((disc.radius() * least * ratio.powf(stream.random::<f64>())) as f32),
            angle: f64::from((TAU * stream.random::<f64>()) as f32),
            offset: [f64::from(stream.random::<f32>()), f64::from(stream.random::<f32>())],
            mean: 0.0,
            length: 1.0,
        };
        let seen: Vec<f64> = inside.iter().map(|i| function.raw(place(i), 0.5)).collect();
        function.mean = f64::from((seen.iter().sum::<f64>() / seen.len() as f64) as f32);
        function.length =
            f64::from(seen.iter().map(|v| (v - function.mean).powi(2)).sum::<f64>().sqrt() as f32);
        values.extend(seen.iter().map(|v| ((v - function.mean) / function.length) as f32));
        functions.push(function);
    }
    let values = Array2::from_shape_vec((FUNCTIONS, inside.len()), values);
    let dictionary = Dictionary::new(values.unwrap_or_else(|_| Array2::zeros((0, 0))))?;
    Ok((functions, dictionary))
}

/// The atoms that explain most of the signals, `config.atoms` of them or all that are used, and their dictionary.
fn most_used(
    signals: &Array2<f32>,
    dictionary: Dictionary,
    config: &FitConfig,
    stop: &Stop,
) -> Result<(Vec<usize>, Dictionary)> {
    let codes = Pursuit::new(&dictionary, Limits::atoms(config.sparsity)).run(signals.view(), stop)?;
    let mut explained = vec![0.0f64; dictionary.len()];
    for signal in 0..codes.signals() {
        codes.of(signal).for_each(|(atom, weight)| explained[atom] += f64::from(weight).powi(2));
    }
    let mut order: Vec<usize> = (0..explained.len()).filter(|i| explained[*i] > 0.0).collect();
    order.sort_by(|a, b| explained[*b].total_cmp(&explained[*a]).then(a.cmp(b)));
    if config.atoms > 0 {
        order.truncate(config.atoms);
    }
    if order.is_empty() {
        // Level ground.
        order.push(0);
    }
    order.sort_unstable();
    let kept = dictionary.atoms().select(Axis(0), &order);
    Ok((order, Dictionary::new(kept)?))
}
