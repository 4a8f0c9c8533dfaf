//! What detail does to coarse terrain of held-out patches.
//!
//!     monadnock train alps.tif -o alps.safetensors
//!     monadnock eval alps.safetensors alps.tif --systems gnn --save held
//!     cargo bench --bench detail -- alps.safetensors alps.tif held [steps=400] [paper=1] [size=4] [strength=1] [keep=0] ...
//!
//! Trains the detail model on the style's own exemplar window (or reads it again from `<held>/detail.json`, when nothing of
//! the training is set), adds detail to every patch's coarse terrain, corrects it towards the sketch, and prints the mean
//! scores of the coarse and the detailed terrain. Detailed terrain is written beside the coarse one as `detail.tif`.
#![allow(clippy::print_stdout, reason = "an experiment prints")]

use monadnock::Result;
use monadnock::dem::io::{self, ReadOptions, WriteOptions};
use monadnock::dem::{Dem, Normalization};
use monadnock::extract;
use monadnock::grid::{Cell, Grid};
use monadnock::interpolation::NaturalNeighbours;
use monadnock::metrics::{Scores, Summary, copy_audit, diversity, psnr, sliced_wasserstein};
use monadnock::seed::Seed;
use monadnock::sketch::geojson;
use monadnock::systems::region_gnn::Style;
use monadnock::systems::singan::{Detail, DetailConfig, DetailInfo, train};
use monadnock::systems::task::{DetailModel, DetailUse};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [style, area, held, settings @ ..] = &args[..] else {
        println!("usage: detail STYLE DEM HELD [key=value]...");
        return Ok(());
    };
    let style = Style::load(Path::new(style))?;
    let dem = io::read(Path::new(area), &ReadOptions::default())?;
    let e = &style.info.exemplar;
    let window = dem.crop(Cell::new(e.row, e.col), e.rows, e.cols)?;
    let heights = Normalization::of(&window).normalize(&window);
    let no_twins = settings.iter().any(|s| s == "twins=0");
    let settings: Vec<String> = settings.iter().filter(|s| *s != "twins=0").cloned().collect();
    let (config, how, given) = parse(&settings);
    let given = given || no_twins;
    let stored = PathBuf::from(held).join("detail.json");
    let extraction = &style.info.config.extraction;
    let variants = style.info.config.model.extractions;
    let lines = extract::variants(&heights, window.valid(), extraction, variants, Seed(1))?;
    let twins = lines.iter().filter(|lines| lines.line_count() > 0).map(|lines| {
        let diagram = NaturalNeighbours::new(&lines.mask())?;
        let on_lines = lines.heights().as_slice().iter().zip(lines.mask().into_vec());
        let values: Vec<f64> = on_lines.filter(|(_, l)| *l).map(|(z, _)| f64::from(*z)).collect();
        Ok(diagram.interpolate(&values).map(|z| *z as f32))
    });
    let twins: Vec<Grid<f32>> = twins.collect::<Result<_>>()?;
    let mut detail = if given || !stored.exists() {
        learn(&heights, if no_twins { &[] } else { &twins }, &config)?
    } else {
        let text = std::fs::read(&stored).expect("readable");
        let (info, weights): (DetailInfo, Vec<(String, Vec<f32>)>) =
            serde_json::from_slice(&text).expect("a stored detail model");
        Detail::from_parts(info, |name| {
            Ok(weights.iter().find(|(n, _)| n == name).expect("stored").1.clone())
        })?
    };
    detail.calibrate(&twins[0], &lines[0], &heights)?;
    std::fs::write(&stored, serde_json::to_vec(&detail.parts()).expect("plain data")).expect("writable");
    let valid = heights.map(|_| true);
    println!("gain {:.2}", detail.record().gain);
    println!(
        "rebuilt {:.2} dB",
        psnr(&detail.reconstruct().map(|z| z.clamp(0.0, 1.0)), &heights, &valid, 1.0)?
    );
    judge(&style, &heights, &detail, &how, Path::new(held))
}

fn parse(settings: &[String]) -> (DetailConfig, DetailUse, bool) {
    let paper = settings.iter().any(|s| s == "paper=1");
    let base = if paper { DetailConfig::paper() } else { DetailConfig::default() };
    let mut config = toml::Table::try_from(base).expect("plain data");
    let mut how = toml::Table::try_from(DetailUse::default()).expect("plain data");
    let mut given = paper;
    for setting in settings.iter().filter(|s| *s != "paper=1") {
        let (key, value) = setting.split_once('=').expect("KEY=VALUE");
        let overlay = toml::from_str::<toml::Table>(&format!("v = {value}"))
            .unwrap_or_else(|_| toml::from_str(&format!("v = \"{value}\"")).expect("a value"));
        let value = overlay["v"].clone();
        if key == "size" || (key != "noise" && how.contains_key(key)) {
            how.insert(key.into(), value);
        } else if key == "use-noise" {
            how.insert("noise".into(), value);
        } else {
            given = true;
            config.insert(key.into(), value);
        }
    }
    (config.try_into().expect("settings"), how.try_into().expect("settings"), given)
}

fn learn(heights: &Grid<f32>, twins: &[Grid<f32>], config: &DetailConfig) -> Result<Detail> {
    let started = Instant::now();
    let mut last = started;
    let detail = train(heights, twins, config, Seed(1), |r| {
        if (r.step + 1) % (config.steps / 4).max(1) == 0 {
            println!(
                "scale {} step {:5}: critic {:8.4} penalty {:7.4} reconstruction {:.5}  {:.1} s",
                r.scale,
                r.step + 1,
                r.critic,
                r.penalty,
                r.reconstruction,
                last.elapsed().as_secs_f64()
            );
            last = Instant::now();
        }
    })?;
    println!("trained in {:.1} s, {} values", started.elapsed().as_secs_f64(), detail.value_count());
    Ok(detail)
}

fn judge(style: &Style, exemplar: &Grid<f32>, detail: &Detail, how: &DetailUse, held: &Path) -> Result<()> {
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(held).expect("a folder").map(|f| f.expect("readable").path()).collect();
    folders.retain(|f| f.is_dir());
    folders.sort();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let (mut wasserstein, mut copied, mut spread) = ([0.0; 2], 0.0, 0.0);
    let n = folders.len() as f64;
    for folder in &folders {
        let read = |name: &str| io::read(&folder.join(name), &ReadOptions::default());
        let (truth, coarse) = (read("truth.tif")?, read("gnn.tif")?);
        let normal = Normalization::of(&truth);
        let (rows, cols) = truth.shape();
        let options = geojson::ReadOptions { size: Some((rows, cols)), ..Default::default() };
        let sketch = geojson::read(&folder.join("sketch.geojson"), &options)?.sketch;
        let lines = sketch.rasterize().map_heights(|z| normal.to_unit(f64::from(z)) as f32);
        let (unit, valid) = (normal.normalize(&truth), truth.valid().clone());
        let unit_coarse = normal.normalize(&coarse);
        let detailed = detail.add(&unit_coarse, Some(&lines), None, how, Seed(1))?;
        for (map, scores) in [(&unit_coarse, &mut before), (&detailed, &mut after)] {
            let found = extract::ridges_and_valleys(map, &valid, &style.info.config.extraction)?;
            scores.push(Scores::of(map, &unit, &valid, &lines)?.with_lines(&lines, &found)?);
        }
        wasserstein[0] += sliced_wasserstein(&unit_coarse, &unit, &valid)? / n;
        wasserstein[1] += sliced_wasserstein(&detailed, &unit, &valid)? / n;
        copied += copy_audit(&detailed, exemplar)?.copied_share / n;
        let other = detail.add(&unit_coarse, Some(&lines), None, how, Seed(2))?;
        spread += diversity(&[detailed.clone(), other])? / n;
        let metres = detailed.map(|&z| normal.to_metres(f64::from(z)) as f32);
        io::write(
            &Dem::new(metres, truth.cell_size())?,
            &folder.join("detail.tif"),
            &WriteOptions::default(),
        )?;
    }
    println!("{} patches; copied share {copied:.4}, diversity {spread:.4}", folders.len());
    let [coarse, fine] = wasserstein;
    println!("{:22} {coarse:9.4} -> {fine:9.4}  ({:.2})", "sliced_wasserstein", fine / coarse);
    let (before, after) = (Summary::of(&before), Summary::of(&after));
    for coarse in &before.spreads {
        let name = &coarse.name;
        if let Some(fine) = after.get(name) {
            println!("{name:22} {:9.4} -> {:9.4}  ({:.2})", coarse.mean, fine.mean, fine.mean / coarse.mean);
        }
    }
    Ok(())
}
