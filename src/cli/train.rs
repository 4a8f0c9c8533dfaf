//! `monadnock train`: one piece of a DEM becomes a style.

use super::Context;
use super::args::{CropOption, DemInput, read_toml, terrain_name};
use super::outputs::{OutputKind, Outputs};
use crate::checked::Settings;
use crate::control::{Checkpoints, Control, Progress};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::evaluate::{PATCH, choose_exemplar};
use crate::extract::ExtractionConfig;
use crate::grid::{Cell, Grid};
use crate::style::{
    Exemplar, GeneratorConfig, Preset, Source, Style, StyleConfig, SystemPlan, check_patches, generators,
    has_unseen, learn_coarse, learn_detail, overlaid, overlay, unseen_surface,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Windows with more cells than this are not taken whole: training costs about 1 kB a cell and extraction.
const LARGEST_WHOLE: usize = 192 * 192;
/// Share of a long budget that the coarse model gets: both reach their plateau in about this proportion.
const COARSE_SHARE: f64 = 0.3;
/// Seconds in which the coarse model comes near its plateau on two cores; a short budget gives it half of itself, up to these.
const COARSE_SECONDS: f64 = 30.0;
/// Share of what the detail gets of a budget in which the strength of generators is measured.
const UNSEEN_SHARE: f64 = 0.15;
/// Share of a budget that the coarse model gets before patches; two halves of it take half as long again, the rest is the search.
const PATCHES_COARSE_SHARE: f64 = 0.6;

/// Arguments of `train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock train sierra -o sierra.safetensors
  monadnock train alps.tif -o alps.safetensors --crop 256,256,128
  monadnock train alps.tif -o alps.safetensors --preset paper --set model.epochs=1000
  monadnock train alps.tif -o alps.safetensors --config mine.toml
  monadnock train alps.tif -o alps.safetensors --no-detail
  monadnock train alps.tif -o alps.safetensors --detail-model generators
  monadnock train alps.tif -o alps.safetensors --set detail.steps=200
  monadnock train alps.tif -o alps.safetensors --budget 60s
  monadnock train alps.tif -o alps.safetensors --epochs 5000 --resume

First the coarse model is trained, which turns lines into terrain; then comes the detail, which adds the small forms that
lines leave open. The style is written after the first and again after the second, so that it can be used whatever happens.

Detail is the exemplar's own patches (GPNN). Only their strength is measured: two coarse models, each of one half of the exemplar, show
what is left open in terrain that they have not seen. With --detail-model generators, or with a setting of theirs, a SinGAN is
trained instead: minutes, for detail with a little less of the exemplar's statistics. Exemplars of more than 65,536 cells get
generators too. With --preset paper, which is there to compare coarse models, there is detail only when one of these options asks
for it.

A --budget is for everything. With patches the coarse model gets six tenths of it. With generators it gets half, up to 30 s,
and at least three tenths.

While it trains, its state is kept beside the output in STYLE.safetensors.checkpoint (and .detail-checkpoint for the
detail), which is removed at the end. A training that was killed continues from there with --resume and the same
arguments; without --resume it starts over. It ends with the same weights as one that was never stopped, except under
--budget, which ties the schedule to the clock.

Without --crop the whole terrain is learned when it is small, else its most varied central 128x128 patch.

The configuration is a TOML file with the sections [extraction], [model], [generation] and [detail]; --set overrides one key.
Order of precedence: presets, then the file, then --epochs and --set.")]
pub(super) struct TrainArgs {
    #[command(flatten)]
    dem: DemInput,
    /// The style to write
    #[arg(short, long, value_name = "STYLE.safetensors")]
    output: PathBuf,
    #[command(flatten)]
    crop: CropOption,
    /// Named configuration: anchored (ours) or paper (Liu & Benes 2025)
    #[arg(long, value_enum, default_value = "anchored")]
    preset: PresetName,
    /// Configuration file
    #[arg(long, value_name = "F.toml")]
    config: Option<PathBuf>,
    /// One setting, such as model.width=64; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Leave out the detail: terrain then keeps only the forms that its lines say
    #[arg(long)]
    no_detail: bool,
    /// Where detail comes from: the exemplar's own patches (GPNN; the default), or generators that are trained (SinGAN; the default
    /// when a setting of theirs is given)
    #[arg(long, value_enum, value_name = "MODEL", conflicts_with = "no_detail")]
    detail_model: Option<DetailModelName>,
    /// Generators, and their named configuration: ours (the default), or paper (SinGAN as published: hours)
    #[arg(long, value_enum, conflicts_with = "no_detail")]
    detail_preset: Option<DetailPresetName>,
    /// Training steps of the coarse model
    #[arg(long, conflicts_with = "budget")]
    epochs: Option<usize>,
    /// Time for the whole training, such as 60s or 5m; the schedules are fitted to it
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    budget: Option<Duration>,
    /// Take the coarse model from a style of the same window, seed and configuration, and learn only the detail again
    #[arg(long, value_name = "STYLE.safetensors", conflicts_with_all = ["no_detail", "epochs", "budget", "resume"])]
    coarse: Option<PathBuf>,
    /// Continue an interrupted training from its checkpoint
    #[arg(long)]
    resume: bool,
    /// Time between two checkpoints
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, default_value = "10s")]
    checkpoint_every: Duration,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PresetName {
    Anchored,
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum DetailModelName {
    Generators,
    Patches,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum DetailPresetName {
    Ours,
    Paper,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the input, the configuration or the output path.
pub(super) fn run(args: &TrainArgs, context: &Context) -> Result<()> {
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Style)
        .reads(&args.dem.dem)
        .reads(&args.config)
        .reads(&args.coarse)
        .check()?;
    let preset = match args.preset {
        PresetName::Anchored => Preset::Anchored,
        PresetName::Paper => Preset::Paper,
    };
    let named = match args.detail_preset {
        None | Some(DetailPresetName::Ours) => GeneratorConfig::default(),
        Some(DetailPresetName::Paper) => GeneratorConfig::paper(),
    };
    let (config, detail) = resolve(preset, &named, args.config.as_deref(), &args.set, args.epochs)?;
    let asked = args.detail_preset.is_some() || detail != named;
    if args.detail_model == Some(DetailModelName::Patches) && asked {
        let allowed = "patches have no settings: leave out --detail-preset and the keys of [detail]";
        return Err(Error::value("--detail-model", "patches", allowed));
    }
    let with_detail = !args.no_detail && (asked || args.detail_model.is_some() || preset != Preset::Paper);
    let dem = args.dem.load(&context.console)?;
    let (origin, rows, cols) = match args.crop.window {
        Some(window) => (window.origin, window.rows, window.cols),
        None => default_window(&dem, context)?,
    };
    let model = with_detail.then(|| match args.detail_model {
        Some(model) => model,
        None if !asked && check_patches(rows, cols).is_ok() => DetailModelName::Patches,
        None => DetailModelName::Generators,
    });
    if model == Some(DetailModelName::Patches) {
        check_patches(rows, cols)?;
    }
    let plan = config.plan()?;
    let source = Source::new(&terrain_name(&args.dem.dem), &dem, origin, rows, cols)?;
    let [coarse_file, detail_file] =
        ["checkpoint", "detail-checkpoint"].map(|kind| checkpoint_path(&args.output, kind));
    let interrupted = [&coarse_file, &detail_file].into_iter().find(|file| file.exists());
    let fits = |style: &Style| {
        let mut wanted = config.clone();
        if args.budget.is_some() {
            // The clock decides their number.
            wanted.model.epochs = style.config().model.epochs;
        }
        style.continues(&source, &wanted, context.seed)
    };
    // The coarse model is done when its checkpoint is gone, and it is in the output.
    let begun = (args.resume && interrupted.is_none() && args.output.exists())
        .then(|| Style::load(&args.output).ok().filter(|style| fits(style).is_ok()))
        .flatten();
    match interrupted {
        None if args.resume && begun.is_none() => {
            context.console.line(format!("no {}: training from the start", coarse_file.display()));
        }
        Some(file) if !args.resume => {
            let text = "is of an interrupted training; this one starts over (--resume continues it)";
            context.console.warning(format!("{} {text}", file.display()));
            remove(&detail_file)?;
        }
        _ => {}
    }
    let [coarse_budget, unseen_budget, detail_budget] =
        args.budget.map_or([None; 3], |all| budgets(all, model, has_unseen(&*plan, rows, cols)).map(Some));
    let bounds = |path: &Path, budget: Option<Duration>| Bounds {
        budget,
        checkpoints: Some(Checkpoints {
            path: path.to_owned(),
            interval: args.checkpoint_every,
            resume: args.resume,
        }),
    };
    let mut style = if let Some(path) = &args.coarse {
        let style = Style::load(path)?;
        fits(&style).map_err(|e| e.in_file(path))?;
        style
    } else if let Some(style) = begun {
        style
    } else if args.resume && detail_file.exists() && model == Some(DetailModelName::Generators) {
        let style = Style::load(&args.output)?;
        fits(&style).map_err(|e| e.in_file(&args.output))?;
        style
    } else {
        let label = if model.is_some() { "training the coarse model" } else { "training" };
        let bounds = bounds(&coarse_file, coarse_budget);
        let trained = train_with_progress(&source, &config.extraction, &*plan, context, label, bounds);
        told_of_divergence(&trained, &coarse_file, "model", context);
        let style = trained?;
        style.save(&args.output)?;
        remove(&coarse_file)?;
        style
    };
    if let Some(model) = model {
        if model == DetailModelName::Generators && !asked && args.detail_model.is_none() {
            let text =
                format!("{rows}x{cols} cells are not searched for patches: detail comes from generators");
            context.console.line(text);
        }
        let unseen = unseen_with_progress(&source, &config.extraction, &*plan, unseen_budget, context)?;
        let detail = match model {
            DetailModelName::Patches => context.registry.plan_detail("patches", &toml::Table::new())?,
            DetailModelName::Generators => generators(detail.clone())?,
        };
        let Bounds { budget, checkpoints } = bounds(&detail_file, detail_budget);
        let bar = context.console.progress(100, "training the detail");
        let mut progress = |done: &Progress<'_>| {
            bar.note(figures(done));
            bar.reach((100.0 * done.share) as u64);
        };
        let stop = context.stop.clone();
        let control = Control { progress: &mut progress, budget, checkpoints, stop };
        let learned = learn_detail(&mut style, &source, &*plan, unseen, &*detail, control);
        drop(bar);
        told_of_divergence(&learned, &detail_file, "detail", context);
        learned?;
        style.save(&args.output)?;
        remove(&detail_file)?;
    }
    report(&style, &args.output, context)
}

/// What coarse model, unseen terrain and generators get of a budget.
fn budgets(all: Duration, detail: Option<DetailModelName>, unseen: bool) -> [Duration; 3] {
    let none = Duration::ZERO;
    match detail {
        None => [all, none, none],
        Some(DetailModelName::Patches) => {
            let (coarse, halves) =
                (all.mul_f64(PATCHES_COARSE_SHARE), all.mul_f64(0.5 * PATCHES_COARSE_SHARE));
            if unseen { [coarse, halves, none] } else { [coarse + halves, none, none] }
        }
        Some(DetailModelName::Generators) => {
            let coarse = coarse_share(all);
            let halves = if unseen { (all - coarse).mul_f64(UNSEEN_SHARE) } else { none };
            [coarse, halves, all - coarse - halves]
        }
    }
}

/// What the coarse model gets of a budget before generators.
fn coarse_share(all: Duration) -> Duration {
    let seconds = all.as_secs_f64();
    Duration::from_secs_f64((COARSE_SHARE * seconds).max((0.5 * seconds).min(COARSE_SECONDS)))
}

fn report(style: &Style, output: &Path, context: &Context) -> Result<()> {
    for system in &style.coarse {
        context.console.line(format!("{}: {}", output.display(), system.account().text));
    }
    if let Some(detail) = &style.detail {
        context.console.line(format!("detail: {}", detail.account().text));
    }
    Ok(())
}

/// What to do after a divergence, when something was kept.
fn told_of_divergence<T>(trained: &Result<T>, checkpoint: &Path, section: &str, context: &Context) {
    if let (Err(Error::Diverged { .. }), true) = (trained, checkpoint.exists()) {
        context.console.warning(format!(
            "the last good state is kept in {}; continue with --resume --set {section}.learning_rate=...",
            checkpoint.display()
        ));
    }
}

fn remove(checkpoint: &Path) -> Result<()> {
    if checkpoint.exists() {
        std::fs::remove_file(checkpoint).map_err(Error::io(checkpoint, "remove the checkpoint"))?;
    }
    Ok(())
}

/// The whole DEM when it is small, else the patch that represents it.
fn default_window(dem: &Dem, context: &Context) -> Result<(Cell, usize, usize)> {
    let (rows, cols) = dem.shape();
    if rows * cols <= LARGEST_WHOLE {
        return Ok((Cell::new(0, 0), rows, cols));
    }
    let origin = choose_exemplar(dem)?;
    context.console.line(format!(
        "learning from the {PATCH}x{PATCH} window at row {}, column {} (choose another with --crop)",
        origin.row, origin.col
    ));
    Ok((origin, PATCH, PATCH))
}

/// Where the state of a training is kept while it runs.
fn checkpoint_path(output: &Path, kind: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".");
    name.push(kind);
    name.into()
}

/// What bounds and keeps a training.
#[derive(Default)]
pub(super) struct Bounds {
    pub(super) budget: Option<Duration>,
    pub(super) checkpoints: Option<Checkpoints>,
}

/// Learns a style under a progress bar.
pub(super) fn train_with_progress(
    source: &Source,
    extraction: &ExtractionConfig,
    plan: &dyn SystemPlan,
    context: &Context,
    label: &str,
    bounds: Bounds,
) -> Result<Style> {
    let bar = context.console.progress(100, label);
    let mut progress = |done: &Progress<'_>| {
        bar.note(figures(done));
        bar.reach((100.0 * done.share) as u64);
    };
    let Bounds { budget, checkpoints } = bounds;
    let control = Control { progress: &mut progress, budget, checkpoints, stop: context.stop.clone() };
    learn_coarse(source, extraction, plan, context.seed, control)
}

/// The figures of a step, for people.
fn figures(done: &Progress<'_>) -> String {
    let figures = done.figures.iter().map(|(name, value)| format!("{name} {value:.3}"));
    figures.collect::<Vec<_>>().join(", ")
}

/// What the coarse model leaves open in terrain that it has not seen, under a progress bar.
pub(super) fn unseen_with_progress(
    source: &Source,
    extraction: &ExtractionConfig,
    plan: &dyn SystemPlan,
    budget: Option<Duration>,
    context: &Context,
) -> Result<Option<Grid<f32>>> {
    let bar = context.console.progress(100, "measuring what is left to the detail");
    let mut progress = |done: &Progress<'_>| bar.reach((100.0 * done.share) as u64);
    let stop = context.stop.clone();
    let control = Control { progress: &mut progress, budget, checkpoints: None, stop };
    unseen_surface(plan, &Exemplar::new(source, extraction, context.seed)?, control)
}

/// The presets, overlaid with a file and with single keys.
fn resolve(
    preset: Preset,
    detail: &GeneratorConfig,
    file: Option<&Path>,
    set: &[String],
    epochs: Option<usize>,
) -> Result<(StyleConfig, GeneratorConfig)> {
    let mut over = toml::Table::new();
    let base = StyleConfig::preset(preset);
    if let Some(path) = file {
        over = read_toml(path)?;
        // Checked here as well, so that a bad key names the file.
        both(&base, detail, &over).map_err(|e| e.in_file(path))?;
    }
    for setting in set {
        let allowed = "allowed: KEY=VALUE such as model.width=64 or model.base=\"laplace\"";
        let Some((key, value)) = setting.split_once('=') else {
            return Err(Error::value("--set", setting, allowed));
        };
        // A bare word is a string, so that `model.base=laplace` works in a shell.
        let table: toml::Table = toml::from_str(&format!("{key}={value}"))
            .or_else(|_| toml::from_str(&format!("{key}=\"{value}\"")))
            .map_err(|_| Error::value("--set", setting, allowed))?;
        overlay(&mut over, &table);
    }
    let (mut config, detail) = both(&base, detail, &over)?;
    if let Some(epochs) = epochs {
        config.model.epochs = epochs;
    }
    config.validate()?;
    detail.validate()?;
    Ok((config, detail))
}

/// The section `detail` of a table, and the others.
fn both(
    base: &StyleConfig,
    detail: &GeneratorConfig,
    over: &toml::Table,
) -> Result<(StyleConfig, GeneratorConfig)> {
    let mut rest = over.clone();
    let section = rest.remove("detail");
    let config = overlaid(base, [&rest], "configuration")?;
    let section = match section {
        Some(toml::Value::Table(section)) => section,
        Some(other) => return Err(Error::value("detail", other, "allowed: a section with keys")),
        None => toml::Table::new(),
    };
    Ok((config, overlaid(detail, [&section], "configuration of the detail")?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::region_gnn::config::Base;
    use crate::systems::singan::config::View;

    #[test]
    fn a_short_budget_is_halved_and_a_long_one_goes_to_the_detail() {
        let share = |seconds: u64| coarse_share(Duration::from_secs(seconds)).as_secs_f64();
        assert_eq!([20, 60, 100].map(share), [10.0, 30.0, 30.0]);
        assert!((share(300) - 90.0).abs() < 1e-9);
    }

    #[test]
    fn a_budget_is_shared_without_a_rest_for_steps_that_are_not_taken() {
        let minute = Duration::from_secs(60);
        let shares = |detail, unseen| budgets(minute, detail, unseen).map(|part| part.as_secs_f64());
        assert_eq!(shares(None, true), [60.0, 0.0, 0.0]);
        assert_eq!(shares(Some(DetailModelName::Patches), true), [36.0, 18.0, 0.0]);
        assert_eq!(shares(Some(DetailModelName::Patches), false), [54.0, 0.0, 0.0]);
        assert_eq!(shares(Some(DetailModelName::Generators), true), [30.0, 4.5, 25.5]);
        assert_eq!(shares(Some(DetailModelName::Generators), false), [30.0, 0.0, 30.0]);
    }

    #[test]
    fn settings_overlay_the_preset_and_bad_ones_are_named() {
        let set = |s: &[&str]| {
            let settings: Vec<String> = s.iter().map(|s| (*s).to_owned()).collect();
            resolve(Preset::Anchored, &GeneratorConfig::default(), None, &settings, Some(7))
        };
        let (config, detail) = set(&[
            "model.base=laplace",
            "extraction.min_order=3",
            "model.losses.ssim=2.5",
            "detail.steps=9",
            "detail.view=heights",
        ])
        .unwrap();
        assert_eq!((detail.steps, detail.view), (9, View::Heights));
        assert!(set(&["detail.stepps=9"]).unwrap_err().to_string().contains("stepps"));
        assert!(set(&["detail.width=33"]).unwrap_err().to_string().contains("detail.width is 33"));
        assert_eq!((config.model.base, config.extraction.min_order), (Base::Laplace, 3));
        assert_eq!((config.model.losses.ssim, config.model.epochs), (2.5, 7));
        assert!(set(&["model.widht=64"]).unwrap_err().to_string().contains("widht"));
        assert!(set(&["model.width=33"]).unwrap_err().to_string().contains("33"));
        assert!(set(&["nonsense"]).unwrap_err().to_string().contains("nonsense"));
    }
}
