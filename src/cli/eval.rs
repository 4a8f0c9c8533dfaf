//! `monadnock eval`: every system rebuilds every patch of a DEM from its own lines.

use super::Context;
use super::args::DemInput;
use super::outputs::{OutputKind, Outputs};
use crate::dem::Dem;
use crate::dem::io::{self, WriteOptions};
use crate::error::{Error, Result};
use crate::evaluate::{
    Evaluation, EvaluationConfig, PATCH, Rebuilt, SystemSummary, aggregate, evaluate, patch_cells, to_csv,
};
use crate::file;
use crate::grid::{Cell, Grid, Mask, Window};
use crate::metrics::{aspect_distance, copy_audit, geomorphon_distance, sliced_wasserstein};
use crate::sketch::Sketch;
use crate::sketch::geojson::{self, HeightUnit};
use crate::style::{Registry, Style, fingerprint};
use crate::viz::report::{Column, Entry, Table};
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// Arguments of `eval`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock eval alps.safetensors alps.tif
  monadnock eval alps.safetensors alps.tif --systems gnn,laplace,natural-neighbour --csv scores.csv
  monadnock eval alps.safetensors alps.tif --patches '0,0;128,256' --save rebuilt
  monadnock eval alps.safetensors alps.tif --sketch-order 3

Each 128x128 patch is put into 0 to 1 by its own range, its ridges and valleys are extracted from it alone, every system
rebuilds it from them with their heights, and the result is scored against the truth (Liu & Benes 2025, 7.2). Patches that
overlap the exemplar are left out and said so. A style with detail is scored without and with it (gnn, gnn+detail).

Below the scores stands what needs no cell-by-cell truth: the sliced Wasserstein distance of 7x7 patches to those of the true
terrain, the distances of slope directions and of landforms (geomorphons), and, where the DEM is the one that the style was
learned from, the share of small patches that are copies of the exemplar's. Systems that lay pieces of the exemplar (synthesis) say
themselves what they copied: the share of the cells in pieces of more than 20x20 cells, and how often the place that is used most is
used (\"repeats\").")]
pub(super) struct EvalArgs {
    /// The style, as written by `train`
    style: PathBuf,
    #[command(flatten)]
    dem: DemInput,
    /// `all` whole patches, or north-west cells as ROW,COL;ROW,COL
    #[arg(long, default_value = "all")]
    patches: String,
    /// `all`, or names separated by commas
    #[arg(long, default_value = "all")]
    systems: String,
    /// Lowest Strahler order of the lines that the systems are given
    #[arg(long, value_name = "N")]
    sketch_order: Option<u8>,
    /// Fewest cells that a line given to the systems drains
    #[arg(long, value_name = "N")]
    sketch_accumulation: Option<u32>,
    /// Write a row per patch and system as CSV
    #[arg(long, value_name = "F")]
    csv: Option<PathBuf>,
    /// Write rows and means as JSON
    #[arg(long, value_name = "F")]
    json: Option<PathBuf>,
    /// Write each patch's truth, sketch and every system's terrain into a folder
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the style, the DEM, a patch or an output path.
pub(super) fn run(args: &EvalArgs, context: &Context) -> Result<()> {
    Outputs::new()
        .writes("--csv", &args.csv, OutputKind::Csv)
        .writes("--json", &args.json, OutputKind::Json)
        .writes("--save", &args.save, OutputKind::Folder)
        .reads(&args.style)
        .reads(&args.dem.dem)
        .check()?;
    let style = context.registry.load(&args.style)?;
    let dem = args.dem.load(&context.console)?;
    let systems = context.registry.select(&style, &args.systems)?;
    let origins = patches(&args.patches, &dem)?;
    let (origins, overlapping) = without_exemplar(&style, &dem, origins);
    if overlapping > 0 {
        let text = if overlapping == 1 {
            "patch overlaps the exemplar and is"
        } else {
            "patches overlap the exemplar and are"
        };
        context.console.line(format!("{overlapping} {text} left out"));
    }
    if origins.is_empty() {
        let (rows, cols) = dem.shape();
        let allowed = format!(
            "at least one whole {PATCH}x{PATCH} patch beside the exemplar is needed ({rows}x{cols} cells)"
        );
        return Err(Error::value("patches", &args.patches, allowed));
    }
    let config = EvaluationConfig {
        extraction: style.origin.extraction.clone(),
        sketch_order: args.sketch_order,
        sketch_accumulation: args.sketch_accumulation,
        keep: true,
    };
    let progress = context.console.progress(origins.len() as u64, "patches");
    let stop = context.stop();
    let evaluation =
        evaluate(&dem, &origins, &systems, &config, context.seed, &stop, || progress.advance(1))?;
    drop(progress);
    let likenesses = likenesses(&evaluation, &style, &context.registry, &dem)?;
    if let Some(path) = &args.csv {
        file::write_bytes(path, to_csv(&evaluation.rows)?.as_bytes())?;
    }
    if let Some(path) = &args.json {
        let mut json = as_json(&evaluation);
        json["kinds"] = serde_json::json!(likenesses);
        file::write_bytes(path, format!("{json:#}\n").as_bytes())?;
    }
    if let Some(folder) = &args.save {
        for patch in &evaluation.patches {
            save(patch, folder, &dem)?;
        }
    }
    context.console.line(table(&aggregate(&evaluation.rows)));
    context.console.line(likeness_table(&likenesses));
    for row in evaluation.rows.iter().filter(|row| row.error.is_some()) {
        let error = row.error.as_deref().unwrap_or_default();
        context.console.warning(format!("patch {},{}, {}: {error}", row.row, row.col, row.system));
    }
    Ok(())
}

fn patches(text: &str, dem: &Dem) -> Result<Vec<Cell>> {
    if text == "all" {
        return Ok(patch_cells(dem));
    }
    text.split(';')
        .map(|pair| {
            let numbers: Option<Vec<usize>> = pair.split(',').map(|s| s.trim().parse().ok()).collect();
            match numbers.as_deref() {
                Some(&[row, col]) => Ok(Cell::new(row, col)),
                _ => Err(Error::value("--patches", pair, "allowed: all, or ROW,COL;ROW,COL")),
            }
        })
        .collect()
}

/// Leaves out patches that share cells with the exemplar, when this is the DEM that it was cut from.
fn without_exemplar(style: &Style, dem: &Dem, origins: Vec<Cell>) -> (Vec<Cell>, usize) {
    let e = &style.origin.exemplar;
    if fingerprint(dem) != e.source_sha256 {
        return (origins, 0);
    }
    let meets = |start: usize, other: usize, len: usize| start < other + len && other < start + PATCH;
    let overlaps = |c: &Cell| meets(c.row, e.row, e.rows) && meets(c.col, e.col, e.cols);
    let count = origins.len();
    let kept: Vec<Cell> = origins.into_iter().filter(|c| !overlaps(c)).collect();
    let left_out = count - kept.len();
    (kept, left_out)
}

/// Rows and means.
fn as_json(evaluation: &Evaluation) -> serde_json::Value {
    let means: Vec<serde_json::Value> = aggregate(&evaluation.rows)
        .iter()
        .map(|line| {
            serde_json::json!({
                "system": line.system,
                "patches": line.patches,
                "failed": line.failed,
                "seconds": line.seconds,
                "scores": line.summary.spreads,
            })
        })
        .collect();
    serde_json::json!({ "systems": means, "rows": evaluation.rows })
}

/// Whether a system's terrain is of the true kind: means over the patches where a value exists, none where it nowhere does.
#[derive(Debug, serde::Serialize)]
struct Likeness {
    system: String,
    sliced_wasserstein: Option<f64>,
    aspect_distance: Option<f64>,
    geomorphon_distance: Option<f64>,
    /// Of trained systems, on the DEM of the exemplar.
    copied_share: Option<f64>,
    /// Of systems that say where their terrain comes from: share of the cells in pieces of the exemplar over 20x20 cells, and how often the
    /// place that is used most is used.
    verbatim_share: Option<f64>,
    most_uses: Option<f64>,
}

/// The likeness of all systems that rebuilt a patch. What a patch has no answer to (level ground faces nowhere) is left out
/// there: the scores of an evaluation are not lost for it.
fn likenesses(
    evaluation: &Evaluation,
    style: &Style,
    registry: &Registry,
    dem: &Dem,
) -> Result<Vec<Likeness>> {
    let e = &style.origin.exemplar;
    let exemplar = if fingerprint(dem) == e.source_sha256 {
        Some(dem.crop(Window::new(Cell::new(e.row, e.col), e.rows, e.cols))?)
            .filter(|window| window.void_count() == 0)
    } else {
        None
    };
    let names = evaluation.patches.first().map(|patch| &patch.outputs).into_iter().flatten();
    let likeness = |(i, (name, _)): (usize, &(String, Option<Grid<f32>>))| {
        let audited = exemplar.as_ref().filter(|_| registry.has_learned(name));
        let of_patch = |patch: &Rebuilt| -> Option<[Option<f64>; 4]> {
            let output = patch.outputs[i].1.as_ref()?;
            let (truth, valid) = (&patch.truth, &patch.valid);
            let copied = audited.and_then(|exemplar| {
                let metres = patch.normalization.denormalize(output);
                copy_audit(&metres, exemplar.heights()).ok().map(|audit| audit.copied_share)
            });
            Some([
                sliced_wasserstein(output, truth, valid).ok(),
                aspect_distance(output, truth, valid).ok(),
                geomorphon_distance(output, truth, valid).ok(),
                copied,
            ])
        };
        let found: Vec<_> = evaluation.patches.par_iter().filter_map(of_patch).collect();
        let [sliced_wasserstein, aspect_distance, geomorphon_distance, copied_share] = means(&found);
        let audits = evaluation.rows.iter().filter(|row| row.system == *name).filter_map(|row| row.sources);
        let audits: Vec<_> =
            audits.map(|audit| [Some(audit.verbatim_share), Some(audit.most_uses as f64)]).collect();
        let [verbatim_share, most_uses] = means(&audits);
        Likeness {
            system: name.clone(),
            sliced_wasserstein,
            aspect_distance,
            geomorphon_distance,
            copied_share,
            verbatim_share,
            most_uses,
        }
    };
    Ok(names.enumerate().map(likeness).collect())
}

/// The mean of every column over the rows that have a value in it.
fn means<const N: usize>(rows: &[[Option<f64>; N]]) -> [Option<f64>; N] {
    std::array::from_fn(|column| {
        let values: Vec<f64> = rows.iter().filter_map(|row| row[column]).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    })
}

/// One line per system.
fn likeness_table(rows: &[Likeness]) -> String {
    let columns = [
        Column::text("system"),
        Column::number("patch dist", 4),
        Column::number("aspect dist", 4),
        Column::number("landforms", 4),
        Column::number("copied", 1).unit("%"),
        Column::number("in pieces", 1).unit("%"),
        Column::number("repeats", 0),
    ];
    let table = rows.iter().fold(Table::new(columns), |table, row| {
        let distances = [row.sliced_wasserstein, row.aspect_distance, row.geomorphon_distance];
        let percent = |share: Option<f64>| share.map(|share| 100.0 * share);
        let copies = [percent(row.copied_share), percent(row.verbatim_share), row.most_uses];
        let numbers = distances.into_iter().chain(copies).map(Entry::from);
        table.row(std::iter::once(Entry::from(row.system.as_str())).chain(numbers))
    });
    table.text()
}

/// Mean ± standard deviation of the main scores, one line per system.
pub(super) fn table(systems: &[SystemSummary]) -> String {
    const COLUMNS: [(&str, &str, usize); 8] = [
        ("ssim", "SSIM", 4),
        ("psnr", "PSNR dB", 2),
        ("mean_slope_ratio", "slope", 3),
        ("slope_distance", "slope dist", 4),
        ("spectrum_distance", "spectrum", 2),
        ("stroke_height_error", "stroke err", 4),
        ("ridge_f1", "ridge F1", 3),
        ("valley_f1", "valley F1", 3),
    ];
    let with_failures = systems.iter().any(|s| s.failed > 0);
    let mut columns = vec![Column::text("system"), Column::number("n", 0)];
    columns.extend(COLUMNS.map(|(_, title, decimals)| Column::number(title, decimals)));
    columns.push(Column::number("s/patch", 2));
    columns.extend(with_failures.then(|| Column::number("failed", 0)));
    let table = systems.iter().fold(Table::new(columns), |table, s| {
        let mut row = vec![Entry::from(s.system.as_str()), Entry::from(s.patches)];
        row.extend(COLUMNS.map(|(name, ..)| Entry::from(s.summary.get(name).map(|s| (s.mean, s.sd)))));
        row.push(Entry::from(s.seconds));
        row.extend(with_failures.then(|| Entry::from(s.failed)));
        table.row(row)
    });
    table.text()
}

/// `DIR/ROW_COL/`: truth.tif, sketch.geojson and SYSTEM.tif in metres, where the patch lies in `dem`.
fn save(patch: &Rebuilt, folder: &Path, dem: &Dem) -> Result<()> {
    let place = dem.georeference().map(|g| g.shifted(patch.origin.row, patch.origin.col));
    let folder = folder.join(format!("{}_{}", patch.origin.row, patch.origin.col));
    fs::create_dir_all(&folder).map_err(Error::io(&folder, "create the folder"))?;
    let metres = |unit: &Grid<f32>, valid: Mask| -> Result<Dem> {
        let heights = patch.normalization.denormalize(unit);
        Ok(Dem::with_voids(heights, valid, dem.cell_size())?.at(place))
    };
    let options = WriteOptions::default();
    io::write(&metres(&patch.truth, patch.valid.clone())?, &folder.join("truth.tif"), &options)?;
    let lines = patch.lines.to_metres(patch.normalization);
    geojson::write(
        &folder.join("sketch.geojson"),
        &Sketch::trace(&lines),
        HeightUnit::Metres,
        place.as_ref(),
    )?;
    for (name, output) in &patch.outputs {
        if let Some(output) = output {
            let everywhere = output.map(|_| true);
            io::write(&metres(output, everywhere)?, &folder.join(format!("{name}.tif")), &options)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_leave_out_what_is_missing() {
        let rows = [[Some(1.0), None, None], [Some(4.0), Some(2.0), None]];
        assert_eq!(means(&rows), [Some(2.5), Some(2.0), None]);
    }

    #[test]
    fn a_value_that_does_not_exist_is_a_dash() {
        let row = Likeness {
            system: "laplace".to_owned(),
            sliced_wasserstein: Some(0.25),
            aspect_distance: None,
            geomorphon_distance: None,
            copied_share: None,
            verbatim_share: Some(0.125),
            most_uses: Some(3.0),
        };
        let text = likeness_table(&[row]);
        let cells: Vec<&str> = text.lines().last().unwrap().split_whitespace().collect();
        assert_eq!(cells, ["laplace", "0.2500", "-", "-", "-", "12.5", "3"]);
    }
}
