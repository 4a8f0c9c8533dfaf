//! What protocols share in measuring one patch, sketch and seed: the task, the sketch, the scores.
//!
//! In: a [`Task`] with the trained systems. Out: a [`Measured`] for each system; what fails is one with the error.

use super::areas::{Area, Resolved};
use super::record::Record;
use super::spec::{Choice, ExperimentSpec, SketchSpec};
use crate::control::Stop;
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::evaluate::{EvaluationConfig, Patch, Rebuilt, evaluate_reduced, patch_seed};
use crate::grid::{Cell, Grid, Mask};
use crate::metrics::{curvature_distance, mean_slope_ratio, slope_distance, spectrum_distance};
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::style::{Named, Style};
use std::time::Instant;

/// What is measured: systems of an area and seed, on a cell with a sketch.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) resolved: &'a Resolved,
    /// The area of the styles.
    pub(super) area: &'a Area,
    /// North-west cell of the patch.
    pub(super) cell: Cell,
    pub(super) sketch: &'a SketchSpec,
    pub(super) systems: &'a Systems<'a>,
    pub(super) seed: u64,
    pub(super) record: &'a Record,
}

/// Scores by name; `None` where there is no such score.
pub(super) type Values = Vec<(&'static str, Option<f64>)>;

/// The score of a name, if there is one.
pub(super) fn value_of(values: &[(&'static str, Option<f64>)], name: &str) -> Option<f64> {
    values.iter().find(|(known, _)| *known == name).and_then(|(_, value)| *value)
}

/// The scores of one system.
pub(super) struct Measured {
    pub(super) system: String,
    /// Metres of the unit interval.
    pub(super) relief: f64,
    /// Share of the cells that carry a line.
    pub(super) line_share: f64,
    pub(super) values: Values,
    /// Seconds for one terrain.
    pub(super) seconds: f64,
    /// Empty when there are scores.
    pub(super) error: String,
}

impl Measured {
    pub(super) fn new(
        system: &str,
        (relief, line_share): (f64, f64),
        started: Instant,
        scored: Result<Values, impl std::fmt::Display>,
    ) -> Self {
        let (values, error) = match scored {
            Ok(values) => (values, String::new()),
            Err(error) => (Vec::new(), error.to_string()),
        };
        let seconds = started.elapsed().as_secs_f64();
        Self { system: system.to_owned(), relief, line_share, values, seconds, error }
    }
}

/// The systems of an area and seed.
pub(super) struct Systems<'a> {
    /// By the names that they have in the scores.
    pub(super) named: Vec<Named>,
    /// The style behind each of those that have one.
    pub(super) styles: Vec<(String, &'a Style)>,
}

impl<'a> Systems<'a> {
    pub(super) fn called(&self, name: &str) -> Option<&Named> {
        self.named.iter().find(|(known, _)| known == name)
    }

    /// The style behind a system.
    ///
    /// # Errors
    /// When it has none, as an interpolator.
    pub(super) fn style_of(&self, name: &str) -> Result<&'a Style> {
        let found = self.styles.iter().find(|(label, _)| label == name);
        found.map(|(_, style)| *style).ok_or_else(|| {
            Error::value("system", name, "allowed here: one of a trained style, not an interpolator")
        })
    }
}

/// How patches become the sketch.
fn evaluation_config(spec: &ExperimentSpec, sketch: &SketchSpec, keep: bool) -> EvaluationConfig {
    EvaluationConfig {
        extraction: spec.extraction.clone(),
        sketch_order: sketch.order,
        sketch_accumulation: sketch.accumulation,
        keep,
    }
}

/// The patch rebuilt by every system and scored against its truth; the terrains too when they are to be kept.
pub(super) fn rebuild(task: &Task<'_>, dem: &Dem, keep: bool) -> Result<(Vec<Measured>, Vec<Rebuilt>)> {
    let (spec, sketch) = (&task.resolved.spec, task.sketch);
    let config = evaluation_config(spec, sketch, keep);
    let reduce = |lines: LineMap, cell: Cell| reduced(spec, sketch, lines, cell);
    let (systems, seed) = (&task.systems.named, Seed(task.seed));
    let found = evaluate_reduced(dem, &[task.cell], systems, &config, &reduce, seed, &Stop::new(), || {})?;
    let rows = found.rows.into_iter().map(|row| Measured {
        system: row.system,
        relief: row.relief,
        line_share: row.line_share,
        values: row.scores.map(|scores| scores.values().to_vec()).unwrap_or_default(),
        seconds: row.seconds,
        error: row.error.unwrap_or_default(),
    });
    Ok((rows.collect(), found.patches))
}

/// The lines that a sketch keeps of those of the patch at `cell`.
fn reduced(spec: &ExperimentSpec, sketch: &SketchSpec, lines: LineMap, cell: Cell) -> LineMap {
    let Some(limit) = sketch.strokes else { return lines };
    let seed = Seed(spec.seeds[0]).derive(&format!("strokes of patch {},{}", cell.row, cell.col));
    let random = sketch.choose == Some(Choice::Random);
    lines.with_strokes(limit, random.then_some(seed))
}

/// The patch at a cell as its sketch shows it.
///
/// # Errors
/// As [`Patch::new`].
pub(super) fn patch_of(spec: &ExperimentSpec, area: &Area, cell: Cell, sketch: &SketchSpec) -> Result<Patch> {
    let reduce = |lines: LineMap, cell: Cell| reduced(spec, sketch, lines, cell);
    Patch::new(&area.dem, cell, &evaluation_config(spec, sketch, false), &reduce)
}

/// Scores of every system that need no truth, by `score`.
pub(super) fn without_truth(
    task: &Task<'_>,
    score: impl Fn(&Named, &Patch, Seed) -> Result<Values>,
) -> Result<Vec<Measured>> {
    let patch = patch_of(&task.resolved.spec, task.area, task.cell, task.sketch);
    let seed = patch_seed(Seed(task.seed), task.cell);
    let one = |named: &Named| {
        let started = Instant::now();
        let about = patch.as_ref().map_or((0.0, 0.0), |p| (p.relief(), p.line_share()));
        let scored = match &patch {
            Ok(patch) => score(named, patch, seed).map_err(|e| e.to_string()),
            Err(error) => Err(error.to_string()),
        };
        Measured::new(&named.0, about, started, scored)
    };
    Ok(task.systems.named.iter().map(one).collect())
}

/// What holds terrain against the exemplar of its style: slopes, curvatures and spectrum.
pub(super) const STYLE_COLUMNS: [&str; 4] =
    ["style_slope_ratio", "style_slope_distance", "style_curvature_distance", "style_spectrum_distance"];

/// The scores of [`STYLE_COLUMNS`]; empty when the exemplar has another shape. Both in the unit interval of their own sketch
/// or range.
pub(super) fn beside_style(area: &Area, output: &Grid<f32>, valid: &Mask) -> Values {
    let dem = &area.source.dem;
    if dem.shape() != output.shape() {
        return Vec::new();
    }
    let exemplar = Normalization::of(dem).normalize(dem);
    let both = Mask::from_fn(output.rows(), output.cols(), |cell| valid[cell] && dem.valid()[cell]);
    let scores = [
        mean_slope_ratio(output, &exemplar, &both),
        slope_distance(output, &exemplar, &both),
        curvature_distance(output, &exemplar, &both),
        spectrum_distance(output, &exemplar, &both),
    ];
    STYLE_COLUMNS.into_iter().zip(scores.map(Result::ok)).collect()
}
