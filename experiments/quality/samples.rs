//! What terrain from noise alone has in common with the exemplar: the statistics of a detail model by itself.
//!
//!     monadnock train grand-canyon -o ours.safetensors --detail-model generators
//!     monadnock train grand-canyon -o published.safetensors --detail-preset paper
//!     cargo bench --bench samples -- 20 1,.3 grand-canyon ours.safetensors published.safetensors
//!
//! Draws so many terrains of the exemplar's size from every style in every variety (`SampleUse`), seeds 1, 2, ..., and prints one
//! line a style and variety: means of the sliced Wasserstein distance of 7x7 patches, of the distances of spectra (dB), slopes and
//! curvatures, of the ratio of mean slopes (each to the exemplar) with their standard errors, the terrains' diversity and the
//! share of them that is copied. All styles must have learned a window of the terrain.
#![allow(clippy::print_stdout, reason = "an experiment prints")]

use monadnock::Result;
use monadnock::control::Stop;
use monadnock::dem::io::{self, ReadOptions};
use monadnock::dem::{Dem, Normalization, bundled};
use monadnock::grid::{Cell, Grid, Mask, Window};
use monadnock::metrics::{
    copy_audit, curvature_distance, diversity, mean_slope_ratio, sliced_wasserstein, slope_distance,
    spectrum_distance,
};
use monadnock::seed::Seed;
use monadnock::style::Style;
use monadnock::systems::task::SampleUse;
use std::path::Path;

const NAMES: [&str; 5] = ["wasserstein", "spectrum dB", "slope", "curvature", "slope ratio"];

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [count, varieties, terrain, styles @ ..] = &args[..] else {
        println!("usage: samples COUNT VARIETY,... DEM STYLE...");
        return Ok(());
    };
    let count: u64 = count.parse().expect("a number of terrains");
    let varieties: Vec<f32> =
        varieties.split(',').map(|v| v.parse().expect("a variety from 0 to 1")).collect();
    let dem = if bundled::names().any(|name| name == terrain) {
        bundled::load(terrain)?
    } else {
        io::read(Path::new(terrain), &ReadOptions::default())?
    };
    print!("{:30} {:>7}", "style", "variety");
    NAMES.iter().for_each(|name| print!(" {name:>18}"));
    println!(" {:>10} {:>8}", "diversity", "copied");
    styles.iter().try_for_each(|path| lines(path, &varieties, &dem, count))
}

fn lines(path: &str, varieties: &[f32], dem: &Dem, count: u64) -> Result<()> {
    let style = Style::load(Path::new(path))?;
    let e = &style.origin.exemplar;
    let window = dem.crop(Window::new(Cell::new(e.row, e.col), e.rows, e.cols))?;
    let (exemplar, valid) = (Normalization::of(&window).normalize(&window), window.valid());
    let detail = style.needed_detail()?;
    let name = Path::new(path).file_stem().map_or(path.into(), |s| s.to_string_lossy());
    for &variety in varieties {
        let what = SampleUse { rows: e.rows, cols: e.cols, variety };
        let drawn = (1..=count).map(|seed| detail.sample(&what, Seed(seed), &Stop::new()));
        print!("{name:30} {variety:>7}");
        print_scores(&drawn.collect::<Result<Vec<_>>>()?, &exemplar, valid)?;
    }
    Ok(())
}

fn print_scores(terrains: &[Grid<f32>], exemplar: &Grid<f32>, valid: &Mask) -> Result<()> {
    let mut scores = vec![Vec::new(); NAMES.len()];
    let mut copied = 0.0;
    for terrain in terrains {
        let found = [
            sliced_wasserstein(terrain, exemplar, valid)?,
            spectrum_distance(terrain, exemplar, valid)?,
            slope_distance(terrain, exemplar, valid)?,
            curvature_distance(terrain, exemplar, valid)?,
            mean_slope_ratio(terrain, exemplar, valid)?,
        ];
        scores.iter_mut().zip(found).for_each(|(all, one)| all.push(one));
        copied += copy_audit(terrain, exemplar)?.copied_share / terrains.len() as f64;
    }
    for values in &scores {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        print!(" {:>18}", format!("{mean:.4} +- {:.4}", (variance / n).sqrt()));
    }
    println!(" {:>10.4} {copied:>8.4}", diversity(terrains)?);
    Ok(())
}
