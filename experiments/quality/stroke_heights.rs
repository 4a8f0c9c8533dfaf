//! How near the heights that strokes are given come to true ones: `cargo bench --bench stroke_heights -- FOLDER`.
//!
//! Every folder in FOLDER is a case: `exemplar.tif`, `strokes.geojson` (with heights, of terrain that the exemplar does not show)
//! and `truth.npy` (that terrain). Heights are taken from the strokes and filled again; beside them stands the naive filling: the
//! mean height of the exemplar's ridges and valleys, or of the given heights of the kind. Errors are means over the vertices,
//! in percent of the truth's relief; "shape" leaves out the mean of all.

#![allow(clippy::print_stdout, reason = "a report")]

use monadnock::dem::io::{ReadOptions, read};
use monadnock::error::{Error, Result};
use monadnock::interpolation::height_model::{Density, HeightModel};
use monadnock::seed::Seed;
use monadnock::sketch::geojson::{self, SketchReading};
use monadnock::sketch::{Sketch, StrokeKind};
use rand::RngExt;

/// Shares of the vertices that keep their heights; none, one in all, and more.
const KEPT: [f64; 4] = [0.0, 1e-9, 0.1, 0.3];

fn main() -> Result<()> {
    let folder = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let Some(folder) = folder else {
        println!("no folder of cases given: nothing measured");
        return Ok(());
    };
    println!(
        "{:20} {:>6}  {:>8} {:>8}  {:>8} {:>8}",
        "case", "kept", "error %", "naive %", "shape %", "naive %"
    );
    let mut sums = [[0.0; 4]; KEPT.len()];
    let mut cases = 0.0;
    let entries = std::fs::read_dir(&folder).expect("the folder can be read");
    let mut folders: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    folders.sort();
    for case in folders.iter().filter(|path| path.join("truth.npy").is_file()) {
        let exemplar = read(&case.join("exemplar.tif"), &ReadOptions::default())?;
        let (low, high) = read(&case.join("truth.npy"), &ReadOptions::default())?.range();
        let drawn = geojson::read(&case.join("strokes.geojson"), &geojson::ReadOptions::default())?;
        let model = HeightModel::fit(&exemplar).map_err(|e| e.in_file(case))?;
        cases += 1.0;
        for (share, sums) in KEPT.iter().zip(&mut sums) {
            let errors = errors(&model, &drawn, *share, f64::from(high - low))?;
            sums.iter_mut().zip(errors).for_each(|(sum, e)| *sum += e);
            row(&case.file_name().unwrap_or_default().to_string_lossy(), *share, errors);
        }
    }
    for (share, sums) in KEPT.iter().zip(sums) {
        row("mean", *share, sums.map(|sum| sum / f64::max(cases, 1.0)));
    }
    Ok(())
}

fn row(name: &str, share: f64, [error, naive, shape, naive_shape]: [f64; 4]) {
    let kept = if share > 0.0 && share < 1e-3 { "one".to_owned() } else { format!("{:.0} %", 100.0 * share) };
    println!("{name:20} {kept:>6}  {error:8.2} {naive:8.2}  {shape:8.2} {naive_shape:8.2}");
}

/// Error and shape error of the filling and of the naive one, percent of `relief`.
fn errors(model: &HeightModel, drawn: &SketchReading, share: f64, relief: f64) -> Result<[f64; 4]> {
    let mut stream = Seed(1).stream("kept heights");
    let count: usize = drawn.given.iter().map(Vec::len).sum();
    let kept = (share * count as f64).ceil() as usize;
    let mut given: Vec<Vec<bool>> = drawn.given.iter().map(|g| vec![false; g.len()]).collect();
    for _ in 0..kept {
        let stroke = stream.random_range(0..given.len());
        let vertex = stream.random_range(0..given[stroke].len());
        given[stroke][vertex] = true;
    }
    let filled = model.fill(&drawn.sketch, &given)?;
    let naive = naive(model, &drawn.sketch, &given)?;
    let (ours, naive) =
        (differences(&drawn.sketch, &filled.sketch, relief)?, differences(&drawn.sketch, &naive, relief)?);
    let mean = |d: &[f64]| d.iter().map(|d| d.abs()).sum::<f64>() / d.len() as f64;
    let shape = |d: &[f64]| {
        let level = d.iter().sum::<f64>() / d.len() as f64;
        mean(&d.iter().map(|d| d - level).collect::<Vec<_>>())
    };
    Ok([mean(&ours), mean(&naive), shape(&ours), shape(&naive)])
}

/// One height for all ridges and one for all valleys.
fn naive(model: &HeightModel, sketch: &Sketch, given: &[Vec<bool>]) -> Result<Sketch> {
    let middle: &Density = &model.densities[model.densities.len() / 2];
    let level = |kind: StrokeKind| {
        let known = sketch.strokes.iter().zip(given).filter(|(s, _)| s.kind == kind);
        let known: Vec<f64> = known
            .flat_map(|(s, g)| s.vertices.iter().zip(g).filter(|(_, given)| **given).map(|(v, _)| v.z))
            .collect();
        match (known.len(), kind) {
            (0, StrokeKind::Ridge) => middle.ridges[0],
            (0, StrokeKind::Valley) => middle.valleys[0],
            (n, _) => known.iter().sum::<f64>() / n as f64,
        }
    };
    let mut flat = sketch.clone();
    for (stroke, given) in flat.strokes.iter_mut().zip(given) {
        let z = level(stroke.kind);
        stroke.vertices.iter_mut().zip(given).filter(|(_, given)| !**given).for_each(|(v, _)| v.z = z);
    }
    Ok(flat)
}

/// Heights of `other` minus those of `truth` at the vertices of `truth`, percent of `relief`.
fn differences(truth: &Sketch, other: &Sketch, relief: f64) -> Result<Vec<f64>> {
    let mut found = Vec::new();
    for (a, b) in truth.strokes.iter().zip(&other.strokes) {
        let mut rest = b.vertices.iter();
        for v in &a.vertices {
            let same = rest.find(|w| (w.x, w.y) == (v.x, v.y));
            let same = same.ok_or_else(|| {
                Error::value("vertex", format!("({}, {})", v.x, v.y), "it is filled, not moved")
            })?;
            found.push(100.0 * (same.z - v.z) / relief);
        }
    }
    Ok(found)
}
