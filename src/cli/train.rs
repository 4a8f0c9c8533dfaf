//! `monadnock train`: one piece of a DEM becomes a style.

use super::Context;
use super::args::{CropOption, DemInput, check_output, keep_inputs, read_toml, terrain_name};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::experiment::{PATCH, choose_exemplar, overlay, style_config};
use crate::grid::Cell;
use crate::systems::region_gnn::style::{Source, Style, StyleConfig, learn_with};
use crate::systems::region_gnn::{Checkpoints, Control, EpochReport, Preset};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Windows with more cells than this are not taken whole: training costs about 1 kB a cell and extraction.
const LARGEST_WHOLE: usize = 192 * 192;

/// Arguments of `train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock train sierra -o sierra.safetensors
  monadnock train alps.tif -o alps.safetensors --crop 256,256,128
  monadnock train alps.tif -o alps.safetensors --preset paper --set model.epochs=1000
  monadnock train alps.tif -o alps.safetensors --config mine.toml
  monadnock train alps.tif -o alps.safetensors --budget 60s
  monadnock train alps.tif -o alps.safetensors --epochs 5000 --resume

While it trains, its state is kept beside the output in STYLE.safetensors.checkpoint, which is removed at the end. A
training that was killed continues from there with --resume and the same arguments; without --resume it begins anew. It
ends with the same weights as one that was never stopped, except under --budget, which ties the schedule to the clock.

Without --crop the whole terrain is learned when it is small, else its most varied central 128x128 patch.

The configuration is a TOML file with the sections [extraction], [model] and [generation]; --set overrides one key.
Order of precedence: preset, then the file, then --epochs and --set.")]
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
    /// Training steps
    #[arg(long, conflicts_with = "budget")]
    epochs: Option<usize>,
    /// Time for the training, such as 60s or 5m; the schedule is fitted to it
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    budget: Option<Duration>,
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

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the input, the configuration or the output path.
pub(super) fn run(args: &TrainArgs, context: &Context) -> Result<()> {
    let preset = match args.preset {
        PresetName::Anchored => Preset::Anchored,
        PresetName::Paper => Preset::Paper,
    };
    let config = resolve(preset, args.config.as_deref(), &args.set, args.epochs)?;
    let dem = args.dem.load(&context.console)?;
    check_output(&args.output)?;
    keep_inputs(&args.output, &[&args.dem.dem])?;
    let (origin, rows, cols) = match args.crop.window {
        Some(window) => (window.origin, window.rows, window.cols),
        None => default_window(&dem, context)?,
    };
    let source = Source::new(&terrain_name(&args.dem.dem), &dem, origin, rows, cols)?;
    let checkpoint = checkpoint_path(&args.output);
    if args.resume && !checkpoint.exists() {
        context.console.line(format!("no {}: training from the start", checkpoint.display()));
    } else if !args.resume && checkpoint.exists() {
        let text = "is of an interrupted training; this one begins anew (--resume continues it)";
        context.console.warning(format!("{} {text}", checkpoint.display()));
    }
    let checkpoints =
        Checkpoints { path: checkpoint.clone(), interval: args.checkpoint_every, resume: args.resume };
    let bounds = Bounds { budget: args.budget, checkpoints: Some(checkpoints) };
    let trained = train_with_progress(&source, &config, context, "training", bounds);
    if let (Err(Error::Diverged { .. }), true) = (&trained, checkpoint.exists()) {
        context.console.warning(format!(
            "the last good state is kept in {}; continue with --resume --set model.learning_rate=...",
            checkpoint.display()
        ));
    }
    let style = trained?;
    style.save(&args.output)?;
    if checkpoint.exists() {
        std::fs::remove_file(&checkpoint).map_err(Error::io(&checkpoint, "remove the checkpoint"))?;
    }
    let t = &style.info.training;
    context.console.line(format!(
        "{}: {} epochs in {:.1} s ({:.3} s each); exemplar rebuilt with SSIM {:.4}, PSNR {:.2} dB, l_gt {:.2e}",
        args.output.display(),
        t.epochs,
        t.seconds,
        t.seconds_per_epoch,
        t.ssim,
        t.psnr,
        t.l_gt
    ));
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
fn checkpoint_path(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".checkpoint");
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
    config: &StyleConfig,
    context: &Context,
    label: &str,
    bounds: Bounds,
) -> Result<Style> {
    // Under a budget the bar counts seconds, else epochs.
    let total = bounds.budget.map_or(config.model.epochs as u64, |budget| budget.as_secs());
    let bar = context.console.progress(total, label);
    let mut shown = 0;
    let mut progress = |report: &EpochReport| {
        let l = &report.losses;
        bar.note(format!("SSIM {:.3}, l_gt {:.1e}", 1.0 - l.ssim, l.ground_truth));
        let now = bounds.budget.map_or(report.epoch as u64, |_| report.seconds as u64).min(total);
        bar.advance(now.saturating_sub(shown));
        shown = now.max(shown);
    };
    let control = Control { progress: &mut progress, budget: bounds.budget, checkpoints: bounds.checkpoints };
    learn_with(source, config, context.seed, control)
}

/// The preset, overlaid with a file and with single keys.
fn resolve(
    preset: Preset,
    file: Option<&Path>,
    set: &[String],
    epochs: Option<usize>,
) -> Result<StyleConfig> {
    let mut over = toml::Table::new();
    let base = StyleConfig::preset(preset);
    if let Some(path) = file {
        over = read_toml(path)?;
        // Checked here as well, so that a bad key names the file.
        style_config(&base, [&over]).map_err(|e| e.in_file(path))?;
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
    let mut config = style_config(&base, [&over])?;
    if let Some(epochs) = epochs {
        config.model.epochs = epochs;
    }
    config.validate()?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::region_gnn::config::Base;

    #[test]
    fn settings_overlay_the_preset_and_bad_ones_are_named() {
        let set = |s: &[&str]| {
            let settings: Vec<String> = s.iter().map(|s| (*s).to_owned()).collect();
            resolve(Preset::Anchored, None, &settings, Some(7))
        };
        let config = set(&["model.base=laplace", "extraction.min_order=3", "model.losses.ssim=2.5"]).unwrap();
        assert_eq!((config.model.base, config.extraction.min_order), (Base::Laplace, 3));
        assert_eq!((config.model.losses.ssim, config.model.epochs), (2.5, 7));
        assert!(set(&["model.widht=64"]).unwrap_err().to_string().contains("widht"));
        assert!(set(&["model.width=33"]).unwrap_err().to_string().contains("33"));
        assert!(set(&["nonsense"]).unwrap_err().to_string().contains("nonsense"));
    }
}
