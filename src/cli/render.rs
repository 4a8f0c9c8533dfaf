//! `render`: terrain as a shaded relief picture, with a sketch over it.

use super::Context;
use super::args::{CropOption, DemInput};
use super::outputs::{OutputKind, Outputs};
use super::sketch_input::{Map, SketchOptions, read_on_map, window_of};
use crate::dem::Georeference;
use crate::error::Result;
use crate::grid::Window;
use crate::sketch::Sketch;
use crate::sketch::geojson::{MissingHeights, ReadOptions};
use crate::viz::{LineArt, LineStyle, Palette, Relief};
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock render sierra -o sierra.png
  monadnock render grand-canyon --palette arid --scale 2 -o canyon.png
  monadnock render alps.tif --crop 512,512,128 --scale 4 --sketch patch.geojson -o patch.png
  monadnock render sierra --crop 128,128,128 --sketch lambda-ring -o lambda.png
  monadnock render moon.tif --grey -o shading.png

Only the positions of a sketch count here, not its heights. One in columns and rows that was drawn on a map of another
size than the terrain, or the window of it, is stretched over the terrain. One of the whole terrain is cropped with it.";

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
    /// Ridges and valleys to draw over the terrain: a GeoJSON file, or a sketch that comes with the program (a-circle,
    /// empty-corner, fault-line, lambda-ring, meander, p-valley, range-and-river, single-stroke, three-peaks, valley-system,
    /// volcano-ring)
    #[arg(long, value_name = "SKETCH")]
    sketch: Option<PathBuf>,
    #[command(flatten)]
    reading: SketchOptions,
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
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Picture)
        .reads(&args.input.dem)
        .reads(&args.sketch)
        .check()?;
    let whole = args.input.load(&context.console)?;
    let window = args.crop.window_of(&whole);
    let ground = Ground { window, whole: whole.shape(), georeference: whole.georeference().copied() };
    let dem = args.crop.apply(whole)?;
    let palette = if args.grey { Palette::Grey } else { args.palette.into() };
    let relief = Relief::with_palette(palette).scaled(args.scale);
    let mut picture = relief.draw(&dem)?;
    if let Some(path) = &args.sketch {
        // Only places are drawn.
        let options = ReadOptions { missing_heights: MissingHeights::Leave, ..args.reading.options() };
        let sketch = ground.sketch_over(path, &options, context)?;
        LineArt::try_from(&sketch)?.overlay(&mut picture, &LineStyle::default())?;
    }
    picture.write_png(&args.output)?;
    let (rows, cols) = picture.shape();
    context.console.line(format!("wrote {} ({cols} x {rows} pixels)", args.output.display()));
    Ok(())
}

/// The window that is drawn, and the terrain that it is cut from.
struct Ground {
    window: Window,
    /// (rows, columns) of the whole terrain.
    whole: (usize, usize),
    /// Its place.
    georeference: Option<Georeference>,
}

impl Ground {
    /// The sketch in `path` on the window's raster.
    fn sketch_over(&self, path: &Path, options: &ReadOptions, context: &Context) -> Result<Sketch> {
        let (here, window) = ((self.window.rows, self.window.cols), self.window);
        let map = Map { size: self.whole, georeference: self.georeference };
        let (reading, stretched) = read_on_map(path, map, here, options)?;
        let drawn = stretched.unwrap_or((reading.sketch.rows, reading.sketch.cols));
        for warning in reading.warnings {
            context.console.warning(format!("{}: {warning}", path.display()));
        }
        let sketch = reading.sketch;
        if drawn == self.whole && drawn != here {
            let shown = window_of(&sketch, window);
            if shown.strokes.is_empty() {
                let text = format!("no line of the sketch lies in the window of {window}");
                context.console.warning(format!("{}: {text}", path.display()));
            }
            Ok(shown)
        } else if drawn != here {
            let text =
                format!("drawn on {}x{} cells, stretched over {}x{}", drawn.0, drawn.1, here.0, here.1);
            context.console.note(format!("{}: {text}", path.display()));
            Ok(sketch.scaled_to(here.0, here.1))
        } else {
            Ok(sketch)
        }
    }
}
