//! `extract`: terrain to the sketch that a hand would draw of it.

use super::args::{self, CropOption, DemInput};
use super::outputs::{OutputKind, Outputs};
use super::{Context, info};
use crate::control::Stop;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::extract::{ExtractionConfig, crop_lines, ridges_and_valleys_until};
use crate::sketch::geojson::{self, HeightUnit};
use crate::sketch::{LineMap, PartLengths, Sketch, split_parts};
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock extract sierra -o sketch.geojson
  monadnock extract alps.tif --crop 512,512,128 --with-context -o patch.geojson
  monadnock extract N46E007.hgt --accumulation 100 --min-order 3 -o main-lines.geojson
  monadnock extract heights.png --elevation 300,2100 --cell-size 30 -o sketch.geojson

The sketch holds heights in metres. Its coordinates are those of the terrain's coordinate system when the terrain has
one, else columns and rows. A configuration file names what it changes (TOML), at its top or in a section [extraction]:
  smoothing = 0.7          # cells
  routing = \"least-cost\"   # or \"filled\"
  margin = 32              # cells
  min_accumulation = 12    # cells
  min_order = 2
  closing = 1              # cells
  min_length = 10          # cells
  gradient_quantile = 0.01";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ExtractArgs {
    #[command(flatten)]
    input: DemInput,
    /// The sketch to write (GeoJSON)
    #[arg(short, long, value_name = "SKETCH")]
    output: PathBuf,
    #[command(flatten)]
    crop: CropOption,
    /// Find the lines of the whole terrain first and cut the window out then: they reach its frame, and water from outside
    /// counts
    #[arg(long, requires = "window")]
    with_context: bool,
    /// A line drains at least this many cells [default: 12]
    #[arg(long, value_name = "N")]
    accumulation: Option<u32>,
    /// Lowest Strahler order that is kept [default: 2]
    #[arg(long, value_name = "N")]
    min_order: Option<u8>,
    /// Settings from a file; the options here overrule it
    #[arg(long, value_name = "FILE", conflicts_with = "paper")]
    config: Option<PathBuf>,
    /// The steps of the paper and nothing else: no smoothing, filled pits, no margin
    #[arg(long)]
    paper: bool,
}

pub(super) fn run(args: &ExtractArgs, context: &Context) -> Result<()> {
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Sketch)
        .reads(&args.input.dem)
        .reads(&args.config)
        .check()?;
    let config = args.config()?;
    let dem = args.input.load(&context.console)?;
    let (dem, lines) = args.lines_of(dem, &config, &context.stop())?;
    if lines.line_count() == 0 {
        let allowed = "at least one is needed: try terrain with more relief, a larger window, or lower \
                       --accumulation or --min-order";
        return Err(Error::value("number of ridges and valleys", 0, allowed).in_file(&args.input.dem));
    }
    let sketch = Sketch::trace(&lines);
    geojson::write(&args.output, &sketch, HeightUnit::Metres, dem.georeference())?;

    let console = &context.console;
    let parts = split_parts(&lines, PartLengths::default(), context.seed).len();
    console.line(info::table(&info::lines_rows(&sketch, &lines)).trim_end());
    console
        .line(info::table(&[("parts".into(), format!("{parts} (of seed {})", context.seed.0))]).trim_end());
    console.line(format!("wrote {}", args.output.display()));
    Ok(())
}

impl ExtractArgs {
    /// Defaults, then the file, then the options.
    fn config(&self) -> Result<ExtractionConfig> {
        let mut config = match &self.config {
            Some(path) => config_in(path)?,
            None if self.paper => ExtractionConfig::paper(),
            None => ExtractionConfig::default(),
        };
        config.min_accumulation = self.accumulation.unwrap_or(config.min_accumulation);
        config.min_order = self.min_order.unwrap_or(config.min_order);
        config.validate()?;
        Ok(config)
    }

    /// The window with its lines.
    fn lines_of(&self, dem: Dem, config: &ExtractionConfig, stop: &Stop) -> Result<(Dem, LineMap)> {
        if !self.with_context {
            let dem = self.crop.apply(dem)?;
            let lines = ridges_and_valleys_until(dem.heights(), dem.valid(), config, stop)?;
            return Ok((dem, lines));
        }
        let window = self.crop.window_of(&dem);
        let cut = self.crop.apply(dem.clone())?;
        let all = ridges_and_valleys_until(dem.heights(), dem.valid(), config, stop)?;
        let lines = crop_lines(&all, window, config.min_length)?;
        Ok((cut, lines))
    }
}

/// The extraction settings in a file, which may be one for `train` with a section for them.
fn config_in(path: &Path) -> Result<ExtractionConfig> {
    let mut table = args::read_toml(path)?;
    let table = match table.remove("extraction") {
        Some(toml::Value::Table(section)) => section,
        Some(other) => {
            return Err(Error::file(path, "extraction", other, "allowed: a section [extraction]"));
        }
        None => table,
    };
    let config: ExtractionConfig = args::config_of(path, table)?;
    config.validate().map_err(|e| e.in_file(path))?;
    Ok(config)
}
