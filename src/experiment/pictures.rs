//! Pictures of terrain in a record: what protocols share, and sheets of patches.

use super::areas::{Area, Resolved};
use super::measure::{Measured, Systems, Task, rebuild, value_of};
use super::record::Record;
use super::results::{Results, difference};
use super::spec::SketchSpec;
use super::styles::Styles;
use crate::error::Result;
use crate::evaluate::{PATCH, Rebuilt};
use crate::file;
use crate::grid::{Cell, Window};
use crate::sketch::LineMap;
use crate::viz::{LineArt, LineStyle, Painter, Picture, Rgb, Sheet};
use std::collections::VecDeque;

/// Panels per row of a patch's sheet.
const COLUMNS: usize = 4;

/// Where pictures of a record are kept, and what they are made of.
pub(super) struct Gallery<'a> {
    pub(super) resolved: &'a Resolved,
    styles: &'a Styles<'a>,
    pub(super) record: &'a Record,
    /// The first seed, of which pictures are.
    pub(super) seed: u64,
    /// The system that the experiment is about.
    pub(super) highlight: String,
    pub(super) sketches: Vec<SketchSpec>,
}

impl<'a> Gallery<'a> {
    /// An empty one.
    pub(super) fn new(resolved: &'a Resolved, styles: &'a Styles<'a>, record: &'a Record) -> Result<Self> {
        file::remove(&record.path("pictures"))?;
        let spec = &resolved.spec;
        Ok(Self {
            resolved,
            styles,
            record,
            seed: spec.seeds[0],
            highlight: spec.highlighted()?,
            sketches: spec.sketches(),
        })
    }

    /// The systems of an area, interpolators among them.
    pub(super) fn systems(&self, area: &Area) -> Result<Systems<'_>> {
        self.styles.systems(area, self.seed, true)
    }

    pub(super) fn keep(&self, name: &str, picture: &Picture) -> Result<()> {
        file::create_folder(&self.record.path("pictures"))?;
        picture.write_png(&self.record.path("pictures").join(format!("{name}.png")))
    }
}

/// Lines on paper.
pub(super) fn paper(lines: &LineMap) -> Result<Picture> {
    LineArt::from(lines).on_paper(Painter::SCALE)
}

/// The place of a panel that there is not.
pub(super) fn blank() -> Picture {
    Picture::filled(PATCH * Painter::SCALE, PATCH * Painter::SCALE, Rgb::WHITE)
}

/// A name as a part of a file's name.
pub(super) fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

/// A sheet for each of a few patches per area: where the highlighted system does worst and best against the interpolators.
pub(super) fn patch_sheets(gallery: &Gallery<'_>) -> Result<()> {
    let (resolved, seed) = (gallery.resolved, gallery.seed);
    let table = gallery.record.scores()?;
    let results = Results::new(&resolved.spec, &table)?;
    let with_best = !results.interpolators().is_empty();
    let against = if with_best { "PSNR above the best interpolator" } else { "PSNR" };
    for area in &resolved.areas {
        let mut margins: Vec<(f64, Cell, &SketchSpec)> = Vec::new();
        for sketch in &gallery.sketches {
            let own = results.cells(&gallery.highlight, &area.name, &sketch.name, "psnr");
            let best = results.best_of_each(&area.name, &sketch.name, "psnr");
            let found = if with_best { difference(&own, &best) } else { own };
            let here = found.into_iter().filter(|((.., of), _)| *of == seed);
            margins.extend(here.map(|((row, col, _), margin)| (margin, Cell::new(row, col), sketch)));
        }
        margins.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // The worst, the best, the second worst, ...
        let mut order = VecDeque::from(margins);
        let systems = gallery.systems(area)?;
        for i in 0..resolved.spec.pictures {
            let next = if i % 2 == 0 { order.pop_front() } else { order.pop_back() };
            let Some((margin, cell, sketch)) = next else { break };
            let task = Task { resolved, area, cell, sketch, systems: &systems, seed, record: gallery.record };
            let (rows, patches) = rebuild(&task, &area.dem, true)?;
            let Some(patch) = patches.first() else { continue };
            let title = format!(
                "{}, row {}, column {}, sketch \"{}\", seed {seed}: {against} {margin:+.2} dB",
                area.name, cell.row, cell.col, sketch.name
            );
            let name =
                format!("{}-{:02}-{}_{}-{}", area.name, i + 1, cell.row, cell.col, plain(&sketch.name));
            gallery.keep(&name, &sheet(area, patch, &rows, title)?)?;
        }
    }
    Ok(())
}

/// Truth, lines and every system's terrain beside each other, in the same colours.
fn sheet(area: &Area, patch: &Rebuilt, rows: &[Measured], title: String) -> Result<Picture> {
    let painter = Painter::of(&area.dem.crop(Window::square(patch.origin, PATCH))?);
    let drawn = painter.draw(&patch.truth, &patch.valid)?;
    let mut lined = drawn.clone();
    LineArt::from(&patch.lines).overlay(&mut lined, &LineStyle::default())?;
    let mut sheet =
        Sheet::new(COLUMNS).title(title).panel(drawn, "truth").panel(lined, "its lines, as given");
    for (name, output) in patch.outputs.iter().filter_map(|(name, output)| Some((name, output.as_ref()?))) {
        let values = rows.iter().find(|row| row.system == *name).map_or(&[][..], |row| &row.values);
        let caption = match (value_of(values, "ssim"), value_of(values, "psnr")) {
            (Some(ssim), Some(psnr)) => format!("{name}: SSIM {ssim:.3}, {psnr:.1} dB"),
            _ => name.clone(),
        };
        sheet = sheet.panel(painter.draw(output, &patch.valid)?, caption);
    }
    painter.finish(sheet)
}
