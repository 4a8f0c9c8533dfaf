//! `monadnock sketch fill`, and the heights that `generate` gives to strokes without any.

use super::Context;
use super::console::Console;
use super::outputs::{OutputKind, Outputs};
use super::sketch_input::{SketchOptions, in_metres};
use super::sketch_map::MapOptions;
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::height_model::HeightModel;
use crate::sketch::Sketch;
use crate::sketch::geojson::{self, HeightUnit, MissingHeights, ReadOptions, SketchReading};
use crate::systems::pipeline::{StyleDetail, detail_of};
use crate::systems::region_gnn::Style;
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
    let style = Style::load(&args.style)?;
    let options = ReadOptions { missing_heights: MissingHeights::Leave, ..args.reading.options() };
    let [x, y] = style.info.exemplar.cell_size;
    let console = &context.console;
    let placed = args.map.read(&args.sketch, &options, CellSize::new(x, y)?, console)?;
    let sketch = in_metres(&placed.reading, style.info.normalization);
    let style = StyleHeights { path: &args.style, style: &style, range: style.info.normalization };
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
        let filled = self.model()?.fill(&sketch, &reading.given).map_err(|e| e.in_file(path))?;
        let name = path.display();
        console.line(format!(
            "{name}: strokes without heights: {}, with some of them: {}; they get those that ridges and valleys of the style \
             have (`sketch fill` shows them)",
            filled.without, filled.partly
        ));
        let listed = |strokes: &[usize]| {
            strokes.iter().map(|i| reading.names[*i].as_str()).collect::<Vec<_>>().join(", ")
        };
        if !filled.assumed_outlets.is_empty() {
            console.line(format!(
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

    /// What ridges and valleys are like in the terrain that the style keeps for its detail.
    fn model(&self) -> Result<HeightModel> {
        let none = || {
            let allowed = "strokes without heights take them from the style's terrain: train it with --detail-model patches, or \
                           give every stroke heights";
            Error::file(self.path, "terrain of the style", "not kept", allowed)
        };
        let Some(StyleDetail::Patches(detail)) = detail_of(self.style)? else { return Err(none()) };
        let ((rows, cols), (_, tensors)) = (detail.shape(), detail.parts());
        let unit =
            tensors.into_iter().find(|(name, _)| name == "truth").map(|(_, unit)| unit).ok_or_else(none)?;
        let own = self.style.info.normalization;
        let heights = Grid::from_vec(rows, cols, unit)?.map(|&z| own.to_metres(f64::from(z)) as f32);
        let model = HeightModel::fit(&Dem::new(heights, CellSize::square(1.0)?)?)
            .map_err(|e| e.in_file(self.path))?;
        Ok(model.in_range(own, self.range))
    }
}
