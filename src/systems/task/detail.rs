//! Detail for a given map: what every model of small forms shares, whatever the forms come from.
//!
//! A model says what it would add ([`DetailModel::residual`]); from there on all are alike: the residual is corrected towards
//! the lines, masked, and added with a strength that is counted from the one that suits the exemplar.

use super::SampleUse;
use super::calibration::best_gain;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask, distance};
use crate::interpolation::{Correction, CorrectionKind};
use crate::seed::Seed;
use crate::sketch::LineMap;
use serde::{Deserialize, Serialize};

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
    /// Amplitude of the noise: 0 gives the one most likely answer, 1 as trained. For patches: every seed leaves out the share
    /// noise / (1 + noise) of the exemplar's. Sparse sums have one answer, the same for all seeds.
    pub noise: f32,
    /// Share of the generators' most likely answer, the one without noise, that is added. 0 leaves what is likely to the map,
    /// and adds only what a draw has beside it; 1 is SinGAN's own use. Patches have one answer, which is added whole.
    pub likely: f32,
    /// Whether the map's slopes at the first scale are brought to those of the exemplar's coarse twins before, and back after:
    /// detail then fits the map's relief whatever its unit. Without it heights are taken in the exemplar's range.
    pub match_relief: bool,
    /// Whether the strength counts from the one that suits the exemplar best (the model's [`gain`](DetailModel::gain)), or from what was trained.
    pub calibrated: bool,
}

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

/// What a model makes of a map, before lines, mask and strength.
#[derive(Clone, Debug)]
pub struct Residual {
    /// The map without the forms that are the model's. (rows, columns) of the map, in its unit.
    pub smooth: Grid<f32>,
    /// What the model adds. (rows, columns) of the map, in its unit.
    pub added: Grid<f32>,
}

/// A model of an exemplar's small forms.
pub trait DetailModel: Send + Sync {
    /// What the model makes of `heights`; none where it has nothing to add, as on a map of a few cells. Forms smaller than
    /// `size` cells are the model's. `lines` are those that the map passes through.
    ///
    /// # Errors
    /// When the map is too large for the model, or the work is stopped.
    fn residual(
        &self,
        heights: &Grid<f32>,
        lines: Option<&LineMap>,
        size: f64,
        how: &DetailUse,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Option<Residual>>;

    /// The share of the residual that suits the exemplar best ([`gain_of`]).
    fn gain(&self) -> f32;

    /// `heights` with `factor` times as many rows and columns and the model's forms below the old cells; none where the model adds detail to
    /// enlarged maps alone ([`add`](Self::add)).
    ///
    /// # Errors
    /// When a setting or the factor is out of range, or the work is stopped.
    fn amplified(
        &self,
        _heights: &Grid<f32>,
        _factor: usize,
        _how: &DetailUse,
        _stop: &Stop,
    ) -> Result<Option<Grid<f32>>> {
        Ok(None)
    }

    /// Terrain of the exemplar's kind from noise alone. (`what.rows`, `what.cols`), in the exemplar's unit interval (which it may
    /// leave); the same for the same seed.
    ///
    /// # Errors
    /// When a setting is out of range, there are more cells than the model can make, or the work is stopped.
    fn sample(&self, what: &SampleUse, seed: Seed, stop: &Stop) -> Result<Grid<f32>>;

    /// Adds detail to `heights` (the exemplar's unit interval is 0 to 1; any finite heights are allowed). With `lines`, the
    /// answer passes through them to the bit. Where `mask` is given and false the map stays as it is; inside its edge detail
    /// fades in over 4 cells.
    ///
    /// # Errors
    /// When a setting is out of range, a height is not finite, lines or mask have another shape, the map is too large, or the work
    /// is stopped.
    fn add(
        &self,
        heights: &Grid<f32>,
        lines: Option<&LineMap>,
        mask: Option<&Mask>,
        how: &DetailUse,
        seed: Seed,
        stop: &Stop,
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
        let size = how.size.unwrap_or_else(|| lines.map_or(SIZE_WITHOUT_LINES, gap));
        let Some(found) = self.residual(heights, lines, size, how, seed, stop)? else {
            return corrected(correction.as_ref(), heights.clone(), stop);
        };
        let (ground, residual) = tied(heights, &found, correction.as_ref(), how.keep, stop)?;
        let gain = how.strength * if how.calibrated { self.gain() } else { 1.0 };
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
}

/// The strength with which `found`, what a model makes of the exemplar's coarse twin, brings it nearest to the exemplar
/// `truth` in slopes, curvatures and spectrum. `twin` is the coarse map that `lines` of the exemplar give.
///
/// # Errors
/// When there is no line, shapes differ or the exemplar is level.
pub(crate) fn gain_of(found: &Residual, twin: &Grid<f32>, lines: &LineMap, truth: &Grid<f32>) -> Result<f32> {
    let correction = Correction::new(CorrectionKind::NaturalNeighbour, lines)?;
    let (ground, residual) = tied(twin, found, Some(&correction), DetailUse::default().keep, &Stop::new())?;
    best_gain(&ground, &residual, truth)
}

/// The map that keeps its share of small forms, and what is added to it, both corrected.
fn tied(
    heights: &Grid<f32>,
    found: &Residual,
    correction: Option<&Correction>,
    keep: f32,
    stop: &Stop,
) -> Result<(Grid<f32>, Grid<f32>)> {
    let ground = corrected(correction, combined(heights, keep, &found.smooth, 1.0 - keep), stop)?;
    // The correction is affine: what it makes of a residual is the difference of two corrected maps.
    let both = corrected(correction, combined(&ground, 1.0, &found.added, 1.0), stop)?;
    let residual = combined(&both, 1.0, &ground, -1.0);
    Ok((ground, residual))
}

fn corrected(correction: Option<&Correction>, map: Grid<f32>, stop: &Stop) -> Result<Grid<f32>> {
    match correction {
        Some(correction) => correction.apply_until(&map, stop),
        None => Ok(map),
    }
}

/// a x + b y, cell by cell.
pub(crate) fn combined(x: &Grid<f32>, a: f32, y: &Grid<f32>, b: f32) -> Grid<f32> {
    let mut sum = x.clone();
    for (x, y) in sum.as_mut_slice().iter_mut().zip(y.as_slice()) {
        *x = a * *x + b * y;
    }
    sum
}

/// Mean distance of a cell to the nearest line, cells: the size of what lines leave open.
pub(crate) fn gap(lines: &LineMap) -> f64 {
    let squared = distance::squared(&lines.mask());
    let sum: f64 = squared.as_slice().iter().map(|d| f64::from(*d).sqrt()).sum();
    (sum / squared.len() as f64).max(1.0)
}

/// 0 where the mask is false, rising to 1 over [`MASK_RAMP`] cells inside it.
fn ramp(mask: &Mask) -> Grid<f32> {
    let outside = distance::squared(&mask.map(|inside| !inside));
    outside.map(|&d| if d == distance::NOWHERE { 1.0 } else { ((d as f32).sqrt() / MASK_RAMP).min(1.0) })
}
