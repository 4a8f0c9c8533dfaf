//! As `neighbours`, with each area's style on the patches of all areas (Liu & Benes 2025, Fig. 6).

use super::general;
use crate::control::Stop;
use crate::dem::Normalization;
use crate::error::Result;
use crate::evaluate::{PATCH, patch_seed};
use crate::experiment::areas::{Area, Resolved};
use crate::experiment::measure::{Measured, STYLE_COLUMNS, Task, beside_style, patch_of, rebuild};
use crate::experiment::pictures::{Gallery, blank, paper};
use crate::experiment::protocol::{Finding, Protocol, SketchSource};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::{ExperimentSpec, SketchSpec};
use crate::grid::{Cell, Window};
use crate::metrics::Scores;
use crate::seed::Seed;
use crate::viz::{Painter, Sheet};

pub(super) struct Exchange;

impl Protocol for Exchange {
    fn columns(&self) -> Vec<&'static str> {
        Scores::names().into_iter().chain(STYLE_COLUMNS).collect()
    }

    fn sketch_source(&self) -> SketchSource {
        SketchSource::Areas
    }

    /// One for each area, called as it is.
    fn sketches(&self, spec: &ExperimentSpec) -> Vec<SketchSpec> {
        let of = |name: &String| SketchSpec { name: name.clone(), ..SketchSpec::default() };
        spec.area.iter().map(|area| of(&area.name)).collect()
    }

    fn cells(&self, resolved: &Resolved, area: &Area, sketch: &SketchSpec) -> Vec<Cell> {
        home(resolved, area, sketch).patches.clone()
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        let home = home(task.resolved, task.area, task.sketch);
        let (mut rows, patches) = rebuild(task, &home.dem, true)?;
        let Some(patch) = patches.first() else { return Ok(rows) };
        for row in &mut rows {
            if let Some((_, Some(output))) = patch.outputs.iter().find(|(name, _)| *name == row.system) {
                row.values.extend(beside_style(task.area, output, &patch.valid));
            }
        }
        Ok(rows)
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::means(results, true))
    }

    fn about_pictures(&self) -> &'static str {
        "The first seed."
    }

    /// A column for each area's sketch, a row for each area's style.
    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        let (resolved, seed, highlight) = (gallery.resolved, gallery.seed, &gallery.highlight);
        let mut patches = Vec::new();
        for (area, sketch) in resolved.areas.iter().zip(&gallery.sketches) {
            let Some(&cell) = area.patches.first() else { continue };
            let Ok(patch) = patch_of(&resolved.spec, area, cell, sketch) else { continue };
            patches.push((area, cell, Painter::of(&area.dem.crop(Window::square(cell, PATCH))?), patch));
        }
        let title = format!("Styles on each other's sketches: {highlight}, seed {seed}");
        let subtitle = "Columns: the first test patch of each area, in its own colours. Rows: truth, its lines, then the style \
                        of each area; the first column is what the style learned.";
        let heads = patches.iter().map(|(area, ..)| format!("sketch of {}", area.name));
        let styles = resolved.areas.iter().map(|area| format!("style of {}", area.name));
        let mut sheet = Sheet::new(1 + patches.len())
            .title(title)
            .subtitle(subtitle)
            .column_heads(std::iter::once("exemplar".to_owned()).chain(heads))
            .row_heads(["truth".to_owned(), "lines".to_owned()].into_iter().chain(styles))
            .panel(blank(), "");
        for (_, _, painter, patch) in &patches {
            sheet = sheet.panel(painter.draw(&patch.truth, &patch.valid)?, "");
        }
        sheet = sheet.panel(blank(), "");
        for (.., patch) in &patches {
            sheet = sheet.panel(paper(&patch.lines)?, "");
        }
        for style in &resolved.areas {
            let systems = gallery.systems(style)?;
            let dem = &style.source.dem;
            let range = Normalization::of(dem);
            let is_whole = dem.shape() == (PATCH, PATCH);
            let exemplar = Painter::of(dem).draw(&range.normalize(dem), dem.valid())?;
            sheet = sheet.panel(if is_whole { exemplar } else { blank() }, "");
            for (_, cell, painter, patch) in &patches {
                let made = match systems.called(highlight) {
                    Some((_, system)) => {
                        let output =
                            system.generate(&patch.lines, patch_seed(Seed(seed), *cell), &Stop::new())?;
                        painter.draw(&output, &patch.valid)?
                    }
                    None => blank(),
                };
                sheet = sheet.panel(made, "");
            }
        }
        gallery.keep("exchange", &sheet.draw()?)
    }
}

/// Where the patches of a sketch lie: in the area that the sketch is called after.
fn home<'a>(resolved: &'a Resolved, area: &'a Area, sketch: &SketchSpec) -> &'a Area {
    resolved.areas.iter().find(|other| other.name == sketch.name).unwrap_or(area)
}
