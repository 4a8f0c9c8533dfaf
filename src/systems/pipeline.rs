//! A coarse system and the detail model together: what a style file holds, and how terrain is made with it.
//!
//! Lines -> coarse terrain (`region_gnn`) -> detail (`singan`) -> correction towards the lines -> terrain. The detail model rides
//! in the style as named tensors and one description that the coarse system does not look into.

use super::region_gnn::Style;
use super::region_gnn::style::Source;
use super::singan::{self, Detail, DetailConfig, DetailInfo, DetailUse, StepReport};
use super::task::SketchToTerrain;
use crate::dem::Normalization;
use crate::error::{Error, Result};
use crate::extract;
use crate::grid::resample::resample;
use crate::grid::{Grid, Mask};
use crate::interpolation::{Correction, CorrectionKind, NaturalNeighbours, harmonic};
use crate::seed::Seed;
use crate::sketch::LineMap;
use std::sync::Arc;

/// Learns the detail of the style's own exemplar and puts it into the style.
///
/// The coarse twins of the training are natural-neighbour surfaces through the exemplar's extracted lines, in the variants that
/// the coarse model was trained with. Voids of the exemplar are filled harmonically.
///
/// # Errors
/// When a setting is out of range, the exemplar is too small, or the training diverges.
pub fn learn_detail(
    style: &mut Style,
    source: &Source,
    config: &DetailConfig,
    seed: Seed,
    progress: impl FnMut(&StepReport),
) -> Result<()> {
    let heights = style.info.normalization.normalize(&source.dem);
    let valid = source.dem.valid();
    let settings = &style.info.config;
    let variants =
        extract::variants(&heights, valid, &settings.extraction, settings.model.extractions, seed)?;
    let twins: Vec<Grid<f32>> =
        variants.iter().filter(|lines| lines.line_count() > 0).map(natural_surface).collect::<Result<_>>()?;
    let filled = if valid.as_slice().contains(&false) {
        harmonic(valid, &heights.map(|z| f64::from(*z)))?.map(|z| *z as f32)
    } else {
        heights
    };
    let detail = singan::train(&filled, &twins, config, seed.derive("detail"), progress)?;
    let (info, weights) = detail.parts();
    let info = serde_json::to_value(&info)
        .map_err(|e| Error::value("description of the detail", e, "it must be plain data"))?;
    style.info.detail = Some(info);
    style.detail_tensors = weights;
    Ok(())
}

/// The natural-neighbour surface through lines.
fn natural_surface(lines: &LineMap) -> Result<Grid<f32>> {
    let mask = lines.mask();
    let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
    let values: Vec<f64> = on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
    Ok(NaturalNeighbours::new(&mask)?.interpolate(&values).map(|z| *z as f32))
}

/// The detail model of a style; none when it was trained without.
///
/// # Errors
/// When the style's description and tensors contradict each other.
pub fn detail_of(style: &Style) -> Result<Option<Detail>> {
    let Some(info) = &style.info.detail else { return Ok(None) };
    let info: DetailInfo = serde_json::from_value(info.clone())
        .map_err(|e| Error::value("description of the detail", e, "allowed: what `train` writes"))?;
    let tensor = |name: &str| {
        let found = style.detail_tensors.iter().find(|(n, _)| n == name);
        found.map(|(_, values)| values.clone()).ok_or_else(|| {
            Error::value(format!("tensor detail.{name}"), "missing", "a style with detail has it")
        })
    };
    Detail::from_parts(info, tensor).map(Some)
}

/// [`detail_of`], where a style without detail is a mistake.
///
/// # Errors
/// As there, and when there is none.
pub fn needed_detail(style: &Style) -> Result<Detail> {
    detail_of(style)?.ok_or_else(|| {
        Error::value("detail of the style", "none", "train the style again without --no-detail")
    })
}

/// A coarse system with detail, corrected towards the lines at the end.
pub struct Detailed {
    /// Makes the coarse terrain.
    pub coarse: Box<dyn SketchToTerrain>,
    /// Adds the detail.
    pub detail: Arc<Detail>,
    /// How.
    pub how: DetailUse,
}

impl SketchToTerrain for Detailed {
    fn generate(&self, lines: &LineMap, seed: Seed) -> Result<Grid<f32>> {
        let coarse = self.coarse.generate(lines, seed)?;
        let detailed = self.detail.add(&coarse, None, &self.how, seed.derive("detail"))?;
        Correction::new(CorrectionKind::NaturalNeighbour, lines)?.apply(&detailed)
    }
}

/// Adds detail to terrain in metres; with `lines` in metres, their heights are kept. Where `mask` is false nothing changes.
///
/// # Errors
/// When a setting is out of range or shapes differ.
pub fn add_detail(
    terrain: &Grid<f32>,
    detail: &Detail,
    range: Normalization,
    lines: Option<&LineMap>,
    mask: Option<&Mask>,
    how: &DetailUse,
    seed: Seed,
) -> Result<Grid<f32>> {
    let unit = terrain.map(|&z| range.to_unit(f64::from(z)) as f32);
    let detailed = detail.add(&unit, mask, how, seed.derive("detail"))?;
    let metres = detailed.map(|&z| range.to_metres(f64::from(z)) as f32);
    match lines {
        Some(lines) => Correction::new(CorrectionKind::NaturalNeighbour, lines)?.apply(&metres),
        None => Ok(metres),
    }
}

/// Terrain `factor` times as fine in each direction, with the style's detail below its own cells.
///
/// # Errors
/// When a setting is out of range or the terrain has voids that were not filled.
pub fn amplify(
    terrain: &Grid<f32>,
    detail: &Detail,
    range: Normalization,
    factor: usize,
    how: &DetailUse,
    seed: Seed,
) -> Result<Grid<f32>> {
    let (rows, cols) = terrain.shape();
    let large = resample(terrain, rows * factor, cols * factor);
    let how = DetailUse { size: factor as f64, keep: 0.0, ..how.clone() };
    add_detail(&large, detail, range, None, None, &how, seed)
}
