//! Pictures of a few patches of an experiment: where the system it is about does worst and best against the interpolators.

use super::evaluation::Rebuilt;
use super::gallery::{self, SystemsOf};
use super::measure::{Measured, rebuilt};
use super::record::Record;
use super::resolve::Resolved;
use super::rows::ScoreTable;
use super::spec::{Kind, SketchSpec};
use crate::dem::Dem;
use crate::error::Result;
use crate::file;
use crate::grid::{Cell, Grid};
use crate::viz::{ColorBar, LineArt, LineStyle, Palette, Picture, Relief, Sheet};

/// Pixels a cell.
pub(super) const SCALE: usize = 2;
/// Panels a row.
const COLUMNS: usize = 4;

/// Draws them into the record's `pictures`, named so that their order is that of the report.
pub(super) fn write(resolved: &Resolved, record: &Record, systems: SystemsOf<'_>) -> Result<()> {
    let spec = &resolved.spec;
    file::remove(&record.path("pictures"))?;
    if matches!(spec.kind, Kind::Fit | Kind::Disentanglement) {
        return Ok(());
    }
    file::create_folder(&record.path("pictures"))?;
    if spec.kind == Kind::Sparse || spec.kind == Kind::Exchange || !spec.kind.has_truth() {
        gallery::write(resolved, record, systems)?;
    }
    if spec.kind == Kind::Exchange || !spec.kind.has_truth() {
        return Ok(());
    }
    let table = record.scores()?;
    let (seed, sketches, highlight) = (spec.seeds[0], spec.sketches(), spec.highlighted()?);
    let interpolators = spec.interpolator_names()?;
    for area in &resolved.areas {
        let mut margins: Vec<(f64, Cell, &SketchSpec)> = Vec::new();
        for sketch in &sketches {
            for &cell in &area.patches {
                let margin = margin(&table, &area.name, cell, seed, &sketch.name, &highlight, &interpolators);
                margins.extend(margin.map(|margin| (margin, cell, sketch)));
            }
        }
        margins.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // The worst, the best, the second worst, ...
        let mut order = std::collections::VecDeque::from(margins);
        let systems = systems(area, seed)?;
        for i in 0..spec.pictures.min(order.len()) {
            let Some((margin, cell, sketch)) =
                (if i % 2 == 0 { order.pop_front() } else { order.pop_back() })
            else {
                break;
            };
            let (rows, patches) = rebuilt(resolved, area, cell, sketch, &systems.named, seed, true)?;
            let Some(patch) = patches.first() else { continue };
            let caption = |system: &str| {
                let row: Option<&Measured> = rows.iter().find(|row| row.system == system);
                let value = |name| row?.values.iter().find(|(n, _)| *n == name).and_then(|(_, v)| *v);
                match (value("ssim"), value("psnr")) {
                    (Some(ssim), Some(psnr)) => format!("{system}: SSIM {ssim:.3}, {psnr:.1} dB"),
                    _ => system.to_owned(),
                }
            };
            let against = if interpolators.is_empty() { "PSNR" } else { "PSNR above the best interpolator" };
            let title = format!(
                "{}, row {}, column {}, sketch \"{}\", seed {seed}: {against} {margin:+.2} dB",
                area.name, cell.row, cell.col, sketch.name
            );
            let picture = sheet(patch, &area.dem, &title, caption)?;
            let name =
                format!("{}-{:02}-{}_{}-{}.png", area.name, i + 1, cell.row, cell.col, plain(&sketch.name));
            picture.write_png(&record.path("pictures").join(name))?;
        }
    }
    Ok(())
}

/// PSNR of the system above the best interpolator on that patch, dB; its PSNR when there is no interpolator.
fn margin(
    table: &ScoreTable,
    area: &str,
    cell: Cell,
    seed: u64,
    sketch: &str,
    system: &str,
    interpolators: &[String],
) -> Option<f64> {
    let column = table.column("psnr")?;
    let rows = || {
        table.rows.iter().filter(move |row| {
            let k = &row.key;
            (k.area.as_str(), k.row, k.col, k.seed, k.sketch.as_str())
                == (area, cell.row, cell.col, seed, sketch)
        })
    };
    let own = rows().find(|row| row.key.system == system)?.values[column]?;
    let others =
        rows().filter(|row| interpolators.contains(&row.key.system)).filter_map(|row| row.values[column]);
    let best = others.fold(f64::NEG_INFINITY, f64::max);
    Some(if best.is_finite() { own - best } else { own }).filter(|margin| margin.is_finite())
}

/// Truth, lines and every system's terrain beside each other, in the same colours.
fn sheet(patch: &Rebuilt, area: &Dem, title: &str, caption: impl Fn(&str) -> String) -> Result<Picture> {
    let metres = |unit: &Grid<f32>| -> Result<Dem> {
        let heights = unit.map(|&z| patch.normalization.to_metres(f64::from(z)) as f32);
        Dem::with_voids(heights, patch.valid.clone(), area.cell_size())
    };
    let truth = metres(&patch.truth)?;
    let relief = Relief::with_palette(Palette::Alpine).scaled(SCALE).fixed_for(&truth);
    let drawn = relief.draw(&truth)?;
    let mut lined = drawn.clone();
    LineArt::from(&patch.lines).overlay(&mut lined, &LineStyle::default())?;
    let mut sheet =
        Sheet::new(COLUMNS).title(title).panel(drawn, "truth").panel(lined, "its lines, as given");
    for (name, output) in &patch.outputs {
        if let Some(output) = output {
            sheet = sheet.panel(relief.draw(&metres(output)?)?, caption(name));
        }
    }
    let range = patch.normalization;
    let bar = ColorBar::new(relief.palette, range.low(), range.high(), "Height, m")?;
    sheet.color_bar(bar).scale_bar(area.cell_size().x() / SCALE as f64).draw()
}

/// A name as a part of a file's name.
pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}
