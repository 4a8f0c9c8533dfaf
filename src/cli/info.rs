//! `monadnock info`: what is in a DEM, a sketch or a style.

use super::args::{DemInput, bundled_name};
use super::console::Context;
use crate::error::Result;
use crate::sketch::geojson;
use crate::sketch::{SketchGraph, StrokeKind, samples};
use crate::systems::region_gnn::style;
use serde_json::{Value, json};

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  monadnock info alps.tif
  monadnock info sketch.geojson
  monadnock info sierra.safetensors --json

A style's `training` holds epochs, seconds, seconds_per_epoch, ssim, psnr, l_gt on the exemplar, and peak_memory in bytes.")]
pub(super) struct InfoArgs {
    #[command(flatten)]
    file: DemInput,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub(super) fn run(args: &InfoArgs, context: &Context) -> Result<()> {
    let path = &args.file.dem;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let sample = !path.exists() && samples::names().any(|name| path.to_str() == Some(name));
    let value = match extension.as_str() {
        "safetensors" => style::describe(path)?,
        "geojson" | "json" => sketch(&geojson::read(path, &geojson::ReadOptions::default())?)?,
        _ if sample => sketch(&samples::load(path.to_str().unwrap_or_default())?)?,
        _ => dem(&args.file)?,
    };
    if args.json {
        context.console.output(format!("{value:#}"));
    } else {
        let mut text = String::new();
        readable(&value, 0, &mut text);
        context.console.output(text.trim_end());
    }
    Ok(())
}

fn dem(input: &DemInput) -> Result<Value> {
    let (dem, description) = input.describe()?;
    let (rows, cols) = dem.shape();
    let (low, high) = dem.range();
    let voids = dem.void_count();
    Ok(json!({
        "kind": "dem",
        "file": bundled_name(&input.dem).map_or_else(|| input.dem.display().to_string(), |n| format!("bundled tile {n}")),
        "rows": rows,
        "cols": cols,
        "elevation_m": [low, high],
        "cell_size_m": [dem.cell_size().x(), dem.cell_size().y()],
        "voids": voids,
        "void_share": voids as f64 / (rows * cols) as f64,
        "georeference": dem.georeference(),
        "storage": description,
    }))
}

fn sketch(reading: &geojson::SketchReading) -> Result<Value> {
    let sketch = &reading.sketch;
    let lines = sketch.rasterize();
    let graph = SketchGraph::of(&lines);
    let mut kinds = serde_json::Map::new();
    for (name, kind) in [("ridges", StrokeKind::Ridge), ("valleys", StrokeKind::Valley)] {
        let strokes: Vec<_> = sketch.strokes.iter().filter(|s| s.kind == kind).collect();
        let length: f64 = strokes
            .iter()
            .flat_map(|s| s.vertices.windows(2))
            .map(|w| (w[1].x - w[0].x).hypot(w[1].y - w[0].y))
            .sum();
        let cells = lines.kinds().as_slice().iter().filter(|k| **k == Some(kind)).count();
        kinds.insert(
            name.to_owned(),
            json!({
                "strokes": strokes.len(),
                "lines_of_strahler_order": graph.stream_counts(kind),
                "bifurcation_ratio": graph.bifurcation_ratio(kind),
                "vertices": strokes.iter().map(|s| s.vertices.len()).sum::<usize>(),
                "length_cells": length,
                "line_cells": cells,
            }),
        );
    }
    Ok(json!({
        "kind": "sketch",
        "rows": sketch.rows,
        "cols": sketch.cols,
        "unit": reading.unit,
        "heights": sketch.height_range(),
        "ridges": kinds["ridges"],
        "valleys": kinds["valleys"],
        "georeference": reading.georeference,
        "warnings": reading.warnings,
    }))
}

/// Longest list that is printed in full.
const LONGEST_LIST: usize = 8;

/// Indented `key: value` lines; long lists are only counted.
fn readable(value: &Value, depth: usize, out: &mut String) {
    let Value::Object(map) = value else { return };
    for (key, value) in map {
        let indent = "  ".repeat(depth);
        match value {
            Value::Object(_) => {
                *out += &format!("{indent}{key}:\n");
                readable(value, depth + 1, out);
            }
            Value::Array(list) if list.len() > LONGEST_LIST || list.iter().any(Value::is_object) => {
                *out += &format!("{indent}{key}: {} entries\n", list.len());
            }
            Value::Array(list) => {
                let items: Vec<String> = list.iter().map(plain).collect();
                *out += &format!("{indent}{key}: {}\n", items.join(", "));
            }
            Value::Null => *out += &format!("{indent}{key}: none\n"),
            other => *out += &format!("{indent}{key}: {}\n", plain(other)),
        }
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
