//! Drawings without a truth, in several variants (Liu & Benes 2025, Figs. 7, 20).

use super::general;
use crate::control::Stop;
use crate::dem::Normalization;
use crate::error::Result;
use crate::experiment::areas::{Area, Resolved};
use crate::experiment::measure::{Measured, STYLE_COLUMNS, Task, Values, beside_style, value_of};
use crate::experiment::pictures::{Gallery, paper, plain};
use crate::experiment::protocol::check;
use crate::experiment::protocol::{Finding, Protocol, SketchSource};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::{ExperimentSpec, SketchSpec};
use crate::extract::{self, ExtractionConfig};
use crate::grid::{Cell, Grid};
use crate::metrics::{
    LINE_TOLERANCE, diversity, line_agreement, mean_valid_slope, pit_share, roughness, stroke_height_error,
};
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind, samples};
use crate::style::Named;
use crate::systems::task::{Ground, RandomHeights, with_random_lines};
use crate::viz::{Painter, Sheet};
use std::time::Instant;

/// Variants of a drawing.
const VARIANTS: usize = 4;

/// Scores of the terrain alone and with its lines, means over the variants.
const COLUMNS: [&str; 9] = [
    "diversity",
    "stroke_height_error",
    "drawn_ridge_recall",
    "drawn_valley_recall",
    "ridge_f1",
    "valley_f1",
    "roughness",
    "pit_share",
    "clipped_share",
];

pub(super) struct Drawings;

impl Protocol for Drawings {
    fn columns(&self) -> Vec<&'static str> {
        COLUMNS.into_iter().chain(STYLE_COLUMNS).collect()
    }

    fn sketch_source(&self) -> SketchSource {
        SketchSource::Drawings
    }

    fn has_test_patches(&self) -> bool {
        false
    }

    fn draws_lines(&self) -> bool {
        true
    }

    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        let allowed = "kind = \"drawings\" needs at least one drawing";
        check(!spec.sketch.is_empty(), "number of sketches", 0, allowed)
    }

    fn cells(&self, _: &Resolved, _: &Area, _: &SketchSpec) -> Vec<Cell> {
        vec![Cell::new(0, 0)]
    }

    /// Every system makes all variants: scores are means over them.
    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        let (drawn, variants) = drawing(task.area, task.sketch, task.seed)?;
        let cells = VARIANTS * drawn.kinds().len();
        let line_share = variants.iter().map(LineMap::line_count).sum::<usize>() as f64 / cells as f64;
        let (low, high) = task.area.source.dem.range();
        let about = (f64::from(high) - f64::from(low), line_share);
        let one = |(name, system): &Named| {
            let started = Instant::now();
            let make = |(v, lines): (usize, &LineMap)| {
                system.generate(lines, variant_seed(task.seed, v), &Stop::new())
            };
            let outputs: Result<Vec<Grid<f32>>> = variants.iter().enumerate().map(make).collect();
            let seconds = started.elapsed().as_secs_f64() / VARIANTS as f64;
            let extraction = &task.resolved.spec.extraction;
            let scored =
                outputs.and_then(|outputs| scores(task.area, &drawn, &variants, &outputs, extraction));
            Measured { seconds, ..Measured::new(name, about, started, scored) }
        };
        Ok(task.systems.named.iter().map(one).collect())
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::means(results, false))
    }

    fn about_pictures(&self) -> &'static str {
        "A sheet for each drawing and style, of the first seed."
    }

    /// A sheet for each drawing: a row for each sketch of it (random lines), its variants beside the lines of the first.
    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        let (seed, highlight) = (gallery.seed, &gallery.highlight);
        let mut names: Vec<&str> = Vec::new();
        for name in gallery.sketches.iter().filter_map(|s| s.drawing.as_deref()) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        for area in &gallery.resolved.areas {
            let systems = gallery.systems(area)?;
            let Some((_, system)) = systems.called(highlight) else { continue };
            let painter = Painter::of(&area.source.dem);
            for name in &names {
                let rows = || gallery.sketches.iter().filter(|s| s.drawing.as_deref() == Some(name));
                let mut sheet = Sheet::new(1 + VARIANTS)
                    .title(format!("{name} in the style of {}: {highlight}, seed {seed}", area.name))
                    .subtitle("Each row: the lines of the first variant, then four variants.")
                    .row_heads(rows().map(|s| match (s.random.unwrap_or(0), s.random_heights) {
                        (0, _) => "as drawn".to_owned(),
                        (nodes, Some(RandomHeights::Range)) => format!("{nodes} random nodes, whole range"),
                        (nodes, _) => format!("{nodes} random nodes"),
                    }));
                for sketch in rows() {
                    let (_, variants) = drawing(area, sketch, seed)?;
                    sheet = sheet.panel(paper(&variants[0])?, "lines");
                    for (v, lines) in variants.iter().enumerate() {
                        let output = system.generate(lines, variant_seed(seed, v), &Stop::new())?;
                        sheet = sheet.panel(painter.draw_whole(&output)?, format!("variant {}", v + 1));
                    }
                }
                gallery.keep(&format!("{}-{}", plain(&area.name), plain(name)), &painter.finish(sheet)?)?;
            }
        }
        Ok(())
    }
}

/// The lines of each variant of a drawing, and those that were drawn.
fn drawing(area: &Area, sketch: &SketchSpec, seed: u64) -> Result<(LineMap, Vec<LineMap>)> {
    let name = sketch.drawing.as_deref().unwrap_or_default();
    let drawn = samples::load(name)?.sketch;
    let dem = &area.source.dem;
    let exemplar = Normalization::of(dem).normalize(dem);
    let ground = Ground { range: (0.0, 1.0), slope: Some(mean_valid_slope(&exemplar, dem.valid())?) };
    let (nodes, heights) = (sketch.random.unwrap_or(0), sketch.random_heights.unwrap_or_default());
    let one = |v| {
        with_random_lines(&drawn, nodes, heights, ground, variant_seed(seed, v))
            .map(|sketch| sketch.rasterize())
    };
    Ok((drawn.rasterize(), (0..VARIANTS).map(one).collect::<Result<_>>()?))
}

/// The seed of a variant.
fn variant_seed(seed: u64, variant: usize) -> Seed {
    Seed(seed).derive_indexed("variant", variant)
}

fn scores(
    area: &Area,
    drawn: &LineMap,
    variants: &[LineMap],
    outputs: &[Grid<f32>],
    extraction: &ExtractionConfig,
) -> Result<Values> {
    let mut all: Vec<Values> = Vec::new();
    for (lines, output) in variants.iter().zip(outputs) {
        let valid = output.map(|_| true);
        let outside = output.as_slice().iter().filter(|z| !(0.0..=1.0).contains(*z)).count();
        let found = extract::ridges_and_valleys(output, &valid, extraction)?;
        let agreement = |wanted: &LineMap, kind| line_agreement(wanted, &found, kind, LINE_TOLERANCE);
        let (ridge, valley) = (StrokeKind::Ridge, StrokeKind::Valley);
        let mut values: Values = vec![
            ("stroke_height_error", stroke_height_error(output, &valid, drawn)?),
            ("drawn_ridge_recall", agreement(drawn, ridge)?.map(|a| a.recall)),
            ("drawn_valley_recall", agreement(drawn, valley)?.map(|a| a.recall)),
            ("ridge_f1", agreement(lines, ridge)?.map(|a| a.f1())),
            ("valley_f1", agreement(lines, valley)?.map(|a| a.f1())),
            ("roughness", Some(roughness(output))),
            ("pit_share", Some(pit_share(output, &valid)?)),
            ("clipped_share", Some(outside as f64 / output.len() as f64)),
        ];
        values.extend(beside_style(area, output, &valid));
        all.push(values);
    }
    let spread = diversity(outputs)?;
    let mean = |name: &'static str| {
        let found: Vec<f64> = all.iter().filter_map(|values| value_of(values, name)).collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    let value = |name| (name, if name == "diversity" { Some(spread) } else { mean(name) });
    Ok(Drawings.columns().into_iter().map(value).collect())
}
