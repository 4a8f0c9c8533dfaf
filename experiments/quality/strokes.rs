//! Terrain from a few strokes, for a folder of cases: what another program scores.
//!
//!     cargo bench --bench strokes -- CASES OUT [SEED] [NAME,...]
//!
//! CASES holds folders NAME/ with `exemplar.tif` (heights in metres) and `strokes.geojson`. Writes OUT/NAME.npy (metres), solved by
//! the landscape model as fitted to the exemplar and pinned to the strokes, and prints one line a case: seconds of the fit, of the
//! landscape, of a guide (cells of twice the side), of pin and breach, and the share of the cells in pits before and after.
#![allow(clippy::print_stdout, reason = "an experiment prints")]

use monadnock::Result;
use monadnock::dem::Dem;
use monadnock::dem::io::{self, ReadOptions};
use monadnock::landscape::{BreachConfig, LandscapeConfig, LandscapeFit, breach, pin, solve};
use monadnock::seed::Seed;
use monadnock::sketch::geojson;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [cases, out, rest @ ..] = &args[..] else {
        println!("usage: strokes CASES OUT [SEED] [NAME,...]");
        return Ok(());
    };
    let seed = Seed(rest.first().map_or(1, |seed| seed.parse().expect("a number as the seed")));
    let mut names: Vec<String> = match rest.get(1) {
        Some(names) => names.split(',').map(String::from).collect(),
        None => std::fs::read_dir(cases)
            .expect("a folder of cases")
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| Path::new(cases).join(name).is_dir())
            .collect(),
    };
    names.sort();
    std::fs::create_dir_all(out).expect("a folder for the terrain");
    println!(
        "{:20} {:>6} {:>6} {:>6} {:>6} {:>7} {:>7}",
        "case", "fit", "solve", "guide", "end", "pits", "left"
    );
    names.iter().try_for_each(|name| {
        one(&Path::new(cases).join(name), &Path::new(out).join(format!("{name}.npy")), seed)
    })
}

fn one(case: &Path, out: &Path, seed: Seed) -> Result<()> {
    let exemplar = io::read(&case.join("exemplar.tif"), &ReadOptions::default())?;
    let cell = exemplar.cell_size();
    let lines =
        geojson::read(&case.join("strokes.geojson"), &geojson::ReadOptions::default())?.sketch.rasterize();
    let timed = |since: Instant| since.elapsed().as_secs_f64();

    let start = Instant::now();
    let fit = LandscapeFit::of(exemplar.heights(), exemplar.valid(), cell.mean())?;
    let fitted = timed(start);
    let start = Instant::now();
    let landscape = solve(&fit, &lines, cell.mean(), &LandscapeConfig::default(), seed)?;
    let solved = timed(start);
    let start = Instant::now();
    solve(&fit, &lines, cell.mean(), &LandscapeConfig::guide(), seed)?.heights(4)?;
    let guided = timed(start);
    let start = Instant::now();
    let pinned = pin(&landscape.heights(1)?, &lines)?;
    let config = BreachConfig { pit_share: fit.pit_share.max(0.003), ..BreachConfig::default() };
    let ended = breach(&pinned, &lines, &config)?;
    let end = timed(start);
    let name = case.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    println!(
        "{name:20} {fitted:6.2} {solved:6.2} {guided:6.2} {end:6.2} {:7.4} {:7.4}",
        ended.pits_before, ended.pits_after
    );
    io::write(&Dem::new(ended.heights, cell)?, out, &io::WriteOptions::default())
}
