//! Pictures of the kinds that are more than patches beside each other: drawings, exchanged styles, moved lines, and what
//! becomes of a patch as its lines go.

use super::measure::{self, Systems};
use super::moved;
use super::pictures::{SCALE, plain};
use super::record::Record;
use super::resolve::{Area, Resolved};
use super::spec::{ExperimentSpec, Kind, SketchSpec};
use crate::control::Stop;
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::Result;
use crate::grid::{Grid, Mask};
use crate::sketch::LineMap;
use crate::style::Named;
use crate::systems::task::RandomHeights;
use crate::viz::{ColorBar, LineArt, Palette, Picture, Relief, Rgb, Sheet};

/// What gives the systems of an area and seed.
pub(super) type SystemsOf<'a> = &'a dyn Fn(&Area, u64) -> Result<Systems<'a>>;

/// Draws what the kind has into the record's `pictures`.
pub(super) fn write(resolved: &Resolved, record: &Record, systems: SystemsOf<'_>) -> Result<()> {
    let keep = |name: String, sheet: Picture| sheet.write_png(&record.path("pictures").join(name));
    match resolved.spec.kind {
        Kind::Drawings => drawings(resolved, systems, &keep),
        Kind::Exchange => keep("exchange.png".to_owned(), exchange(resolved, systems)?),
        Kind::Invariance => invariance(resolved, systems, &keep),
        _ => thinning(resolved, systems, &keep),
    }
}

type Keep<'a> = &'a dyn Fn(String, Picture) -> Result<()>;

/// Unit heights as a picture in colours that are the same for all of a sheet.
struct Painter {
    relief: Relief,
    range: Normalization,
    cell_size: CellSize,
}

impl Painter {
    fn new(reference: &Dem, range: Normalization) -> Self {
        let relief = Relief::with_palette(Palette::Alpine).scaled(SCALE).fixed_for(reference);
        Self { relief, range, cell_size: reference.cell_size() }
    }

    fn draw(&self, unit: &Grid<f32>, valid: &Mask) -> Result<Picture> {
        let heights = unit.map(|&z| self.range.to_metres(f64::from(z)) as f32);
        self.relief.draw(&Dem::with_voids(heights, valid.clone(), self.cell_size)?)
    }

    fn finish(&self, sheet: Sheet) -> Result<Picture> {
        let bar = ColorBar::new(self.relief.palette, self.range.low(), self.range.high(), "Height, m")?;
        sheet.color_bar(bar).scale_bar(self.cell_size.x() / SCALE as f64).draw()
    }
}

fn paper(lines: &LineMap) -> Result<Picture> {
    LineArt::from(lines).on_paper(SCALE)
}

/// The place of a panel that there is not.
fn blank() -> Picture {
    Picture::filled(super::PATCH * SCALE, super::PATCH * SCALE, Rgb::WHITE)
}

fn system_called<'a>(systems: &'a Systems<'_>, name: &str) -> Option<&'a Named> {
    systems.named.iter().find(|(known, _)| known == name)
}

/// A sheet for each drawing: a row for each sketch of it (random lines), its variants beside the lines of the first.
fn drawings(resolved: &Resolved, systems: SystemsOf<'_>, keep: Keep<'_>) -> Result<()> {
    let spec = &resolved.spec;
    let (seed, highlight, sketches) = (spec.seeds[0], spec.highlighted()?, spec.sketches());
    let mut names: Vec<&str> = Vec::new();
    for name in sketches.iter().filter_map(|s| s.drawing.as_deref()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    for area in &resolved.areas {
        let systems = systems(area, seed)?;
        let Some((_, system)) = system_called(&systems, &highlight) else { continue };
        let painter = Painter::new(&area.source.dem, Normalization::of(&area.source.dem));
        for name in &names {
            let rows: Vec<&SketchSpec> =
                sketches.iter().filter(|s| s.drawing.as_deref() == Some(name)).collect();
            let title = format!("{name} in the style of {}: {highlight}, seed {seed}", area.name);
            let subtitle = "Each row: the lines of the first variant, then four variants.";
            let mut sheet = Sheet::new(1 + measure::VARIANTS).title(title).subtitle(subtitle);
            sheet = sheet.row_heads(rows.iter().map(|s| match s.random {
                Some(nodes) if nodes > 0 => match s.random_heights {
                    Some(RandomHeights::Range) => format!("{nodes} random nodes, whole range"),
                    _ => format!("{nodes} random nodes"),
                },
                _ => "as drawn".to_owned(),
            }));
            for sketch in rows {
                let (_, variants) = measure::drawing(area, sketch, seed)?;
                sheet = sheet.panel(paper(&variants[0])?, "lines");
                for (v, lines) in variants.iter().enumerate() {
                    let output = system.generate(lines, measure::variant_seed(seed, v), &Stop::new())?;
                    let picture = painter.draw(&output, &output.map(|_| true))?;
                    sheet = sheet.panel(picture, format!("variant {}", v + 1));
                }
            }
            keep(format!("{}-{}.png", plain(&area.name), plain(name)), painter.finish(sheet)?)?;
        }
    }
    Ok(())
}

/// A column for each area's sketch, a row for each area's style.
fn exchange(resolved: &Resolved, systems: SystemsOf<'_>) -> Result<Picture> {
    let spec = &resolved.spec;
    let (seed, highlight, sketches) = (spec.seeds[0], spec.highlighted()?, spec.sketches());
    let mut patches = Vec::new();
    for (area, sketch) in resolved.areas.iter().zip(&sketches) {
        let Some(&cell) = area.patches.first() else { continue };
        let Ok(patch) = measure::patch_of(spec, area, cell, sketch) else { continue };
        let reference = area.dem.crop(cell, super::PATCH, super::PATCH)?;
        patches.push((area, cell, Painter::new(&reference, patch.normalization), patch));
    }
    let title = format!("Styles on each other's sketches: {highlight}, seed {seed}");
    let subtitle = "Columns: the first test patch of each area, in its own colours. Rows: truth, its lines, then the style of \
                    each area; the first column is what the style learned.";
    let mut sheet = Sheet::new(1 + patches.len()).title(title).subtitle(subtitle);
    let heads = patches.iter().map(|(area, ..)| format!("sketch of {}", area.name));
    sheet = sheet.column_heads(std::iter::once("exemplar".to_owned()).chain(heads));
    let styles = resolved.areas.iter().map(|area| format!("style of {}", area.name));
    sheet = sheet.row_heads(["truth".to_owned(), "lines".to_owned()].into_iter().chain(styles));
    sheet = sheet.panel(blank(), "");
    for (_, _, painter, patch) in &patches {
        sheet = sheet.panel(painter.draw(&patch.truth, &patch.valid)?, "");
    }
    sheet = sheet.panel(blank(), "");
    for (.., patch) in &patches {
        sheet = sheet.panel(paper(&patch.lines)?, "");
    }
    for style in &resolved.areas {
        let systems = systems(style, seed)?;
        let dem = &style.source.dem;
        let range = Normalization::of(dem);
        let is_whole = dem.shape() == (super::PATCH, super::PATCH);
        let exemplar = Painter::new(dem, range).draw(&range.normalize(dem), dem.valid())?;
        sheet = sheet.panel(if is_whole { exemplar } else { blank() }, "");
        for (_, cell, painter, patch) in &patches {
            let made = match system_called(&systems, &highlight) {
                Some((_, system)) => {
                    let output =
                        system.generate(&patch.lines, measure::patch_seed(seed, *cell), &Stop::new())?;
                    painter.draw(&output, &patch.valid)?
                }
                None => blank(),
            };
            sheet = sheet.panel(made, "");
        }
    }
    sheet.draw()
}

/// For the first patch of each area the moved lines and their terrain, as it came.
fn invariance(resolved: &Resolved, systems: SystemsOf<'_>, keep: Keep<'_>) -> Result<()> {
    let spec = &resolved.spec;
    let (seed, highlight) = (spec.seeds[0], spec.highlighted()?);
    for area in &resolved.areas {
        let systems = systems(area, seed)?;
        let (Some(&cell), Some(named)) = (area.patches.first(), system_called(&systems, &highlight)) else {
            continue;
        };
        let sketches = spec.sketches();
        let Ok(patch) = measure::patch_of(spec, area, cell, &sketches[0]) else { continue };
        let reference = area.dem.crop(cell, super::PATCH, super::PATCH)?;
        let painter = Painter::new(&reference, patch.normalization);
        let title = format!("Moved lines: {highlight}, {} {},{}, seed {seed}", area.name, cell.row, cell.col);
        let mut made = Vec::new();
        let mut sheet = Sheet::new(1 + sketches.len()).title(title);
        sheet = sheet.panel(paper(&patch.lines)?, "lines");
        for sketch in &sketches {
            let seed = measure::patch_seed(seed, cell);
            let (before, after, way) = moved::pair(named, &systems, &patch.lines, sketch, seed)?;
            if made.is_empty() {
                made.push((before, "terrain".to_owned()));
            }
            made.push((after, String::new()));
            sheet = sheet.panel(paper(&way.lines(&patch.lines))?, sketch.name.as_str());
        }
        for (output, caption) in &made {
            sheet = sheet.panel(painter.draw(output, &output.map(|_| true))?, caption.as_str());
        }
        keep(format!("{}-moved.png", plain(&area.name)), painter.finish(sheet)?)?;
    }
    Ok(())
}

/// For the first patch of each area its sketches side by side with what becomes of them.
fn thinning(resolved: &Resolved, systems: SystemsOf<'_>, keep: Keep<'_>) -> Result<()> {
    let spec: &ExperimentSpec = &resolved.spec;
    let (seed, highlight, sketches) = (spec.seeds[0], spec.highlighted()?, spec.sketches());
    if sketches.len() < 2 {
        return Ok(());
    }
    for area in &resolved.areas {
        let Some(&cell) = area.patches.first() else { continue };
        let systems = systems(area, seed)?;
        let shown: Vec<&Named> = systems
            .named
            .iter()
            .filter(|(name, _)| *name == highlight || spec.interpolators.first() == Some(name))
            .collect();
        let reference = area.dem.crop(cell, super::PATCH, super::PATCH)?;
        let painter = Painter::new(&reference, Normalization::of(&reference));
        let title = format!("From few to many lines: {} {},{}, seed {seed}", area.name, cell.row, cell.col);
        let rows = std::iter::once("lines").chain(shown.iter().map(|(name, _)| name.as_str()));
        let mut sheet = Sheet::new(sketches.len()).title(title).row_heads(rows);
        sheet = sheet.column_heads(sketches.iter().map(|s| s.name.as_str()));
        let mut patches = Vec::new();
        // A thin sketch may leave a patch no line: its place stays empty, as its rows have the error.
        for sketch in &sketches {
            let patch = measure::patch_of(spec, area, cell, sketch).ok();
            sheet = sheet.panel(patch.as_ref().map_or_else(|| Ok(blank()), |p| paper(&p.lines))?, "");
            patches.push(patch);
        }
        for (_, system) in shown {
            for patch in &patches {
                let made = match patch {
                    Some(patch) => {
                        let made =
                            system.generate(&patch.lines, measure::patch_seed(seed, cell), &Stop::new());
                        made.ok().map(|output| painter.draw(&output, &patch.valid)).transpose()?
                    }
                    None => None,
                };
                sheet = sheet.panel(made.unwrap_or_else(blank), "");
            }
        }
        keep(format!("{}-00-sketches.png", plain(&area.name)), painter.finish(sheet)?)?;
    }
    Ok(())
}
