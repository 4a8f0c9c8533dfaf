//! The steps of the demo; every file that they write is kept.

use super::report;
use super::results::{DemoResults, DemoStyle};
use crate::cli::Context;
use crate::cli::generate::ground_of;
use crate::cli::outputs::{OutputKind, Outputs};
use crate::cli::sketch_input::in_metres;
use crate::cli::watch::watched;
use crate::dem::io::{self, WriteOptions};
use crate::dem::{Dem, bundled};
use crate::error::{Error, Result};
use crate::evaluate::{EvaluationConfig, PATCH, choose_exemplar, evaluate, patch_cells, to_csv};
use crate::extract;
use crate::file;
use crate::grid::{Cell, Grid, Window};
use crate::seed::Seed;
use crate::sketch::geojson::{self, HeightUnit};
use crate::sketch::{Sketch, samples};
use crate::style::{Method, NETWORK, Recipe, Source, Style, StyleConfig, add_detail, learn};
use crate::systems::task::{DetailUse, RandomHeights, SketchToTerrain, with_random_lines};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The embedded exemplars, the first one also for the comparison on its neighbours.
const EXEMPLARS: [&str; 2] = ["sierra", "grand-canyon"];
/// The hand-drawn sketch: a ridge like a lambda inside a ring of valleys (Liu & Benes 2025, Fig. 10).
const DRAWING: &str = "lambda-ring";
/// What becomes of these is shown beside it, and what several seeds make of the first one.
const OTHERS: [&str; 3] = ["range-and-river", "valley-system", "single-stroke"];
/// Seeds of one drawing.
const VARIANTS: u64 = 3;
/// Nodes of random lines in the enhanced version of the drawing (paper, 5.2).
const RANDOM_NODES: usize = 40;

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock demo
  monadnock demo --quick --out look

Trains a style on each embedded exemplar, rebuilds neighbouring terrain with every system, turns four drawings into terrain
in both styles, and writes report.html with all pictures, GeoTIFFs, sketches and styles beside it.")]
pub(in crate::cli) struct DemoArgs {
    /// Train briefly and compare on three patches only
    #[arg(long)]
    quick: bool,
    /// The folder to write
    #[arg(long, default_value = "monadnock-demo", value_name = "DIR")]
    out: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// When the folder cannot be written.
pub(in crate::cli) fn run(args: &DemoArgs, context: &Context) -> Result<()> {
    let out = &args.out;
    Outputs::new().writes("--out", out, OutputKind::Folder).check()?;
    fs::create_dir_all(out).map_err(Error::io(out, "create the folder"))?;
    let mut config = StyleConfig::default();
    if args.quick {
        config.model.epochs = 60;
        config.model.extractions = 4;
    }
    let mut times = Vec::new();
    let mut timed = |label: String, started: Instant| times.push((label, started.elapsed()));

    let mut styles = Vec::new();
    for name in EXEMPLARS {
        let started = Instant::now();
        let dem = bundled::load(name)?;
        let origin = choose_exemplar(&dem)?;
        let source = Source::new(name, &dem, Window::square(origin, PATCH))?;
        let recipe = Recipe::network(&config, context.seed)?.with_patches()?.with_systems_for_drawings()?;
        let style = watched(context, None, None, |control| learn(&source, &recipe, control))?;
        timed(format!("training on {name}"), started);
        let started = Instant::now();
        styles.push(draw_with(name, source, style, context)?);
        timed(format!("drawing in the style of {name}"), started);
    }

    let started = Instant::now();
    let compared = bundled::load(EXEMPLARS[0])?;
    let first = &styles[0];
    let exemplar = Cell::new(first.source.info.row, first.source.info.col);
    let mut origins: Vec<Cell> = patch_cells(&compared).into_iter().filter(|c| *c != exemplar).collect();
    if args.quick {
        // Neighbours of the exemplar first.
        origins.sort_by_key(|c| c.distance_squared(exemplar));
        origins.truncate(3);
    }
    let systems = context.registry.all(&first.style);
    let protocol =
        EvaluationConfig { extraction: config.extraction.clone(), keep: true, ..EvaluationConfig::default() };
    let progress = context.console.progress(origins.len() as u64, "comparing systems");
    let evaluation =
        evaluate(&compared, &origins, &systems, &protocol, context.seed, &context.stop(), || {
            progress.advance(1)
        })?;
    drop(progress);
    timed(format!("rebuilding {} patches with {} systems", origins.len(), systems.len()), started);

    let range = styles[0].style.origin.normalization;
    let drawing = in_metres(&samples::load(DRAWING)?, range);
    let others = OTHERS.map(|name| Ok(in_metres(&samples::load(name)?, range)));
    let others = others.into_iter().collect::<Result<_>>()?;
    let commands = commands(&styles, args.quick);
    let mut results =
        DemoResults { quick: args.quick, styles, drawing, others, evaluation, compared, times, commands };
    let started = Instant::now();
    write_data(&results, out)?;
    let page = report::Page::draw(&results, out)?;
    results.times.push(("pictures".to_owned(), started.elapsed()));
    file::write_bytes(&out.join("report.html"), page.html(&results).as_bytes())?;
    context.console.line(format!("{}", out.join("report.html").display()));
    Ok(())
}

fn draw_with(name: &'static str, source: Source, style: Style, context: &Context) -> Result<DemoStyle> {
    let tile = bundled::manifest().iter().find(|tile| tile.name == name);
    let (title, credit) = tile.map_or_else(
        || (name.to_owned(), String::new()),
        |tile| (tile.title.clone(), format!("{}: {}. {}", tile.title, tile.credit, tile.licence)),
    );
    let range = style.origin.normalization;
    let unit = range.normalize(&source.dem);
    let lines = extract::ridges_and_valleys(&unit, source.dem.valid(), &style.origin.extraction)?;
    let metres =
        |unit: &Grid<f32>| -> Result<Dem> { Dem::new(range.denormalize(unit), source.dem.cell_size()) };
    let rebuilt = metres(&style.network()?.rebuild(&lines, style.origin.seed, &context.stop())?)?;
    let drawing = in_metres(&samples::load(DRAWING)?, range);
    let detail = style.needed_detail()?;
    let with_seed = |sketch: &Sketch, method: &Method, seed: Seed| {
        style.generate(&sketch.rasterize(), method, None, seed, &context.stop())
    };
    let made = |sketch: &Sketch, method: &Method| with_seed(sketch, method, context.seed);
    let network = Method::System(NETWORK.to_owned());
    let detailed = |sketch: &Sketch| -> Result<Dem> {
        let (coarse, lines) = (made(sketch, &network)?, sketch.rasterize());
        let how = DetailUse::default();
        let heights =
            add_detail(&coarse, &**detail, range, Some(&lines), None, &how, context.seed, &context.stop())?;
        Dem::new(heights, source.dem.cell_size())
    };
    let ground = ground_of(&style, range);
    let richer = with_random_lines(&drawing, RANDOM_NODES, RandomHeights::default(), ground, context.seed)?;
    let drawn = Dem::new(made(&drawing, &Method::Auto)?, source.dem.cell_size())?;
    let other = |name: &str, seed: Seed| {
        let sketch = in_metres(&samples::load(name)?, range);
        Dem::new(with_seed(&sketch, &Method::Auto, seed)?, source.dem.cell_size())
    };
    let others = OTHERS.iter().map(|name| other(name, context.seed)).collect::<Result<_>>()?;
    let seeds = (0..VARIANTS).map(|i| Seed(context.seed.0.wrapping_add(i)));
    let variants = seeds.map(|seed| other(OTHERS[0], seed)).collect::<Result<_>>()?;
    let (by_network, enhanced) = (detailed(&drawing)?, detailed(&richer)?);
    let lines = lines.to_metres(range);
    Ok(DemoStyle {
        name,
        title,
        credit,
        source,
        lines,
        style,
        rebuilt,
        by_network,
        drawn,
        others,
        variants,
        enhanced: (richer, enhanced),
    })
}

/// Styles, sketches, terrain and scores beside the report.
fn write_data(results: &DemoResults, out: &Path) -> Result<()> {
    let options = WriteOptions::default();
    for s in &results.styles {
        let file = |kind: &str| out.join(format!("{}-{kind}", s.name));
        s.style.save(&file("style.safetensors"))?;
        io::write(&s.source.dem, &file("exemplar.tif"), &options)?;
        io::write(&s.rebuilt, &file("rebuilt.tif"), &options)?;
        io::write(&s.by_network, &file("drawn-by-network.tif"), &options)?;
        io::write(&s.drawn, &file("drawn.tif"), &options)?;
        for (name, terrain) in OTHERS.iter().zip(&s.others) {
            io::write(terrain, &file(&format!("{name}.tif")), &options)?;
        }
        io::write(&s.enhanced.1, &file("drawn-with-random-lines.tif"), &options)?;
        let geo = s.source.dem.georeference();
        geojson::write(&file("exemplar.geojson"), &Sketch::trace(&s.lines), HeightUnit::Metres, geo)?;
        geojson::write(&file("random-lines.geojson"), &s.enhanced.0, HeightUnit::Metres, None)?;
    }
    file::write_bytes(&out.join("drawing.geojson"), samples::text(DRAWING)?.as_bytes())?;
    file::write_bytes(&out.join("scores.csv"), to_csv(&results.evaluation.rows)?.as_bytes())
}

/// The commands that make the same things one by one.
fn commands(styles: &[DemoStyle], quick: bool) -> Vec<String> {
    let mut commands = Vec::new();
    let settings = if quick { " --epochs 60 --set model.extractions=4" } else { "" };
    for s in styles {
        let e = &s.source.info;
        let crop = format!("--crop {},{},{}", e.row, e.col, e.rows);
        commands.push(format!("monadnock extract {} -o {}-exemplar.geojson {crop}", s.name, s.name));
        commands.push(format!("monadnock train {} -o {}-style.safetensors {crop}{settings}", s.name, s.name));
        for (file, more) in [
            ("drawn", String::new()),
            ("drawn-by-network", " --method network".to_owned()),
            ("drawn-with-random-lines", format!(" --method network --random-sketches {RANDOM_NODES}")),
        ] {
            commands.push(format!(
                "monadnock generate {0}-style.safetensors --sketch {DRAWING} -o {0}-{file}.tif{more}",
                s.name
            ));
        }
        for name in OTHERS {
            let variants = if name == OTHERS[0] { format!(" --variants {VARIANTS}") } else { String::new() };
            commands.push(format!(
                "monadnock generate {0}-style.safetensors --sketch {name} -o {0}-{name}.tif{variants}",
                s.name
            ));
        }
        commands.push(format!("monadnock render {0}-drawn.tif -o {0}-drawn.png --scale 4", s.name));
    }
    commands.push(format!(
        "monadnock eval {0}-style.safetensors {0} --csv scores.csv --save rebuilt",
        EXEMPLARS[0]
    ));
    commands
}
