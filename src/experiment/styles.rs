//! The styles of an experiment, trained or read from an earlier run, and the systems that they make.
//!
//! All that this room knows of training stands here.

use super::areas::{Area, Resolved};
use super::events::Event;
use super::measure::Systems;
use super::record::TrainingRow;

use super::spec::{DetailSpec, ExperimentSpec, StyleSpec};
use crate::control::{Checkpoints, Control, Progress, Stage, without_panic};
use crate::error::{Error, Result};
use crate::file;
use crate::seed::Seed;
use crate::style::{
    GenerationConfig, Named, Recipe, Registry, Style, StyleConfig, SystemPlan, learn, unfinished,
};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two states of a training that are kept: what an interruption can cost.
const CHECKPOINTS: Duration = Duration::from_secs(30);

/// A style to be trained: of which area, configured how, with which seed.
struct Training<'a> {
    area: &'a Area,
    style: &'a StyleSpec,
    config: StyleConfig,
    plans: Vec<Arc<dyn SystemPlan>>,
    seed: u64,
    path: PathBuf,
    /// Where the same style without detail is, if there is one.
    coarse: PathBuf,
}

/// A trained style, or why there is none.
type Outcome = std::result::Result<Style, String>;

/// Every style of every area and seed.
pub(super) struct Styles<'a> {
    spec: &'a ExperimentSpec,
    trainings: Vec<Training<'a>>,
    outcomes: Vec<Outcome>,
    /// How many were trained now.
    pub(super) trained: usize,
}

impl<'a> Styles<'a> {
    /// Loads what lies trained in `folder` and trains the rest, `jobs` at a time.
    pub(super) fn train(
        resolved: &'a Resolved,
        folder: &Path,
        jobs: usize,
        watch: &(dyn Fn(Event) + Sync),
    ) -> Result<Self> {
        file::create_folder(folder)?;
        let trainings = trainings(resolved, folder)?;
        let slots: Vec<Mutex<Option<Result<Outcome>>>> = trainings
            .iter()
            .map(|t| Mutex::new(load(&t.path, t, t.style.detail.is_some()).map(|s| Ok(Ok(s)))))
            .collect();
        let lock = |i: usize| slots[i].lock().unwrap_or_else(PoisonError::into_inner);
        let open: Vec<usize> = (0..trainings.len()).filter(|&i| lock(i).is_none()).collect();
        let steps = open.iter().map(|&i| trainings[i].config.model.epochs as u64).sum();
        watch(Event::Training { styles: trainings.len(), cached: trainings.len() - open.len(), steps });
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(open.len()) {
                scope.spawn(|| {
                    while let Some(&i) = open.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let outcome = train(&trainings[i], watch);
                        *lock(i) = Some(outcome);
                    }
                });
            }
        });
        let outcomes = slots.into_iter().map(|slot| {
            let filled = slot.into_inner().unwrap_or_else(PoisonError::into_inner);
            filled.unwrap_or_else(|| Ok(Err("the training did not end".to_owned())))
        });
        Ok(Self {
            spec: &resolved.spec,
            outcomes: outcomes.collect::<Result<_>>()?,
            trained: open.len(),
            trainings,
        })
    }

    /// The styles of an area and seed.
    fn of(&self, area: &Area, seed: u64) -> impl Iterator<Item = (&StyleSpec, &Outcome)> {
        let all = self.trainings.iter().zip(&self.outcomes);
        let name = area.name.clone();
        all.filter(move |(t, _)| t.area.name == name && t.seed == seed).map(|(t, outcome)| (t.style, outcome))
    }

    /// The systems of an area and seed by the names that they have in the scores, those of failed trainings left out.
    pub(super) fn systems(&self, area: &Area, seed: u64, with_interpolators: bool) -> Result<Systems<'_>> {
        let mut systems = Systems { named: Vec::new(), styles: Vec::new() };
        for (spec, outcome) in self.of(area, seed) {
            let Ok(style) = outcome else { continue };
            let uses = self.spec.uses(spec)?;
            let used = style.uses().into_iter().filter(|(name, _)| uses.contains(name));
            for (label, (_, system)) in self.spec.labels(spec)?.into_iter().zip(used) {
                systems.styles.push((label.clone(), style));
                systems.named.push((label, system));
            }
        }
        if with_interpolators {
            systems.named.extend(self.interpolators()?);
        }
        Ok(systems)
    }

    fn interpolators(&self) -> Result<impl Iterator<Item = Named>> {
        let names = self.spec.interpolator_names()?;
        let all = Registry::default().interpolators().to_vec();
        Ok(all.into_iter().filter(move |(name, _)| names.contains(name)))
    }

    /// The systems of an area and seed whose training failed, with the error.
    pub(super) fn failed(&self, area: &Area, seed: u64) -> Result<Vec<(String, String)>> {
        let mut failed = Vec::new();
        for (style, outcome) in self.of(area, seed) {
            if let Err(error) = outcome {
                failed.extend(self.spec.labels(style)?.into_iter().map(|label| (label, error.clone())));
            }
        }
        Ok(failed)
    }

    /// What is known of every training.
    pub(super) fn rows(&self) -> Vec<TrainingRow> {
        self.trainings.iter().zip(&self.outcomes).map(|(training, outcome)| row(training, outcome)).collect()
    }
}

fn trainings<'a>(resolved: &'a Resolved, folder: &Path) -> Result<Vec<Training<'a>>> {
    let mut all = Vec::new();
    for area in &resolved.areas {
        for style in &resolved.spec.style {
            let config = resolved.spec.config_of(style)?;
            for &seed in &resolved.spec.seeds {
                let path = |detail| -> Result<PathBuf> {
                    Ok(folder
                        .join(format!("{}.safetensors", hash(&config, &style.learns, detail, area, seed)?)))
                };
                let (path, coarse) = (path(style.detail.as_ref())?, path(None)?);
                let plans = resolved.spec.plans(style)?;
                all.push(Training { area, style, config: config.clone(), plans, seed, path, coarse });
            }
        }
    }
    Ok(all)
}

/// What a training depends on: not how terrain is made with the style, but for the correction, which is part of how well it
/// rebuilds its exemplar.
fn of_training(config: &StyleConfig) -> StyleConfig {
    let correction = config.generation.correction;
    StyleConfig {
        generation: GenerationConfig { correction, ..GenerationConfig::default() },
        ..config.clone()
    }
}

/// Tells trained styles apart by all that they depend on.
fn hash(
    config: &StyleConfig,
    learns: &[String],
    detail: Option<&DetailSpec>,
    area: &Area,
    seed: u64,
) -> Result<String> {
    let plain = |e| Error::value("configuration", e, "plain data");
    let e = &area.source.info;
    let mut hasher = Sha256::new();
    hasher.update(serde_json::to_string(&of_training(config)).map_err(plain)?);
    if let Some(detail) = detail {
        hasher.update(serde_json::to_string(detail).map_err(plain)?);
    }
    if !learns.is_empty() {
        // What these learn from reaches beyond the window.
        hasher.update(format!("{learns:?} {}", e.source_sha256));
    }
    hasher.update(e.sha256.as_bytes());
    hasher.update(format!("{} {} {:?} {seed}", e.row, e.col, e.cell_size));
    Ok(file::hex(&hasher.finalize()[..12]))
}

/// A style from an earlier run; a file that is not it, or torn, is trained again.
fn load(path: &Path, training: &Training<'_>, with_detail: bool) -> Option<Style> {
    let style = Style::load(path).ok()?;
    // A training that ended early says so in its number of epochs.
    let mut config = of_training(&style.config());
    config.model.epochs = training.config.model.epochs;
    // A style without a network has no configuration of one.
    let is_configured = style.network().is_err() || config == of_training(&training.config);
    let names = |style: &Style| style.coarse.iter().map(|system| system.name()).collect::<Vec<_>>();
    let is_it = is_configured
        && names(&style) == training.plans.iter().map(|plan| plan.name()).collect::<Vec<_>>()
        && style.origin.exemplar == training.area.source.info
        && style.origin.seed == Seed(training.seed)
        && style.detail.is_some() == with_detail;
    style.with_generation(&training.config.generation).ok().filter(|_| is_it)
}

fn train(training: &Training<'_>, watch: &(dyn Fn(Event) + Sync)) -> Result<Outcome> {
    let mut told = 0;
    let learned = without_panic(|| {
        let mut progress = |done: &Progress<'_>| {
            if matches!(done.stage, Stage::Coarse(_)) {
                // Also those that an earlier run has done.
                watch(Event::Steps((done.step - told) as u64));
                told = done.step;
            }
        };
        let mut recipe = Recipe::network(&training.config, Seed(training.seed))?;
        recipe.systems.clone_from(&training.plans);
        recipe.detail = training.style.detail.as_ref().map(DetailSpec::plan).transpose()?;
        // Another style of the experiment, or another experiment, may have trained the coarse model.
        recipe.known = recipe.detail.as_ref().and_then(|_| load(&training.coarse, training, false));
        let checkpoints = Checkpoints { path: training.path.clone(), interval: CHECKPOINTS, resume: true };
        let control = Control { checkpoints: Some(checkpoints), ..Control::new(&mut progress) };
        learn(&training.area.source, &recipe, control).or_else(|error| {
            // A training that failed is not to be continued.
            if let Some((_, path)) = unfinished(&training.path, &recipe) {
                file::remove(&path)?;
            }
            Err(error)
        })
    });
    watch(Event::Steps(training.config.model.epochs.saturating_sub(told) as u64));
    match learned {
        // As read back, so that a continued run does the same as an uninterrupted one.
        Ok(_) => Style::load(&training.path).map(Ok),
        Err(error) => {
            let message = format!("training failed: {error}");
            let (style, area, seed) = (&training.style.name, &training.area.name, training.seed);
            watch(Event::Failed(format!("{style} on {area}, seed {seed}: {message}")));
            Ok(Err(message))
        }
    }
}

fn row(training: &Training<'_>, outcome: &Outcome) -> TrainingRow {
    let round = |value: f64| (value * 1e3).round() / 1e3;
    let mut row = TrainingRow {
        style: training.style.name.clone(),
        area: training.area.name.clone(),
        seed: training.seed,
        ..TrainingRow::default()
    };
    let style = match outcome {
        Ok(style) => style,
        Err(error) => return TrainingRow { error: error.replace(['\n', '\r'], " "), ..row },
    };
    if let Ok(network) = style.network() {
        let t = network.training();
        row.parameters = network.model().network().params().value_count();
        row.epochs = t.epochs;
        (row.seconds, row.preparation_seconds) = (round(t.seconds), round(t.preparation_seconds));
        row.seconds_per_epoch = (t.seconds_per_epoch * 1e5).round() / 1e5;
    }
    if let Some(detail) = &style.detail {
        let account = detail.account();
        row.detail_seconds = Some(round(account.seconds));
        row.detail_gain = Some(round(f64::from(detail.gain())));
        row.detail_psnr = account.figure("PSNR").map(round);
    }
    row
}
