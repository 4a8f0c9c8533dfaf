//! `monadnock sample`: terrain of a style from noise alone.

use super::Context;
use super::args::size;
use super::outputs::{OutputKind, Outputs};
use crate::dem::io::{self, WriteOptions};
use crate::dem::{CellSize, Dem};
use crate::error::Result;
use crate::systems::task::SampleUse;
use std::path::PathBuf;

/// Arguments of `sample`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock sample alps.safetensors --size 256x256 -o alps-like.tif
  monadnock --seed 2 sample alps.safetensors --size 512x1024 -o another.tif
  monadnock sample alps.safetensors --size 128x128 --variety 0.3 -o variant.tif

The terrain has no plan: its large forms are drawn like its small ones. Every --seed gives another. With less --variety more of
the exemplar's own plan is kept, in the middle of a larger map.")]
pub(super) struct SampleArgs {
    /// The style, as written by `train`
    style: PathBuf,
    /// Cells of the map, as HEIGHTxWIDTH
    #[arg(long, value_name = "HxW", value_parser = size)]
    size: (usize, usize),
    /// How far large forms are from the exemplar's: 0 keeps them and draws only small ones again, 1 has a layout of its own
    #[arg(long, value_name = "V", default_value_t = 1.0)]
    variety: f32,
    /// The terrain to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the style or the output path.
pub(super) fn run(args: &SampleArgs, context: &Context) -> Result<()> {
    Outputs::new().writes("--output", &args.output, OutputKind::Terrain).reads(&args.style).check()?;
    let style = context.registry.load(&args.style)?;
    let detail = style.needed_detail().map_err(|e| e.in_file(&args.style))?;
    let range = style.origin.normalization;
    let what = SampleUse { rows: args.size.0, cols: args.size.1, variety: args.variety };
    let unit = detail.sample(&what, context.seed, &context.stop())?;
    let [x, y] = style.origin.exemplar.cell_size;
    let dem = Dem::new(range.denormalize(&unit), CellSize::new(x, y)?)?;
    io::write(&dem, &args.output, &WriteOptions::default())?;
    let ((rows, cols), (low, high)) = (dem.shape(), dem.range());
    context.console.line(format!("{}: {rows}x{cols} cells, {low:.1} to {high:.1} m", args.output.display()));
    Ok(())
}
