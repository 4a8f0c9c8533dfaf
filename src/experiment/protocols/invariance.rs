//! The same lines turned, mirrored and shifted: how much of the terrain depends on where north is (Liu & Benes 2025, Fig. 15).
//!
//! A system makes terrain from the lines and from the moved lines; the second is moved back and compared. With a sketch that
//! moves nothing the two differ in their seed alone.

use super::general;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::evaluate::{PATCH, patch_seed};
use crate::experiment::measure::{Measured, Systems, Task, patch_of, without_truth};
use crate::experiment::pictures::{Gallery, paper, plain};
use crate::experiment::protocol::{Finding, Protocol, SketchSource};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::SketchSpec;
use crate::grid::{Cell, Grid, Window};
use crate::seed::Seed;
use crate::sketch::{LineMap, Motion, split_parts};
use crate::style::Named;
use crate::viz::{Painter, Sheet};

/// Unit heights: the terrain of the moved lines, moved back, against that of the lines.
const COLUMNS: [&str; 2] = ["max_difference", "rms_difference"];

pub(super) struct Invariance;

impl Protocol for Invariance {
    fn columns(&self) -> Vec<&'static str> {
        COLUMNS.to_vec()
    }

    fn sketch_source(&self) -> SketchSource {
        SketchSource::MovedPatches
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        without_truth(task, |named, patch, seed| {
            let [max, rms] = differences(named, task.systems, &patch.lines, task.sketch, seed)?;
            Ok(COLUMNS.into_iter().zip([Some(max), Some(rms)]).collect())
        })
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::means(results, false))
    }

    fn about_pictures(&self) -> &'static str {
        "The first patch of each area: lines as moved, and their terrain as it came. The first seed."
    }

    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        let (spec, highlight, sketches) = (&gallery.resolved.spec, &gallery.highlight, &gallery.sketches);
        for area in &gallery.resolved.areas {
            let systems = gallery.systems(area)?;
            let (Some(&cell), Some(named)) = (area.patches.first(), systems.called(highlight)) else {
                continue;
            };
            let Ok(patch) = patch_of(spec, area, cell, &sketches[0]) else { continue };
            let painter = Painter::of(&area.dem.crop(Window::square(cell, PATCH))?);
            let (Cell { row, col }, seed) = (cell, gallery.seed);
            let title = format!("Moved lines: {highlight}, {} {row},{col}, seed {seed}", area.name);
            let mut made = Vec::new();
            let mut sheet = Sheet::new(1 + sketches.len()).title(title).panel(paper(&patch.lines)?, "lines");
            for sketch in sketches {
                let seed = patch_seed(Seed(seed), cell);
                let (before, after, way) = pair(named, &systems, &patch.lines, sketch, seed)?;
                if made.is_empty() {
                    made.push((before, "terrain"));
                }
                made.push((after, ""));
                sheet = sheet.panel(paper(&way.lines(&patch.lines))?, sketch.name.as_str());
            }
            for (output, caption) in &made {
                sheet = sheet.panel(painter.draw_whole(output)?, *caption);
            }
            gallery.keep(&format!("{}-moved", plain(&area.name)), &painter.finish(sheet)?)?;
        }
        Ok(())
    }
}

/// Terrain of the lines and of the moved lines, the latter as it came.
fn pair(
    (name, system): &Named,
    systems: &Systems<'_>,
    lines: &LineMap,
    sketch: &SketchSpec,
    seed: Seed,
) -> Result<(Grid<f32>, Grid<f32>, Motion)> {
    let shift = sketch.shift.unwrap_or_default();
    let way = Motion::new(sketch.turn.unwrap_or(0.0), sketch.mirror, shift, lines.shape())?;
    let is_at_rest = sketch.turn.is_none() && !sketch.mirror && sketch.shift.is_none();
    let moved = way.lines(lines);
    let style = if sketch.same_parts { systems.style_of(name).ok() } else { None };
    let (before, after) = match style {
        Some(style) => {
            let model = style.network()?.model();
            let parts = split_parts(lines, model.config().parts, seed);
            let turned = way.parts(&parts, lines.shape());
            let make = |lines: &LineMap, parts| {
                model.generate_from_parts(lines, parts, &style.config().generation, seed)
            };
            (make(lines, parts)?, make(&moved, turned)?)
        }
        None => {
            let other = if is_at_rest { seed.derive("another seed") } else { seed };
            (system.generate(lines, seed, &Stop::new())?, system.generate(&moved, other, &Stop::new())?)
        }
    };
    Ok((before, after, way))
}

/// Largest and root mean square difference, unit heights.
fn differences(
    named: &Named,
    systems: &Systems<'_>,
    lines: &LineMap,
    sketch: &SketchSpec,
    seed: Seed,
) -> Result<[f64; 2]> {
    let (before, after, way) = pair(named, systems, lines, sketch, seed)?;
    let (mut max, mut sum, mut count) = (0.0f64, 0.0, 0usize);
    for (cell, &z) in before.cells() {
        if let Some(back) = way.back(&after, cell) {
            let difference = (back - f64::from(z)).abs();
            max = max.max(difference);
            sum += difference * difference;
            count += 1;
        }
    }
    if count == 0 {
        return Err(Error::value("cells to compare", 0, "a smaller shift is needed"));
    }
    Ok([max, (sum / count as f64).sqrt()])
}
