//! Tables of a record beside the scores: what is known of exemplars, the seconds of each stage, the places of states.

use super::measure::{self, Systems};
use super::record::{Record, Timed, TrainingRow};
use super::resolve::{Area, Resolved};
use super::states;
use crate::dem::Normalization;
use crate::error::Result;
use crate::extract;
use crate::grid::Grid;
use crate::interpolation::NaturalNeighbours;
use crate::machine;
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::sketch::{StrokeKind, split_parts};
use crate::style::RegionGraph;
use std::time::Instant;

/// Head of `exemplars.csv`.
pub(super) const EXEMPLAR_HEAD: [&str; 8] =
    ["area", "terrain", "row", "col", "relief_m", "slope_m_per_m", "unit_slope", "line_share"];
/// Head of `stages.csv`.
pub(super) const STAGE_HEAD: [&str; 5] = ["stage", "system", "n", "seconds", "peak_memory_mb"];
/// Head of `states.csv`.
pub(super) const STATE_HEAD: [&str; 6] = ["system", "area", "patch", "kind", "x", "y"];

/// A row for each exemplar: what could tell a good one before any training. Slopes are root mean squares.
pub(super) fn exemplars(resolved: &Resolved, record: &Record) -> Result<()> {
    let mut rows = Vec::new();
    for (area, entry) in resolved.areas.iter().zip(&resolved.spec.area) {
        let dem = &area.source.dem;
        let range = Normalization::of(dem);
        let unit = range.normalize(dem);
        let lines = extract::ridges_and_valleys(&unit, dem.valid(), &resolved.spec.extraction)?;
        let slope = mean_square_slope(&unit).sqrt();
        let relief = range.high() - range.low();
        let info = &area.source.info;
        rows.push(vec![
            area.name.clone(),
            entry.terrain.clone().unwrap_or_else(|| area.name.clone()),
            info.row.to_string(),
            info.col.to_string(),
            format!("{relief:.2}"),
            format!("{:.6}", slope * relief / dem.cell_size().mean()),
            format!("{slope:.6}"),
            format!("{:.6}", lines.line_count() as f64 / unit.len() as f64),
        ]);
    }
    record.write_table("exemplars.csv", &EXEMPLAR_HEAD, rows)
}

/// Seconds and memory of what comes before a training, measured once for each area and style.
pub(super) fn preparation(resolved: &Resolved) -> Result<Vec<Vec<String>>> {
    let mut rows = Vec::new();
    for style in &resolved.spec.style {
        let config = resolved.spec.config_of(style)?;
        let mut seconds = [("extraction", 0.0), ("natural-neighbour surface", 0.0), ("parts and graph", 0.0)];
        for area in &resolved.areas {
            let dem = &area.source.dem;
            let unit = Normalization::of(dem).normalize(dem);
            let mut started = Instant::now();
            let lines = extract::ridges_and_valleys(&unit, dem.valid(), &config.extraction)?;
            seconds[0].1 += started.elapsed().as_secs_f64();
            started = Instant::now();
            let mask = lines.mask();
            let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
            let values: Vec<f64> = on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
            let base: Grid<f32> = NaturalNeighbours::new(&mask)?.interpolate(&values).map(|z| *z as f32);
            seconds[1].1 += started.elapsed().as_secs_f64();
            started = Instant::now();
            let parts = split_parts(&lines, config.model.parts, Seed(resolved.spec.seeds[0]));
            RegionGraph::new(&lines, &parts, Some(base.as_slice()), &config.model)?;
            seconds[2].1 += started.elapsed().as_secs_f64();
        }
        let n = resolved.areas.len();
        rows.extend(seconds.map(|(stage, sum)| stage_row(stage, &style.name, n, sum / n as f64)));
    }
    Ok(rows)
}

/// Writes `stages.csv`: `first` (of [`preparation`]), then trainings and terrains.
pub(super) fn stages(
    record: &Record,
    first: Vec<Vec<String>>,
    trainings: &[TrainingRow],
    peak_of_training: Option<u64>,
    rows: &[Timed],
) -> Result<()> {
    let mut table = first;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let mut styles: Vec<&str> = trainings.iter().map(|t| t.style.as_str()).collect();
    styles.dedup();
    styles.sort_unstable();
    styles.dedup();
    type Seconds = fn(&TrainingRow) -> f64;
    for style in styles {
        let of: Vec<&TrainingRow> =
            trainings.iter().filter(|t| t.style == style && t.error.is_empty()).collect();
        let values = |f: Seconds| mean(&of.iter().map(|t| f(t)).collect::<Vec<_>>());
        let stages: [(&str, Seconds); 3] = [
            ("preparation of a training", |t| t.preparation_seconds),
            ("an epoch", |t| t.seconds_per_epoch),
            ("a training", |t| t.seconds),
        ];
        for (stage, f) in stages {
            let mut row = stage_row(stage, style, of.len(), values(f));
            row[4] = megabytes(peak_of_training);
            table.push(row);
        }
    }
    let mut systems: Vec<&str> = Vec::new();
    for (row, _) in rows {
        if !systems.contains(&row.key.system.as_str()) {
            systems.push(&row.key.system);
        }
    }
    for system in systems {
        let of: Vec<f64> = rows
            .iter()
            .filter(|(r, _)| r.key.system == system && r.error.is_empty())
            .map(|(_, s)| *s)
            .collect();
        table.push(stage_row("a terrain of 128x128 cells", system, of.len(), mean(&of)));
    }
    record.write_table("stages.csv", &STAGE_HEAD, table)
}

fn stage_row(stage: &str, system: &str, n: usize, seconds: f64) -> Vec<String> {
    let peak = megabytes(machine::peak_memory());
    vec![stage.to_owned(), system.to_owned(), n.to_string(), format!("{seconds:.5}"), peak]
}

fn megabytes(bytes: Option<u64>) -> String {
    bytes.map_or_else(String::new, |bytes| (bytes / 1_000_000).to_string())
}

/// Places of the region states of the first patch of each area in two dimensions (t-SNE).
pub(super) fn places<'a>(
    resolved: &'a Resolved,
    record: &Record,
    systems: &dyn Fn(&Area, u64) -> Result<Systems<'a>>,
) -> Result<()> {
    let spec = &resolved.spec;
    let seed = spec.seeds[0];
    let mut rows = Vec::new();
    for area in &resolved.areas {
        let systems = systems(area, seed)?;
        let Some(&cell) = area.patches.first() else { continue };
        let Ok(patch) = measure::patch_of(spec, area, cell, &spec.sketches()[0]) else { continue };
        for named in &systems.named {
            let Ok(found) = states::of(named, &systems, &patch.lines, measure::patch_seed(seed, cell)) else {
                continue;
            };
            for ((kind, _), (x, y)) in found.iter().zip(states::embed(&found, Seed(seed))) {
                let kind = if *kind == StrokeKind::Ridge { "ridge" } else { "valley" };
                let place = format!("{},{}", cell.row, cell.col);
                let mut row = vec![named.0.clone(), area.name.clone(), place, kind.to_owned()];
                row.extend([format!("{x:.5}"), format!("{y:.5}")]);
                rows.push(row);
            }
        }
    }
    record.write_table("states.csv", &STATE_HEAD, rows)
}
