//! How well a style rebuilds the exemplar that it learned (Liu & Benes 2025, Table B1).

use super::record::Timed;
use super::resolve::Area;
use super::rows::{Key, ScoreRow};
use super::spec::FIT_COLUMNS;
use crate::control::Stop;
use crate::dem::Normalization;
use crate::error::Result;
use crate::extract::{self, ExtractionConfig};
use crate::grid::Grid;
use crate::metrics::Scores;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::style::Style;
use crate::systems::task::SketchToTerrain;
use std::time::Instant;

/// What a row of `fit` is about.
pub(super) fn key(area: &Area, system: &str, seed: u64) -> Key {
    let e = &area.source.info;
    let (system, area) = (system.to_owned(), area.name.clone());
    Key { system, area, row: e.row, col: e.col, seed, sketch: "exemplar".to_owned() }
}

/// Lines and unit heights of an exemplar.
fn exemplar(area: &Area, extraction: &ExtractionConfig) -> Result<(Grid<f32>, LineMap)> {
    let dem = &area.source.dem;
    let truth = Normalization::of(dem).normalize(dem);
    let lines = extract::ridges_and_valleys(&truth, dem.valid(), extraction)?;
    Ok((truth, lines))
}

/// The exemplar rebuilt by the style as after its training, with the losses of its last step.
pub(super) fn reconstruct(area: &Area, style: &Style, key: Key, columns: &[&str]) -> Timed {
    let network = style.network();
    let rebuild = |lines: &LineMap| style.network()?.rebuild(lines, Seed(key.seed), &Stop::new());
    let last = network.ok().and_then(|network| network.training().history.last()).map(|report| report.losses);
    let losses = last.map(|l| [l.ground_truth, l.gradient, l.sketch, l.smooth, l.further, 1.0 - l.ssim]);
    scored(area, &style.origin.extraction, rebuild, losses, key.clone(), columns)
}

/// The exemplar rebuilt from its lines by an interpolator.
pub(super) fn interpolate(
    area: &Area,
    system: &dyn SketchToTerrain,
    extraction: &ExtractionConfig,
    key: Key,
    columns: &[&str],
) -> Timed {
    scored(
        area,
        extraction,
        |lines| system.generate(lines, Seed(key.seed), &Stop::new()),
        None,
        key.clone(),
        columns,
    )
}

fn scored(
    area: &Area,
    extraction: &ExtractionConfig,
    rebuild: impl Fn(&LineMap) -> Result<Grid<f32>>,
    losses: Option<[f64; 6]>,
    key: Key,
    columns: &[&str],
) -> Timed {
    let (low, high) = area.source.dem.range();
    let mut row = ScoreRow {
        key,
        relief: f64::from(high) - f64::from(low),
        line_share: 0.0,
        values: vec![None; columns.len()],
        error: String::new(),
    };
    let mut seconds = 0.0;
    let mut fill = || -> Result<()> {
        let (truth, lines) = exemplar(area, extraction)?;
        row.line_share = lines.line_count() as f64 / truth.len() as f64;
        let started = Instant::now();
        let output = rebuild(&lines)?;
        seconds = started.elapsed().as_secs_f64();
        let valid = area.source.dem.valid();
        let found = extract::ridges_and_valleys(&output, valid, extraction)?;
        let scores = Scores::of(&output, &truth, valid, &lines)?.with_lines(&lines, &found)?;
        let values = scores.values();
        let own = std::iter::once(scores.rmse * scores.rmse).map(Some);
        let losses = (0..6).map(|i| losses.map(|losses| losses[i]));
        let more: Vec<(&str, Option<f64>)> = FIT_COLUMNS.into_iter().zip(own.chain(losses)).collect();
        let value = |name: &&str| values.iter().chain(&more).find(|(n, _)| n == name).and_then(|(_, v)| *v);
        row.values = columns.iter().map(value).collect();
        Ok(())
    };
    if let Err(error) = fill() {
        row.error = error.to_string();
    }
    (row, seconds)
}
