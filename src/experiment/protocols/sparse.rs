//! As `neighbours`, from ever thinner sketches.

use super::{losses, neighbours};
use crate::control::Stop;
use crate::error::Result;
use crate::evaluate::{PATCH, patch_seed};
use crate::experiment::measure::patch_of;
use crate::experiment::pictures::{Gallery, blank, paper, patch_sheets, plain};
use crate::experiment::protocol::check;
use crate::experiment::protocol::{Finding, Plot, Protocol};
use crate::experiment::record::Record;
use crate::experiment::results::{Results, Stat};
use crate::experiment::spec::ExperimentSpec;
use crate::grid::Window;
use crate::metrics::title;
use crate::seed::Seed;
use crate::style::Named;
use crate::viz::plot::{Curves, Panel};
use crate::viz::{Painter, Sheet};

/// Metrics that are plotted over the share of lines.
const PLOTTED: usize = 2;

pub(super) struct Sparse;

impl Protocol for Sparse {
    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        let found = spec.sketch.len();
        check(found > 1, "number of sketches", found, "kind = \"sparse\" compares at least 2")
    }

    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        thinning(gallery)?;
        patch_sheets(gallery)
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok([neighbours::areas(results), losses::findings(results)].concat())
    }

    fn plots(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Plot>> {
        let mut plots = Vec::new();
        let share = |sketch: &str| {
            let rows = results.table.rows.iter().filter(|r| r.key.sketch == sketch && r.error.is_empty());
            Stat::of(rows.map(|r| 100.0 * r.line_share)).map(|s| s.mean)
        };
        for metric in results.spec.metrics.iter().take(PLOTTED) {
            let curve = |system: &'_ String| {
                let point = |s: &String| Some((share(s)?, results.stat(system, None, s, metric)?.mean));
                let mut points: Vec<(f64, f64)> = results.sketches.iter().filter_map(point).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                (!points.is_empty()).then(|| (system.clone(), points))
            };
            let mut curves = results.systems.iter().filter_map(curve).peekable();
            if curves.peek().is_some() {
                let panel =
                    curves.fold(Panel::new(title(metric)), |panel, (name, points)| panel.curve(name, points));
                let words = format!("{}: {}", results.spec.title, results.sketches.join(", "));
                let plot = Curves::new(words, "line cells of a patch, %").panel(panel).draw()?;
                let caption =
                    "Mean of the areas' means; a point for each sketch, at its mean share of line cells.";
                plots.push((format!("thinning-{metric}"), plot, caption.to_owned()));
            }
        }
        Ok(plots)
    }
}

/// For the first patch of each area its sketches side by side with what becomes of them.
fn thinning(gallery: &Gallery<'_>) -> Result<()> {
    let (spec, seed) = (&gallery.resolved.spec, gallery.seed);
    for area in &gallery.resolved.areas {
        let Some(&cell) = area.patches.first() else { continue };
        let systems = gallery.systems(area)?;
        let is_compared =
            |name: &String| *name == gallery.highlight || spec.interpolators.first() == Some(name);
        let compared: Vec<&Named> = systems.named.iter().filter(|(name, _)| is_compared(name)).collect();
        let painter = Painter::of(&area.dem.crop(Window::square(cell, PATCH))?);
        let title = format!("From few to many lines: {} {},{}, seed {seed}", area.name, cell.row, cell.col);
        let rows = std::iter::once("lines").chain(compared.iter().map(|(name, _)| name.as_str()));
        let mut sheet = Sheet::new(gallery.sketches.len()).title(title).row_heads(rows);
        sheet = sheet.column_heads(gallery.sketches.iter().map(|s| s.name.as_str()));
        // A thin sketch may leave a patch no line: its place stays empty, as its rows have the error.
        let patches: Vec<_> = gallery.sketches.iter().map(|s| patch_of(spec, area, cell, s).ok()).collect();
        for patch in &patches {
            sheet = sheet.panel(patch.as_ref().map_or_else(|| Ok(blank()), |p| paper(&p.lines))?, "");
        }
        for (_, system) in compared {
            for patch in &patches {
                let made = patch.as_ref().and_then(|patch| {
                    let output =
                        system.generate(&patch.lines, patch_seed(Seed(seed), cell), &Stop::new()).ok()?;
                    Some(painter.draw(&output, &patch.valid))
                });
                sheet = sheet.panel(made.transpose()?.unwrap_or_else(blank), "");
            }
        }
        gallery.keep(&format!("{}-00-sketches", plain(&area.name)), &painter.finish(sheet)?)?;
    }
    Ok(())
}
