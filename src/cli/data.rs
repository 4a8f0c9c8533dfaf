//! `data`: a folder of terrain and its manifest.

use super::Context;
use super::args::tell;
use super::outputs::{OutputKind, Outputs};
use crate::dem::manifest::{Area, FILE_NAME, Manifest};
use crate::error::Result;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock data add areas/jura.tif
  monadnock data add areas/jura.tif --name jura --what 'Swiss Jura' --source 'swisstopo' --licence 'open' --manifest manifest.toml
  monadnock data list areas/manifest.toml

A manifest says of every raster what it is and which bytes it has, so that experiments refuse a spoiled or swapped file. The
raster must say itself all that is needed to read it (cell size, voids), and lie in the manifest's folder or below it.";

/// Arguments of `data`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct DataArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Write the entry of a terrain file into a manifest: hash, shape, cell size, range of heights
    Add(AddArgs),
    /// Check every file of a manifest against its entry
    List(ListArgs),
}

#[derive(clap::Args)]
struct AddArgs {
    /// Terrain file
    file: PathBuf,
    /// The manifest [default: manifest.toml beside the file]
    #[arg(long, value_name = "M")]
    manifest: Option<PathBuf>,
    /// Name to ask for the terrain by [default: that of the file]
    #[arg(long)]
    name: Option<String>,
    /// The place, for people
    #[arg(long, default_value = "")]
    what: String,
    /// Where the heights come from
    #[arg(long, default_value = "")]
    source: String,
    /// Terms of use
    #[arg(long, default_value = "")]
    licence: String,
    /// What was done to the source
    #[arg(long, default_value = "")]
    note: String,
}

#[derive(clap::Args)]
struct ListArgs {
    /// The manifest
    manifest: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the file or the manifest.
pub(super) fn run(args: &DataArgs, context: &Context) -> Result<()> {
    match &args.action {
        Action::Add(args) => add(args, context),
        Action::List(args) => list(&args.manifest, context),
    }
}

fn add(args: &AddArgs, context: &Context) -> Result<()> {
    let beside = || args.file.parent().map(Path::to_owned).unwrap_or_default().join(FILE_NAME);
    let manifest = args.manifest.clone().unwrap_or_else(beside);
    let stem = || args.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Outputs::new().writes("--manifest", &manifest, OutputKind::Toml).reads(&args.file).check()?;
    let name = args.name.clone().unwrap_or_else(stem);
    let folder = manifest.parent().map(Path::to_owned).unwrap_or_default();
    let (area, description) = Area::of_file(&name, &args.file, &folder)?;
    tell(&args.file, &description, &context.console);
    let entry = Area {
        what: args.what.clone(),
        source: args.source.clone(),
        licence: args.licence.clone(),
        note: args.note.clone(),
        ..area
    };
    entry.add_to(&manifest)?;
    context.console.line(format!("{}: added\n{}", manifest.display(), entry.to_toml().trim_end()));
    Ok(())
}

fn list(path: &Path, context: &Context) -> Result<()> {
    let manifest = Manifest::read_file(path)?;
    for area in &manifest.areas {
        let (dem, description) = manifest.load_described(&area.name)?;
        tell(&area.file, &description, &context.console);
        let ((rows, cols), (low, high)) = (dem.shape(), dem.range());
        context.console.line(format!(
            "{:16} {rows} x {cols} cells of {}, {low} to {high} m  {}",
            area.name,
            dem.cell_size().in_words(),
            area.what
        ));
    }
    Ok(())
}
