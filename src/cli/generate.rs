//! `monadnock generate`: a style and a sketch become terrain.

use super::Context;
use super::args::{check_output, elevation, size};
use crate::dem::io::{self, WriteOptions};
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::Result;
use crate::extract::random::{RandomSketchConfig, enhance};
use crate::sketch::geojson::{self, HeightUnit, MissingHeights, SketchReading};
use crate::sketch::{Sketch, samples};
use crate::systems::pipeline::{add_detail, detail_of};
use crate::systems::region_gnn::Style;
use crate::systems::singan::DetailUse;
use std::path::{Path, PathBuf};

/// Arguments of `generate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.tif
  monadnock generate sierra.safetensors --sketch lambda-ring -o terrain.tif --random-sketches 40
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.png --elevation 800,2400
  monadnock generate sierra.safetensors --sketch mine.geojson -o rough.tif --detail-strength 1.3 --detail-size 4

Sketch heights are metres, or 0 to 1 of the style's range when the file says \"unit\": \"normalised\".
The output's format follows its ending: .tif (float32), .png (16 bits), .npy, .asc.")]
pub(super) struct GenerateArgs {
    /// The style, as written by `train`
    style: PathBuf,
    /// The sketch: a GeoJSON file, or one that comes with the program (lambda-ring, meander, p-valley, single-stroke,
    /// volcano-ring)
    #[arg(long, value_name = "S.geojson")]
    sketch: PathBuf,
    /// The terrain to write
    #[arg(short, long)]
    output: PathBuf,
    /// Cells of the map, as HEIGHTxWIDTH, when the sketch does not say
    #[arg(long, value_name = "HxW", value_parser = size)]
    size: Option<(usize, usize)>,
    /// Elevations in metres that stand for the exemplar's lowest and highest height
    #[arg(long, value_name = "MIN,MAX", value_parser = elevation, allow_hyphen_values = true)]
    elevation: Option<Normalization>,
    /// Nodes of random ridges and valleys to fill the empty parts of a sparse sketch (paper, 5.2)
    #[arg(long, value_name = "N")]
    random_sketches: Option<usize>,
    #[command(flatten)]
    detail: DetailOptions,
    /// Fill in missing heights along each stroke from the given ones
    #[arg(long)]
    interpolate_heights: bool,
}

/// How detail is added.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Detail")]
pub(super) struct DetailOptions {
    /// Leave the terrain as the lines say it, without the style's detail
    #[arg(long)]
    no_detail: bool,
    /// Roughness: 0 none, 1 the style's own
    #[arg(long, value_name = "X", default_value_t = DetailUse::default().strength)]
    detail_strength: f32,
    /// Cells below which forms are the style's and no longer the sketch's
    #[arg(long, value_name = "CELLS", default_value_t = DetailUse::default().size)]
    detail_size: f64,
}

impl DetailOptions {
    fn settings(&self) -> DetailUse {
        DetailUse { strength: self.detail_strength, size: self.detail_size, ..DetailUse::default() }
    }
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the style, the sketch or the output path.
pub(super) fn run(args: &GenerateArgs, context: &Context) -> Result<()> {
    let style = Style::load(&args.style)?;
    check_output(&args.output)?;
    let range = args.elevation.unwrap_or(style.info.normalization);
    let missing = if args.interpolate_heights { MissingHeights::Interpolate } else { MissingHeights::Refuse };
    let options = geojson::ReadOptions { size: args.size, missing_heights: missing, ..Default::default() };
    let reading = read_sketch(&args.sketch, &options)?;
    for warning in &reading.warnings {
        context.console.warning(format!("{}: {warning}", args.sketch.display()));
    }
    let sketch = in_metres(&reading, range);
    let sketch = match args.random_sketches {
        Some(nodes) => {
            let heights = Some((range.low(), range.high()));
            let config = RandomSketchConfig { nodes, height_range: heights, ..Default::default() };
            enhance(&sketch, &config, context.seed)?
        }
        None => sketch,
    };
    let lines = sketch.rasterize();
    let terrain = style.generate(&lines, Some(range), context.seed)?;
    let terrain = match detail_of(&style)?.filter(|_| !args.detail.no_detail) {
        Some(detail) => {
            let how = args.detail.settings();
            add_detail(&terrain, &detail, range, Some(&lines), None, &how, context.seed)?
        }
        None => terrain,
    };
    let cell_size = match &reading.georeference {
        // The transform's own steps, when they are metres.
        Some(g) if g.epsg.is_none_or(|code| code != 4326) => {
            CellSize::new(g.transform[0].hypot(g.transform[3]), g.transform[1].hypot(g.transform[4]))?
        }
        _ => CellSize::new(style.info.exemplar.cell_size[0], style.info.exemplar.cell_size[1])?,
    };
    let dem = Dem::new(terrain, cell_size)?.at(reading.georeference);
    io::write(&dem, &args.output, &WriteOptions::default())?;
    let (low, high) = dem.range();
    let (rows, cols) = dem.shape();
    context.console.line(format!("{}: {rows}x{cols} cells, {low:.1} to {high:.1} m", args.output.display()));
    Ok(())
}

/// A sketch file, or a sample by name when there is no such file.
pub(super) fn read_sketch(path: &Path, options: &geojson::ReadOptions) -> Result<SketchReading> {
    match path.to_str() {
        Some(name) if !path.exists() && samples::names().any(|known| known == name) => samples::load(name),
        _ => geojson::read(path, options),
    }
}

/// The sketch with its heights in metres.
pub(super) fn in_metres(reading: &SketchReading, range: Normalization) -> Sketch {
    let mut sketch = reading.sketch.clone();
    if reading.unit == HeightUnit::Normalised {
        for vertex in sketch.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
            vertex.z = range.to_metres(vertex.z);
        }
    }
    sketch
}
