//! `info`: what is in a terrain file, a sketch or a style, for people and as JSON.
//!
//! The JSON of terrain and sketches is defined here; that of a style is what the style says of itself.

use super::Context;
use super::args::{self, DemReading};
use super::sketch_input::{SketchOptions, bundled_sketch, outline, read_sketch};
use super::sketch_map::around_strokes;
use crate::dem::io::{CellSizeSource, Format};
use crate::dem::{Dem, bundled};
use crate::error::{Error, Result};
use crate::sketch::geojson::{HeightUnit, MissingHeights, ReadOptions, SketchReading};
use crate::sketch::{LineMap, Sketch, SketchGraph, StrokeKind, samples};
use serde_json::{Value, json};
use std::io::Read;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock info sierra
  monadnock info N46E007.hgt
  monadnock info sketch.geojson
  monadnock info lambda-ring
  monadnock info sierra.safetensors --json

What a file is follows from its content, whatever its name: JSON is a sketch, a safetensors header a style, the rest terrain.";

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InfoArgs {
    /// Terrain, sketch or style; or the name of terrain (sierra, grand-canyon) or of a sketch (a-circle, empty-corner,
    /// fault-line, lambda-ring, meander, p-valley, range-and-river, single-stroke, three-peaks, valley-system, volcano-ring) that comes with the program
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reading: DemReading,
    #[command(flatten)]
    sketch: SketchOptions,
}

/// Cells along the longer side of the map on which a sketch without one is looked at.
const SHOWN_SIDE: usize = 512;

/// Label and text of something that is known.
pub(super) type Fact = (String, String);

pub(super) fn run(args: &InfoArgs, context: &Context) -> Result<()> {
    let (value, rows) = match content_of(&args.file)? {
        Content::Terrain => terrain(&args.file, &args.reading)?,
        Content::Sketch => sketch(&args.file, args)?,
        Content::Style => {
            let mut value = json!({"kind": "style", "file": args.file.display().to_string()});
            merge(&mut value, context.registry.load(&args.file)?.describe()?);
            let rows = style_rows(&value);
            (value, rows)
        }
    };
    context.console.result(if args.json { format!("{value:#}\n") } else { table(&rows) });
    Ok(())
}

enum Content {
    Terrain,
    Sketch,
    Style,
}

/// What a file is, by its content; an SRTM tile, which begins with any bytes, by its name.
fn content_of(path: &Path) -> Result<Content> {
    if bundled_sketch(path).is_some() {
        return Ok(Content::Sketch);
    }
    if !path.exists() && args::bundled_name(path).is_none() {
        return Err(nothing_there(path));
    }
    if !path.is_file() || Format::of_extension(path) == Some(Format::Hgt) {
        return Ok(Content::Terrain);
    }
    const HEAD: u64 = 64;
    let file = std::fs::File::open(path).map_err(Error::io(path, "open the file"))?;
    let length = file.metadata().map_err(Error::io(path, "open the file"))?.len();
    let mut start = Vec::new();
    file.take(HEAD).read_to_end(&mut start).map_err(Error::io(path, "read the file"))?;
    // The length of the header comes first, then the header, which is JSON.
    if let Some((head, rest)) = start.split_first_chunk::<8>()
        && rest.first() == Some(&b'{')
        && u64::from_le_bytes(*head) <= length
    {
        return Ok(Content::Style);
    }
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start).trim_ascii_start();
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    Ok(match (text.first(), extension.as_deref()) {
        (Some(b'{' | b'['), _) => Content::Sketch,
        // Damaged files of a clear name: their readers say what is wrong.
        (_, Some("safetensors")) if Format::of_content(&start).is_none() => Content::Style,
        (_, Some("geojson" | "json")) if Format::of_content(&start).is_none() => Content::Sketch,
        _ => Content::Terrain,
    })
}

fn nothing_there(path: &Path) -> Error {
    let sketches: Vec<_> = samples::names().collect();
    let allowed = format!(
        "allowed: a terrain file, a sketch or a style, or the name of bundled terrain ({}) or of a bundled sketch ({})",
        args::bundled_terrain(),
        sketches.join(", ")
    );
    Error::file(path, "file", "not there", allowed)
}

fn terrain(path: &Path, reading: &DemReading) -> Result<(Value, Vec<Fact>)> {
    let (dem, description) = reading.read(path)?;
    let tile = args::bundled_name(path).and_then(|name| bundled::manifest().iter().find(|t| t.name == name));
    let (rows, cols) = dem.shape();
    let (low, high) = dem.range();
    let (x, y) = (dem.cell_size().x(), dem.cell_size().y());
    let (mean, voids) = (mean_height(&dem), dem.void_count());
    let value = json!({
        "kind": "terrain",
        "file": path.display().to_string(),
        "format": description.format,
        "sample": description.sample,
        "packing": description.packing,
        "rows": rows,
        "cols": cols,
        "cell_size": {"x": x, "y": y, "source": description.cell_size_source},
        "elevation": {"lowest": low, "highest": high, "mean": mean},
        "voids": voids,
        "coordinates": description.coordinates,
        "georeference": dem.georeference(),
        "notes": description.notes,
        "warnings": description.warnings,
        "bundled": tile,
    });
    let packing =
        if description.packing.is_empty() { String::new() } else { format!(", {}", description.packing) };
    let source = match description.cell_size_source {
        CellSizeSource::File => "",
        CellSizeSource::Caller => ", as given",
        CellSizeSource::AssumedUnit => ", if its unit is the metre: the file does not say",
        CellSizeSource::Assumed => ", assumed: the file does not say",
    };
    let (height, width) = (rows as f64 * y / 1000.0, cols as f64 * x / 1000.0);
    let share = percent(voids, rows * cols);
    let mut table = vec![
        row("terrain", path.display()),
        row("format", format!("{}, {}{packing}", description.format, description.sample)),
        row("size", format!("{rows} rows x {cols} columns")),
        row("cell size", format!("{}{source}", dem.cell_size().in_words())),
        row("extent", format!("{height:.3} km north-south, {width:.3} km west-east")),
        row("elevation", format!("{} to {}, mean {}", metres(low.into()), metres(high.into()), metres(mean))),
        row("voids", if voids == 0 { "none".to_owned() } else { format!("{} ({share})", cells(voids)) }),
        row("coordinates", &description.coordinates),
    ];
    if let Some(g) = dem.georeference() {
        let ((west, north), (east, south)) = (g.to_model(0.0, 0.0), g.to_model(cols as f64, rows as f64));
        table.push(row("corners", format!("({west}, {north}) to ({east}, {south})")));
    }
    if !dem.cell_size().is_square() {
        table.push(row(
            "note",
            "cells are not square: other commands resample the terrain (--keep-cells leaves it)",
        ));
    }
    table.extend(description.notes.iter().map(|note| row("note", note)));
    table.extend(description.warnings.iter().map(|warning| row("warning", warning)));
    if let Some(tile) = tile {
        table.push(row("place", &tile.title));
        table.push(row("source", format!("{} ({})", tile.source, tile.licence)));
        table.push(row("credit", &tile.credit));
    }
    Ok((value, table))
}

fn mean_height(dem: &Dem) -> f64 {
    let known = dem.heights().as_slice().iter().zip(dem.valid().as_slice()).filter(|(_, ok)| **ok);
    let (sum, count) = known.fold((0.0, 0_u64), |(sum, n), (&z, _)| (sum + f64::from(z), n + 1));
    sum / count as f64 // never 0: a DEM has a valid cell
}

fn sketch(path: &Path, args: &InfoArgs) -> Result<(Value, Vec<Fact>)> {
    let options = ReadOptions {
        metres_per_unit: args.reading.options().metres_per_unit,
        missing_heights: MissingHeights::Leave,
        ..args.sketch.options()
    };
    let outline = outline(path, &options)?;
    let mut reading = match around_strokes(&outline, SHOWN_SIDE) {
        // Drawn in a geographic information system, which knows no map.
        Some((size, georeference)) if outline.is_placed && !outline.has_place && !args.sketch.pixels => {
            let own = ReadOptions { size: Some(size), georeference: Some(georeference), ..options };
            let mut reading = read_sketch(path, &own)?;
            reading.warnings.push(
                "The file describes no map: figures are for one of 512 cells around its strokes. `generate` lays it on a \
                 map with --like DEM or --bounds."
                    .to_owned(),
            );
            reading
        }
        _ => read_sketch(path, &options)?,
    };
    // A place that no size follows from is no failure of looking at it.
    let ground = match reading.georeference.map(|g| g.ground((reading.sketch.rows, reading.sketch.cols))) {
        Some(Err(unplaced)) => {
            reading.warnings.push(unplaced.to_string());
            None
        }
        other => other.and_then(Result::ok),
    };
    let open: usize = reading.given.iter().flatten().filter(|given| !**given).count();
    let sketch = &reading.sketch;
    let lines = sketch.rasterize();
    let graph = SketchGraph::of(&lines);
    let (low, high) = given_range(&reading).unwrap_or_default();
    let one = |kind| {
        let figures = KindFigures::of(sketch, &lines, &graph, kind);
        json!({
            "strokes": figures.strokes,
            "vertices": figures.vertices,
            "line_cells": figures.cells,
            "length_cells": graph.length(kind),
            "streams_by_order": graph.stream_counts(kind),
            "bifurcation_ratio": graph.bifurcation_ratio(kind),
        })
    };
    let value = json!({
        "kind": "sketch",
        "file": path.display().to_string(),
        "rows": sketch.rows,
        "cols": sketch.cols,
        "size_stated": reading.stated_size.is_some(),
        "unit": reading.unit,
        "elevation": {"lowest": low, "highest": high},
        "ridges": one(StrokeKind::Ridge),
        "valleys": one(StrokeKind::Valley),
        "line_cells": lines.line_count(),
        "share_of_cells": lines.line_count() as f64 / (sketch.rows * sketch.cols) as f64,
        "georeference": reading.georeference,
        "cell_size": ground.as_ref().map(|g| json!({"x": g.cell_size.x(), "y": g.cell_size.y()})),
        "notes": ground.as_ref().map(|g| g.notes.as_slice()).unwrap_or_default(),
        "bounds": outline.bounds,
        "vertices_without_height": open,
        "warnings": reading.warnings,
    });
    let heights = match reading.unit {
        _ if given_range(&reading).is_none() => "none".to_owned(),
        HeightUnit::Metres => format!("{} to {}", metres(low), metres(high)),
        HeightUnit::Normalised => format!("{low:.3} to {high:.3} of the style's range (0 to 1)"),
    };
    let coordinates = match reading.georeference {
        None => "columns and rows".to_owned(),
        Some(g) => g.coordinates_in_words(),
    };
    let mut table = vec![
        row("sketch", path.display()),
        row("map", format!("{} rows x {} columns", sketch.rows, sketch.cols)),
        row("heights", heights),
        row("coordinates", coordinates),
    ];
    if let Some(size) = ground.as_ref().map(|ground| ground.cell_size) {
        table.push(row("cell size", size.in_words()));
    }
    if open > 0 {
        let all = reading.given.iter().flatten().count();
        table.push(row("without height", format!("{open} of {all} vertices")));
    }
    table.extend(lines_rows(sketch, &lines));
    table.extend(ground.iter().flat_map(|ground| &ground.notes).map(|note| row("note", note)));
    table.extend(reading.warnings.iter().map(|warning| row("warning", warning)));
    Ok((value, table))
}

/// Lowest and highest height that the file gives; `None` when it gives none.
fn given_range(reading: &SketchReading) -> Option<(f64, f64)> {
    let vertices = reading.sketch.strokes.iter().flat_map(|stroke| &stroke.vertices);
    let mut heights =
        vertices.zip(reading.given.iter().flatten()).filter(|(_, given)| **given).map(|(v, _)| v.z);
    let first = heights.next()?;
    Some(heights.fold((first, first), |(low, high), z| (low.min(z), high.max(z))))
}

/// What is counted of the strokes of one kind.
struct KindFigures {
    strokes: usize,
    vertices: usize,
    cells: usize,
    length: f64,
    streams: Vec<usize>,
}

impl KindFigures {
    fn of(sketch: &Sketch, lines: &LineMap, graph: &SketchGraph, kind: StrokeKind) -> Self {
        let strokes = || sketch.strokes.iter().filter(|s| s.kind == kind);
        Self {
            strokes: strokes().count(),
            vertices: strokes().map(|s| s.vertices.len()).sum(),
            cells: lines.kinds().as_slice().iter().filter(|&&k| k == Some(kind)).count(),
            length: graph.length(kind),
            streams: graph.stream_counts(kind).to_vec(),
        }
    }
}

/// The lines of a sketch in figures: what `extract` reports and `info` repeats.
pub(super) fn lines_rows(sketch: &Sketch, lines: &LineMap) -> Vec<Fact> {
    let graph = SketchGraph::of(lines);
    let one = |label: &str, kind| {
        let f = KindFigures::of(sketch, lines, &graph, kind);
        let mut text = format!("{} strokes, {} line cells, {:.0} cells long", f.strokes, f.cells, f.length);
        if !f.streams.is_empty() {
            let streams: Vec<String> = f.streams.iter().map(usize::to_string).collect();
            text += &format!("; {} streams of Strahler order 1 to {}", streams.join(", "), streams.len());
        }
        row(label, text)
    };
    let (count, all) = (lines.line_count(), sketch.rows * sketch.cols);
    vec![
        one("ridges", StrokeKind::Ridge),
        one("valleys", StrokeKind::Valley),
        row("line cells", format!("{count} of {all} ({})", percent(count, all))),
    ]
}

fn row(label: &str, text: impl std::fmt::Display) -> Fact {
    (label.to_owned(), text.to_string())
}

fn cells(count: usize) -> String {
    if count == 1 { "1 cell".to_owned() } else { format!("{count} cells") }
}

fn percent(count: usize, all: usize) -> String {
    format!("{:.2} %", 100.0 * count as f64 / all as f64)
}

/// Metres with as many digits as matter.
fn metres(value: f64) -> String {
    let text = format!("{value:.3}");
    format!("{} m", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Rows under each other, labels in one column.
pub(super) fn table(rows: &[Fact]) -> String {
    let width = rows.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0).max(12);
    rows.iter().map(|(label, text)| format!("{label:width$}  {text}\n")).collect()
}

/// Adds the fields of `more` to those of `value`.
fn merge(value: &mut Value, more: Value) {
    if let (Some(fields), Value::Object(more)) = (value.as_object_mut(), more) {
        fields.extend(more);
    }
}

/// A style for people: where it is from and how well it learned, then its configuration. The JSON has the rest, above all
/// the losses of every epoch.
fn style_rows(value: &Value) -> Vec<Fact> {
    let number = |pointer: &str| value.pointer(pointer).and_then(Value::as_f64);
    let text = |pointer: &str| value.pointer(pointer).map_or_else(|| "-".to_owned(), plain);
    let with = |pointer: &str, digits: usize, unit: &str| {
        number(pointer).map_or_else(|| "-".to_owned(), |v| format!("{v:.digits$}{unit}"))
    };
    let last = value.pointer("/training/history").and_then(Value::as_array).and_then(|epochs| epochs.last());
    let losses = last.and_then(|epoch| epoch.get("losses")).and_then(Value::as_object);
    let losses: Vec<String> = losses
        .into_iter()
        .flatten()
        .filter_map(|(name, loss)| Some(format!("{name} {:.2e}", loss.as_f64()?)))
        .collect();
    let (cell, window) = ("/exemplar/cell_size", "/exemplar");
    let [rows, cols, row_at, col_at] = ["rows", "cols", "row", "col"].map(|k| text(&format!("{window}/{k}")));
    let memory =
        number("/training/peak_memory").map_or_else(|| "-".to_owned(), |b| format!("{:.0} MB", b / 1e6));
    let mut table = vec![
        row("style", text("/file")),
        row(
            "exemplar",
            format!("{}: {rows} x {cols} cells at row {row_at}, column {col_at}", text("/exemplar/name")),
        ),
        row(
            "cell size",
            format!(
                "{} m west-east, {} m north-south",
                text(&format!("{cell}/0")),
                text(&format!("{cell}/1"))
            ),
        ),
        row("elevation", format!("{} to {} m", text("/normalization/low"), text("/normalization/high"))),
        row("parts", format!("{} of ridges, {} of valleys", text("/parts/ridge"), text("/parts/valley"))),
        row("parameters", text("/parameters")),
        row("seed", text("/seed")),
        row("epochs", text("/training/epochs")),
        row("seconds", with("/training/seconds", 1, "")),
        row("seconds per epoch", with("/training/seconds_per_epoch", 3, "")),
        row("peak memory", memory),
        row("last losses", if losses.is_empty() { "-".to_owned() } else { losses.join(", ") }),
        row("SSIM", format!("{} of the exemplar rebuilt from its own lines", with("/training/ssim", 4, ""))),
        row("PSNR", with("/training/psnr", 2, " dB")),
        row("detail", detail_row(value)),
        row("l_gt", number("/training/l_gt").map_or_else(|| "-".to_owned(), |v| format!("{v:.2e}"))),
    ];
    if let Some(config) = value.get("config") {
        table.extend(rows_of(config));
    }
    table
}

/// What the detail model of a style is.
fn detail_row(value: &Value) -> String {
    let Some(record) = value.pointer("/detail/record") else {
        return "none: trained with --no-detail, or by an older version".to_owned();
    };
    if let Some(rows) = value.pointer("/detail/rows") {
        let gain = record.get("gain").and_then(Value::as_f64).unwrap_or_default();
        let cols = value.pointer("/detail/cols").map_or_else(|| "-".to_owned(), plain);
        let what =
            record.get("atoms").map_or_else(|| "patches".to_owned(), |n| format!("{} atoms", plain(n)));
        return format!("{what} of the exemplar, {} x {cols} cells; strength {gain:.2}", plain(rows));
    }
    let number = |key: &str| record.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
    let steps: Vec<u64> = record
        .get("steps")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_u64)
        .collect();
    format!(
        "{} scales, {} steps in {:.1} s; exemplar rebuilt with PSNR {:.2} dB",
        steps.len(),
        steps.iter().sum::<u64>(),
        number("seconds"),
        number("psnr")
    )
}

/// Any JSON object as rows: what lies deeper gets a dotted label.
fn rows_of(value: &Value) -> Vec<Fact> {
    let mut rows = Vec::new();
    push_rows(&mut rows, "", value);
    rows
}

fn push_rows(rows: &mut Vec<Fact>, label: &str, value: &Value) {
    const SHOWN: usize = 8;
    match value {
        Value::Object(fields) => {
            for (key, field) in fields {
                let label = if label.is_empty() { key.clone() } else { format!("{label}.{key}") };
                push_rows(rows, &label, field);
            }
        }
        Value::Array(items) if items.len() > SHOWN => {
            // Curves of a whole training: where they begin and end.
            let [first, last] = [&items[0], &items[items.len() - 1]].map(plain);
            rows.push(row(label, format!("{} values, {first} ... {last}", items.len())));
        }
        Value::Array(items) => rows.push(row(label, items.iter().map(plain).collect::<Vec<_>>().join(", "))),
        Value::Null => rows.push(row(label, "-")),
        other => rows.push(row(label, plain(other))),
    }
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_and_long_values_become_short_rows() {
        let value =
            json!({"a": {"b": [1, 2], "c": null}, "long": (0..20).collect::<Vec<_>>(), "name": "x y"});
        let expected = [("a.b", "1, 2"), ("a.c", "-"), ("long", "20 values, 0 ... 19"), ("name", "x y")];
        assert_eq!(rows_of(&value), expected.map(|(label, text)| row(label, text)));
    }

    #[test]
    fn heights_show_no_digits_that_are_not_there() {
        assert_eq!(
            [metres(30.0), metres(-2.5), metres(0.0), metres(1234.56789)],
            ["30 m", "-2.5 m", "0 m", "1234.568 m"]
        );
    }
}
