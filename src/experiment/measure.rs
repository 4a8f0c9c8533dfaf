//! What a kind of experiment does with one patch (or drawing), sketch and seed: terrain from every system, and its scores.
//!
//! In: an area with its trained systems. Out: a [`Measured`] for each system; what fails is one with the error.

use super::evaluation::{EvaluationConfig, Patch, Rebuilt, evaluate_reduced};
use super::resolve::{Area, Resolved};
use super::spec::{
    Choice, DRAWING_COLUMNS, ExperimentSpec, INVARIANCE_COLUMNS, Kind, STATE_COLUMNS, STYLE_COLUMNS,
    SketchSpec,
};
use super::{moved, states};
use crate::control::Stop;
use crate::dem::Normalization;
use crate::error::{Error, Result};
use crate::extract::{self, ExtractionConfig};
use crate::grid::{Cell, Grid, Mask};
use crate::metrics::{
    LINE_TOLERANCE, curvature_distance, diversity, line_agreement, mean_slope_ratio, mean_valid_slope,
    pit_share, slope_distance, spectrum_distance, stroke_height_error,
};
use crate::seed::Seed;
use crate::sketch::{LineMap, Sketch, StrokeKind, samples};
use crate::style::{Named, Style};
use crate::systems::task::{Ground, with_random_lines};
use rand::RngExt;
use std::time::Instant;

/// Variants of a drawing.
pub(super) const VARIANTS: usize = 4;

/// Scores by name; `None` where there is no such score.
pub(super) type Values = Vec<(&'static str, Option<f64>)>;

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

/// The systems of an area and seed.
pub(super) struct Systems<'a> {
    /// By the names that they have in the scores.
    pub(super) named: Vec<Named>,
    /// The style behind each of those that have one.
    pub(super) styles: Vec<(String, &'a Style)>,
}

/// Terrain and scores of every system. `area` is that of the styles.
///
/// # Errors
/// When a setting is out of range; a system that fails gives its error.
pub(super) fn measure(
    resolved: &Resolved,
    area: &Area,
    cell: Cell,
    sketch: &SketchSpec,
    systems: &Systems<'_>,
    seed: u64,
) -> Result<Vec<Measured>> {
    match resolved.spec.kind {
        Kind::Drawings => drawn(resolved, area, sketch, systems, seed),
        Kind::Invariance => patchwise(resolved, area, cell, sketch, systems, seed, &|name, patch, seed| {
            let [max, rms] = moved::differences(name, systems, &patch.lines, sketch, seed)?;
            Ok(INVARIANCE_COLUMNS.into_iter().zip([Some(max), Some(rms)]).collect())
        }),
        Kind::Disentanglement => {
            patchwise(resolved, area, cell, sketch, systems, seed, &|name, patch, seed| {
                let found = states::of(name, systems, &patch.lines, seed)?;
                Ok(STATE_COLUMNS.into_iter().zip(states::scores(&found).map(Some)).collect())
            })
        }
        kind => {
            let home = home_of(resolved, area, sketch);
            let keep = kind == Kind::Exchange;
            let (rows, patches) = rebuilt(resolved, home, cell, sketch, &systems.named, seed, keep)?;
            Ok(rows
                .into_iter()
                .map(|mut row| {
                    if let Some(patch) = patches.first() {
                        let output = patch.outputs.iter().find(|(name, _)| *name == row.system);
                        if let Some((_, Some(output))) = output {
                            row.values.extend(beside_style(area, output, &patch.valid));
                        }
                    }
                    row
                })
                .collect())
        }
    }
}

/// Where the patches of a sketch lie: for `exchange` in the area that the sketch is called after.
pub(super) fn home_of<'a>(resolved: &'a Resolved, area: &'a Area, sketch: &SketchSpec) -> &'a Area {
    let is_exchange = resolved.spec.kind == Kind::Exchange;
    let other = resolved.areas.iter().find(|other| is_exchange && other.name == sketch.name);
    other.unwrap_or(area)
}

/// How patches become the sketch.
pub(super) fn evaluation_config(spec: &ExperimentSpec, sketch: &SketchSpec) -> EvaluationConfig {
    EvaluationConfig {
        extraction: spec.extraction.clone(),
        sketch_order: sketch.order,
        sketch_accumulation: sketch.accumulation,
    }
}

/// A patch of `home` rebuilt by systems and scored against its truth; the terrains too when they are to be kept.
pub(super) fn rebuilt(
    resolved: &Resolved,
    home: &Area,
    cell: Cell,
    sketch: &SketchSpec,
    systems: &[Named],
    seed: u64,
    keep: bool,
) -> Result<(Vec<Measured>, Vec<Rebuilt>)> {
    let spec = &resolved.spec;
    let config = evaluation_config(spec, sketch);
    let reduce = |lines: LineMap, cell: Cell| reduced(spec, sketch, lines, cell);
    let found = evaluate_reduced(&home.dem, &[cell], systems, &config, &reduce, Seed(seed), keep, || {})?;
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
    let mut strokes = Sketch::trace(&lines).strokes;
    let mut order: Vec<usize> = (0..strokes.len()).collect();
    match sketch.choose.unwrap_or_default() {
        // Ties keep the order of the trace.
        Choice::Longest => order.sort_by_key(|&i| std::cmp::Reverse(strokes[i].vertices.len())),
        Choice::Random => {
            let seed = Seed(spec.seeds[0]).derive(&format!("strokes of patch {},{}", cell.row, cell.col));
            let mut stream = seed.stream("order");
            for i in (1..order.len()).rev() {
                order.swap(i, stream.random_range(0..=i));
            }
        }
    }
    order.truncate(limit);
    order.sort_unstable();
    let mut at = 0..;
    strokes.retain(|_| at.next().is_some_and(|i| order.binary_search(&i).is_ok()));
    let (rows, cols) = lines.shape();
    let mut kept = LineMap::empty(rows, cols);
    for vertex in strokes.iter().flat_map(|stroke| &stroke.vertices) {
        let cell = Cell::new(vertex.y as usize, vertex.x as usize);
        if let Some(kind) = lines.kinds()[cell] {
            kept.set(cell, kind, lines.heights()[cell]);
        }
    }
    kept
}

/// The patch at a cell as its sketch shows it.
///
/// # Errors
/// As [`Patch::new`].
pub(super) fn patch_of(spec: &ExperimentSpec, area: &Area, cell: Cell, sketch: &SketchSpec) -> Result<Patch> {
    let reduce = |lines: LineMap, cell: Cell| reduced(spec, sketch, lines, cell);
    Patch::new(&area.dem, cell, &evaluation_config(spec, sketch), &reduce)
}

/// The seed of a patch, as in an evaluation.
pub(super) fn patch_seed(seed: u64, cell: Cell) -> Seed {
    Seed(seed).derive(&format!("patch {},{}", cell.row, cell.col))
}

/// Scores of every system that need no truth, by `score`.
fn patchwise(
    resolved: &Resolved,
    area: &Area,
    cell: Cell,
    sketch: &SketchSpec,
    systems: &Systems<'_>,
    seed: u64,
    score: &dyn Fn(&Named, &Patch, Seed) -> Result<Values>,
) -> Result<Vec<Measured>> {
    let patch = patch_of(&resolved.spec, area, cell, sketch);
    let one = |named: &Named| {
        let started = Instant::now();
        let scored = match &patch {
            Ok(patch) => score(named, patch, patch_seed(seed, cell)).map_err(|e| e.to_string()),
            Err(error) => Err(error.to_string()),
        };
        let seconds = started.elapsed().as_secs_f64();
        let (relief, line_share) = patch.as_ref().map_or((0.0, 0.0), |p| (p.relief(), p.line_share()));
        measured(named.0.clone(), relief, line_share, seconds, scored)
    };
    Ok(systems.named.iter().map(one).collect())
}

fn measured(
    system: String,
    relief: f64,
    line_share: f64,
    seconds: f64,
    scored: std::result::Result<Values, String>,
) -> Measured {
    let (values, error) = match scored {
        Ok(values) => (values, String::new()),
        Err(error) => (Vec::new(), error),
    };
    Measured { system, relief, line_share, values, seconds, error }
}

/// Terrain that stands for the exemplar of a style: distances of slopes, curvatures and spectrum. Empty when the exemplar
/// has another shape. Both in the unit interval of their own sketch or range.
fn beside_style(area: &Area, output: &Grid<f32>, valid: &Mask) -> Values {
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

/// The lines of each variant of a drawing, and those that were drawn.
pub(super) fn drawing(area: &Area, sketch: &SketchSpec, seed: u64) -> Result<(LineMap, Vec<LineMap>)> {
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
pub(super) fn variant_seed(seed: u64, variant: usize) -> Seed {
    Seed(seed).derive_indexed("variant", variant)
}

/// A drawing in [`VARIANTS`] variants by every system: scores are means over the variants.
fn drawn(
    resolved: &Resolved,
    area: &Area,
    sketch: &SketchSpec,
    systems: &Systems<'_>,
    seed: u64,
) -> Result<Vec<Measured>> {
    let (asked, variants) = drawing(area, sketch, seed)?;
    let line_share = variants.iter().map(LineMap::line_count).sum::<usize>() as f64
        / (VARIANTS * asked.kinds().len()) as f64;
    let (low, high) = area.source.dem.range();
    let one = |(name, system): &Named| {
        let started = Instant::now();
        let outputs: Result<Vec<Grid<f32>>> = variants
            .iter()
            .enumerate()
            .map(|(v, lines)| system.generate(lines, variant_seed(seed, v), &Stop::new()))
            .collect();
        let seconds = started.elapsed().as_secs_f64() / VARIANTS as f64;
        let scored = outputs
            .and_then(|outputs| drawing_scores(area, &asked, &variants, &outputs, &resolved.spec.extraction));
        let relief = f64::from(high) - f64::from(low);
        measured(name.clone(), relief, line_share, seconds, scored.map_err(|e| e.to_string()))
    };
    Ok(systems.named.iter().map(one).collect())
}

fn drawing_scores(
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
        let agreement = |asked: &LineMap, kind| line_agreement(asked, &found, kind, LINE_TOLERANCE);
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
        let of = |values: &Values| values.iter().find(|(n, _)| *n == name).and_then(|(_, v)| *v);
        let found: Vec<f64> = all.iter().filter_map(of).collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    let value = |name| (name, if name == "diversity" { Some(spread) } else { mean(name) });
    Ok(DRAWING_COLUMNS.into_iter().map(value).collect())
}

/// Root mean square of a cell above the mean of its four neighbours, unit heights.
fn roughness(output: &Grid<f32>) -> f64 {
    let (rows, cols) = output.shape();
    let z = |row: usize, col: usize| f64::from(output[Cell::new(row, col)]);
    let (mut sum, mut count) = (0.0, 0usize);
    for row in 1..rows.saturating_sub(1) {
        for col in 1..cols.saturating_sub(1) {
            let around = z(row - 1, col) + z(row + 1, col) + z(row, col - 1) + z(row, col + 1);
            sum += (z(row, col) - around / 4.0).powi(2);
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

/// The style behind a system.
///
/// # Errors
/// When it has none, as an interpolator.
pub(super) fn style_of<'a>(name: &str, systems: &Systems<'a>) -> Result<&'a Style> {
    let found = systems.styles.iter().find(|(label, _)| label == name);
    found.map(|(_, style)| *style).ok_or_else(|| {
        Error::value("system", name, "allowed here: one of a trained style, not an interpolator")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sketch_keeps_its_longest_or_random_strokes() {
        let mut lines = LineMap::empty(30, 30);
        for (row, length) in [(2, 5), (8, 20), (14, 9), (20, 12)] {
            (0..length).for_each(|col| lines.set(Cell::new(row, col), StrokeKind::Ridge, row as f32));
        }
        let spec: ExperimentSpec = toml::from_str(
            "kind = 'sparse'\ntitle = 't'\nquestion = 'q'\nseeds = [3]\nbudget_minutes = 1\nstyle = []\narea = []",
        )
        .unwrap();
        let sketch = |strokes, choose| SketchSpec { strokes: Some(strokes), choose, ..SketchSpec::default() };
        let cell = Cell::new(0, 0);
        let kept = |s: &SketchSpec| reduced(&spec, s, lines.clone(), cell);
        assert_eq!(kept(&sketch(9, None)), lines);
        let longest = kept(&sketch(2, Some(Choice::Longest)));
        assert_eq!(longest.line_count(), 32);
        assert_eq!(longest.heights()[Cell::new(8, 19)], 8.0);
        let random = sketch(2, Some(Choice::Random));
        assert_eq!(kept(&random), kept(&random));
        let other = |cell| reduced(&spec, &random, lines.clone(), cell).line_count();
        let counts: std::collections::BTreeSet<usize> = (0..20).map(|i| other(Cell::new(i, 0))).collect();
        assert!(counts.len() > 1, "{counts:?}");
    }

    #[test]
    fn roughness_is_that_of_a_saw() {
        let saw = Grid::from_fn(8, 8, |c| if (c.row + c.col) % 2 == 0 { 0.5f32 } else { 0.25 });
        assert!((roughness(&saw) - 0.25).abs() < 1e-9);
        assert!(roughness(&Grid::from_fn(8, 8, |c| c.row as f32 * 0.1 + c.col as f32 * 0.05)) < 1e-6);
    }
}
