//! As `neighbours`, with the seconds and memory of each stage (Liu & Benes 2025, section 7).

use super::{losses, neighbours};
use crate::dem::Normalization;
use crate::error::Result;
use crate::experiment::areas::Resolved;
use crate::experiment::protocol::{Finding, Finished, Protocol};
use crate::experiment::record::{Record, StageRow, TrainingRow};
use crate::experiment::results::Results;
use crate::extract;
use crate::grid::Grid;
use crate::interpolation::NaturalNeighbours;
use crate::machine;
use crate::seed::Seed;
use crate::sketch::split_parts;
use crate::style::RegionGraph;
use crate::viz::report::{Column, Entry, Table};
use std::time::Instant;

/// The table of stages in the record.
const TABLE: &str = "stages.csv";

pub(super) struct Cost;

impl Protocol for Cost {
    /// What comes before a training, once for each area and style.
    fn before_training(&self, resolved: &Resolved, record: &Record) -> Result<()> {
        let mut rows = Vec::new();
        for style in &resolved.spec.style {
            let config = resolved.spec.config_of(style)?;
            let mut seconds = [
                ("extraction", Vec::new()),
                ("natural-neighbour surface", Vec::new()),
                ("parts and graph", Vec::new()),
            ];
            for area in &resolved.areas {
                let dem = &area.source.dem;
                let unit = Normalization::of(dem).normalize(dem);
                let mut started = Instant::now();
                let lines = extract::ridges_and_valleys(&unit, dem.valid(), &config.extraction)?;
                seconds[0].1.push(started.elapsed().as_secs_f64());
                started = Instant::now();
                let mask = lines.mask();
                let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
                let values: Vec<f64> =
                    on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
                let base: Grid<f32> = NaturalNeighbours::new(&mask)?.interpolate(&values).map(|z| *z as f32);
                seconds[1].1.push(started.elapsed().as_secs_f64());
                started = Instant::now();
                let parts = split_parts(&lines, config.model.parts, Seed(resolved.spec.seeds[0]));
                RegionGraph::new(&lines, &parts, Some(base.as_slice()), &config.model)?;
                seconds[2].1.push(started.elapsed().as_secs_f64());
            }
            let peak = machine::peak_memory();
            rows.extend(seconds.map(|(stage, seconds)| StageRow::new(stage, &style.name, &seconds, peak)));
        }
        record.write_table(TABLE, &rows)
    }

    /// Trainings and terrains.
    fn after_scoring(&self, finished: &Finished<'_>) -> Result<()> {
        let spec = &finished.resolved.spec;
        let mut table: Vec<StageRow> = finished.record.table(TABLE)?;
        let mut styles: Vec<&str> = spec.style.iter().map(|style| style.name.as_str()).collect();
        styles.sort_unstable();
        for style in styles {
            let of = finished.trainings.iter().filter(|t| t.style == style && t.error.is_empty());
            let mut add = |stage: &str, seconds: fn(&TrainingRow) -> f64| {
                let seconds: Vec<f64> = of.clone().map(seconds).collect();
                table.push(StageRow::new(stage, style, &seconds, finished.peak_of_training));
            };
            add("preparation of a training", |t| t.preparation_seconds);
            add("an epoch", |t| t.seconds_per_epoch);
            add("a training", |t| t.seconds);
        }
        for system in spec.systems()? {
            let of = finished.rows.iter().filter(|(row, _)| row.key.system == system && row.error.is_empty());
            let seconds: Vec<f64> = of.map(|(_, seconds)| *seconds).collect();
            table.push(StageRow::new(
                "a terrain of 128x128 cells",
                &system,
                &seconds,
                machine::peak_memory(),
            ));
        }
        finished.record.write_table(TABLE, &table)
    }

    fn findings(&self, results: &Results<'_>, record: &Record) -> Result<Vec<Finding>> {
        let mut findings = [neighbours::areas(results), losses::findings(results)].concat();
        for (name, title) in [(TABLE, "Here"), ("peers.csv", "Others on this machine")] {
            let rows: Vec<StageRow> = record.table(name)?;
            if rows.is_empty() {
                continue;
            }
            let caption = format!("{title}, seconds and peak memory of the process up to then:");
            let numbers = [("n", 0), ("s", 5), ("MB", 0)].map(|(name, digits)| Column::number(name, digits));
            let columns = ["stage", "system"].map(Column::text).into_iter().chain(numbers);
            let table = rows.into_iter().fold(Table::new(columns).caption(caption), |table, row| {
                let peak = row.peak_memory_mb.map(|mb| mb as f64);
                let words = [Entry::from(row.stage), row.system.into(), row.n.into(), row.seconds.into()];
                table.row(words.into_iter().chain([peak.into()]))
            });
            findings.push(Finding::Table(table));
        }
        Ok(findings)
    }
}
