//! Terrain from noise: the paper's own use of its patches.
//!
//! At the coarsest scale random hills become patches of the exemplar in a few rounds; from there on every scale adds what the
//! exemplar has beyond its next coarser self. With less variety the exemplar's own layout is mixed into the hills, as in the paper.

use super::patches::{Layers, Waves};
use super::synthesis::{Exemplars, at, first_scale, kept, shape_at, voted};
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::grid::resample::resample;
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::systems::task::{SampleUse, combined};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Rounds at the coarsest scale (10 in the paper's code).
const ROUNDS: usize = 10;
/// Cells of the coarsest scale from one random height to the next: hills about as large as a patch.
const HILLS: usize = 4;
/// What votes have averaged away is given back at most so many times.
const STRONGEST: f32 = 3.0;
/// Share of the exemplar's tiles that a draw leaves out; at the coarsest scale only where the layout is new.
const LEFT_OUT: f64 = 0.5;

/// Terrain of the kind of `truth`, in its unit.
///
/// # Errors
/// When the work is stopped.
pub(super) fn sample(truth: &Grid<f32>, what: &SampleUse, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
    let (rows, cols) = (what.rows, what.cols);
    let shortest = [truth.rows() / 2, truth.cols() / 2, rows, cols].into_iter().min().unwrap_or(0);
    let start = first_scale(f64::INFINITY, shortest);
    let waves = Waves::new();
    let draw = |map: &Layers, exemplars: &Exemplars, left_out: f64, slope: f32, seed: Seed| {
        voted(map, exemplars, &kept(exemplars, left_out, seed), &waves, slope, stop)
    };
    let slope = |map: &Grid<f32>| mean_square_slope(map).sqrt() as f32;

    let coarse = at(truth, start);
    let (mean, spread) = moments(&coarse);
    let level = coarse.map(|z| z - mean);
    let both = |map: Grid<f32>| Layers { residual: Some(map.clone()), ground: map, marks: None };
    let exemplars = Exemplars::of(&both(level.clone()), &level);
    let mut map = hills(shape_at((rows, cols), start), spread, seed);
    what.mix(&mut map, &level);
    for round in 0..ROUNDS {
        let left_out = LEFT_OUT * f64::from(what.variety);
        let drawn =
            draw(&both(map), &exemplars, left_out, slope(&level), seed.derive_indexed("round", round))?;
        map = as_strong(drawn, &level);
    }
    let mut map = map.map(|z| z + mean);
    for scale in (0..start).rev() {
        let fine = at(truth, scale);
        let smooth = resample(&at(truth, scale + 1), fine.rows(), fine.cols());
        let value = combined(&fine, 1.0, &smooth, -1.0);
        let exemplars =
            Exemplars::of(&Layers { ground: smooth.clone(), residual: None, marks: None }, &value);
        let (r, c) = shape_at((rows, cols), scale);
        let layers = Layers { ground: resample(&map, r, c), residual: None, marks: None };
        let added = draw(&layers, &exemplars, LEFT_OUT, slope(&smooth), seed.derive_indexed("scale", scale))?;
        map = combined(&layers.ground, 1.0, &as_strong(added, &value), 1.0);
    }
    Ok(map)
}

/// `map` with the standard deviation of `like`: overlapping patches that disagree have averaged forms away.
fn as_strong(map: Grid<f32>, like: &Grid<f32>) -> Grid<f32> {
    let ratio = moments(like).1 / moments(&map).1.max(f32::MIN_POSITIVE);
    let gain = ratio.min(STRONGEST);
    map.map(|z| gain * z)
}

/// Random hills around zero.
fn hills((rows, cols): (usize, usize), spread: f32, seed: Seed) -> Grid<f32> {
    let mut stream = seed.stream("hills");
    let (few_rows, few_cols) = ((rows / HILLS).max(2), (cols / HILLS).max(2));
    let noise = Grid::from_fn(few_rows, few_cols, |_| stream.sample::<f32, _>(StandardNormal));
    let map = resample(&noise, rows, cols);
    let (mean, own) = moments(&map);
    map.map(|z| (z - mean) * spread / own.max(f32::MIN_POSITIVE))
}

/// Mean and standard deviation.
fn moments(map: &Grid<f32>) -> (f32, f32) {
    let count = map.len() as f64;
    let mean = map.as_slice().iter().map(|z| f64::from(*z)).sum::<f64>() / count;
    let square = map.as_slice().iter().map(|z| (f64::from(*z) - mean).powi(2)).sum::<f64>() / count;
    (mean as f32, square.sqrt() as f32)
}
