//! A coarse system and the detail model together: what a style file holds, and how terrain is made with it.
//!
//! Lines -> coarse terrain (`region_gnn`) -> detail (`singan` or `gpnn`) -> correction towards the lines -> terrain. The detail
//! model rides in the style as named tensors and one description that the coarse system does not look into.

use super::gpnn::{PatchDetail, PatchInfo};
use super::region_gnn::style::{Source, StyleConfig, learn_with};
use super::region_gnn::{Control, EpochReport, Style, needs_correction};
use super::singan::{self, Detail, DetailConfig, DetailInfo};
use super::task::{DetailModel, DetailUse, Finishing, Residual, SampleUse, SketchToTerrain};
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract;
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Mask};
use crate::interpolation::{NaturalNeighbours, harmonic};
use crate::seed::Seed;
use crate::sketch::LineMap;
use serde_json::Value;
use std::sync::Arc;
use std::time::Duration;

/// Smallest side of half an exemplar that a coarse model is trained on.
const SMALLEST_HALF: usize = 48;
/// Width of the seam in which one half's answer becomes the other's, cells.
const SEAM: f32 = 8.0;
/// Most cells that [`amplify`] makes: 32,768 by 32,768.
const MOST_CELLS: usize = 1 << 30;

/// Learns the detail of the style's own exemplar and puts it into the style.
///
/// The coarse twins of the training are natural-neighbour surfaces through the exemplar's extracted lines, in the variants that
/// the coarse model was trained with. Voids of the exemplar are filled harmonically. Its strength is the one that suits
/// `unseen` ([`unseen_surface`]), or the first twin where there is none.
///
/// # Errors
/// When a setting is out of range, the exemplar is too small, the training diverges, or a checkpoint does not fit.
pub fn learn_detail(
    style: &mut Style,
    source: &Source,
    unseen: Option<&Grid<f32>>,
    config: &DetailConfig,
    seed: Seed,
    control: singan::Control<'_>,
) -> Result<()> {
    let Twins { truth, twins } = Twins::of(style, source, style.info.config.model.extractions, seed)?;
    let surfaces: Vec<Grid<f32>> = twins.iter().map(|(surface, _)| surface.clone()).collect();
    let mut detail = singan::train_with(&truth, &surfaces, config, seed.derive("detail"), control)?;
    let (surface, lines) = &twins[0];
    detail.calibrate(unseen.unwrap_or(surface), lines, &truth)?;
    let (info, weights) = detail.parts();
    put(style, serde_json::to_value(&info), weights)
}

/// Takes the patches of the style's own exemplar as its detail, and puts them into the style. Their strength is the one that
/// suits `unseen` ([`unseen_surface`]), or the natural-neighbour surface where there is none.
///
/// # Errors
/// When the exemplar is too small or too large.
pub fn take_patches(
    style: &mut Style,
    source: &Source,
    unseen: Option<&Grid<f32>>,
    seed: Seed,
) -> Result<()> {
    let Twins { truth, mut twins } = Twins::of(style, source, 1, seed)?;
    let (surface, lines) = twins.swap_remove(0);
    let mut detail = PatchDetail::new(truth, surface.clone(), &lines)?;
    detail.calibrate(unseen.unwrap_or(&surface), &lines, seed.derive("detail"))?;
    let (info, tensors) = detail.parts();
    put(style, serde_json::to_value(&info), tensors)
}

fn put(style: &mut Style, info: serde_json::Result<Value>, tensors: Vec<(String, Vec<f32>)>) -> Result<()> {
    let plain = |e| Error::value("description of the detail", e, "it must be plain data");
    style.info.detail = Some(info.map_err(plain)?);
    style.detail_tensors = tensors;
    Ok(())
}

/// The lines of an exemplar in `count` variants of the extraction, those with lines: at least one.
fn drawn(style: &Style, source: &Source, count: usize, seed: Seed) -> Result<Vec<LineMap>> {
    let heights = style.info.normalization.normalize(&source.dem);
    let config = &style.info.config.extraction;
    let mut variants = extract::variants(&heights, source.dem.valid(), config, count, seed)?;
    variants.retain(|lines| lines.line_count() > 0);
    if variants.is_empty() {
        let allowed = "detail is learned beside the exemplar's lines";
        return Err(Error::value("number of line cells", 0, allowed));
    }
    Ok(variants)
}

/// An exemplar and its coarse twins.
struct Twins {
    /// Unit interval, voids filled.
    truth: Grid<f32>,
    /// Surfaces and the lines that they pass through; at least one.
    twins: Vec<(Grid<f32>, LineMap)>,
}

impl Twins {
    /// The twins in `count` variants of the extraction.
    fn of(style: &Style, source: &Source, count: usize, seed: Seed) -> Result<Self> {
        let variants = drawn(style, source, count, seed)?.into_iter();
        let twins = variants.map(|lines| Ok((natural_surface(&lines)?, lines))).collect::<Result<_>>()?;
        let (heights, valid) = (style.info.normalization.normalize(&source.dem), source.dem.valid());
        let truth = if valid.as_slice().contains(&false) {
            harmonic(valid, &heights.map(|z| f64::from(*z)))?.map(|z| *z as f32)
        } else {
            heights
        };
        Ok(Self { truth, twins })
    }
}

/// Whether `style` is what a training of `source` with this seed and configuration has made, so that its detail can be
/// learned in a later run.
///
/// # Errors
/// Says what differs.
pub fn continues(style: &Style, source: &Source, config: &StyleConfig, seed: Seed) -> Result<()> {
    let allowed = "to resume, or to take its coarse model, exemplar, seed and configuration must be the same";
    if style.info.exemplar.sha256 != source.info.sha256 {
        return Err(Error::value("exemplar of the style", &style.info.exemplar.name, allowed));
    }
    if style.info.seed != seed {
        return Err(Error::value("seed of the style", style.info.seed.0, allowed));
    }
    if *config != style.info.config {
        return Err(Error::value("configuration of the style", "another one", allowed));
    }
    Ok(())
}

/// Whether [`unseen_surface`] is asked of a style of this configuration with an exemplar of `rows` x `cols` cells.
#[must_use]
pub fn has_unseen(config: &StyleConfig, rows: usize, cols: usize) -> bool {
    needs_correction(&config.model) && rows.min(cols / 2) >= SMALLEST_HALF
}

/// What a coarse model like the style's makes of the exemplar's lines where it has not seen the exemplar, in the unit interval:
/// two models, one a half of the exemplar, are trained with half the epochs (or together for `budget`), and each answers in the
/// other half. `progress` gets the share that is done. None where there is too little to learn from, and for a coarse model that
/// does not pass through its lines (`paper`).
///
/// # Errors
/// When the exemplar has no lines.
pub fn unseen_surface(
    style: &Style,
    source: &Source,
    seed: Seed,
    budget: Option<Duration>,
    progress: &mut dyn FnMut(f64),
) -> Result<Option<Grid<f32>>> {
    let (rows, cols) = source.dem.shape();
    if !has_unseen(&style.info.config, rows, cols) {
        return Ok(None);
    }
    let middle = cols / 2;
    let lines = drawn(style, source, 1, seed)?.swap_remove(0);
    let seed = seed.derive("held out");
    let mut config = style.info.config.clone();
    config.model.epochs = (config.model.epochs / 2).max(1);
    let range = style.info.normalization;
    let metres = lines.map_heights(|z| range.to_metres(f64::from(z)) as f32);
    let mut answer = |half: usize, first: usize, width: usize| -> Result<Option<Grid<f32>>> {
        let budget = budget.map(|both| both / 2);
        let mut told = |report: &EpochReport| {
            let done = match budget {
                Some(budget) => report.seconds / budget.as_secs_f64(),
                None => report.epoch as f64 / config.model.epochs as f64,
            };
            progress(0.5 * (half as f64 + done));
        };
        let control = Control { progress: &mut told, budget, checkpoints: None };
        // Half of an exemplar may be void, level or without a line.
        let learned = Source::new(&source.info.name, &source.dem, Cell::new(0, first), rows, width)
            .and_then(|half| learn_with(&half, &config, seed, control));
        let Ok(model) = learned else { return Ok(None) };
        let heights = model.generate(&metres, Some(range), seed)?;
        Ok(Some(heights.map(|z| range.to_unit(f64::from(*z)) as f32)))
    };
    let Some(by_west) = answer(0, 0, middle)? else { return Ok(None) };
    let Some(mut whole) = answer(1, middle, cols - middle)? else { return Ok(None) };
    for (cell, z) in by_west.cells() {
        let share = (0.5 + (cell.col as f32 - middle as f32) / SEAM).clamp(0.0, 1.0);
        whole[cell] += share * (z - whole[cell]);
    }
    Ok(Some(whole))
}

/// The natural-neighbour surface through lines.
fn natural_surface(lines: &LineMap) -> Result<Grid<f32>> {
    let mask = lines.mask();
    let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
    let values: Vec<f64> = on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
    Ok(NaturalNeighbours::new(&mask)?.interpolate(&values).map(|z| *z as f32))
}

/// The detail model of a style, of either kind.
#[derive(Clone, Debug)]
pub enum StyleDetail {
    /// Trained generators (SinGAN).
    Generators(Detail),
    /// The exemplar's patches (GPNN).
    Patches(PatchDetail),
}

impl StyleDetail {
    fn model(&self) -> &dyn DetailModel {
        match self {
            Self::Generators(detail) => detail,
            Self::Patches(detail) => detail,
        }
    }
}

impl DetailModel for StyleDetail {
    fn residual(
        &self,
        heights: &Grid<f32>,
        lines: Option<&LineMap>,
        size: f64,
        how: &DetailUse,
        seed: Seed,
    ) -> Result<Option<Residual>> {
        self.model().residual(heights, lines, size, how, seed)
    }

    fn gain(&self) -> f32 {
        self.model().gain()
    }

    fn sample(&self, what: &SampleUse, seed: Seed) -> Result<Grid<f32>> {
        self.model().sample(what, seed)
    }
}

/// The detail model of a style; none when it was trained without.
///
/// # Errors
/// When the style's description and tensors contradict each other.
pub fn detail_of(style: &Style) -> Result<Option<StyleDetail>> {
    let Some(info) = &style.info.detail else { return Ok(None) };
    let described =
        |e: serde_json::Error| Error::value("description of the detail", e, "allowed: what `train` writes");
    let tensor = |name: &str| {
        let found = style.detail_tensors.iter().find(|(n, _)| n == name);
        found.map(|(_, values)| values.clone()).ok_or_else(|| {
            Error::value(format!("tensor detail.{name}"), "missing", "a style with detail has it")
        })
    };
    // Only patches name their model: generators came first.
    if info.get("model").is_some() {
        let info: PatchInfo = serde_json::from_value(info.clone()).map_err(described)?;
        return PatchDetail::from_parts(&info, tensor).map(StyleDetail::Patches).map(Some);
    }
    let info: DetailInfo = serde_json::from_value(info.clone()).map_err(described)?;
    Detail::from_parts(info, tensor).map(StyleDetail::Generators).map(Some)
}

/// [`detail_of`], where a style without detail is a mistake.
///
/// # Errors
/// As there, and when there is none.
pub fn needed_detail(style: &Style) -> Result<StyleDetail> {
    detail_of(style)?.ok_or_else(no_detail)
}

/// A style without detail where one is needed.
#[must_use]
pub fn no_detail() -> Error {
    Error::value("detail of the style", "none", "train the style again without --no-detail")
}

/// A coarse system with detail, corrected towards the lines at the end.
#[must_use]
pub fn detailed(start: Arc<dyn SketchToTerrain>, detail: Arc<StyleDetail>, how: DetailUse) -> Finishing {
    let finish = move |coarse: &Grid<f32>, lines: &LineMap, seed: Seed| {
        detail.add(coarse, Some(lines), None, &how, seed.derive("detail"))
    };
    Finishing { start, finish: Box::new(finish) }
}

/// Adds detail to terrain in metres; with `lines` in metres, their heights are kept. Where `mask` is false nothing changes.
///
/// # Errors
/// When a setting is out of range or shapes differ.
pub fn add_detail(
    terrain: &Grid<f32>,
    detail: &dyn DetailModel,
    range: Normalization,
    lines: Option<&LineMap>,
    mask: Option<&Mask>,
    how: &DetailUse,
    seed: Seed,
) -> Result<Grid<f32>> {
    let to_unit = |z: f32| range.to_unit(f64::from(z)) as f32;
    let unit = terrain.map(|&z| to_unit(z));
    let unit_lines = lines.map(|lines| lines.map_heights(to_unit));
    let detailed = detail.add(&unit, unit_lines.as_ref(), mask, how, seed.derive("detail"))?;
    let mut metres = detailed.map(|&z| range.to_metres(f64::from(z)) as f32);
    // What stays, stays to the bit: there and back again rounds.
    for (i, z) in metres.as_mut_slice().iter_mut().enumerate() {
        if mask.is_some_and(|mask| !mask.as_slice()[i]) {
            *z = terrain.as_slice()[i];
        }
    }
    if let Some(lines) = lines {
        for (cell, height) in lines.heights().cells() {
            if lines.kinds()[cell].is_some() && mask.is_none_or(|mask| mask[cell]) {
                metres[cell] = *height;
            }
        }
    }
    Ok(metres)
}

/// Terrain `factor` times as fine in each direction, with the style's detail below its own cells. Where it has voids, so has
/// the answer; they are bridged harmonically meanwhile.
///
/// # Errors
/// When a setting is out of range, there are more than 2^30 cells to make, or more than the detail model can.
pub fn amplify(
    dem: &Dem,
    detail: &dyn DetailModel,
    range: Normalization,
    factor: usize,
    how: &DetailUse,
    seed: Seed,
) -> Result<Dem> {
    let (rows, cols) = dem.shape();
    let cells = (rows * cols).saturating_mul(factor * factor);
    if !(2..=16).contains(&factor) || cells > MOST_CELLS {
        let found = format!("{factor} for {rows}x{cols} cells");
        let allowed = format!("allowed: 2 to 16, and at most {MOST_CELLS} cells in the end");
        return Err(Error::value("factor", found, allowed));
    }
    let valid = dem.valid();
    let known = if dem.void_count() > 0 {
        harmonic(valid, &dem.heights().map(|z| f64::from(*z)))?.map(|z| *z as f32)
    } else {
        dem.heights().clone()
    };
    let large = resample(&known, rows * factor, cols * factor);
    let how = DetailUse { size: Some(factor as f64), keep: 0.0, ..how.clone() };
    let heights = add_detail(&large, detail, range, None, None, &how, seed)?;
    let valid =
        Mask::from_fn(rows * factor, cols * factor, |c| valid[Cell::new(c.row / factor, c.col / factor)]);
    let cell = dem.cell_size();
    let cell = CellSize::new(cell.x() / factor as f64, cell.y() / factor as f64)?;
    let georeference = dem.georeference().map(|g| g.on_raster((rows, cols), (rows * factor, cols * factor)));
    Ok(Dem::with_voids(heights, valid, cell)?.at(georeference))
}
