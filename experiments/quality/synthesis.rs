//! Terrain from a few strokes by synthesis, for a folder of cases: what another program scores.
//!
//!     cargo bench --bench synthesis -- CASES OUT [seed=1] [names=NAME,...] [FIELD=VALUE ...]
//!
//! CASES holds folders NAME/ with `exemplar.tif` (heights in metres) and `strokes.geojson`. Writes OUT/NAME.npy (metres) and prints one
//! line a case: seconds of preparing the exemplar and of making the terrain (the first and a second time, when the exemplar has been drawn as
//! densely before), the share of the cells in pits before and after breaches, and the symmetries that are used; at the end, of cases with a
//! `truth.npy` (metres), the share of their windows that a forest tells from real ones. A FIELD is one of
//! the configuration, with the keys of tables and the numbers of levels joined by dots: `quilting.radius=6 levels.0.rounds=2`.
#![allow(clippy::print_stdout, reason = "an experiment prints")]

use monadnock::control::Stop;
use monadnock::dem::Dem;
use monadnock::dem::io::{self, ReadOptions};
use monadnock::metrics::{told_share, window_features};
use monadnock::seed::Seed;
use monadnock::sketch::geojson;
use monadnock::systems::synthesis::{Synthesis, SynthesisConfig};
use monadnock::{Error, Result};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [cases, out, rest @ ..] = &args[..] else {
        println!("usage: synthesis CASES OUT [seed=N] [names=NAME,...] [FIELD=VALUE ...]");
        return Ok(());
    };
    let (mut seed, mut names) = (Seed(1), None);
    let mut fields = toml::Value::try_from(SynthesisConfig::default()).expect("a table");
    for arg in rest {
        match arg.split_once('=') {
            Some(("seed", value)) => seed = Seed(value.parse().expect("a number as the seed")),
            Some(("names", value)) => names = Some(value.split(',').map(String::from).collect()),
            Some((field, value)) => set(&mut fields, field, value)?,
            None => return Err(Error::value("argument", arg, "allowed: FIELD=VALUE")),
        }
    }
    let config: SynthesisConfig = fields
        .try_into()
        .map_err(|e| Error::value("configuration", e, "see the fields of SynthesisConfig"))?;
    let mut names: Vec<String> = names.unwrap_or_else(|| {
        std::fs::read_dir(cases)
            .expect("a folder of cases")
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| Path::new(cases).join(name).is_dir())
            .collect()
    });
    names.sort();
    std::fs::create_dir_all(out).expect("a folder for the terrain");
    println!(
        "{:20} {:>7} {:>6} {:>6} {:>7} {:>7} symmetries",
        "case", "prepare", "first", "again", "pits", "left"
    );
    let mut told = Vec::new();
    for name in &names {
        let case = Path::new(cases).join(name);
        let made = one(name, &case, &Path::new(out).join(format!("{name}.npy")), &config, seed)?;
        if case.join("truth.npy").exists() {
            let cell_size = Some(made.cell_size());
            let truth = io::read(&case.join("truth.npy"), &ReadOptions { cell_size, ..Default::default() })?;
            told.push((window_features(&truth)?, window_features(&made)?));
        }
    }
    if told.len() > 1 {
        let shares = told_share(&told, seed)?;
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        println!("told from real, {} cases: {mean:.4}", shares.len());
    }
    Ok(())
}

/// Puts a value at a path of keys and numbers.
fn set(fields: &mut toml::Value, path: &str, value: &str) -> Result<()> {
    let unknown = || Error::value("field", path, "see the fields of SynthesisConfig");
    let parsed = format!("value = {value}").parse::<toml::Table>();
    let mut parsed = parsed.map_err(|e| Error::value(path, value, e.to_string()))?;
    let value = parsed.remove("value").ok_or_else(unknown)?;
    let (parents, last) = path.rsplit_once('.').map_or((None, path), |(a, b)| (Some(a), b));
    let mut place = fields;
    for key in parents.iter().flat_map(|p| p.split('.')) {
        place = match key.parse::<usize>() {
            Ok(i) => place.get_mut(i),
            Err(_) => place.get_mut(key),
        }
        .ok_or_else(unknown)?;
    }
    place.as_table_mut().ok_or_else(unknown)?.insert(last.into(), value);
    Ok(())
}

fn one(name: &str, case: &Path, out: &Path, config: &SynthesisConfig, seed: Seed) -> Result<Dem> {
    let dem = io::read(&case.join("exemplar.tif"), &ReadOptions::default())?;
    let lines = geojson::read(&case.join("strokes.geojson"), &geojson::ReadOptions::default())?;
    let lines = lines.sketch.rasterize();
    let timed = |since: Instant| since.elapsed().as_secs_f64();
    let start = Instant::now();
    let synthesis = Synthesis::new(&dem, config)?;
    let prepared = timed(start);
    let start = Instant::now();
    let made = synthesis.synthesize(&lines, seed, &Stop::new())?;
    let first = timed(start);
    let start = Instant::now();
    synthesis.synthesize(&lines, seed, &Stop::new())?;
    let again = timed(start);
    let (before, after) = made.pits;
    let turned: Vec<String> = synthesis.symmetries().turned[1..].iter().map(|t| format!("{t:.2}")).collect();
    println!(
        "{name:20} {prepared:7.2} {first:6.2} {again:6.2} {before:7.4} {after:7.4} {:?} {}",
        synthesis.symmetries().used,
        turned.join(" ")
    );
    let made = Dem::new(made.heights, dem.cell_size())?;
    io::write(&made, out, &io::WriteOptions::default())?;
    Ok(made)
}
