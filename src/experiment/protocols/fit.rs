//! Every exemplar is rebuilt by the style that learned it (Liu & Benes 2025, Table B1).

use crate::control::Stop;
use crate::dem::Normalization;
use crate::error::Result;
use crate::experiment::areas::{Area, Resolved};
use crate::experiment::measure::{Measured, Task, Values};
use crate::experiment::pictures::Gallery;
use crate::experiment::protocol::{Finding, Protocol, SketchSource, not_for};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::{ExperimentSpec, SketchSpec};
use crate::extract::{self, ExtractionConfig};
use crate::grid::{Cell, Grid};
use crate::metrics::Scores;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::style::Named;
use crate::systems::task::SketchToTerrain;
use crate::viz::report::{Column, Entry, Table, Text};
use std::time::Instant;

/// Losses beside the scores: `l_gt` of the rebuilt exemplar, and those of the last training step with its noise and masked
/// parts.
const COLUMNS: [&str; 7] = [
    "l_gt",
    "train_l_gt",
    "train_l_gradient",
    "train_l_sketch",
    "train_l_smooth",
    "train_l_further",
    "train_ssim",
];

pub(super) struct Fit;

impl Protocol for Fit {
    fn columns(&self) -> Vec<&'static str> {
        Scores::names().into_iter().chain(COLUMNS).collect()
    }

    fn sketch_source(&self) -> SketchSource {
        SketchSource::Areas
    }

    fn has_test_patches(&self) -> bool {
        false
    }

    fn compares_uses(&self) -> bool {
        false
    }

    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        if spec.patches_per_area.is_some() {
            return Err(not_for(spec.kind, "patches_per_area", "given", "it tests the exemplars"));
        }
        match spec.style.iter().find(|style| !style.systems.is_empty()) {
            Some(style) => {
                let key = format!("systems of style {:?}", style.name);
                let found = style.systems.join(", ");
                Err(not_for(spec.kind, key, found, "a style rebuilds its exemplar in one way"))
            }
            None => Ok(()),
        }
    }

    fn sketches(&self, _: &ExperimentSpec) -> Vec<SketchSpec> {
        vec![SketchSpec { name: "exemplar".to_owned(), ..SketchSpec::default() }]
    }

    fn cells(&self, _: &Resolved, area: &Area, _: &SketchSpec) -> Vec<Cell> {
        vec![Cell::new(area.source.info.row, area.source.info.col)]
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        Ok(task.systems.named.iter().map(|named| rebuilt(task, named)).collect())
    }

    fn pictures(&self, _: &Gallery<'_>) -> Result<()> {
        Ok(())
    }

    /// A row for each area and style.
    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        let metrics = [
            ("ssim", "SSIM"),
            ("psnr", "PSNR, dB"),
            ("l_gt", "l_gt, 1e-4"),
            ("train_l_gradient", "l_gradient, 1e-4"),
        ];
        let heads = ["area", "style"].into_iter().chain(metrics.map(|(_, head)| head)).map(Column::text);
        let caption = format!(
            "Exemplars rebuilt from their own lines, mean ± standard deviation over {}:",
            results.seeds()
        );
        let mut table = Table::new(heads).caption(caption);
        for area in &results.spec.area {
            for system in results.style_systems() {
                let mut row = vec![Entry::from(area.name.as_str()), Entry::from(Text::code(system))];
                row.extend(metrics.map(|(metric, head)| {
                    let factor = if head.ends_with("1e-4") { 1e4 } else { 1.0 };
                    let digits = if metric == "ssim" { 4 } else { 2 };
                    let stat = results.stat(system, Some(&area.name), "exemplar", metric);
                    let words =
                        stat.map(|s| format!("{:.digits$} ± {:.digits$}", factor * s.mean, factor * s.sd));
                    Entry::from(words)
                }));
                table = table.row(row);
            }
        }
        Ok(vec![Finding::Table(table)])
    }
}

/// The exemplar rebuilt by a style as after its training, with the losses of its last step; or by an interpolator.
fn rebuilt(task: &Task<'_>, (name, system): &Named) -> Measured {
    let seed = Seed(task.seed);
    let (low, high) = task.area.source.dem.range();
    let relief = f64::from(high) - f64::from(low);
    let rebuild = |extraction: &ExtractionConfig,
                   losses: Option<[f64; 6]>,
                   make: &dyn Fn(&LineMap) -> Result<Grid<f32>>| {
        let (mut line_share, mut started) = (0.0, Instant::now());
        let mut fill = || -> Result<Values> {
            let dem = &task.area.source.dem;
            let truth = Normalization::of(dem).normalize(dem);
            let lines = extract::ridges_and_valleys(&truth, dem.valid(), extraction)?;
            line_share = lines.line_count() as f64 / truth.len() as f64;
            started = Instant::now();
            let output = make(&lines)?;
            let found = extract::ridges_and_valleys(&output, dem.valid(), extraction)?;
            let scores = Scores::of(&output, &truth, dem.valid(), &lines)?.with_lines(&lines, &found)?;
            let own = std::iter::once(Some(scores.rmse * scores.rmse));
            let losses = (0..6).map(|i| losses.map(|losses| losses[i]));
            Ok(scores.values().into_iter().chain(COLUMNS.into_iter().zip(own.chain(losses))).collect())
        };
        let scored = fill();
        Measured::new(name, (relief, line_share), started, scored)
    };
    match task.systems.style_of(name) {
        Ok(style) => {
            let last = style.network().ok().and_then(|network| network.training().history.last());
            let losses = last.map(|report| report.losses);
            let losses =
                losses.map(|l| [l.ground_truth, l.gradient, l.sketch, l.smooth, l.further, 1.0 - l.ssim]);
            rebuild(&style.origin.extraction, losses, &|lines| {
                style.network()?.rebuild(lines, seed, &Stop::new())
            })
        }
        Err(_) => {
            rebuild(&task.resolved.spec.extraction, None, &|lines| system.generate(lines, seed, &Stop::new()))
        }
    }
}
