//! `render`: terrain as a shaded relief picture, with a sketch over it.

use super::Context;
use super::args::{self, CropOption, DemInput, Window};
use crate::dem::Dem;
use crate::error::Result;
use crate::sketch::Sketch;
use crate::sketch::geojson::{self, ReadOptions, SketchReading};
use crate::viz::{LineArt, LineStyle, Palette, Relief};
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock render sierra -o sierra.png
  monadnock render grand-canyon --palette arid --scale 2 -o canyon.png
  monadnock render alps.tif --crop 512,512,128 --scale 4 --sketch patch.geojson -o patch.png
  monadnock render moon.tif --grey -o shading.png

Only the positions of a sketch count here, not its heights. One in columns and rows that was drawn on a map of another
size is stretched over the terrain, as `generate` does.";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    input: DemInput,
    /// The picture to write (PNG)
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
    #[command(flatten)]
    crop: CropOption,
    /// Ridges and valleys to draw over the terrain (GeoJSON)
    #[arg(long, value_name = "SKETCH")]
    sketch: Option<PathBuf>,
    /// Pixels a cell, along each side, 1 to 64
    #[arg(long, value_name = "N", default_value_t = 1)]
    scale: usize,
    /// Colours of the heights
    #[arg(long, value_enum, default_value = "alpine")]
    palette: PaletteName,
    /// Shading alone, without colours
    #[arg(long, visible_alias = "no-colour", conflicts_with = "palette")]
    grey: bool,
}

/// The palettes for heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum PaletteName {
    /// Temperate mountains: green valleys to white summits
    Alpine,
    /// Deserts and canyons: umber to pale limestone
    Arid,
    /// Bodies without air or plants
    Lunar,
    /// Every height the same light grey
    Grey,
    /// Black to white, by height
    Tone,
}

impl From<PaletteName> for Palette {
    fn from(name: PaletteName) -> Self {
        match name {
            PaletteName::Alpine => Self::Alpine,
            PaletteName::Arid => Self::Arid,
            PaletteName::Lunar => Self::Lunar,
            PaletteName::Grey => Self::Grey,
            PaletteName::Tone => Self::Tone,
        }
    }
}

pub(super) fn run(args: &RenderArgs, context: &Context) -> Result<()> {
    args::check_output(&args.output)?;
    let whole = args.input.load()?;
    let window = args.crop.window_of(&whole);
    let shape = whole.shape();
    let dem = args.crop.apply(whole)?;
    let palette = if args.grey { Palette::Grey } else { args.palette.into() };
    let relief = Relief::with_palette(palette).scaled(args.scale);
    let mut picture = relief.draw(&dem)?;
    if let Some(path) = &args.sketch {
        let sketch = sketch_over(path, &dem, window, shape, context)?;
        LineArt::try_from(&sketch)?.overlay(&mut picture, &LineStyle::default())?;
    }
    picture.write_png(&args.output)?;
    let (rows, cols) = picture.shape();
    context.console.line(format!("wrote {} ({cols} x {rows} pixels)", args.output.display()));
    Ok(())
}

/// The sketch in `path` on the raster of `dem`, the `window` of terrain of the shape `whole`.
fn sketch_over(
    path: &Path,
    dem: &Dem,
    window: Window,
    whole: (usize, usize),
    context: &Context,
) -> Result<Sketch> {
    let own = geojson::read(path, &ReadOptions::default())?;
    let reading = match own.stated_size {
        // In columns and rows of a map that the file describes.
        Some(_) if own.georeference.is_none() => own,
        // In coordinates of the terrain.
        _ => {
            let size = Some(dem.shape());
            let options =
                ReadOptions { size, georeference: dem.georeference().copied(), ..Default::default() };
            geojson::read(path, &options)?
        }
    };
    let SketchReading { mut sketch, warnings, .. } = reading;
    for warning in warnings {
        context.console.warning(format!("{}: {warning}", path.display()));
    }
    let (drawn, here) = ((sketch.rows, sketch.cols), dem.shape());
    if drawn != here && drawn == whole {
        for v in sketch.strokes.iter_mut().flat_map(|s| &mut s.vertices) {
            (v.x, v.y) = (v.x - window.origin.col as f64, v.y - window.origin.row as f64);
        }
        (sketch.rows, sketch.cols) = here;
    } else if drawn != here {
        let text = format!("drawn on {}x{} cells, stretched over {}x{}", drawn.0, drawn.1, here.0, here.1);
        context.console.line(format!("{}: {text}", path.display()));
        sketch = sketch.scaled_to(here.0, here.1);
    }
    Ok(sketch)
}
