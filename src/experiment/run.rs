//! Runs an experiment: trains what is not trained yet, scores what is not scored yet, and writes the record.
//!
//! In: a [`Resolved`] experiment and a folder. Out: the record ([`Record`]). The scores do not depend on the number of jobs
//! or threads, nor on how often the run was interrupted. Cost: the trainings, each with the memory of one.

use super::areas::{Area, Resolved};
use super::events::Event;
use super::measure::{Task, value_of};
use super::pictures::Gallery;
use super::protocol::{Finished, Protocol};
use super::protocols;
use super::record::{Record, Session};
use super::rows::{Key, ScoreRow, Timed};
use super::spec::{ExperimentSpec, SketchSpec};
use super::styles::Styles;
use crate::control::without_panic;
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::machine;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// How to run.
#[derive(Clone, Debug)]
pub(crate) struct RunOptions {
    /// The folder of the record.
    pub(crate) out: PathBuf,
    /// Styles trained at once, at least 1.
    pub(crate) jobs: usize,
    /// Start over, whatever the folder holds.
    pub(crate) restart: bool,
    /// The folder of trained styles, which several experiments may share; none is the record's own.
    pub(crate) styles: Option<PathBuf>,
}

/// What a run did.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// Rows in `scores.csv`.
    pub(crate) rows: usize,
    /// Rows with an error.
    pub(crate) failed: usize,
    /// Seconds of all sessions of the record.
    pub(crate) seconds: f64,
}

/// Runs what of the experiment is not yet in the record.
///
/// # Errors
/// When the record is of another experiment or build, or cannot be written. A training or a system that fails gives rows with
/// its error instead.
pub(crate) fn run(
    resolved: &Resolved,
    options: &RunOptions,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Outcome> {
    if options.jobs == 0 {
        return Err(Error::value("number of jobs", 0, "allowed: at least 1"));
    }
    let started = Instant::now();
    let spec = &resolved.spec;
    let protocol = protocols::of(spec.kind);
    let record = Record::new(&options.out);
    let mut machine = record.begin(spec, options.restart)?;
    let columns = spec.columns();
    let finished = record.journal(columns.len())?;

    protocol.before_training(resolved, &record)?;
    let folder = options.styles.clone().unwrap_or_else(|| record.path("styles"));
    let styles = Styles::train(resolved, &folder, options.jobs, watch)?;
    let trainings = styles.rows();
    record.write_table("training.csv", &trainings)?;
    let (peak_of_training, trained) = (machine::peak_memory(), styles.trained);

    let plan = Plan { resolved, protocol, columns: &columns, styles, record: &record };
    let (mut rows, scored) = plan.score_all(finished, watch)?;
    protocol.complete(&record, &mut rows)?;
    record.write_scores(&columns, &rows)?;
    machine.session.push(Session {
        seconds: started.elapsed().as_secs_f64(),
        jobs: options.jobs,
        threads: rayon::current_num_threads(),
        trained,
        rows: scored,
        peak_memory_mb: machine::peak_memory().unwrap_or_default() / 1_000_000,
    });
    record.write_machine(&machine)?;
    protocol.after_scoring(&Finished {
        resolved,
        styles: &plan.styles,
        record: &record,
        trainings: &trainings,
        peak_of_training,
        rows: &rows,
    })?;
    if spec.pictures > 0 {
        let gallery = Gallery::new(resolved, &plan.styles, &record)?;
        protocol.pictures(&gallery)?;
    }
    Ok(Outcome {
        rows: rows.len(),
        failed: rows.iter().filter(|(row, _)| !row.error.is_empty()).count(),
        seconds: machine.session.iter().map(|s| s.seconds).sum(),
    })
}

/// What is scored, with what was trained for it.
struct Plan<'a> {
    resolved: &'a Resolved,
    protocol: &'a dyn Protocol,
    columns: &'a [&'static str],
    styles: Styles<'a>,
    record: &'a Record,
}

/// A patch of an area with a sketch.
type Site<'a> = (&'a Area, Cell, &'a SketchSpec);

fn key(&(area, cell, sketch): &Site<'_>, seed: u64, system: &str) -> Key {
    let (system, area, sketch) = (system.to_owned(), area.name.clone(), sketch.name.clone());
    Key { system, area, row: cell.row, col: cell.col, seed, sketch }
}

impl Plan<'_> {
    fn spec(&self) -> &ExperimentSpec {
        &self.resolved.spec
    }

    /// Everything that is scored, in the experiment's order: patch by patch, as far as the sketches are of the same ones.
    fn sites<'s>(&'s self, sketches: &'s [SketchSpec]) -> Vec<Site<'s>> {
        let mut sites = Vec::new();
        for area in &self.resolved.areas {
            let of_sketch = |sketch: &'s SketchSpec| {
                let cells = self.protocol.cells(self.resolved, area, sketch);
                cells.into_iter().map(move |cell| (area, cell, sketch))
            };
            let mut of_area: Vec<Site<'_>> = sketches.iter().flat_map(of_sketch).collect();
            let cells: Vec<Cell> = of_area.iter().map(|site| site.1).collect();
            of_area.sort_by_key(|site| cells.iter().position(|cell| *cell == site.1));
            sites.extend(of_area);
        }
        sites
    }

    /// All rows in the experiment's order, and how many were scored now.
    fn score_all(
        &self,
        mut finished: BTreeMap<Key, Timed>,
        watch: &(dyn Fn(Event) + Sync),
    ) -> Result<(Vec<Timed>, usize)> {
        let (systems, sketches, seeds) = (self.spec().systems()?, self.spec().sketches(), &self.spec().seeds);
        let sites = self.sites(&sketches);
        let keys = |site: &Site<'_>| -> Vec<Key> {
            seeds.iter().flat_map(|&seed| systems.iter().map(move |s| key(site, seed, s))).collect()
        };
        let open: Vec<_> =
            sites.iter().filter(|site| keys(site).iter().any(|key| !finished.contains_key(key))).collect();
        let per_site = (systems.len() * seeds.len()) as u64;
        let (left, kept) = (open.len() as u64 * per_site, (sites.len() - open.len()) as u64 * per_site);
        watch(Event::Scoring { rows: left, kept });
        let journal = Mutex::new(());
        let new: Vec<Vec<Timed>> = open
            .par_iter()
            .map(|site| {
                let rows = self.score(site)?;
                let guard = journal.lock().unwrap_or_else(PoisonError::into_inner);
                self.record.note(&rows)?;
                drop(guard);
                for (row, _) in rows.iter().filter(|(row, _)| !row.error.is_empty()) {
                    let Key { system, area, row: at, col, .. } = &row.key;
                    watch(Event::Failed(format!("{system} on {area} {at},{col}: {}", row.error)));
                }
                watch(Event::Scored(rows.len() as u64));
                Ok(rows)
            })
            .collect::<Result<_>>()?;
        let scored = new.iter().map(Vec::len).sum();
        finished.extend(new.into_iter().flatten().map(|row| (row.0.key.clone(), row)));
        let rows = sites.iter().flat_map(keys).map(|key| {
            let fault = "every system gives a row: this is a fault of the program";
            finished.remove(&key).ok_or_else(|| Error::value("row", format!("{key:?}"), fault))
        });
        Ok((rows.collect::<Result<_>>()?, scored))
    }

    /// The rows of one site: every system with every seed. Interpolators draw nothing at random, so that their rows of the
    /// first seed are those of all, unless the protocol draws their lines.
    fn score(&self, site: &Site<'_>) -> Result<Vec<Timed>> {
        let (area, cell, sketch) = *site;
        let interpolators = self.spec().interpolator_names()?;
        let failed = |seed: u64, system: &str, error: &str| {
            (ScoreRow::failed(key(site, seed, system), self.columns.len(), error), 0.0)
        };
        let mut rows: Vec<Timed> = Vec::new();
        let mut shared: Vec<Timed> = Vec::new();
        for (i, &seed) in self.spec().seeds.iter().enumerate() {
            rows.extend(
                self.styles.failed(area, seed)?.iter().map(|(name, error)| failed(seed, name, error)),
            );
            let with_interpolators = i == 0 || self.protocol.draws_lines();
            let systems = self.styles.systems(area, seed, with_interpolators)?;
            let (resolved, record) = (self.resolved, self.record);
            let task = Task { resolved, area, cell, sketch, systems: &systems, seed, record };
            match without_panic(|| self.protocol.measure(&task)) {
                Ok(all) => rows.extend(all.into_iter().map(|one| {
                    let values = self.columns.iter().map(|name| value_of(&one.values, name)).collect();
                    let row = ScoreRow {
                        relief: one.relief,
                        line_share: one.line_share,
                        values,
                        ..ScoreRow::failed(key(site, seed, &one.system), 0, &one.error)
                    };
                    (row, one.seconds)
                })),
                Err(error) => {
                    let error = error.to_string();
                    rows.extend(systems.named.iter().map(|(name, _)| failed(seed, name, &error)));
                }
            }
            if i == 0 {
                shared =
                    rows.iter().filter(|(r, _)| interpolators.contains(&r.key.system)).cloned().collect();
            } else if !with_interpolators {
                rows.extend(shared.iter().cloned().map(|(mut row, seconds)| {
                    row.key.seed = seed;
                    (row, seconds)
                }));
            }
        }
        Ok(rows)
    }
}
