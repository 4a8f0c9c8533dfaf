//! `monadnock amplify`: terrain becomes finer, with a style's detail below its cells.

use super::Context;
use super::args::DemInput;
use super::outputs::{OutputKind, Outputs};
use crate::dem::io::{self, WriteOptions};
use crate::error::Result;
use crate::systems::task::DetailUse;
use std::path::PathBuf;

/// Arguments of `amplify`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock amplify alps.safetensors coarse.tif --factor 4 -o fine.tif
  monadnock --seed 7 amplify alps.safetensors coarse.tif --factor 2 -o other.tif --strength 0.7
  monadnock amplify sparse.safetensors painted.png --elevation 0,2000 --cell-size 640 --factor 64 -o canyon.tif

Every cell becomes FACTOR x FACTOR cells. Forms of the size of the old cells and larger stay; smaller ones are the style's,
as rough as the terrain itself is beside the style's exemplar. Cell size and georeference follow; voids stay voids. With
sparse detail the terrain, shrunk again, is the input, and every seed gives the same.")]
pub(super) struct AmplifyArgs {
    /// The style, as written by `train`
    style: PathBuf,
    #[command(flatten)]
    dem: DemInput,
    /// New cells along the side of an old one: 2, 4, 8 or 16; with sparse detail up to 256
    #[arg(long, value_name = "N", value_parser = factor)]
    factor: usize,
    /// The terrain to write
    #[arg(short, long)]
    output: PathBuf,
    /// Roughness: 0 none, 1 the style's own
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    strength: f32,
}

fn factor(text: &str) -> Result<usize, String> {
    let factor = text.trim().parse().ok().filter(|n: &usize| n.is_power_of_two() && (2..=256).contains(n));
    factor.ok_or_else(|| "allowed: 2, 4, 8, 16, 32, 64, 128, 256".to_owned())
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the style, the terrain or the output path.
pub(super) fn run(args: &AmplifyArgs, context: &Context) -> Result<()> {
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Terrain)
        .reads(&args.style)
        .reads(&args.dem.dem)
        .check()?;
    let style = context.registry.load(&args.style)?;
    style.needed_detail().map_err(|e| e.in_file(&args.style))?;
    let dem = args.dem.load(&context.console)?;
    let how = DetailUse { strength: args.strength, ..DetailUse::default() };
    let fine = style.amplify(&dem, args.factor, &how, context.seed, &context.stop())?;
    io::write(&fine, &args.output, &WriteOptions::default())?;
    let ((rows, cols), (low, high)) = (fine.shape(), fine.range());
    context.console.line(format!("{}: {rows}x{cols} cells, {low:.1} to {high:.1} m", args.output.display()));
    Ok(())
}
