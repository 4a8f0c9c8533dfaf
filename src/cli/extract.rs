//! `monadnock extract`: ridges and valleys of a DEM as a sketch.

use super::args::{DemInput, Window};
use super::console::Context;
use crate::error::{Error, Result};
use crate::extract::{self, ExtractionConfig};
use crate::sketch::geojson::{self, HeightUnit};
use crate::sketch::{PartLengths, Sketch, StrokeKind, split_parts};
use std::path::PathBuf;

/// Arguments of `extract`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock extract sierra -o sierra.geojson --crop 128,128,128
  monadnock extract alps.tif -o main-lines.geojson --min-order 4
  monadnock extract alps.tif -o patch.geojson --crop 128,128,128 --with-context

Heights are metres. The sketch is georeferenced when the DEM is, else in cells from the north-west corner.")]
pub(super) struct ExtractArgs {
    #[command(flatten)]
    dem: DemInput,
    /// The sketch to write
    #[arg(short, long, value_name = "S.geojson")]
    output: PathBuf,
    /// Only this window
    #[arg(long, value_name = "ROW,COL,SIZE")]
    crop: Option<Window>,
    /// With --crop: find the lines on the whole DEM, then cut the window out
    #[arg(long, requires = "crop")]
    with_context: bool,
    /// Fewest cells that a line drains
    #[arg(long, value_name = "N")]
    accumulation: Option<u32>,
    /// Lowest Strahler order
    #[arg(long, value_name = "N")]
    min_order: Option<u8>,
    /// The paper's steps and nothing else
    #[arg(long)]
    paper: bool,
}

/// Runs the verb.
pub(super) fn run(args: &ExtractArgs, context: &Context) -> Result<()> {
    let base = if args.paper { ExtractionConfig::paper() } else { ExtractionConfig::default() };
    let config = ExtractionConfig {
        min_accumulation: args.accumulation.unwrap_or(base.min_accumulation),
        min_order: args.min_order.unwrap_or(base.min_order),
        ..base
    };
    config.validate()?;
    let whole = args.dem.load()?;
    let dem = match args.crop {
        Some(window) => window.crop(&whole)?,
        None => whole.clone(),
    };
    let lines = match args.crop {
        Some(w) if args.with_context => {
            extract::with_context(whole.heights(), whole.valid(), &config, w.origin, w.rows, w.cols)?
        }
        _ => extract::ridges_and_valleys(dem.heights(), dem.valid(), &config)?,
    };
    if lines.line_count() == 0 {
        let allowed =
            "no ridge or valley was found; lower --accumulation or --min-order, or take a window with relief";
        return Err(Error::value("number of line cells", 0, allowed));
    }
    let sketch = Sketch::trace(&lines);
    geojson::write(&args.output, &sketch, HeightUnit::Metres, dem.georeference())?;
    let count = |kind| sketch.strokes.iter().filter(|s| s.kind == kind).count();
    let parts = split_parts(&lines, PartLengths::default(), context.seed);
    let (rows, cols) = lines.shape();
    context.console.line(format!(
        "{}: {} ridge and {} valley strokes, {} line cells ({:.1} % of {rows}x{cols}), {} parts of 5 to 10 cells",
        args.output.display(),
        count(StrokeKind::Ridge),
        count(StrokeKind::Valley),
        lines.line_count(),
        100.0 * lines.line_count() as f64 / (rows * cols) as f64,
        parts.len()
    ));
    Ok(())
}
