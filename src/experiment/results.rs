//! The rows of an experiment, summarised: means of areas and of patches, and against the interpolators.
//!
//! Every mean is over the cells (patch and seed) that have a finite score. The mean of all areas is the mean of the areas' means,
//! so that an area with many patches does not outweigh the others. Differences are taken cell by cell.

use super::rows::{ScoreRow, ScoreTable};
use super::spec::ExperimentSpec;
use crate::error::Result;
pub(crate) use crate::metrics::Stat;
use crate::metrics::lower_is_better;
use std::collections::BTreeMap;

/// A patch and a seed: (row, column, seed).
pub(crate) type CellKey = (usize, usize, u64);
/// A score on every cell that has one.
pub(crate) type Cells = BTreeMap<CellKey, f64>;

/// The rows of an experiment, to be asked for means.
#[derive(Clone, Debug)]
pub(crate) struct Results<'a> {
    pub(super) spec: &'a ExperimentSpec,
    pub(super) table: &'a ScoreTable,
    interpolators: Vec<String>,
    /// The names of all systems.
    pub(super) systems: Vec<String>,
    /// The system that the experiment is about.
    pub(super) highlight: String,
    pub(super) sketches: Vec<String>,
    /// Rows of every (system, area, sketch).
    index: BTreeMap<(&'a str, &'a str, &'a str), Vec<&'a ScoreRow>>,
}

impl<'a> Results<'a> {
    /// Of a record's experiment and scores.
    ///
    /// # Errors
    /// When the experiment names an interpolator that there is not.
    pub(crate) fn new(spec: &'a ExperimentSpec, table: &'a ScoreTable) -> Result<Self> {
        let mut index: BTreeMap<_, Vec<&ScoreRow>> = BTreeMap::new();
        for row in &table.rows {
            let k = &row.key;
            index.entry((k.system.as_str(), k.area.as_str(), k.sketch.as_str())).or_default().push(row);
        }
        let (interpolators, systems) = (spec.interpolator_names()?, spec.systems()?);
        let highlight = spec.highlight.clone().unwrap_or_else(|| systems[0].clone());
        let sketches = spec.sketches().into_iter().map(|sketch| sketch.name).collect();
        Ok(Self { spec, table, interpolators, systems, highlight, sketches, index })
    }

    /// The interpolators that the experiment compares.
    #[must_use]
    pub(crate) fn interpolators(&self) -> &[String] {
        &self.interpolators
    }

    /// The rows of a system in an area.
    pub(super) fn rows<'s>(&'s self, system: &'s str, area: &'s str, sketch: &'s str) -> &'s [&'s ScoreRow] {
        self.index.get(&(system, area, sketch)).map_or(&[], Vec::as_slice)
    }

    /// The scores of a system on the cells of an area.
    #[must_use]
    pub(crate) fn cells(&self, system: &str, area: &str, sketch: &str, metric: &str) -> Cells {
        let Some(column) = self.table.column(metric) else { return Cells::new() };
        let rows = self.rows(system, area, sketch).iter();
        let scored = rows.filter_map(|row| Some((row, row.values[column].filter(|v| v.is_finite())?)));
        scored.map(|(row, value)| ((row.key.row, row.key.col, row.key.seed), value)).collect()
    }

    /// The scores of a system in all areas, one after the other.
    pub(super) fn values(&self, system: &str, sketch: &str, metric: &str) -> Vec<f64> {
        let areas = self.spec.area.iter();
        areas.flat_map(|area| self.cells(system, &area.name, sketch, metric).into_values()).collect()
    }

    /// Mean and spread over the cells of an area, or of all areas' means.
    #[must_use]
    pub(crate) fn stat(&self, system: &str, area: Option<&str>, sketch: &str, metric: &str) -> Option<Stat> {
        let of = |area: &str| Stat::of(self.cells(system, area, sketch, metric).into_values());
        match area {
            Some(area) => of(area),
            None => Stat::of(self.spec.area.iter().filter_map(|area| of(&area.name)).map(|stat| stat.mean)),
        }
    }

    /// Every area by name, then `None` for all of them together if there are several.
    pub(super) fn areas(&self) -> Vec<Option<&'a str>> {
        let names = self.spec.area.iter().map(|area| Some(area.name.as_str()));
        names.chain((self.spec.area.len() > 1).then_some(None)).collect()
    }

    /// The systems that are no interpolators.
    pub(super) fn style_systems(&self) -> Vec<&str> {
        self.systems.iter().filter(|s| !self.interpolators.contains(s)).map(String::as_str).collect()
    }

    /// "3 seeds"
    pub(super) fn seeds(&self) -> String {
        match self.spec.seeds.len() {
            1 => "1 seed".to_owned(),
            n => format!("{n} seeds"),
        }
    }

    /// The interpolator with the best mean of an area, or of all of them.
    #[must_use]
    pub(crate) fn best_interpolator(
        &self,
        area: Option<&str>,
        sketch: &str,
        metric: &str,
    ) -> Option<(&str, f64)> {
        let mean = |name: &String| self.stat(name, area, sketch, metric).map(|stat| stat.mean);
        let means = self.interpolators.iter().filter_map(|name| Some((name.as_str(), mean(name)?)));
        means.reduce(|best, next| if better(metric, next.1, best.1) { next } else { best })
    }

    /// On every cell the best of the interpolators there.
    #[must_use]
    pub(crate) fn best_of_each(&self, area: &str, sketch: &str, metric: &str) -> Cells {
        let mut best = Cells::new();
        for name in &self.interpolators {
            for (cell, value) in self.cells(name, area, sketch, metric) {
                let entry = best.entry(cell).or_insert(value);
                if better(metric, value, *entry) {
                    *entry = value;
                }
            }
        }
        best
    }

    /// Cells of an area on which a system failed and another one did not.
    #[must_use]
    pub(crate) fn failures(&self, system: &str, area: &str, sketch: &str) -> usize {
        let rows = || self.table.rows.iter().filter(|row| row.key.area == area && row.key.sketch == sketch);
        let cell = |row: &ScoreRow| (row.key.row, row.key.col, row.key.seed);
        let possible: std::collections::BTreeSet<CellKey> =
            rows().filter(|row| row.error.is_empty()).map(cell).collect();
        let failed = rows().filter(|row| row.key.system == system && !row.error.is_empty());
        failed.filter(|row| possible.contains(&cell(row))).count()
    }
}

/// Whether `a` is a better score than `b`.
#[must_use]
pub(crate) fn better(metric: &str, a: f64, b: f64) -> bool {
    if lower_is_better(metric) { a < b } else { a > b }
}

/// `a - b` on the cells that both have.
#[must_use]
pub(crate) fn difference(a: &Cells, b: &Cells) -> Cells {
    a.iter().filter_map(|(cell, value)| Some((*cell, value - b.get(cell)?))).collect()
}

/// Mean over seeds of every patch: (row, column).
#[must_use]
pub(crate) fn of_patches(cells: &Cells) -> BTreeMap<(usize, usize), f64> {
    let mut patches: BTreeMap<(usize, usize), (f64, usize)> = BTreeMap::new();
    for (&(row, col, _), value) in cells {
        let entry = patches.entry((row, col)).or_default();
        *entry = (entry.0 + value, entry.1 + 1);
    }
    patches.into_iter().map(|(patch, (sum, n))| (patch, sum / n as f64)).collect()
}
