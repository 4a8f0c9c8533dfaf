//! Runs an experiment: trains what is not trained yet, scores what is not scored yet, and writes the record.
//!
//! In: a [`Resolved`] experiment and a folder. Out: the record ([`Record`]). The scores do not depend on the number of jobs
//! or threads, nor on how often the run was interrupted. Cost: the trainings, each with the memory of one.

use super::measure::{Systems, home_of, measure};
use super::record::{DetailRow, Record, Session, Timed, TrainingRow};
use super::resolve::{Area, Resolved};
use super::rows::{Key, ScoreRow};
use super::spec::{DetailSpec, ExperimentSpec, Kind, SketchSpec, StyleSpec};
use super::{extras, fit};
use crate::control::{Checkpoints, Control, Progress, Stage};
use crate::error::{Error, Result};
use crate::file;
use crate::grid::Cell;
use crate::machine;
use crate::seed::Seed;
use crate::style::{
    Exemplar, GenerationConfig, Registry, Style, StyleConfig, TrainingSummary, learn_coarse, learn_detail,
    unseen_surface,
};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two states of a training that are kept: what an interruption can cost.
const CHECKPOINTS: Duration = Duration::from_secs(30);

/// How to run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The folder of the record.
    pub out: PathBuf,
    /// Styles trained at once, at least 1.
    pub jobs: usize,
    /// Begin anew, whatever the folder holds.
    pub restart: bool,
    /// The folder of trained styles, which several experiments may share; none is the record's own.
    pub styles: Option<PathBuf>,
}

/// What happens while an experiment runs; told from several threads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// So many styles are to be trained, in so many steps.
    Training {
        /// Styles.
        styles: usize,
        /// Styles that an earlier run has trained.
        cached: usize,
        /// Steps of all that are left.
        steps: u64,
    },
    /// So many steps of a training more are done.
    Steps(u64),
    /// So many rows are to be scored.
    Scoring {
        /// Rows left.
        rows: u64,
        /// Rows that an earlier run has scored.
        kept: u64,
    },
    /// So many rows more are scored.
    Scored(u64),
    /// Something failed, which is a row with its error.
    Failed(String),
}

/// What a run did.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Rows in `scores.csv`.
    pub rows: usize,
    /// Rows with an error.
    pub failed: usize,
    /// Seconds of all sessions of the record.
    pub seconds: f64,
}

/// A style that is to be there: of which area, configured how, with which seed.
struct Wanted<'a> {
    area: &'a Area,
    style: &'a StyleSpec,
    config: StyleConfig,
    seed: u64,
    path: PathBuf,
    /// Where the same style without detail is, if there is one.
    coarse: PathBuf,
}

/// A trained style, or why there is none.
type Trained = std::result::Result<Style, String>;

/// Runs what of the experiment is not yet in the record.
///
/// # Errors
/// When the record is of another experiment or build, or cannot be written. A training or a system that fails gives rows with
/// its error instead.
pub fn run(resolved: &Resolved, options: &RunOptions, watch: &(dyn Fn(Event) + Sync)) -> Result<Outcome> {
    if options.jobs == 0 {
        return Err(Error::value("number of jobs", 0, "allowed: at least 1"));
    }
    let started = Instant::now();
    let spec = &resolved.spec;
    let record = Record::new(&options.out);
    let mut machine = record.begin(spec, options.restart)?;
    let columns = spec.columns();
    let finished = record.journal(columns.len())?;

    let first = if spec.kind == Kind::Cost { extras::preparation(resolved)? } else { Vec::new() };
    let folder = options.styles.clone().unwrap_or_else(|| record.path("styles"));
    file::create_folder(&folder)?;
    let wanted = wanted(resolved, &folder)?;
    let (styles, trained) = train_all(&wanted, options.jobs, watch)?;
    let trainings: Vec<TrainingRow> =
        wanted.iter().zip(&styles).map(|(wanted, style)| training_row(wanted, style)).collect();
    record.write_training(&trainings)?;
    let peak_of_training = machine::peak_memory();

    let plan = Plan { resolved, columns: &columns, wanted: &wanted, styles: &styles, record: &record };
    let (rows, scored) = plan.score_all(finished, watch)?;
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
    match spec.kind {
        Kind::Exemplar => extras::exemplars(resolved, &record)?,
        Kind::Cost => extras::stages(&record, first, &trainings, peak_of_training, &rows)?,
        Kind::Disentanglement => {
            extras::places(resolved, &record, &|area, seed| plan.systems(area, seed, true))?
        }
        _ => {}
    }
    if spec.pictures > 0 {
        super::pictures::write(resolved, &record, &|area, seed| plan.systems(area, seed, true))?;
    }
    Ok(Outcome {
        rows: rows.len(),
        failed: rows.iter().filter(|(row, _)| !row.error.is_empty()).count(),
        seconds: machine.session.iter().map(|s| s.seconds).sum(),
    })
}

/// Every style of every area and seed.
fn wanted<'a>(resolved: &'a Resolved, folder: &Path) -> Result<Vec<Wanted<'a>>> {
    let mut all = Vec::new();
    for area in &resolved.areas {
        for style in &resolved.spec.style {
            let config = resolved.spec.config_of(style)?;
            for &seed in &resolved.spec.seeds {
                let path = |detail| -> Result<PathBuf> {
                    Ok(folder.join(format!("{}.safetensors", hash(&config, detail, area, seed)?)))
                };
                let (path, coarse) = (path(style.detail.as_ref())?, path(None)?);
                all.push(Wanted { area, style, config: config.clone(), seed, path, coarse });
            }
        }
    }
    Ok(all)
}

/// What a training depends on: not how terrain is made with the style, but for the correction, which is part of how well it
/// rebuilds its exemplar.
fn of_training(config: &StyleConfig) -> StyleConfig {
    let generation =
        GenerationConfig { correction: config.generation.correction, ..GenerationConfig::default() };
    StyleConfig { generation, ..config.clone() }
}

/// Tells trained styles apart by all that they depend on.
fn hash(config: &StyleConfig, detail: Option<&DetailSpec>, area: &Area, seed: u64) -> Result<String> {
    let plain = |e| Error::value("configuration", e, "plain data");
    let config = serde_json::to_string(&of_training(config)).map_err(plain)?;
    let e = &area.source.info;
    let mut hasher = Sha256::new();
    hasher.update(config.as_bytes());
    if let Some(detail) = detail {
        hasher.update(serde_json::to_string(detail).map_err(plain)?.as_bytes());
    }
    hasher.update(e.sha256.as_bytes());
    hasher.update(format!("{} {} {:?} {seed}", e.row, e.col, e.cell_size));
    Ok(file::hex(&hasher.finalize()[..12]))
}

/// Loads what is trained and trains the rest, `jobs` at a time; in the order of `wanted`, with the number that was trained.
fn train_all(
    wanted: &[Wanted<'_>],
    jobs: usize,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(Vec<Trained>, usize)> {
    let slots: Vec<Mutex<Option<Result<Trained>>>> = wanted
        .iter()
        .map(|w| Mutex::new(load(&w.path, w, w.style.detail.is_some()).map(|style| Ok(Ok(style)))))
        .collect();
    let fill = |slot: &Mutex<Option<Result<Trained>>>, value| {
        *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    };
    let is_open = |slot: &Mutex<Option<_>>| slot.lock().unwrap_or_else(PoisonError::into_inner).is_none();
    let open: Vec<usize> = (0..wanted.len()).filter(|&i| is_open(&slots[i])).collect();
    let steps = open.iter().map(|&i| wanted[i].config.model.epochs as u64).sum();
    watch(Event::Training { styles: wanted.len(), cached: wanted.len() - open.len(), steps });
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(open.len()) {
            scope.spawn(|| {
                while let Some(&i) = open.get(next.fetch_add(1, Ordering::Relaxed)) {
                    fill(&slots[i], train(&wanted[i], watch));
                }
            });
        }
    });
    let styles = slots.into_iter().map(|slot| {
        let filled = slot.into_inner().unwrap_or_else(PoisonError::into_inner);
        filled.unwrap_or_else(|| Ok(Err("the training did not end".to_owned())))
    });
    Ok((styles.collect::<Result<_>>()?, open.len()))
}

/// A style from an earlier run; a file that is not it, or torn, is trained again.
fn load(path: &Path, wanted: &Wanted<'_>, with_detail: bool) -> Option<Style> {
    let style = Style::load(path).ok()?;
    // A training that ended early says so in its number of epochs.
    let mut config = of_training(&style.config());
    config.model.epochs = wanted.config.model.epochs;
    let is_it = config == of_training(&wanted.config)
        && style.origin.exemplar == wanted.area.source.info
        && style.origin.seed == Seed(wanted.seed)
        && style.detail.is_some() == with_detail;
    style.with_generation(&wanted.config.generation).ok().filter(|_| is_it)
}

fn train(wanted: &Wanted<'_>, watch: &(dyn Fn(Event) + Sync)) -> Result<Trained> {
    let mut told = 0;
    let checkpoint = wanted.path.with_extension("checkpoint");
    let detail_checkpoint = wanted.path.with_extension("detail-checkpoint");
    let learned = without_panic(|| {
        let mut progress = |done: &Progress<'_>| {
            if matches!(done.stage, Stage::Coarse(_)) {
                // Also those that an earlier run has done.
                watch(Event::Steps((done.step - told) as u64));
                told = done.step;
            }
        };
        let kept =
            |path: &Path| Checkpoints { path: path.to_owned(), interval: CHECKPOINTS, resume: path.exists() };
        let (source, seed) = (&wanted.area.source, Seed(wanted.seed));
        let plan = wanted.config.plan()?;
        // Another style of the experiment, or another experiment, may have trained the coarse model.
        let known = wanted.style.detail.as_ref().and_then(|_| load(&wanted.coarse, wanted, false));
        let mut style = match known {
            Some(style) => style,
            None => {
                let checkpoints = Some(kept(&checkpoint));
                let control = Control { checkpoints, ..Control::new(&mut progress) };
                learn_coarse(source, &wanted.config.extraction, &*plan, seed, control)?
            }
        };
        if let Some(detail) = &wanted.style.detail {
            let exemplar = Exemplar::new(source, &wanted.config.extraction, seed)?;
            let unseen = unseen_surface(&*plan, &exemplar, Control::new(&mut |_| {}))?;
            let control =
                Control { checkpoints: Some(kept(&detail_checkpoint)), ..Control::new(&mut progress) };
            learn_detail(&mut style, source, &*plan, unseen, &*detail.plan()?, control)?;
        }
        Ok(style)
    });
    watch(Event::Steps(wanted.config.model.epochs.saturating_sub(told) as u64));
    file::remove(&checkpoint)?;
    file::remove(&detail_checkpoint)?;
    match learned {
        Ok(style) => {
            style.save(&wanted.path)?;
            // As read back, so that a continued run does the same as an uninterrupted one.
            Style::load(&wanted.path).map(Ok)
        }
        Err(error) => {
            let message = format!("training failed: {error}");
            watch(Event::Failed(format!(
                "{} on {}, seed {}: {message}",
                wanted.style.name, wanted.area.name, wanted.seed
            )));
            Ok(Err(message))
        }
    }
}

fn training_row(wanted: &Wanted<'_>, style: &Trained) -> TrainingRow {
    let network = style.as_ref().ok().and_then(|style| style.network().ok());
    let training = network.map(|network| network.training());
    let value = |f: fn(&TrainingSummary) -> f64| training.map_or(0.0, f);
    TrainingRow {
        style: wanted.style.name.clone(),
        area: wanted.area.name.clone(),
        seed: wanted.seed,
        parameters: network.map_or(0, |network| network.model().network().params().value_count()),
        epochs: training.map_or(0, |t| t.epochs),
        seconds: value(|t| t.seconds),
        preparation_seconds: value(|t| t.preparation_seconds),
        seconds_per_epoch: value(|t| t.seconds_per_epoch),
        detail: style.as_ref().ok().and_then(|style| style.detail.as_ref()).map(|detail| {
            let account = detail.account();
            DetailRow {
                seconds: account.seconds,
                gain: f64::from(detail.gain()),
                psnr: account.figure("PSNR"),
            }
        }),
        error: style.as_ref().err().cloned().unwrap_or_default(),
    }
}

/// What is scored, with what was trained for it.
struct Plan<'a> {
    resolved: &'a Resolved,
    columns: &'a [&'static str],
    wanted: &'a [Wanted<'a>],
    styles: &'a [Trained],
    record: &'a Record,
}

impl Plan<'_> {
    fn spec(&self) -> &ExperimentSpec {
        &self.resolved.spec
    }

    /// The trained styles of an area and seed.
    fn styles_of(&self, area: &Area, seed: u64) -> impl Iterator<Item = (&StyleSpec, &Trained)> + use<'_> {
        let all = self.wanted.iter().zip(self.styles);
        let name = area.name.clone();
        all.filter(move |(w, _)| w.area.name == name && w.seed == seed).map(|(w, style)| (w.style, style))
    }

    /// The systems of an area and seed by the names that they have in the scores, those of failed trainings left out.
    fn systems(&self, area: &Area, seed: u64, with_interpolators: bool) -> Result<Systems<'_>> {
        let mut systems = Systems { named: Vec::new(), styles: Vec::new() };
        for (spec, style) in self.styles_of(area, seed) {
            let Ok(style) = style else { continue };
            let uses = self.spec().uses(spec)?;
            for (name, system) in style.uses() {
                if !uses.contains(&name) {
                    continue;
                }
                systems.styles.push((spec.label(&name), style));
                systems.named.push((spec.label(&name), system));
            }
        }
        if with_interpolators {
            let names = self.spec().interpolator_names()?;
            systems.named.extend(
                Registry::default().interpolators().iter().filter(|(name, _)| names.contains(name)).cloned(),
            );
        }
        Ok(systems)
    }

    /// The cells of an area that a sketch is taken of.
    fn cells(&self, area: &Area, sketch: &SketchSpec) -> Vec<Cell> {
        match self.spec().kind {
            Kind::Fit => vec![Cell::new(area.source.info.row, area.source.info.col)],
            Kind::Drawings => vec![Cell::new(0, 0)],
            _ => home_of(self.resolved, area, sketch).patches.clone(),
        }
    }

    /// All rows in the experiment's order, and how many were scored now.
    fn score_all(
        &self,
        mut finished: BTreeMap<Key, Timed>,
        watch: &(dyn Fn(Event) + Sync),
    ) -> Result<(Vec<Timed>, usize)> {
        let systems = self.spec().systems()?;
        let sketches = self.spec().sketches();
        let mut tasks: Vec<(&Area, Cell, &SketchSpec)> = Vec::new();
        for area in &self.resolved.areas {
            let of: Vec<_> = sketches
                .iter()
                .flat_map(|sketch| self.cells(area, sketch).into_iter().map(move |cell| (area, cell, sketch)))
                .collect();
            // Patch by patch, as far as the sketches are of the same ones.
            let place = |cell: Cell| of.iter().position(|task| task.1 == cell);
            let mut sorted: Vec<_> = of.clone();
            sorted.sort_by_key(|task| place(task.1));
            tasks.extend(sorted);
        }
        let keys = |&(area, cell, sketch): &(&Area, Cell, &SketchSpec)| -> Vec<Key> {
            let key = |seed: u64, system: &String| Key {
                system: system.clone(),
                area: area.name.clone(),
                row: cell.row,
                col: cell.col,
                seed,
                sketch: sketch.name.clone(),
            };
            self.spec().seeds.iter().flat_map(|&seed| systems.iter().map(move |s| key(seed, s))).collect()
        };
        let open: Vec<_> =
            tasks.iter().filter(|task| keys(task).iter().any(|key| !finished.contains_key(key))).collect();
        let per_task = (systems.len() * self.spec().seeds.len()) as u64;
        let (left, kept) = (open.len() as u64 * per_task, (tasks.len() - open.len()) as u64 * per_task);
        watch(Event::Scoring { rows: left, kept });
        let journal = Mutex::new(());
        let new: Vec<Vec<Timed>> = open
            .par_iter()
            .map(|&&(area, cell, sketch)| {
                let rows = match self.spec().kind {
                    Kind::Fit => self.fit(area)?,
                    _ => self.rebuild(area, cell, sketch)?,
                };
                let guard = journal.lock().unwrap_or_else(PoisonError::into_inner);
                self.record.note(&rows)?;
                drop(guard);
                for (row, _) in rows.iter().filter(|(row, _)| !row.error.is_empty()) {
                    let k = &row.key;
                    watch(Event::Failed(format!(
                        "{} on {} {},{}: {}",
                        k.system, k.area, k.row, k.col, row.error
                    )));
                }
                watch(Event::Scored(rows.len() as u64));
                Ok(rows)
            })
            .collect::<Result<_>>()?;
        let scored = new.iter().map(Vec::len).sum();
        finished.extend(new.into_iter().flatten().map(|row| (row.0.key.clone(), row)));
        let rows = tasks.iter().flat_map(keys).map(|key| {
            finished.remove(&key).ok_or_else(|| {
                Error::value(
                    "row",
                    format!("{key:?}"),
                    "every system gives a row: this is a fault of the program",
                )
            })
        });
        Ok((rows.collect::<Result<_>>()?, scored))
    }

    /// The rows of one patch and sketch: every system with every seed. Interpolators draw nothing at random, so that their
    /// rows of the first seed are those of all.
    fn rebuild(&self, area: &Area, cell: Cell, sketch: &SketchSpec) -> Result<Vec<Timed>> {
        let interpolators = self.spec().interpolator_names()?;
        // Random lines of a drawing differ from seed to seed, and so does what is made of them.
        let draws_anew = self.spec().kind == Kind::Drawings;
        let mut rows: Vec<Timed> = Vec::new();
        let mut shared: Vec<Timed> = Vec::new();
        for (i, &seed) in self.spec().seeds.iter().enumerate() {
            let key = |system: &str| Key {
                system: system.to_owned(),
                area: area.name.clone(),
                row: cell.row,
                col: cell.col,
                seed,
                sketch: sketch.name.clone(),
            };
            for (style, trained) in self.styles_of(area, seed) {
                if let Err(error) = trained {
                    let names = self.spec().uses(style)?;
                    rows.extend(
                        names.iter().map(|n| (self.failed(key(&style.label(n)), error.clone()), 0.0)),
                    );
                }
            }
            let systems = self.systems(area, seed, i == 0 || draws_anew)?;
            let all = without_panic(|| measure(self.resolved, area, cell, sketch, &systems, seed));
            let all = match all {
                Ok(all) => all,
                Err(error) => {
                    let failed = |name: &String| (self.failed(key(name), error.to_string()), 0.0);
                    rows.extend(systems.named.iter().map(|(name, _)| failed(name)));
                    Vec::new()
                }
            };
            for one in all {
                let value = |name: &&str| one.values.iter().find(|(n, _)| n == name).and_then(|(_, v)| *v);
                let scored = ScoreRow {
                    key: key(&one.system),
                    relief: one.relief,
                    line_share: one.line_share,
                    values: self.columns.iter().map(value).collect(),
                    error: one.error,
                };
                rows.push((scored, one.seconds));
            }
            if draws_anew {
                continue;
            }
            if i == 0 {
                shared =
                    rows.iter().filter(|(r, _)| interpolators.contains(&r.key.system)).cloned().collect();
            } else {
                rows.extend(shared.iter().map(|(row, seconds)| {
                    let key = Key { seed, ..row.key.clone() };
                    (ScoreRow { key, ..row.clone() }, *seconds)
                }));
            }
        }
        Ok(rows)
    }

    /// The rows of one exemplar.
    fn fit(&self, area: &Area) -> Result<Vec<Timed>> {
        let mut rows = Vec::new();
        for &seed in &self.spec().seeds {
            let key = |system: &str| fit::key(area, system, seed);
            for (style, trained) in self.styles_of(area, seed) {
                let row = match trained {
                    Ok(style_) => fit::reconstruct(area, style_, key(&style.name), self.columns),
                    Err(error) => (self.failed(key(&style.name), error.clone()), 0.0),
                };
                rows.push(row);
            }
            let names = self.spec().interpolator_names()?;
            for (name, system) in
                Registry::default().interpolators().iter().filter(|(name, _)| names.contains(name))
            {
                rows.push(fit::interpolate(
                    area,
                    &**system,
                    &self.spec().extraction,
                    key(name),
                    self.columns,
                ));
            }
        }
        Ok(rows)
    }

    fn failed(&self, key: Key, error: String) -> ScoreRow {
        ScoreRow { key, relief: 0.0, line_share: 0.0, values: vec![None; self.columns.len()], error }
    }
}

/// What `work` gives; a fault of ours in one cell of a long run is that cell's error and not the end of all.
fn without_panic<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        let text = text.unwrap_or_else(|| "without a word".to_owned());
        Err(Error::value(
            "state of the program",
            format!("a panic ({text})"),
            "a fault of monadnock: please report it",
        ))
    })
}
