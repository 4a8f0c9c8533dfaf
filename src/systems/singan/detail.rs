//! A trained detail model and its uses: detail for a given map, and terrain from noise.

use super::config::{DetailConfig, View, shrunk};
use super::network::{Network, Shape};
use super::scale::{Lens, Residual, Scale};
use super::train::{FIXED_NOISE, noise_field};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Grid, Mask};
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// How detail is added to a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DetailUse {
    /// Forms smaller than this many cells are the model's, larger ones the map's: the scale where detail begins.
    pub size: f64,
    /// How much of it: 0 none, 1 the exemplar's own, more is rougher.
    pub strength: f32,
    /// Share of the map's own small forms that stay; 0 replaces them (SinGAN's own use), 1 adds to them.
    pub keep: f32,
    /// Amplitude of the noise: 0 gives the one most likely answer, 1 as trained.
    pub noise: f32,
    /// Whether the map's slopes at the first scale are brought to those of the exemplar's coarse twins before, and back after: detail then fits the
    /// map's relief whatever its unit. Without it heights are taken in the exemplar's range.
    pub match_relief: bool,
}

impl Default for DetailUse {
    fn default() -> Self {
        Self { size: 2.0, strength: 1.0, keep: 0.0, noise: 1.0, match_relief: true }
    }
}

impl DetailUse {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        let number = |name: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::value(format!("detail {name}"), value, format!("allowed: {low} to {high}")))
        };
        number("size", self.size, 1.0, 1e6)?;
        number("strength", f64::from(self.strength), 0.0, 10.0)?;
        number("keep", f64::from(self.keep), 0.0, 1.0)?;
        number("noise", f64::from(self.noise), 0.0, 10.0)
    }
}

/// A detail model trained on one exemplar.
#[derive(Clone, Debug)]
pub struct Detail {
    config: DetailConfig,
    sizes: Vec<(usize, usize)>,
    pub(super) scales: Vec<Scale>,
    pub(super) fixed_noise: Seed,
}

impl Detail {
    pub(super) fn empty(config: DetailConfig, sizes: Vec<(usize, usize)>) -> Self {
        Self { config, sizes, scales: Vec::new(), fixed_noise: Seed::default() }
    }

    /// The settings of the training.
    #[must_use]
    pub const fn config(&self) -> &DetailConfig {
        &self.config
    }

    /// (rows, columns) of the exemplar's scales, the coarsest first.
    #[must_use]
    pub fn sizes(&self) -> &[(usize, usize)] {
        &self.sizes
    }

    /// Number of trained values.
    #[must_use]
    pub fn value_count(&self) -> usize {
        self.scales.iter().map(|s| s.net.values.len()).sum()
    }

    /// Cells of the finest scale in one of a scale.
    fn cell(&self, scale: usize) -> f64 {
        let last = self.sizes[self.sizes.len() - 1];
        f64::from(last.0.min(last.1) as u32) / f64::from(self.sizes[scale].0.min(self.sizes[scale].1) as u32)
    }

    /// `coarse` through the scales `range`, then enlarged to `size`: the map that the scale after them adds detail to. The
    /// coarse map is enlarged to the first of them when it comes from the one before.
    pub(super) fn refine(
        &self,
        coarse: &Grid<f32>,
        range: Range<usize>,
        size: (usize, usize),
        amplitude: f32,
        seed: Seed,
    ) -> Grid<f32> {
        let mut map = coarse.clone();
        for scale in range {
            let (rows, cols) = self.sizes[scale];
            map = self.pass(scale, &resample(&map, rows, cols), amplitude, seed);
        }
        resample(&map, size.0, size.1)
    }

    /// One scale with noise of its own stream.
    fn pass(&self, scale: usize, up: &Grid<f32>, amplitude: f32, seed: Seed) -> Grid<f32> {
        let level = &self.scales[scale];
        let mut stream = seed.derive_indexed("noise of scale", scale).stream("field");
        let field = (amplitude > 0.0).then(|| noise_field(level.lens, up.rows(), up.cols(), &mut stream));
        level.apply(up, field.as_ref(), amplitude)
    }

    /// The exemplar rebuilt from the fixed noise, 0 to 1.
    ///
    /// # Panics
    /// Never: a trained model has a scale.
    #[must_use]
    pub fn reconstruct(&self) -> Grid<f32> {
        let (rows, cols) = self.sizes[0];
        let first = &self.scales[0];
        let field = noise_field(first.lens, rows, cols, &mut self.fixed_noise.stream(FIXED_NOISE));
        let mut map = first.apply(&Grid::filled(rows, cols, 0.0), Some(&field), 1.0);
        for (scale, &(rows, cols)) in self.scales.iter().zip(&self.sizes).skip(1) {
            map = scale.apply(&resample(&map, rows, cols), None, 0.0);
        }
        map.map(|z| 0.5 * (z + 1.0))
    }

    /// Terrain of the exemplar's kind from noise alone. (rows, cols), in the exemplar's unit interval (which it may leave).
    ///
    /// # Errors
    /// When a side is smaller than 16 cells.
    pub fn sample(&self, rows: usize, cols: usize, seed: Seed) -> Result<Grid<f32>> {
        if rows.min(cols) < 16 {
            return Err(Error::value("size to sample", format!("{rows}x{cols}"), "allowed: at least 16x16"));
        }
        let size = |scale: usize| shrunk((rows, cols), self.cell(scale).recip());
        let (r, c) = size(0);
        let mut map = Grid::filled(r, c, 0.0);
        for scale in 0..self.scales.len() {
            let (r, c) = size(scale);
            map = self.pass(scale, &resample(&map, r, c), 1.0, seed);
        }
        Ok(map.map(|z| 0.5 * (z + 1.0)))
    }

    /// The coarsest scale whose cells are not larger than the forms that stay: detail begins above it.
    fn start(&self, size: f64) -> usize {
        let last = self.scales.len() - 1;
        (0..last).find(|&scale| self.cell(scale) <= size).unwrap_or(last).min(last.saturating_sub(1))
    }

    /// Adds detail to `heights` (the exemplar's unit interval is 0 to 1; any finite heights are allowed). Where `mask` is
    /// given and false the map stays as it is.
    ///
    /// # Errors
    /// When a setting is out of range, a height is not finite or the mask has another shape.
    pub fn add(
        &self,
        heights: &Grid<f32>,
        mask: Option<&Mask>,
        how: &DetailUse,
        seed: Seed,
    ) -> Result<Grid<f32>> {
        how.validate()?;
        if let Some(mask) = mask.filter(|mask| mask.shape() != heights.shape()) {
            let allowed = format!("the map is {:?}", heights.shape());
            return Err(Error::value("mask of detail", format!("{:?}", mask.shape()), allowed));
        }
        if let Some((cell, z)) = heights.cells().find(|(_, z)| !z.is_finite()) {
            let name = format!("height at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, z, "allowed: finite"));
        }
        let (rows, cols) = heights.shape();
        if self.scales.len() < 2 || rows.min(cols) < 4 {
            return Ok(heights.clone());
        }
        let start = self.start(how.size);
        let size = |scale: usize| shrunk((rows, cols), self.cell(scale).recip());
        let (r, c) = size(start);
        let shrunk_map = resample(heights, r, c).map(|z| 2.0 * z - 1.0);
        let ratio = if how.match_relief { self.relief(&shrunk_map, start) } else { 1.0 };
        let base = shrunk_map.as_slice().iter().map(|z| f64::from(*z)).sum::<f64>() / shrunk_map.len() as f64;
        let base = if how.match_relief { base as f32 } else { 0.0 };
        let mut detailed = shrunk_map.map(|z| (z - base) * ratio);
        let mut smooth = detailed.clone();
        for scale in start + 1..self.scales.len() {
            let (r, c) = size(scale);
            detailed = self.pass(scale, &resample(&detailed, r, c), how.noise, seed);
            smooth = resample(&smooth, r, c);
        }
        let mut out = heights.clone();
        let values = detailed.as_slice().iter().zip(smooth.as_slice());
        for (i, (z, (d, s))) in out.as_mut_slice().iter_mut().zip(values).enumerate() {
            if mask.is_none_or(|mask| mask.as_slice()[i]) {
                let smooth = 0.5 * (s / ratio + base + 1.0);
                let ground = how.keep * *z + (1.0 - how.keep) * smooth;
                *z = ground + how.strength * 0.5 * (d - s) / ratio;
            }
        }
        Ok(out)
    }

    /// What brings the map's slopes at a scale to those of the exemplar's coarse twins; 1 for level ground.
    fn relief(&self, map: &Grid<f32>, scale: usize) -> f32 {
        let own = mean_square_slope(map).sqrt() as f32;
        let twins = self.scales[scale].residual.slope_of_twins;
        if own > 0.0 { (twins / own).clamp(1e-3, 1e3) } else { 1.0 }
    }
}

/// What a style file says of its detail model beside the weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetailInfo {
    /// The settings of the training.
    pub config: DetailConfig,
    /// (rows, columns) of the scales.
    pub sizes: Vec<(usize, usize)>,
    /// Seed of the reconstruction's noise.
    pub fixed_noise: Seed,
    /// Of every scale: amplitude of the noise, height of an output, root mean square slopes of the exemplar and of its twins.
    pub scales: Vec<[f32; 4]>,
}

impl Detail {
    /// The description and the named weights, to be stored in any container.
    #[must_use]
    pub fn parts(&self) -> (DetailInfo, Vec<(String, Vec<f32>)>) {
        let info = DetailInfo {
            config: self.config.clone(),
            sizes: self.sizes.clone(),
            fixed_noise: self.fixed_noise,
            scales: self
                .scales
                .iter()
                .map(|s| {
                    let r = s.residual;
                    [s.noise, r.scale, r.slope_of_exemplar, r.slope_of_twins]
                })
                .collect(),
        };
        let name = |i: usize| format!("scale.{i}");
        let weights = self.scales.iter().enumerate().map(|(i, s)| (name(i), s.net.values.clone()));
        (info, weights.collect())
    }

    /// The model that [`parts`](Self::parts) came from; `weights` gives the tensor of a name.
    ///
    /// # Errors
    /// When the description contradicts itself or a tensor is missing or has another length.
    pub fn from_parts(info: DetailInfo, mut weights: impl FnMut(&str) -> Result<Vec<f32>>) -> Result<Self> {
        info.config.validate()?;
        let last =
            *info.sizes.last().ok_or_else(|| Error::value("scales of the detail", 0, "at least one"))?;
        if info.config.pyramid(last.0, last.1) != info.sizes || info.scales.len() != info.sizes.len() {
            let allowed = "they must be those of the configuration";
            return Err(Error::value("scales of the detail", format!("{:?}", info.sizes), allowed));
        }
        let mut detail = Self::empty(info.config.clone(), info.sizes.clone());
        detail.fixed_noise = info.fixed_noise;
        for (i, &[noise, scale, slope, coarse]) in info.scales.iter().enumerate() {
            let view = info.config.view;
            let gain = if view == View::Slopes { slope.recip() } else { 1.0 };
            let lens = Lens { view, gain };
            let width = if i < 4 { info.config.width } else { info.config.fine_width };
            let shape = Shape { inputs: lens.generator_inputs(), width, batch_norm: false };
            let values = weights(&format!("scale.{i}"))?;
            let good = values.len() == shape.value_count() && values.iter().all(|v| v.is_finite());
            if !(good && noise.is_finite() && scale.is_finite() && slope > 0.0 && coarse > 0.0) {
                let allowed = format!("allowed: {} finite values and positive slopes", shape.value_count());
                return Err(Error::value(format!("detail of scale {i}"), values.len(), allowed));
            }
            let net = Network { shape, values, running: Vec::new() };
            let residual = Residual { view, scale, slope_of_exemplar: slope, slope_of_twins: coarse };
            detail.scales.push(Scale { net, lens, residual, noise });
        }
        Ok(detail)
    }
}
