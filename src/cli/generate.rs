//! `monadnock generate`: a style and a sketch become terrain.

use super::Context;
use super::args::{elevation, read_numbers};
use super::console::Console;
use super::outputs::{OutputKind, Outputs};
use super::sketch_check::{CheckOptions, draw_variants, sheet_path, variant_path};
use super::sketch_fill::StyleHeights;
use super::sketch_input::{SketchOptions, in_metres};
use super::sketch_map::MapOptions;
use crate::dem::io::{self, WriteOptions};
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};
use crate::machine;
use crate::seed::Seed;
use crate::sketch::geojson::{MissingHeights, ReadOptions};
use crate::sketch::{LineMap, Sketch};
use crate::style::{Drain, Method, NETWORK, Style, add_detail};
use crate::systems::task::{DetailUse, Ground, RandomHeights, with_random_lines};
use std::path::{Path, PathBuf};

/// Arguments of `generate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.tif
  monadnock generate sierra.safetensors --sketch lambda-ring -o terrain.tif --random-sketches 40
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.png --elevation 800,2400
  monadnock generate sierra.safetensors --sketch volcano-ring -o large.tif --size 256x256
  monadnock generate sierra.safetensors --sketch mine.geojson -o smooth.tif --no-detail
  monadnock generate sierra.safetensors --sketch qgis.geojson -o terrain.tif --like alps.tif
  monadnock generate sierra.safetensors --sketch qgis.geojson -o terrain.tif --bounds strokes
  monadnock generate sierra.safetensors --sketch mine.geojson -o six.tif --variants 6
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.tif --check --bound found=0.8
  monadnock generate sierra.safetensors --sketch mine.geojson -o terrain.tif --sources sources.png
  monadnock --seed 2 generate sierra.safetensors --sketch mine.geojson -o other.tif --detail-strength 0.6

A stroke may have no heights, or a few: the others are those that the style's ridges and valleys have (`sketch fill`).
Sketch heights are metres, or 0 to 1 of the style's range when the file says \"unit\": \"normalised\".
With --size a sketch that states the size of its map (those of the program do, and files of `extract`) is scaled to it frame
to frame; one with a georeference keeps its ground and gets other cells. A file in columns and rows that states no size is
taken as drawn on a map of that size, from its north-west corner; without --size its strokes decide the size.
Few strokes become terrain from the exemplar's own patches (synthesis); dense sketches, 10 % of the cells and more, go to the
network, and between their lines the style's detail adds the small forms. --method overrules. Strokes keep their heights; every
--seed draws other forms between them. A mask says where detail is wanted: a terrain file of the map's size whose heights are above 0.5 there (a PNG is white
there).

A sketch drawn in a geographic information system is laid on a map with --like DEM or --bounds. One with a place has the cell
size on the ground that its coordinates give; one without has the style's.

The output's format follows its ending: .tif (float32), .png (16 bits), .npy, .asc.")]
pub(super) struct GenerateArgs {
    /// The style, as written by `train`
    style: PathBuf,
    /// The sketch: a GeoJSON file, or one that comes with the program (a-circle, empty-corner, fault-line, lambda-ring,
    /// meander, p-valley, range-and-river, single-stroke, three-peaks, valley-system, volcano-ring)
    #[arg(long, value_name = "S.geojson")]
    sketch: PathBuf,
    /// The terrain to write
    #[arg(short, long)]
    output: PathBuf,
    /// What makes the terrain: auto (few strokes: synthesis; many: the network), network, synthesis or landscape, or another
    /// system of the style by its name
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = method)]
    method: Method,
    /// Elevations in metres that stand for the exemplar's lowest and highest height
    #[arg(long, value_name = "MIN,MAX", value_parser = elevation, allow_hyphen_values = true)]
    elevation: Option<Normalization>,
    /// Nodes of random ridges and valleys to fill the empty parts of a sparse sketch (paper, 5.2)
    #[arg(long, value_name = "N")]
    random_sketches: Option<usize>,
    /// Heights of random lines: around the drawn strokes, as steep as the style; or from the whole range (paper)
    #[arg(long, value_enum, value_name = "WHERE", default_value = "style", requires = "random_sketches")]
    random_heights: RandomHeightsName,
    /// Fill in missing heights along each stroke from its given ones, in place of what the style's ridges and valleys say
    #[arg(long)]
    interpolate_heights: bool,
    /// Metres in one unit of the sketch's heights (0.3048 for feet); overrules the file
    #[arg(long, value_name = "M", value_parser = metres_per_unit, allow_hyphen_values = true)]
    metres_per_unit: Option<f64>,
    /// Lines wander by so many cells (root mean square), that straight and round ones look drawn by hand; 0 to 16. Terrain, check
    /// and pictures are those of the lines as they wander
    #[arg(long, value_name = "CELLS", default_value_t = 0.0)]
    wander: f64,
    #[command(flatten)]
    map: MapOptions,
    #[command(flatten)]
    reading: SketchOptions,
    /// Terrain from so many seeds, beginning with --seed: OUTPUT, OUTPUT-2, ... and a picture of all, OUTPUT-variants.png
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=24))]
    variants: u8,
    /// Keep rivers in the drawn valleys, and cut dams until no more of the terrain lies in pits than of the style's: auto where rivers
    /// made the style, always (also without a word), never (of synthesis and landscape: no more than they do themselves)
    #[arg(long, value_enum, value_name = "WHEN", num_args = 0..=1, require_equals = true, default_value = "auto",
        default_missing_value = "always")]
    drain: DrainName,
    /// Write for every cell which place of the style's terrain, or which stroke, it comes from: arrays (.npz) or a picture (.png);
    /// of systems that lay pieces of it (synthesis)
    #[arg(long, value_name = "F")]
    sources: Option<PathBuf>,
    #[command(flatten)]
    detail: DetailOptions,
    #[command(flatten)]
    check: CheckOptions,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum DrainName {
    Auto,
    Always,
    Never,
}

impl From<DrainName> for Drain {
    fn from(name: DrainName) -> Self {
        match name {
            DrainName::Auto => Self::LikeExemplar,
            DrainName::Always => Self::Always,
            DrainName::Never => Self::Never,
        }
    }
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum RandomHeightsName {
    Style,
    Range,
}

impl From<RandomHeightsName> for RandomHeights {
    fn from(name: RandomHeightsName) -> Self {
        match name {
            RandomHeightsName::Style => Self::Style,
            RandomHeightsName::Range => Self::Range,
        }
    }
}

/// What random lines are measured by, metres.
pub(super) fn ground_of(style: &Style, range: Normalization) -> Ground {
    let metres = range.high() - range.low();
    Ground { range: (range.low(), range.high()), slope: style.origin.mean_slope.map(|slope| slope * metres) }
}

const DETAIL: &str = "Detail";

// What is said about detail; no doc comment, see args.rs.
#[derive(Debug, clap::Args)]
struct DetailOptions {
    /// Only the forms that the strokes say
    #[arg(long, help_heading = DETAIL)]
    no_detail: bool,
    /// Roughness: 0 none, 1 the style's own, 2 twice as much
    #[arg(long, help_heading = DETAIL, value_name = "X", default_value_t = 1.0, conflicts_with = "no_detail")]
    detail_strength: f32,
    /// Forms smaller than this many cells are the style's, larger ones the strokes'; chosen by the gaps between the strokes
    /// when absent
    #[arg(long, help_heading = DETAIL, value_name = "CELLS", conflicts_with = "no_detail")]
    detail_size: Option<f64>,
    /// Where detail is wanted: above 0.5, or white in a PNG
    #[arg(long, help_heading = DETAIL, value_name = "MASK", conflicts_with = "no_detail")]
    detail_mask: Option<PathBuf>,
}

/// What terrain was made from.
#[derive(Clone, Copy)]
struct Use<'a> {
    style: &'a Style,
    /// Whether the system made all small forms itself.
    is_complete: bool,
    lines: &'a LineMap,
    /// Metres that stand for the style's range.
    range: Normalization,
    seed: Seed,
}

impl DetailOptions {
    /// Whether something was said about detail.
    fn is_asked(&self) -> bool {
        self.detail_strength != 1.0 || self.detail_size.is_some() || self.detail_mask.is_some()
    }

    /// Adds the style's detail to `terrain`, in metres.
    fn add(&self, how: &Use<'_>, terrain: Grid<f32>, context: &Context) -> Result<Grid<f32>> {
        let Use { style, is_complete, lines, range, seed } = *how;
        if self.no_detail || ((style.detail.is_none() || is_complete) && !self.is_asked()) {
            return Ok(terrain);
        }
        let detail = style.needed_detail()?;
        let mask = self.detail_mask.as_deref().map(|path| mask(path, terrain.shape())).transpose()?;
        let how =
            DetailUse { strength: self.detail_strength, size: self.detail_size, ..DetailUse::default() };
        add_detail(&terrain, &**detail, range, Some(lines), mask.as_ref(), &how, seed, &context.stop())
    }
}

/// The cells above one half of a raster of this shape.
fn mask(path: &Path, shape: (usize, usize)) -> Result<Mask> {
    // Where it lies and how large its cells are does not count.
    let (dem, _) = read_numbers(path, Some(CellSize::square(1.0)?))?;
    if dem.shape() != shape {
        let (found, wanted) = (dem.shape(), shape);
        let found = format!("{}x{} cells", found.0, found.1);
        return Err(Error::file(path, "mask", found, format!("the map has {}x{}", wanted.0, wanted.1)));
    }
    Ok(Mask::from_fn(shape.0, shape.1, |c| dem.valid()[c] && dem.heights()[c] > 0.5))
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the style, the sketch or the output path.
pub(super) fn run(args: &GenerateArgs, context: &Context) -> Result<()> {
    let of_variants = |path: &PathBuf| -> Vec<PathBuf> {
        (0..usize::from(args.variants)).map(|i| variant_path(path, i)).collect()
    };
    let (variants, sources) =
        (of_variants(&args.output), args.sources.as_ref().map(of_variants).unwrap_or_default());
    let sheet = (args.variants > 1).then(|| sheet_path(&args.output));
    let mut outputs = Outputs::new();
    for path in &variants {
        outputs = outputs.writes("--output", path, OutputKind::Terrain);
    }
    for path in &sources {
        outputs = outputs.writes("--sources", path, OutputKind::Sources);
    }
    outputs
        .writes("--variants", &sheet, OutputKind::Picture)
        .writes("--check-json", &args.check.check_json, OutputKind::Json)
        .reads(&args.style)
        .reads(&args.sketch)
        .reads(args.map.like())
        .reads(&args.detail.detail_mask)
        .check()?;
    args.check.bounds()?;
    let style = context.registry.load(&args.style)?;
    let range = args.elevation.unwrap_or(style.origin.normalization);
    let missing = if args.interpolate_heights { MissingHeights::Interpolate } else { MissingHeights::Leave };
    let metres_per_unit = args.metres_per_unit;
    let options = ReadOptions { missing_heights: missing, metres_per_unit, ..args.reading.options() };
    let [x, y] = style.origin.exemplar.cell_size;
    let placed = args.map.read(&args.sketch, &options, CellSize::new(x, y)?, &context.console)?;
    let sketch = in_metres(&placed.reading, range);
    let heights = StyleHeights { path: &args.style, style: &style, range };
    let sketch = heights.fill(&args.sketch, &placed.reading, sketch, &context.console)?;
    warn_of_heights(&args.sketch, &sketch, range, args.elevation.is_some(), &context.console);
    check_memory(sketch.rows, sketch.cols, machine::available_memory())?;
    let sketch = match args.random_sketches {
        Some(nodes) => {
            let ground = ground_of(&style, range);
            with_random_lines(&sketch, nodes, args.random_heights.into(), ground, context.seed)?
        }
        None => sketch,
    };
    let sketch = sketch.wandering(args.wander, context.seed.derive("wander"))?;
    let lines = sketch.rasterize();
    let system = style.system_for(&lines, &args.method).map_err(|e| e.in_file(&args.style))?;
    let share = 100.0 * lines.line_count() as f64 / (sketch.rows * sketch.cols) as f64;
    let most = 100.0 * system.sparse_up_to();
    let why = match args.method {
        Method::System(_) => "as asked for".to_owned(),
        Method::Auto if most > 0.0 => format!("up to {most:.0} % its terrain looks more real"),
        Method::Auto => "nearer to the heights of dense sketches; --method synthesis for others".to_owned(),
    };
    context.console.note(format!(
        "{}: strokes on {share:.1} % of the cells: terrain by {}, {why} (--method)",
        args.sketch.display(),
        system.name()
    ));
    let mut made = Vec::new();
    for (i, path) in variants.iter().enumerate() {
        let seed = Seed(context.seed.0.wrapping_add(i as u64));
        let (terrain, provenance) = if args.sources.is_some() {
            let made = style.generate_traced(&lines, &args.method, Some(range), seed, &context.stop());
            made.map(|(terrain, provenance)| (terrain, Some(provenance)))
                .map_err(|e| e.in_file(&args.style))?
        } else {
            (style.generate(&lines, &args.method, Some(range), seed, &context.stop())?, None)
        };
        let how = Use { style: &style, is_complete: system.is_complete(), lines: &lines, range, seed };
        let terrain = args.detail.add(&how, terrain, context).map_err(|e| match e {
            Error::Value { .. } => e.in_file(&args.style),
            other => other,
        })?;
        let terrain = args.drained(&how, &sketch, terrain, context)?;
        let dem = Dem::new(terrain, placed.cell_size)?.at(placed.reading.georeference);
        io::write(&dem, path, &WriteOptions::default())?;
        let (low, high) = dem.range();
        let ((rows, cols), side) = (dem.shape(), dem.cell_size().in_words());
        context
            .console
            .line(format!("{}: {rows}x{cols} cells of {side}, {low:.1} to {high:.1} m", path.display()));
        if let (Some(path), Some(provenance), Some(exemplar)) = (sources.get(i), &provenance, &style.terrain)
        {
            super::sources::write(path, &dem, provenance, &sketch, exemplar)?;
            context.console.line(format!("wrote {}", path.display()));
        }
        made.push((format!("seed {}", seed.0), dem));
    }
    if let Some(sheet) = &sheet {
        draw_variants(&made, &sketch, sheet)?;
        context.console.line(format!("wrote {}", sheet.display()));
    }
    let style_pits = style.landscape().map(|fit| fit.pit_share);
    args.check.run(&made[0].1, &sketch, style_pits, &args.output, context)
}

impl GenerateArgs {
    /// `terrain`, in metres, with ways out for water as far as that is wanted.
    fn drained(
        &self,
        how: &Use<'_>,
        sketch: &Sketch,
        terrain: Grid<f32>,
        context: &Context,
    ) -> Result<Grid<f32>> {
        let stop = context.stop();
        let Some(drained) = how.style.drained(&terrain, sketch, self.drain.into(), &stop)? else {
            return Ok(terrain);
        };
        let percent = |share: f64| 100.0 * share;
        context.console.note(format!(
            "drained: {:.1} % of the cells lay in pits, {:.1} % do (--drain)",
            percent(drained.pits_before),
            percent(drained.pits_after)
        ));
        Ok(drained.heights)
    }
}

/// `network` is how people call the first system.
fn method(text: &str) -> Result<Method, String> {
    Ok(match text {
        "auto" => Method::Auto,
        "network" => Method::System(NETWORK.to_owned()),
        name => Method::System(name.to_owned()),
    })
}

fn metres_per_unit(text: &str) -> Result<f64, String> {
    let metres = text.trim().parse::<f64>().ok().filter(|m| m.is_finite() && *m > 0.0);
    metres.ok_or_else(|| "allowed: metres above 0, as in 0.3048".to_owned())
}

/// Heights farther out of a style's range than this share of its relief are worth a warning.
const FAR_OUTSIDE: f64 = 1.0;

/// Warns of heights that the style has never seen, and says when they would fit as feet.
fn warn_of_heights(path: &Path, sketch: &Sketch, range: Normalization, is_given: bool, console: &Console) {
    let Some((low, high)) = sketch.height_range() else { return };
    let spare = FAR_OUTSIDE * (range.high() - range.low());
    let fits = |low: f64, high: f64| low >= range.low() - spare && high <= range.high() + spare;
    if fits(low, high) {
        return;
    }
    const FOOT: f64 = 0.3048;
    let remedy = if fits(low * FOOT, high * FOOT) {
        "in feet they would fit: --metres-per-unit 0.3048"
    } else {
        "--elevation MIN,MAX moves the style's range, --metres-per-unit says what a unit is"
    };
    let whose = if is_given { "the range of --elevation" } else { "the style's range" };
    console.warning(format!(
        "{}: heights of {low:.1} to {high:.1} m lie far outside {whose}, {:.1} to {:.1} m: {remedy}",
        path.display(),
        range.low(),
        range.high()
    ));
}

/// What generation takes a cell, bytes: 1.1 to 1.3 kB were measured.
const MEMORY_PER_CELL: u64 = 1300;

/// Refuses a map that the machine cannot hold, rather than be killed in the middle of it.
fn check_memory(rows: usize, cols: usize, available: Option<u64>) -> Result<()> {
    let needed = rows as u64 * cols as u64 * MEMORY_PER_CELL;
    match available {
        Some(available) if needed > available => {
            let gigabytes = |bytes: u64| bytes as f64 / 1e9;
            let allowed = format!(
                "the whole map is generated at once, which would take about {:.1} GB of memory; {:.1} GB are free",
                gigabytes(needed),
                gigabytes(available)
            );
            Err(Error::value("size of the map", format!("{rows}x{cols}"), allowed))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_beyond_the_memory_is_refused_beforehand() {
        check_memory(128, 128, Some(1 << 30)).unwrap();
        check_memory(16_384, 16_384, None).unwrap();
        let message = check_memory(4096, 4096, Some(8_000_000_000)).unwrap_err().to_string();
        assert!(
            message.contains("4096x4096") && message.contains("21.8 GB") && message.contains("8.0 GB"),
            "{message}"
        );
    }
}
