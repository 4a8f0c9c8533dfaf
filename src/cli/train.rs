//! `monadnock train`: one piece of a DEM becomes a style.

use super::Context;
use super::args::{CropOption, DemInput, SettingsOptions, terrain_name};
use super::outputs::{OutputKind, Outputs};
use super::watch::watched;
use crate::control::Checkpoints;
use crate::error::{Error, Result};
use crate::style::{
    Choices, DetailChoice, GeneratorConfig, Preset, Recipe, Source, default_window, learn, unfinished,
};
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `train`.
#[derive(Debug, clap::Args)]
#[command(after_help = include_str!("train.txt"))]
pub(super) struct TrainArgs {
    #[command(flatten)]
    dem: DemInput,
    /// The style to write
    #[arg(short, long, value_name = "STYLE.safetensors")]
    output: PathBuf,
    #[command(flatten)]
    crop: CropOption,
    /// Named configuration of the network: anchored (ours) or paper (Liu & Benes 2025)
    #[arg(long, value_parser = ["anchored", "paper"], default_value = "anchored")]
    preset: String,
    /// Coarse systems to learn, separated by commas, the first for dense sketches [default: gnn,landscape,synthesis; gnn alone with
    /// --preset paper]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    systems: Option<Vec<String>>,
    /// Leave the exemplar's terrain out of the style, and with it the synthesis, which makes terrain of it
    #[arg(long)]
    no_terrain: bool,
    #[command(flatten)]
    settings: SettingsOptions,
    /// Leave out the detail: terrain then keeps only the forms that its lines say
    #[arg(long)]
    no_detail: bool,
    /// Where detail comes from: `patches`, the exemplar's own (GPNN; the default), `generators` that are trained (SinGAN; the
    /// default when a setting of theirs is given), or `sparse` sums of the exemplar's forms (made for `amplify`)
    #[arg(long, value_name = "MODEL", conflicts_with = "no_detail")]
    detail_model: Option<String>,
    /// Generators, and their named configuration: ours (the default), or paper (SinGAN as published: hours)
    #[arg(long, value_parser = ["ours", "paper"], conflicts_with = "no_detail")]
    detail_preset: Option<String>,
    /// Training steps of the network
    #[arg(long, conflicts_with = "budget")]
    epochs: Option<usize>,
    /// Time for the whole training, such as 60s or 5m; the schedules are fitted to it
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    budget: Option<Duration>,
    /// Take the coarse model from a style of the same window, seed and configuration, and make only the detail anew
    #[arg(long, value_name = "STYLE.safetensors", conflicts_with_all = ["no_detail", "epochs", "budget", "resume"])]
    coarse: Option<PathBuf>,
    /// Continue an interrupted training from its checkpoint
    #[arg(long)]
    resume: bool,
    /// Time between two checkpoints
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, default_value = "10s")]
    checkpoint_every: Duration,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the input, the configuration or the output path.
pub(super) fn run(args: &TrainArgs, context: &Context) -> Result<()> {
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Style)
        .reads(&args.dem.dem)
        .reads(&args.settings.config)
        .reads(&args.coarse)
        .check()?;
    // The settings first, whatever the terrain: what is wrong with them is said at once.
    let recipe = |shape| {
        args.settings.read(|settings| {
            let choices = Choices { settings: settings.clone(), ..args.choices() };
            Recipe::new(&context.registry, &choices, shape, context.seed)
        })
    };
    recipe((64, 64))?;
    let dem = args.dem.load(&context.console)?;
    let window = match args.crop.window {
        Some(window) => window,
        None => default_window(&dem)?,
    };
    if args.crop.window.is_none() && window.shape() != dem.shape() {
        context.console.line(format!("learning from the window of {window} (choose another with --crop)"));
    }
    let mut recipe = recipe(window.shape())?;
    recipe.keep_terrain = !args.no_terrain;
    let source = Source::new(&terrain_name(&args.dem.dem), &dem, window)?;
    if args.systems.is_none() {
        for (name, why) in recipe.leave_out_unsuited(&source) {
            context.console.note(format!("{}: {name} is left out: {why}", args.output.display()));
        }
    }
    if let Some(path) = &args.coarse {
        let style = context.registry.load(path)?;
        recipe.continues(&style, &source, false).map_err(|e| e.in_file(path))?;
        recipe.known = Some(style);
    }
    args.tell_of_checkpoints(&recipe, context);
    let checkpoints =
        Some(Checkpoints { path: args.output.clone(), interval: args.checkpoint_every, resume: args.resume });
    let learned = watched(context, args.budget, checkpoints, |control| learn(&source, &recipe, control));
    if let (Err(Error::Diverged { .. }), Some((part, path))) = (&learned, unfinished(&args.output, &recipe)) {
        let is_detail = recipe.detail.as_ref().is_some_and(|detail| detail.name() == part);
        let section = if is_detail { "detail" } else { "model" };
        context.console.warning(format!(
            "the last good state is kept in {}; continue with --resume --set {section}.learning_rate=...",
            path.display()
        ));
    }
    let style = learned?;
    for system in &style.coarse {
        context.console.line(format!("{}: {}", args.output.display(), system.account().text));
    }
    if let Some(detail) = &style.detail {
        context.console.line(format!("detail: {}", detail.account().text));
    }
    Ok(())
}

impl TrainArgs {
    fn choices(&self) -> Choices {
        Choices {
            preset: if self.preset == "paper" { Preset::Paper } else { Preset::Anchored },
            generators: self.detail_preset.as_ref().map(|name| {
                if name == "paper" { GeneratorConfig::paper() } else { GeneratorConfig::default() }
            }),
            systems: self.systems.clone(),
            detail: match &self.detail_model {
                _ if self.no_detail => DetailChoice::Without,
                Some(name) => DetailChoice::Named(name.clone()),
                None => DetailChoice::Automatic,
            },
            settings: toml::Table::new(),
            epochs: self.epochs,
        }
    }

    fn tell_of_checkpoints(&self, recipe: &Recipe, context: &Context) {
        match unfinished(&self.output, recipe) {
            Some((_, file)) if !self.resume => {
                let text = "is of an interrupted training; this one starts over (--resume continues it)";
                context.console.warning(format!("{} {text}", file.display()));
            }
            None if self.resume && !self.output.exists() => {
                context.console.line(format!("no {}: training from the start", self.output.display()));
            }
            _ => {}
        }
    }
}
