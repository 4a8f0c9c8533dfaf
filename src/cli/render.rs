//! `monadnock render`: a DEM as shaded relief.

use super::args::{DemInput, Window};
use super::console::Context;
use super::generate::read_sketch;
use crate::error::{Error, Result};
use crate::sketch::geojson;
use crate::viz::{Exaggeration, LineArt, LineStyle, Palette, Relief};
use std::path::PathBuf;

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock render sierra -o sierra.png
  monadnock render terrain.tif -o terrain.png --scale 4 --sketch mine.geojson
  monadnock render moon.tif -o moon.png --palette lunar --exaggeration 2")]
pub(super) struct RenderArgs {
    #[command(flatten)]
    dem: DemInput,
    /// The picture to write
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
    /// Only this window
    #[arg(long, value_name = "ROW,COL,SIZE")]
    crop: Option<Window>,
    /// A sketch to draw over it: a GeoJSON file or a sample that comes with the program
    #[arg(long, value_name = "S.geojson")]
    sketch: Option<PathBuf>,
    /// Pixels of a cell
    #[arg(long, default_value_t = 1, value_name = "N")]
    scale: usize,
    /// Colours
    #[arg(long, value_enum, default_value = "alpine")]
    palette: PaletteName,
    /// Vertical exaggeration of the shading [default: by the mean slope]
    #[arg(long, value_name = "FACTOR")]
    exaggeration: Option<f64>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PaletteName {
    Alpine,
    Arid,
    Lunar,
    Grey,
}

/// Runs the verb.
pub(super) fn run(args: &RenderArgs, context: &Context) -> Result<()> {
    let dem = args.dem.load()?;
    let dem = match args.crop {
        Some(window) => window.crop(&dem)?,
        None => dem,
    };
    let palette = match args.palette {
        PaletteName::Alpine => Palette::Alpine,
        PaletteName::Arid => Palette::Arid,
        PaletteName::Lunar => Palette::Lunar,
        PaletteName::Grey => Palette::Grey,
    };
    let exaggeration = match args.exaggeration {
        Some(factor) if factor > 0.0 && factor.is_finite() => Exaggeration::By(factor),
        Some(factor) => return Err(Error::value("--exaggeration", factor, "allowed: positive and finite")),
        None => Exaggeration::Auto,
    };
    let relief = Relief { exaggeration, ..Relief::with_palette(palette).scaled(args.scale) };
    let mut picture = relief.draw(&dem)?;
    if let Some(path) = &args.sketch {
        let options = geojson::ReadOptions {
            size: Some(dem.shape()),
            georeference: dem.georeference().copied(),
            ..Default::default()
        };
        let reading = read_sketch(path, &options)?;
        for warning in &reading.warnings {
            context.console.warn(format!("{}: {warning}", path.display()));
        }
        LineArt::try_from(&reading.sketch)?.overlay(&mut picture, &LineStyle::default())?;
    }
    picture.write_png(&args.output)?;
    let (rows, cols) = picture.shape();
    context.console.line(format!("{}: {cols}x{rows} pixels", args.output.display()));
    Ok(())
}
