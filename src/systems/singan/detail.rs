//! A trained detail model and its uses: detail for a given map, and terrain from noise.

use super::config::{DetailConfig, View, shrunk};
use super::network::REACH;
use super::scale::{FIXED_NOISE, Scale, ScaleInfo, noise_field};
use crate::checked::Settings;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Window};
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::systems::task::{DetailModel, DetailUse, Residual, SampleUse, gain_of, gap};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Maps with a side shorter than this stay as they are.
const SMALLEST_MAP: usize = 4;
/// A detail model trained on one exemplar.
#[derive(Clone, Debug)]
pub(crate) struct Detail {
    config: DetailConfig,
    pub(super) sizes: Vec<(usize, usize)>,
    pub(super) scales: Vec<Scale>,
    pub(super) fixed_noise: Seed,
    pub(super) record: DetailRecord,
}

impl Detail {
    pub(super) fn empty(config: DetailConfig, sizes: Vec<(usize, usize)>) -> Self {
        let record = DetailRecord { seconds: 0.0, steps: Vec::new(), psnr: 0.0, gain: 1.0 };
        Self { config, sizes, scales: Vec::new(), fixed_noise: Seed::default(), record }
    }

    pub(super) const fn settings(&self) -> &DetailConfig {
        &self.config
    }

    /// What the training was.
    #[must_use]
    pub(crate) const fn record(&self) -> &DetailRecord {
        &self.record
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
        let field = (amplitude > 0.0).then(|| self.noise(scale, up.rows(), up.cols(), seed));
        self.scales[scale].apply(up, field.as_ref(), amplitude)
    }

    /// As [`pass`](Self::pass), unless it is stopped.
    fn pass_until(
        &self,
        scale: usize,
        up: &Grid<f32>,
        amplitude: f32,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let field = (amplitude > 0.0).then(|| self.noise(scale, up.rows(), up.cols(), seed));
        self.scales[scale].apply_until(up, field.as_ref(), amplitude, stop)
    }

    /// A scale's noise in its generator's frame.
    fn noise(&self, scale: usize, rows: usize, cols: usize, seed: Seed) -> Grid<f32> {
        let mut stream = seed.derive_indexed("noise of scale", scale).stream("field");
        noise_field(self.scales[scale].inputs, rows, cols, &mut stream)
    }

    /// The coarsest scale's noise that rebuilds the exemplar, in the generator's frame.
    fn layout_noise(&self) -> Grid<f32> {
        let (rows, cols) = self.sizes[0];
        noise_field(self.scales[0].inputs, rows, cols, &mut self.fixed_noise.stream(FIXED_NOISE))
    }

    /// The exemplar rebuilt from the fixed noise, 0 to 1.
    ///
    /// # Panics
    /// Never: a trained model has a scale.
    #[must_use]
    pub(crate) fn reconstruct(&self) -> Grid<f32> {
        self.rebuilt().map(|z| 0.5 * (z + 1.0))
    }

    /// The same through the scales that are there, -1 to 1.
    pub(super) fn rebuilt(&self) -> Grid<f32> {
        let (rows, cols) = self.sizes[0];
        let mut map = self.scales[0].apply(&Grid::filled(rows, cols, 0.0), Some(&self.layout_noise()), 1.0);
        for (scale, &(rows, cols)) in self.scales.iter().zip(&self.sizes).skip(1) {
            map = scale.apply(&resample(&map, rows, cols), None, 0.0);
        }
        map
    }

    /// The coarsest scale whose cells are not larger than the forms that stay: detail begins above it.
    fn start(&self, size: f64) -> usize {
        let last = self.scales.len() - 1;
        (0..last).find(|&scale| self.cell(scale) <= size).unwrap_or(last).min(last.saturating_sub(1))
    }

    /// (rows, columns) at a scale of a map that has `shape` at the finest.
    fn size_of(&self, shape: (usize, usize), scale: usize) -> (usize, usize) {
        let (rows, cols) = shrunk(shape, self.cell(scale).recip());
        (rows.max(2), cols.max(2))
    }

    /// Finds the strength with which a coarse twin of the exemplar `truth` comes nearest to it in slopes, curvatures and
    /// spectrum, and takes it for 1 from now on. `twin` is the coarse map that `lines` of the exemplar give.
    ///
    /// # Errors
    /// When there is no line, shapes differ or the exemplar is level.
    pub(crate) fn calibrate(
        &mut self,
        twin: &Grid<f32>,
        lines: &LineMap,
        truth: &Grid<f32>,
        stop: &Stop,
    ) -> Result<()> {
        let seed = self.fixed_noise.derive("calibration");
        if let Some(found) =
            self.residual(twin, Some(lines), gap(lines), &DetailUse::default(), seed, stop)?
        {
            self.record.gain = gain_of(&found, twin, lines, truth)?;
        }
        Ok(())
    }

    /// What brings the map's slopes at a scale to those of the exemplar's coarse twins; 1 for level ground.
    fn relief(&self, map: &Grid<f32>, scale: usize) -> f32 {
        let own = mean_square_slope(map).sqrt() as f32;
        let twins = self.scales[scale].residual.slope_of_twins;
        if own > 0.0 { (twins / own).clamp(1e-3, 1e3) } else { 1.0 }
    }
}

impl DetailModel for Detail {
    /// What the scales make of the map from the one on whose cells are not larger than the forms that stay.
    fn residual(
        &self,
        heights: &Grid<f32>,
        _: Option<&LineMap>,
        size: f64,
        how: &DetailUse,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Option<Residual>> {
        if self.scales.len() < 2 || heights.rows().min(heights.cols()) < SMALLEST_MAP {
            return Ok(None);
        }
        let start = self.start(size);
        let (r, c) = self.size_of(heights.shape(), start);
        let shrunk_map = resample(heights, r, c).map(|z| 2.0 * z - 1.0);
        let ratio = if how.match_relief { self.relief(&shrunk_map, start) } else { 1.0 };
        let base = shrunk_map.as_slice().iter().map(|z| f64::from(*z)).sum::<f64>() / shrunk_map.len() as f64;
        let base = if how.match_relief { base as f32 } else { 0.0 };
        let mut detailed = shrunk_map.map(|z| (z - base) * ratio);
        let mut smooth = detailed.clone();
        let mut likely = (how.likely < 1.0).then(|| detailed.clone());
        for scale in start + 1..self.scales.len() {
            let (r, c) = self.size_of(heights.shape(), scale);
            detailed = self.pass_until(scale, &resample(&detailed, r, c), how.noise, seed, stop)?;
            likely = likely
                .map(|map| self.pass_until(scale, &resample(&map, r, c), 0.0, seed, stop))
                .transpose()?;
            smooth = resample(&smooth, r, c);
        }
        let likely = likely.unwrap_or_else(|| smooth.clone());
        let values = smooth.as_slice().iter().zip(likely.as_slice());
        for (d, (s, l)) in detailed.as_mut_slice().iter_mut().zip(values) {
            let already = how.likely * s + (1.0 - how.likely) * l;
            *d = 0.5 * (*d - already) / ratio;
        }
        Ok(Some(Residual { smooth: smooth.map(|s| 0.5 * (s / ratio + base + 1.0)), added: detailed }))
    }

    fn gain(&self) -> f32 {
        self.record.gain
    }

    /// Every scale from the coarsest on, whose noise is mixed from a fresh one and that which rebuilds the exemplar.
    fn sample(&self, what: &SampleUse, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        what.validate()?;
        let size = |scale: usize| shrunk((what.rows, what.cols), self.cell(scale).recip());
        let (first, (r, c)) = (&self.scales[0], size(0));
        let mut field = self.noise(0, r, c, seed);
        let layout = match first.inputs.view {
            // The frame of zeros is no layout: inside a larger map it would be a ring.
            View::Heights => self.layout_noise().crop(Window::new(
                Cell::new(REACH, REACH),
                self.sizes[0].0,
                self.sizes[0].1,
            ))?,
            View::Slopes => self.layout_noise(),
        };
        what.mix(&mut field, &layout);
        let mut map = first.apply(&Grid::filled(r, c, 0.0), Some(&field), 1.0);
        for scale in 1..self.scales.len() {
            let (r, c) = size(scale);
            map = self.pass_until(scale, &resample(&map, r, c), 1.0, seed, stop)?;
        }
        Ok(map.map(|z| 0.5 * (z + 1.0)))
    }
}

/// What a training was and how well the exemplar is rebuilt from its fixed noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DetailRecord {
    /// Seconds of the training.
    pub(crate) seconds: f64,
    /// Steps of every scale, the coarsest first.
    pub(crate) steps: Vec<usize>,
    /// PSNR of the rebuilt exemplar, decibels, range 1.
    pub(crate) psnr: f64,
    /// Share of the trained detail that suits the exemplar best; 1 before [`Detail::calibrate`].
    pub(crate) gain: f32,
}

/// What a style file says of its detail model beside the weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DetailInfo {
    /// The settings of the training.
    pub(crate) config: DetailConfig,
    /// (rows, columns) of the scales.
    pub(crate) sizes: Vec<(usize, usize)>,
    /// Seed of the reconstruction's noise.
    pub(crate) fixed_noise: Seed,
    /// Every scale.
    pub(crate) scales: Vec<ScaleInfo>,
    /// The training.
    pub(crate) record: DetailRecord,
}

impl Detail {
    /// The description and the named weights, to be stored in any container.
    #[must_use]
    pub(crate) fn parts(&self) -> (DetailInfo, Vec<(String, Vec<f32>)>) {
        let info = DetailInfo {
            config: self.config.clone(),
            sizes: self.sizes.clone(),
            fixed_noise: self.fixed_noise,
            scales: self.scales.iter().map(Scale::info).collect(),
            record: self.record.clone(),
        };
        let name = |i: usize| format!("scale.{i}");
        let weights = self.scales.iter().enumerate().map(|(i, s)| (name(i), s.net.values.clone()));
        (info, weights.collect())
    }

    /// The model that [`parts`](Self::parts) came from; `weights` gives the tensor of a name.
    ///
    /// # Errors
    /// When the description contradicts itself or a tensor is missing or has another length.
    pub(crate) fn from_parts(
        info: DetailInfo,
        mut weights: impl FnMut(&str) -> Result<Vec<f32>>,
    ) -> Result<Self> {
        info.config.validate()?;
        if !(0.0..=10.0).contains(&info.record.gain) {
            return Err(Error::value("gain of the detail", info.record.gain, "allowed: 0 to 10"));
        }
        let last =
            *info.sizes.last().ok_or_else(|| Error::value("scales of the detail", 0, "at least one"))?;
        if info.config.pyramid(last.0, last.1) != info.sizes || info.scales.len() != info.sizes.len() {
            let allowed = "they must be those of the configuration";
            return Err(Error::value("scales of the detail", format!("{:?}", info.sizes), allowed));
        }
        let mut detail = Self::empty(info.config.clone(), info.sizes.clone());
        (detail.fixed_noise, detail.record) = (info.fixed_noise, info.record);
        for (i, scale) in info.scales.iter().enumerate() {
            let values = weights(&format!("scale.{i}"))?;
            detail.scales.push(Scale::from_info(&info.config, i, scale, values)?);
        }
        Ok(detail)
    }
}
