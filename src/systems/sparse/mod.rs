//! Detail by sparse sums of the exemplar's own forms: multi-resolution dictionaries.
//!
//! Guérin, Digne, Galin, Peytavie: *Sparse representation of terrains for procedural modeling*, Eurographics 2016. The exemplar is shrunk; its coarse
//! squares are what maps are compared with, and its fine ones what they get (`amplify`). Learned atoms are some of its squares
//! (Eq. 2), each in the eight symmetries. What departs from the paper: `docs/papers/sparse.md`.

mod amplify;
mod config;

#[cfg(test)]
mod tests;

pub(crate) use config::SparseConfig;

use crate::arrays::Arrays;
use crate::checked::Checked;
use crate::control::{Control, Progress, Stage, Stop};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::pyramid::shrunk;
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Window, gaussian};
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::sparse::{Disc, LearningConfig, Update, learn};
use crate::systems::task::{Account, DetailModel, DetailUse, Exemplar, Part, Residual, SampleUse};
use amplify::Atoms;
use ndarray::Array2;
use rand::RngExt;
use rand::seq::index;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Fine cells along a coarse one: the paper's steps of 4 (Fig. 16). Half of it is made of the same atoms, shrunk.
const FACTOR: usize = 4;
/// Signals from which atoms are learned.
const SIGNALS: usize = 4096;
/// Largest number of squares of a complete dictionary in all symmetries: their fine squares have some hundred megabytes.
const MOST_SQUARES: usize = 120_000;
/// Largest amplification along a side; the paper's Fig. 16.
const MOST: usize = 256;

/// What a style file says of the detail beside the exemplar and its atoms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SparseInfo {
    /// Rows of the exemplar.
    pub(crate) rows: usize,
    /// Columns of the exemplar.
    pub(crate) cols: usize,
    /// The settings.
    pub(crate) config: Checked<SparseConfig>,
    /// What was measured.
    pub(crate) record: SparseRecord,
}

/// What was measured when atoms were learned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SparseRecord {
    /// Atoms, without symmetries.
    pub(crate) atoms: usize,
    /// Rounds of learning.
    pub(crate) rounds: usize,
    /// Share of the exemplar's coarse forms that its atoms explain.
    pub(crate) explained: f64,
    /// The share of fine forms that costs no PSNR against the bicubic map, at most 1.
    pub(crate) gain: f32,
    /// Seconds that it took.
    pub(crate) seconds: f64,
}

/// Sparse detail: an exemplar and which of its squares are atoms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SparseDetail {
    config: SparseConfig,
    /// Unit interval.
    exemplar: Grid<f32>,
    /// The cells at which atoms begin, as their places in the exemplar; none: all of them.
    places: Vec<u32>,
    record: SparseRecord,
}

impl SparseDetail {
    fn disc(config: &SparseConfig) -> Result<Disc> {
        Disc::new(config.radius, config.step)
    }

    /// Fine cells along the side of a square.
    fn side(config: &SparseConfig) -> Result<usize> {
        Ok(Self::disc(config)?.side() * FACTOR)
    }

    /// Takes atoms of `exemplar`. `seed` draws the signals and the first atoms.
    fn learned(
        exemplar: Grid<f32>,
        config: &SparseConfig,
        seed: Seed,
        control: &mut Control<'_>,
    ) -> Result<Self> {
        let started = Instant::now();
        let (disc, side) = (Self::disc(config)?, Self::side(config)?);
        let all = places(exemplar.shape(), side)?;
        let record = SparseRecord { atoms: all.len(), rounds: 0, explained: 1.0, gain: 1.0, seconds: 0.0 };
        let mut model = Self { config: config.clone(), exemplar, places: Vec::new(), record };
        if config.atoms == 0 {
            let turns = if config.symmetries { 8 } else { 1 };
            if all.len() * turns > MOST_SQUARES {
                let allowed =
                    format!("a complete dictionary has at most {MOST_SQUARES} squares: learn atoms of it");
                return Err(Error::value(
                    "sparse.atoms",
                    format!("0 ({} squares)", all.len() * turns),
                    allowed,
                ));
            }
        } else {
            let mut drawn: Vec<u32> =
                index::sample(&mut seed.stream("signals"), all.len(), SIGNALS.min(all.len()))
                    .into_iter()
                    .map(|i| all[i])
                    .collect();
            drawn.sort_unstable();
            let inside = disc.inside();
            let mut signals = Array2::zeros((drawn.len(), inside.len()));
            for (place, mut signal) in drawn.iter().zip(signals.rows_mut()) {
                let square = shrunk(&square(&model.exemplar, *place, side)?, FACTOR);
                Disc::signal(square.as_slice(), &inside, signal.as_slice_mut().unwrap_or_default());
            }
            let whole: f64 = signals.iter().map(|v: &f32| f64::from(*v).powi(2)).sum();
            let what = LearningConfig {
                atoms: config.atoms,
                sparsity: config.sparsity,
                rounds: config.rounds,
                update: Update::Signal,
            };
            let progress = &mut *control.progress;
            let mut heard = |round: usize, error: f64| {
                let figures = [("error", error / whole.max(f64::MIN_POSITIVE))];
                let (step, steps) = (round, config.rounds.max(1));
                let (share, seconds) = (step as f64 / steps as f64, started.elapsed().as_secs_f64());
                progress(&Progress {
                    stage: Stage::Detail(Self::NAME),
                    step,
                    steps,
                    share,
                    seconds,
                    figures: &figures,
                });
            };
            let learned = learn(signals.view(), what, seed, control.budget, &control.stop, &mut heard)
                .map_err(|e| {
                    e.renamed(|name| {
                        if name == "number of atoms" { "sparse.atoms".to_owned() } else { name.to_owned() }
                    })
                })?;
            model.places = learned.chosen.iter().flatten().map(|i| drawn[*i]).collect();
            model.places.sort_unstable();
            model.record.atoms = model.places.len();
            model.record.rounds = learned.errors.len() - 1;
            model.record.explained = 1.0 - learned.errors.last().copied().unwrap_or(0.0) / whole;
        }
        model.record.seconds = started.elapsed().as_secs_f64();
        Ok(model)
    }

    /// The atoms in all their symmetries.
    fn atoms(&self) -> Result<Atoms> {
        let (disc, side) = (Self::disc(&self.config)?, Self::side(&self.config)?);
        let all =
            if self.places.is_empty() { places(self.exemplar.shape(), side)? } else { self.places.clone() };
        let turns = if self.config.symmetries { 8 } else { 1 };
        let mut squares = Vec::with_capacity(all.len() * turns);
        for place in all {
            let square = square(&self.exemplar, place, side)?;
            squares.extend((0..turns).map(|turn| turned(&square, turn)));
        }
        Atoms::new(disc, FACTOR, squares)
    }

    /// `map` with `factor` times as many rows and columns, in steps of 4 and a last one of 2.
    fn enlarged(&self, map: &Grid<f32>, factor: usize, strength: f32, stop: &Stop) -> Result<Grid<f32>> {
        let atoms = self.atoms()?;
        let mut map = map.clone();
        let mut left = factor;
        while left > 1 {
            let step = if left.is_multiple_of(FACTOR) { FACTOR } else { 2 };
            map = atoms.at(step, !self.config.consistent).amplified(
                &map,
                self.config.sparsity,
                strength,
                stop,
            )?;
            left /= step;
        }
        Ok(map)
    }

    /// The largest strength, up to 1, that costs no PSNR against the bicubic map on the half of the exemplar that atoms have not seen, in the
    /// mean of both halves. Detail is added in proportion to the strength, so that the error is a parabola in it.
    fn calibrate(&mut self, seed: Seed, control: &mut Control<'_>) -> Result<()> {
        let (rows, cols) = self.exemplar.shape();
        let half = cols / 2 / FACTOR * FACTOR;
        let side = Self::side(&self.config)?;
        if !self.config.consistent || half < 2 * side || rows < 2 * side {
            return Ok(());
        }
        let parts = [
            self.exemplar.crop(Window::new(Cell::new(0, 0), rows, half))?,
            self.exemplar.crop(Window::new(Cell::new(0, half), rows, half))?,
        ];
        let (mut bicubic, mut bare, mut cross, mut power) = (0.0, 0.0, 0.0, 0.0);
        for (known, unseen) in [(0, 1), (1, 0)] {
            let atoms = if self.config.atoms == 0 {
                0
            } else {
                self.config.atoms.min(count((rows, half), side) / 8).max(1)
            };
            let config = SparseConfig { atoms, ..self.config.clone() };
            let quiet = &mut |_: &Progress<'_>| ();
            let mut quiet =
                Control { progress: quiet, budget: None, checkpoints: None, stop: control.stop.clone() };
            let model =
                Self::learned(parts[known].clone(), &config, seed.derive_indexed("half", known), &mut quiet)?;
            let coarse = shrunk(&parts[unseen], FACTOR);
            let (high, wide) = (coarse.rows() * FACTOR, coarse.cols() * FACTOR);
            let [zero, one] = [0.0, 1.0].map(|gain| model.enlarged(&coarse, FACTOR, gain, &control.stop));
            let (zero, one, up) = (zero?, one?, resample(&coarse, high, wide));
            for (cell, zero) in zero.cells() {
                let truth = f64::from(parts[unseen][cell]);
                let (off, added) = (f64::from(*zero) - truth, f64::from(one[cell] - zero));
                bicubic += (f64::from(up[cell]) - truth).powi(2);
                bare += off * off;
                cross += off * added;
                power += added * added;
            }
        }
        // bare + 2 g cross + g^2 power = bicubic
        let root = (cross * cross + power * (bicubic - bare)).max(0.0).sqrt();
        let gain = if power > 0.0 { ((root - cross) / power).clamp(0.0, 1.0) } else { 1.0 };
        self.record.gain = gain as f32;
        Ok(())
    }
}

/// Number of squares of `side` cells in a raster.
fn count((rows, cols): (usize, usize), side: usize) -> usize {
    (rows + 1).saturating_sub(side) * (cols + 1).saturating_sub(side)
}

/// The first cells of all squares of `side` cells in a raster, as places in it.
fn places((rows, cols): (usize, usize), side: usize) -> Result<Vec<u32>> {
    if count((rows, cols), side) == 0 {
        let allowed = format!("allowed: at least {side}x{side} cells with this radius");
        return Err(Error::value("exemplar of sparse detail", format!("{rows}x{cols}"), allowed));
    }
    let place = |row: usize| (0..=cols - side).map(move |col| (row * cols + col) as u32);
    Ok((0..=rows - side).flat_map(place).collect())
}

fn square(exemplar: &Grid<f32>, place: u32, side: usize) -> Result<Grid<f32>> {
    exemplar.crop(Window::square(exemplar.cell_at(place as usize), side))
}

/// A square in one of the eight symmetries.
fn turned(square: &Grid<f32>, turn: usize) -> Grid<f32> {
    let last = square.rows() - 1;
    Grid::from_fn(square.rows(), square.cols(), |c| {
        let (a, b) = if turn & 1 == 0 { (c.row, c.col) } else { (c.col, c.row) };
        let flip = |i: usize, is: bool| if is { last - i } else { i };
        square[Cell::new(flip(a, turn & 2 != 0), flip(b, turn & 4 != 0))]
    })
}

impl DetailModel for SparseDetail {
    /// The map is shrunk to cells of about `size`, and made fine again. Nothing is drawn: every seed gives the same.
    fn residual(
        &self,
        heights: &Grid<f32>,
        _: Option<&LineMap>,
        size: f64,
        _: &DetailUse,
        _: Seed,
        stop: &Stop,
    ) -> Result<Option<Residual>> {
        let factor = (size.max(2.0).log2().round() as u32).min(MOST.ilog2());
        let factor = 1usize << factor;
        let (rows, cols) = heights.shape();
        let coarse = (rows.div_ceil(factor), cols.div_ceil(factor));
        if coarse.0.min(coarse.1) < 4 || mean_square_slope(heights) <= 0.0 {
            return Ok(None);
        }
        let map = resample(heights, coarse.0, coarse.1);
        let fine = |strength: f32| -> Result<Grid<f32>> {
            Ok(resample(&self.enlarged(&map, factor, strength, stop)?, rows, cols))
        };
        let (smooth, mut added) = (resample(&map, rows, cols), fine(1.0)?);
        let bare = if self.config.consistent { fine(0.0)? } else { smooth.clone() };
        added.as_mut_slice().iter_mut().zip(bare.as_slice()).for_each(|(z, bare)| *z -= bare);
        Ok(Some(Residual { smooth, added }))
    }

    fn gain(&self) -> f32 {
        self.record.gain
    }

    fn amplified(
        &self,
        heights: &Grid<f32>,
        factor: usize,
        how: &DetailUse,
        stop: &Stop,
    ) -> Result<Option<Grid<f32>>> {
        how.validate()?;
        if !factor.is_power_of_two() || !(2..=MOST).contains(&factor) {
            let allowed = format!("allowed: 2, 4, 8 and so on up to {MOST}");
            return Err(Error::value("factor", factor, allowed));
        }
        let strength = how.strength * if how.calibrated { self.gain() } else { 1.0 };
        self.enlarged(heights, factor, strength, stop).map(Some)
    }

    /// Random hills with the mean, the deviation and the reach of the exemplar's coarsest forms, amplified twice by 4.
    fn sample(&self, what: &SampleUse, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        what.validate()?;
        let shrink = FACTOR * FACTOR;
        let coarse = (what.rows.div_ceil(shrink).max(4), what.cols.div_ceil(shrink).max(4));
        let (rows, cols) = self.exemplar.shape();
        let layout = resample(&self.exemplar, (rows / shrink).max(2), (cols / shrink).max(2));
        let (mean, deviation) = moments(&layout);
        let mut stream = seed.stream("hills");
        let noise = Grid::from_fn(coarse.0, coarse.1, |_| stream.sample::<f32, _>(StandardNormal));
        let mut hills = gaussian::smooth(&noise, &noise.map(|_| true), 1.0);
        let (own, spread) = moments(&hills);
        let scale = deviation / spread.max(f64::MIN_POSITIVE);
        hills.as_mut_slice().iter_mut().for_each(|z| *z = ((f64::from(*z) - own) * scale) as f32);
        what.mix(&mut hills, &layout.map(|z| (f64::from(*z) - mean) as f32));
        hills.as_mut_slice().iter_mut().for_each(|z| *z += mean as f32);
        self.enlarged(&hills, shrink, self.gain(), stop)?.crop(Window::new(
            Cell::new(0, 0),
            what.rows,
            what.cols,
        ))
    }
}

/// Mean and standard deviation.
fn moments(map: &Grid<f32>) -> (f64, f64) {
    let count = map.len() as f64;
    let mean = map.as_slice().iter().map(|z| f64::from(*z)).sum::<f64>() / count;
    let square = map.as_slice().iter().map(|z| (f64::from(*z) - mean).powi(2)).sum::<f64>() / count;
    (mean, square.sqrt())
}

impl Part for SparseDetail {
    const NAME: &'static str = "sparse";
    type Config = SparseConfig;
    type Description = SparseInfo;

    /// Learns which squares of the exemplar are atoms, and how much of them may be added.
    fn learn(exemplar: &Exemplar, config: &Checked<SparseConfig>, mut control: Control<'_>) -> Result<Self> {
        let seed = exemplar.seed.derive("sparse detail");
        let started = Instant::now();
        let mut detail = Self::learned(exemplar.filled()?, config, seed, &mut control)?;
        detail.calibrate(seed, &mut control)?;
        let seconds = started.elapsed().as_secs_f64();
        detail.record.seconds = seconds;
        let (stage, steps) = (Stage::Detail(Self::NAME), config.rounds.max(1));
        (control.progress)(&Progress { stage, step: steps, steps, share: 1.0, seconds, figures: &[] });
        Ok(detail)
    }

    fn config(&self) -> &SparseConfig {
        &self.config
    }

    fn account(&self) -> Account {
        let r = &self.record;
        let text = format!(
            "{} atoms, {:.1} % of the exemplar explained with {} of them a disc, strength {:.2}, in {:.1} s",
            r.atoms,
            100.0 * r.explained,
            self.config.sparsity,
            r.gain,
            r.seconds
        );
        let figures =
            vec![("atoms", r.atoms as f64), ("explained", r.explained), ("strength", f64::from(r.gain))];
        Account { text, seconds: r.seconds, figures }
    }

    fn save(&self) -> Result<(SparseInfo, Arrays)> {
        let (rows, cols) = self.exemplar.shape();
        let mut arrays = Arrays::default();
        arrays.put_f32("exemplar", &[rows, cols], self.exemplar.as_slice());
        arrays.put_u32("places", &[self.places.len()], &self.places);
        let config = Checked::new(self.config.clone())?;
        Ok((SparseInfo { rows, cols, config, record: self.record }, arrays))
    }

    fn load(info: SparseInfo, arrays: &mut Arrays, _: Option<&Arc<Dem>>) -> Result<Self> {
        let exemplar = Grid::from_vec(info.rows, info.cols, arrays.take_f32("exemplar")?)?;
        let places = arrays.take_u32("places")?;
        let config = info.config.into_inner();
        let side = Self::side(&config)?;
        let fits = |place: &&u32| {
            let cell = exemplar.cell_at(**place as usize);
            cell.row + side <= info.rows && cell.col + side <= info.cols
        };
        if let Some(place) = places.iter().find(|place| !fits(place)) {
            let allowed = "squares of atoms lie inside the exemplar";
            return Err(Error::value("place of an atom", place, allowed));
        }
        if let Some(z) = exemplar.as_slice().iter().find(|z| !z.is_finite()) {
            return Err(Error::value("height of the exemplar", z, "allowed: finite"));
        }
        let is_complete = config.atoms == 0;
        if places.is_empty() != is_complete || info.record.atoms != places.len() && !is_complete {
            let allowed = format!("the description has {}", info.record.atoms);
            return Err(Error::value("number of atoms", places.len(), allowed));
        }
        if !(0.0..=1.0).contains(&info.record.gain) {
            return Err(Error::value("gain of the detail", info.record.gain, "allowed: 0 to 1"));
        }
        Ok(Self { config, exemplar, places, record: info.record })
    }
}
