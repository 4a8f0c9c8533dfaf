//! Amplification by multi-resolution dictionaries (Guérin et al. 2016, 5.3, Figs. 9 and 10).
//!
//! Discs of a map become sums of coarse atoms; what the fine atoms have beyond these is added to the enlarged map with the same weights.
//! The enlarged map is the bicubic surface whose means over the old cells, with what is added, are the map again: terrain that is amplified and
//! shrunk is the input. All of that correction happens on the map's own cells, since the means of enlarged maps and of blended atoms
//! are linear in what they are made of; the fine map is written once. Cost: (side / step)^2 products a fine cell and atom.

use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::grid::pyramid::shrunk;
use crate::grid::resample::{Resampling, resample};
use crate::machine;
use crate::sparse::{Codes, Dictionary, Disc, Limits, Pursuit};
use ndarray::{Array2, Axis};
use rayon::prelude::*;

/// Rounds of the correction.
const ROUNDS: usize = 8;

/// Squares of an exemplar at the fine size, each with its own coarse square.
pub(super) struct Atoms {
    disc: Disc,
    /// The coarse atoms.
    low: Dictionary,
    /// The fine squares over the length of their coarse atom and without its mean, (N, (side factor)^2).
    high: Vec<Grid<f32>>,
    factor: usize,
}

impl Atoms {
    /// From fine squares, `factor` cells a coarse cell. Squares without relief are left out.
    ///
    /// # Errors
    /// When no square has relief.
    pub(super) fn new(disc: Disc, factor: usize, squares: Vec<Grid<f32>>) -> Result<Self> {
        let inside = disc.inside();
        let (mut values, mut high) = (Vec::new(), Vec::new());
        let mut signal = vec![0.0; inside.len()];
        for square in squares {
            let mean = Disc::signal(shrunk(&square, factor).as_slice(), &inside, &mut signal);
            let length = signal.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
            if length > f64::from(f32::EPSILON) {
                high.push(square.map(|z| (f64::from(z - mean) / length) as f32));
                values.extend_from_slice(&signal);
            }
        }
        let values = Array2::from_shape_vec((high.len(), inside.len()), values);
        let low = Dictionary::new(values.unwrap_or_else(|_| Array2::zeros((0, inside.len()))))?;
        Ok(Self { disc, low, high, factor })
    }

    /// What is needed to amplify by `factor`, a divisor of that of the atoms.
    pub(super) fn at(&self, factor: usize, replace: bool) -> Level<'_> {
        let (side, shares) = (self.disc.side() * factor, self.disc.shares(factor));
        let fine = |square: &Grid<f32>| {
            let mut fine = shrunk(square, self.factor / factor);
            if !replace {
                let smooth = resample(&shrunk(square, self.factor), side, side);
                fine.as_mut_slice().iter_mut().zip(smooth.as_slice()).for_each(|(z, s)| *z -= s);
            }
            fine.as_mut_slice().iter_mut().zip(&shares).for_each(|(z, share)| *z *= share);
            fine
        };
        let high: Vec<Grid<f32>> = self.high.par_iter().map(fine).collect();
        let means = high.iter().map(|square| shrunk(square, factor)).collect();
        Level { atoms: self, factor, replace, high, means, shares: Grid::from_vec(side, side, shares).ok() }
    }
}

/// Atoms for one factor.
pub(super) struct Level<'a> {
    atoms: &'a Atoms,
    factor: usize,
    /// Whether discs take the place of the map, as published, instead of being added to it.
    replace: bool,
    /// What is blended: fine atoms, or what they have beyond their coarse ones, times the disc's share.
    high: Vec<Grid<f32>>,
    /// The same in means over coarse cells.
    means: Vec<Grid<f32>>,
    shares: Option<Grid<f32>>,
}

/// Centres of discs with what stands there.
struct Primitives {
    /// (rows, columns) of centres.
    shape: (usize, usize),
    means: Vec<f32>,
    codes: Codes,
}

impl Level<'_> {
    /// `map` with `factor` times as many rows and columns. Of what atoms add, `gain` is taken.
    ///
    /// # Errors
    /// When the work is stopped.
    pub(super) fn amplified(
        &self,
        map: &Grid<f32>,
        sparsity: usize,
        gain: f32,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let (rows, cols) = map.shape();
        let primitives = self.primitives(map, sparsity, stop)?;
        let fine = (rows * self.factor, cols * self.factor);
        let shares = self.shares.as_ref().filter(|_| self.replace);
        if self.replace {
            let mut out = Grid::filled(fine.0, fine.1, 0.0);
            self.blend(&primitives, &self.high, shares, 1.0, &mut out);
            return Ok(out);
        }
        let up = Resampling::new((rows, cols), fine);
        let back = up.averaged(self.factor);
        // What the means of the old cells lack, once atoms are added to the enlarged map.
        let mut missing = Grid::filled(rows, cols, 0.0);
        self.blend(&primitives, &self.means, None, -gain, &mut missing);
        let add = |a: &mut Grid<f32>, sign: f32, b: &Grid<f32>| {
            a.as_mut_slice().par_iter_mut().zip(b.as_slice()).for_each(|(a, b)| *a += sign * b);
        };
        let mut source = map.clone();
        add(&mut missing, 1.0, map);
        add(&mut missing, -1.0, &back.apply(map));
        for _ in 0..ROUNDS {
            stop.check()?;
            add(&mut source, 1.0, &missing);
            let reached = back.apply(&missing);
            add(&mut missing, -1.0, &reached);
        }
        let mut out = up.apply(&source);
        stop.check()?;
        self.blend(&primitives, &self.high, None, gain, &mut out);
        Ok(out)
    }

    /// The discs of a map as sums of coarse atoms.
    fn primitives(&self, map: &Grid<f32>, sparsity: usize, stop: &Stop) -> Result<Primitives> {
        let disc = self.atoms.disc;
        let (shape, inside) = (disc.centres(map.shape()), disc.inside());
        let pursuit = Pursuit::new(&self.atoms.low, Limits::atoms(sparsity));
        let rows = (0..shape.0).into_par_iter().map(|row| {
            let mut square = vec![0.0; disc.side() * disc.side()];
            let mut signals = Array2::<f32>::zeros((shape.1, inside.len()));
            let mut means = Vec::with_capacity(shape.1);
            for (col, mut signal) in signals.axis_iter_mut(Axis(0)).enumerate() {
                disc.square(map, (row, col), &mut square);
                means.push(Disc::signal(&square, &inside, signal.as_slice_mut().unwrap_or_default()));
            }
            Ok((means, pursuit.run(signals.view(), stop)?))
        });
        let (means, codes): (Vec<_>, Vec<_>) = rows.collect::<Result<Vec<_>>>()?.into_iter().unzip();
        Ok(Primitives { shape, means: means.concat(), codes: Codes::joined(sparsity, codes) })
    }

    /// Adds `gain` times the weighted squares around all centres to a map. `shares`: also the discs' means, times these.
    fn blend(
        &self,
        primitives: &Primitives,
        squares: &[Grid<f32>],
        shares: Option<&Grid<f32>>,
        gain: f32,
        out: &mut Grid<f32>,
    ) {
        let disc = self.atoms.disc;
        let side = squares[0].rows();
        // Cells of this map a cell of the coarse one.
        let fine = side / disc.side();
        let (band, cols) = (disc.step() * fine, out.cols());
        let reach = disc.side().div_ceil(2 * disc.step());
        let arch = machine::arch();
        out.as_mut_slice().par_chunks_mut(band * cols).enumerate().for_each(|(b, out)| {
            let top = (b * band) as isize;
            let near = b + disc.margin();
            let first = near.saturating_sub(reach);
            let last = (near + 1 + reach).min(primitives.shape.0 - 1);
            arch.dispatch(
                #[inline(always)]
                || {
                    for (row, out) in (top..).zip(out.chunks_exact_mut(cols)) {
                        for centre_row in first..=last {
                            let inner = row - disc.first(centre_row) * fine as isize;
                            if !(0..side as isize).contains(&inner) {
                                continue;
                            }
                            let inner = inner as usize * side;
                            for centre_col in 0..primitives.shape.1 {
                                let left = disc.first(centre_col) * fine as isize;
                                let skipped = (-left).max(0) as usize;
                                let start = left.max(0) as usize;
                                let width = (side - skipped.min(side)).min(cols.saturating_sub(start));
                                let out = &mut out[start.min(cols)..][..width];
                                let mut add = |weight: f32, values: &Grid<f32>| {
                                    let values = &values.as_slice()[inner + skipped.min(side)..][..width];
                                    out.iter_mut().zip(values).for_each(|(z, v)| *z += weight * v);
                                };
                                let centre = centre_row * primitives.shape.1 + centre_col;
                                if let Some(shares) = shares {
                                    add(primitives.means[centre], shares);
                                }
                                for (atom, weight) in primitives.codes.of(centre) {
                                    add(gain * weight, &squares[atom]);
                                }
                            }
                        }
                    }
                },
            );
        });
    }
}
