//! A trained detail model and its uses: detail for a given map, and terrain from noise.

use super::calibration::best_gain;
use super::config::{DetailConfig, shrunk};
use super::scale::Scale;
use super::train::{FIXED_NOISE, noise_field};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Grid, Mask, distance};
use crate::interpolation::{Correction, CorrectionKind};
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::sketch::LineMap;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// How detail is added to a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DetailUse {
    /// Forms smaller than this many cells are the model's, larger ones the map's: the scale where detail begins. Absent: the
    /// mean distance of a cell to the nearest line, which is about the size of what lines leave open; 2 without lines.
    pub size: Option<f64>,
    /// How much of it: 0 none, 1 the exemplar's own, more is rougher.
    pub strength: f32,
    /// Share of the map's own small forms that stay; 0 replaces them (SinGAN's own use), 1 adds to them.
    pub keep: f32,
    /// Amplitude of the noise: 0 gives the one most likely answer, 1 as trained.
    pub noise: f32,
    /// Share of the model's most likely answer, the one without noise, that is added. 0 leaves what is likely to the map, and
    /// adds only what a draw has beside it; 1 is SinGAN's own use.
    pub likely: f32,
    /// Whether the map's slopes at the first scale are brought to those of the exemplar's coarse twins before, and back after: detail then fits the
    /// map's relief whatever its unit. Without it heights are taken in the exemplar's range.
    pub match_relief: bool,
    /// Whether the strength counts from the one that suits the exemplar best ([`Detail::calibrate`]), or from what was trained.
    pub calibrated: bool,
}

/// Maps with a side shorter than this stay as they are.
const SMALLEST_MAP: usize = 4;
/// Where detail begins without lines, cells.
const SIZE_WITHOUT_LINES: f64 = 2.0;
/// Width of the ramp inside a mask's edge, cells: no step where detail ends.
const MASK_RAMP: f32 = 4.0;

impl Default for DetailUse {
    fn default() -> Self {
        Self {
            size: None,
            strength: 1.0,
            keep: 1.0,
            noise: 1.0,
            likely: 0.0,
            match_relief: true,
            calibrated: true,
        }
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
        self.size.map_or(Ok(()), |size| number("size", size, 1.0, 1e6))?;
        number("strength", f64::from(self.strength), 0.0, 10.0)?;
        number("keep", f64::from(self.keep), 0.0, 1.0)?;
        number("likely", f64::from(self.likely), 0.0, 1.0)?;
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
    pub(super) record: DetailRecord,
}

impl Detail {
    pub(super) fn empty(config: DetailConfig, sizes: Vec<(usize, usize)>) -> Self {
        let record = DetailRecord { seconds: 0.0, steps: Vec::new(), psnr: 0.0, gain: 1.0 };
        Self { config, sizes, scales: Vec::new(), fixed_noise: Seed::default(), record }
    }

    /// What the training was.
    #[must_use]
    pub const fn record(&self) -> &DetailRecord {
        &self.record
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
        self.rebuilt().map(|z| 0.5 * (z + 1.0))
    }

    /// The same through the scales that are there, -1 to 1.
    pub(super) fn rebuilt(&self) -> Grid<f32> {
        let (rows, cols) = self.sizes[0];
        let first = &self.scales[0];
        let field = noise_field(first.lens, rows, cols, &mut self.fixed_noise.stream(FIXED_NOISE));
        let mut map = first.apply(&Grid::filled(rows, cols, 0.0), Some(&field), 1.0);
        for (scale, &(rows, cols)) in self.scales.iter().zip(&self.sizes).skip(1) {
            map = scale.apply(&resample(&map, rows, cols), None, 0.0);
        }
        map
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

    /// Adds detail to `heights` (the exemplar's unit interval is 0 to 1; any finite heights are allowed). With `lines`, the
    /// answer passes through them to the bit. Where `mask` is given and false the map stays as it is; inside its edge detail
    /// fades in over 4 cells.
    ///
    /// # Errors
    /// When a setting is out of range, a height is not finite, lines or mask have another shape.
    pub fn add(
        &self,
        heights: &Grid<f32>,
        lines: Option<&LineMap>,
        mask: Option<&Mask>,
        how: &DetailUse,
        seed: Seed,
    ) -> Result<Grid<f32>> {
        how.validate()?;
        let shape = heights.shape();
        let lines = lines.filter(|lines| lines.line_count() > 0);
        for (name, other) in
            [("mask of detail", mask.map(Grid::shape)), ("lines of detail", lines.map(|l| l.mask().shape()))]
        {
            if let Some(other) = other.filter(|other| *other != shape) {
                return Err(Error::value(name, format!("{other:?}"), format!("the map is {shape:?}")));
            }
        }
        if let Some((cell, z)) = heights.cells().find(|(_, z)| !z.is_finite()) {
            let name = format!("height at row {}, column {}", cell.row, cell.col);
            return Err(Error::value(name, z, "allowed: finite"));
        }
        let correction = lines.map(|l| Correction::new(CorrectionKind::NaturalNeighbour, l)).transpose()?;
        let corrected = |map: Grid<f32>| match &correction {
            Some(correction) => correction.apply(&map),
            None => Ok(map),
        };
        if self.scales.len() < 2 || shape.0.min(shape.1) < SMALLEST_MAP {
            return corrected(heights.clone());
        }
        let start = self.start(how.size.unwrap_or_else(|| lines.map_or(SIZE_WITHOUT_LINES, gap)));
        let (smooth, residual) = self.residual(heights, start, how, seed);
        let mut ground = heights.clone();
        for (z, smooth) in ground.as_mut_slice().iter_mut().zip(smooth.as_slice()) {
            *z = how.keep * *z + (1.0 - how.keep) * smooth;
        }
        let ground = corrected(ground)?;
        // The correction is affine: what it makes of a residual is the difference of two corrected maps.
        let residual = combined(&corrected(combined(&ground, 1.0, &residual, 1.0))?, 1.0, &ground, -1.0);
        let gain = how.strength * if how.calibrated { self.record.gain } else { 1.0 };
        let weight = mask.map(ramp);
        let mut out = heights.clone();
        for (i, z) in out.as_mut_slice().iter_mut().enumerate() {
            let rough = ground.as_slice()[i] + gain * residual.as_slice()[i];
            match weight.as_ref().map(|w| w.as_slice()[i]) {
                // To the bit: nothing is added to what stays, and lines stay exact.
                Some(w) if w < 1.0 => *z += w * (rough - *z),
                _ => *z = rough,
            }
        }
        Ok(out)
    }

    /// What the scales after `start` make of `heights` without and with their networks: the smooth map, and what is added to it.
    fn residual(
        &self,
        heights: &Grid<f32>,
        start: usize,
        how: &DetailUse,
        seed: Seed,
    ) -> (Grid<f32>, Grid<f32>) {
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
            detailed = self.pass(scale, &resample(&detailed, r, c), how.noise, seed);
            likely = likely.map(|map| self.pass(scale, &resample(&map, r, c), 0.0, seed));
            smooth = resample(&smooth, r, c);
        }
        let likely = likely.unwrap_or_else(|| smooth.clone());
        let values = smooth.as_slice().iter().zip(likely.as_slice());
        for (d, (s, l)) in detailed.as_mut_slice().iter_mut().zip(values) {
            let already = how.likely * s + (1.0 - how.likely) * l;
            *d = 0.5 * (*d - already) / ratio;
        }
        (smooth.map(|s| 0.5 * (s / ratio + base + 1.0)), detailed)
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
    /// As [`add`](Self::add), and when shapes differ or the exemplar is level.
    pub fn calibrate(&mut self, twin: &Grid<f32>, lines: &LineMap, truth: &Grid<f32>) -> Result<()> {
        let bare = DetailUse { calibrated: false, ..DetailUse::default() };
        let rough = self.add(twin, Some(lines), None, &bare, self.fixed_noise.derive("calibration"))?;
        let smooth =
            self.add(twin, Some(lines), None, &DetailUse { strength: 0.0, ..bare }, self.fixed_noise)?;
        self.record.gain = best_gain(&smooth, &combined(&rough, 1.0, &smooth, -1.0), truth)?;
        Ok(())
    }

    /// What brings the map's slopes at a scale to those of the exemplar's coarse twins; 1 for level ground.
    fn relief(&self, map: &Grid<f32>, scale: usize) -> f32 {
        let own = mean_square_slope(map).sqrt() as f32;
        let twins = self.scales[scale].residual.slope_of_twins;
        if own > 0.0 { (twins / own).clamp(1e-3, 1e3) } else { 1.0 }
    }
}

/// a x + b y.
fn combined(x: &Grid<f32>, a: f32, y: &Grid<f32>, b: f32) -> Grid<f32> {
    let mut sum = x.clone();
    for (x, y) in sum.as_mut_slice().iter_mut().zip(y.as_slice()) {
        *x = a * *x + b * y;
    }
    sum
}

/// Mean distance of a cell to the nearest line, cells: the size of what lines leave open.
fn gap(lines: &LineMap) -> f64 {
    let squared = distance::squared(&lines.mask());
    let sum: f64 = squared.as_slice().iter().map(|d| f64::from(*d).sqrt()).sum();
    (sum / squared.len() as f64).max(1.0)
}

/// 0 where the mask is false, rising to 1 over [`MASK_RAMP`] cells inside it.
fn ramp(mask: &Mask) -> Grid<f32> {
    let outside = distance::squared(&mask.map(|inside| !inside));
    outside.map(|&d| if d == distance::NOWHERE { 1.0 } else { ((d as f32).sqrt() / MASK_RAMP).min(1.0) })
}

/// What a training was and how well the exemplar is rebuilt from its fixed noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetailRecord {
    /// Seconds of the training.
    pub seconds: f64,
    /// Steps of every scale, the coarsest first.
    pub steps: Vec<usize>,
    /// PSNR of the rebuilt exemplar, decibels, range 1.
    pub psnr: f64,
    /// Share of the trained detail that suits the exemplar best; 1 before [`Detail::calibrate`].
    pub gain: f32,
}

/// What a scale is beside its weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleInfo {
    /// Amplitude of the noise.
    pub noise: f32,
    /// Height of an output of 1.
    pub output: f32,
    /// Root mean square slope of the exemplar.
    pub slope: f32,
    /// The same of its coarse twins.
    pub slope_of_twins: f32,
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
    /// Every scale.
    pub scales: Vec<ScaleInfo>,
    /// The training.
    pub record: DetailRecord,
}

impl Detail {
    /// The description and the named weights, to be stored in any container.
    #[must_use]
    pub fn parts(&self) -> (DetailInfo, Vec<(String, Vec<f32>)>) {
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
    pub fn from_parts(info: DetailInfo, mut weights: impl FnMut(&str) -> Result<Vec<f32>>) -> Result<Self> {
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
