//! `monadnock sketch fill`, and the heights that `generate` gives to strokes without any.

use super::Context;
use super::console::Console;
use super::outputs::{OutputKind, Outputs};
use super::sketch_input::{SketchOptions, in_metres};
use super::sketch_map::MapOptions;
use crate::dem::{CellSize, Normalization};
use crate::error::Result;
use crate::sketch::Sketch;
use crate::sketch::geojson::{self, HeightUnit, MissingHeights, ReadOptions, SketchReading};
use crate::style::Style;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock sketch fill mine.geojson --style sierra.safetensors -o filled.geojson
  monadnock sketch fill qgis.geojson --style alps.safetensors --like alps.tif -o filled.geojson

A stroke may have no heights, or a few: vertices without z, or with null. `sketch fill` shows what `generate` makes of them:
valleys fall downstream as steeply as the style's, ridges stand above the valleys beside them as its ridges do, crossings agree,
and given heights stay as they are. Parts of strokes without heights get more vertices.";

/// Arguments of `sketch`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SketchArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Give heights to the strokes of a sketch that have none, or only some
    Fill(FillArgs),
}

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
struct FillArgs {
    /// The sketch: a GeoJSON file, or one that comes with the program
    sketch: PathBuf,
    /// The style whose ridges and valleys say how high, as written by `train`
    #[arg(long, value_name = "STYLE")]
    style: PathBuf,
    /// The sketch to write (GeoJSON), in metres
    #[arg(short, long, value_name = "SKETCH")]
    output: PathBuf,
    #[command(flatten)]
    map: MapOptions,
    #[command(flatten)]
    reading: SketchOptions,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the sketch, the style or the output path.
pub(super) fn run(args: &SketchArgs, context: &Context) -> Result<()> {
    let Action::Fill(args) = &args.action;
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Sketch)
        .reads(&args.sketch)
        .reads(&args.style)
        .reads(args.map.like())
        .check()?;
    let style = context.registry.load(&args.style)?;
    let options = ReadOptions { missing_heights: MissingHeights::Leave, ..args.reading.options() };
    let [x, y] = style.origin.exemplar.cell_size;
    let console = &context.console;
    let placed = args.map.read(&args.sketch, &options, CellSize::new(x, y)?, console)?;
    let sketch = in_metres(&placed.reading, style.origin.normalization);
    let style = StyleHeights { path: &args.style, style: &style, range: style.origin.normalization };
    let sketch = style.fill(&args.sketch, &placed.reading, sketch, console)?;
    geojson::write(&args.output, &sketch, HeightUnit::Metres, placed.reading.georeference.as_ref())?;
    let (low, high) = sketch.height_range().unwrap_or_default(); // a sketch that was read has a stroke
    console.line(format!(
        "{}: {} strokes, {low:.1} to {high:.1} m",
        args.output.display(),
        sketch.strokes.len()
    ));
    Ok(())
}

/// A style as the source of heights.
pub(super) struct StyleHeights<'a> {
    /// Its file, for messages.
    pub(super) path: &'a Path,
    pub(super) style: &'a Style,
    /// Metres that stand for its lowest and highest height.
    pub(super) range: Normalization,
}

impl StyleHeights<'_> {
    /// `sketch`, in metres, with heights for the vertices that `reading` leaves open; tells what was assumed.
    ///
    /// # Errors
    /// When heights are open and the style keeps no terrain to take them from.
    pub(super) fn fill(
        &self,
        path: &Path,
        reading: &SketchReading,
        sketch: Sketch,
        console: &Console,
    ) -> Result<Sketch> {
        if reading.given.iter().flatten().all(|given| *given) {
            return Ok(sketch);
        }
        let model = self.style.height_model(self.range).map_err(|e| e.in_file(self.path))?;
        let filled = model.fill(&sketch, &reading.given).map_err(|e| e.in_file(path))?;
        let name = path.display();
        console.note(format!(
            "{name}: strokes without heights: {}, with some of them: {}; they get those that ridges and valleys of the style \
             have (`sketch fill` shows them)",
            filled.without, filled.partly
        ));
        let listed = |strokes: &[usize]| {
            strokes.iter().map(|i| reading.names[*i].as_str()).collect::<Vec<_>>().join(", ")
        };
        if !filled.assumed_outlets.is_empty() {
            console.note(format!(
                "{name}: no given height tells where these valleys drain: taken to leave at the end nearest to the map's frame, \
                 or, as near, where they were drawn to ({})",
                listed(&filled.assumed_outlets)
            ));
        }
        if !filled.rising.is_empty() {
            console.warning(format!(
                "{name}: given heights rise downstream, and are kept: water cannot run there ({})",
                listed(&filled.rising)
            ));
        }
        Ok(filled.sketch)
    }
}
