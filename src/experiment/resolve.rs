//! From an experiment file to terrain in memory and a file in which nothing is left open.

use super::areas::{Area, Loaded, Resolved, Terrain};
use super::protocol::SketchSource;
use super::protocols;
use super::spec::{AreaSpec, ExperimentSpec, Kind, SketchSpec, StyleSpec};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::evaluate::{PATCH, StrokeCase, choose_exemplar, patch_cells};
use crate::grid::{Cell, Window};
use crate::style::{Source, fingerprint};
use std::borrow::Cow;

/// Fills in everything that an experiment leaves open.
///
/// # Errors
/// When an area is not there or not the one that the file means; when exemplar or patches reach past its frame; when a test
/// patch shares cells with the exemplar; when no test patch is left.
pub(crate) fn resolve(spec: &ExperimentSpec, terrain: &Terrain) -> Result<Resolved> {
    spec.validate()?;
    let mut spec = spec.clone();
    if spec.kind == Kind::Exemplar {
        spec.area = every_exemplar(&spec, terrain)?;
    }
    let areas: Vec<Area> = spec.area.iter().map(|area| load(&spec, area, terrain)).collect::<Result<_>>()?;
    for (area, entry) in areas.iter().zip(&mut spec.area) {
        let e = &area.source.info;
        entry.exemplar = Some(vec![e.row, e.col, e.rows]);
        entry.fingerprint = Some(fingerprint(&area.dem));
        entry.patches = protocols::of(spec.kind)
            .has_test_patches()
            .then(|| area.patches.iter().map(|c| [c.row, c.col]).collect());
    }
    let full = |style: &StyleSpec| -> Result<StyleSpec> {
        Ok(StyleSpec {
            name: style.name.clone(),
            learns: style.learns.clone(),
            systems: if protocols::of(spec.kind).compares_uses() { spec.uses(style)? } else { Vec::new() },
            preset: None,
            set: toml::Table::new(),
            config: Some(spec.config_of(style)?),
            detail: style.detail.clone(),
        })
    };
    spec.style = spec.style.iter().map(full).collect::<Result<_>>()?;
    spec.highlight = Some(spec.highlighted()?);
    spec.interpolators = spec.interpolator_names()?;
    spec.overrides = toml::Table::new();
    spec.patches_per_area = None;
    if spec.kind == Kind::Ablation {
        spec.baseline = spec.baseline.or_else(|| spec.highlight.clone());
    }
    let source = protocols::of(spec.kind).sketch_source();
    if source != SketchSource::Areas {
        spec.sketch = spec.sketches();
        let of_network =
            |sketch: &&mut SketchSpec| sketch.drawing.is_none() && source != SketchSource::MainLines;
        for sketch in spec.sketch.iter_mut().filter(of_network) {
            sketch.order = Some(sketch.order.unwrap_or(spec.extraction.min_order));
            sketch.accumulation = Some(sketch.accumulation.unwrap_or(spec.extraction.min_accumulation));
        }
    }
    spec.validate()?;
    Ok(Resolved { spec, areas })
}

/// The terrain of an area, as coarse as the area says.
fn terrain_of(entry: &AreaSpec, terrain: &Terrain) -> Result<Loaded> {
    let loaded = terrain.load(entry.terrain.as_deref().unwrap_or(&entry.name))?;
    match entry.coarser {
        Some(factor) if factor > 1 => Ok(Loaded { dem: loaded.dem.coarsened(factor)?, ..loaded }),
        _ => Ok(loaded),
    }
}

/// An area for every patch that can be the exemplar, where the file names none.
fn every_exemplar(spec: &ExperimentSpec, terrain: &Terrain) -> Result<Vec<AreaSpec>> {
    let mut all = Vec::new();
    for entry in &spec.area {
        if entry.exemplar.is_some() {
            all.push(entry.clone());
            continue;
        }
        let dem = terrain_of(entry, terrain)?.dem;
        let known =
            |cell: &Cell| dem.crop(Window::square(*cell, PATCH)).is_ok_and(|p| p.range().0 < p.range().1);
        for cell in patch_cells(&dem).into_iter().filter(known) {
            all.push(AreaSpec {
                name: format!("{}-{}-{}", entry.name, cell.row, cell.col),
                terrain: Some(entry.terrain.clone().unwrap_or_else(|| entry.name.clone())),
                exemplar: Some(vec![cell.row, cell.col]),
                ..entry.clone()
            });
        }
    }
    Ok(all)
}

fn load(spec: &ExperimentSpec, entry: &AreaSpec, terrain: &Terrain) -> Result<Area> {
    let in_area = |e: Error| e.renamed(|name| format!("{name} (area {:?})", entry.name));
    let Loaded { file, dem, description } = terrain_of(entry, terrain)?;
    let found = fingerprint(&dem);
    if let Some(meant) = entry.fingerprint.as_ref().filter(|meant| **meant != found) {
        let allowed = format!("the experiment means terrain with {meant}");
        return Err(in_area(Error::value("fingerprint", found, allowed)));
    }
    let learned = western(spec, &dem)?;
    let (origin, side) = match entry.exemplar.as_deref() {
        Some([row, col, side]) => (Cell::new(*row, *col), *side),
        Some([row, col]) => (Cell::new(*row, *col), PATCH),
        _ => (choose_exemplar(&learned).map_err(in_area)?, PATCH),
    };
    let source = Source::new(&entry.name, &learned, Window::square(origin, side)).map_err(in_area)?;
    let patches = if protocols::of(spec.kind).has_test_patches() {
        patches(spec, entry, &dem, origin, side).map_err(in_area)?
    } else {
        Vec::new()
    };
    Ok(Area { name: entry.name.clone(), file, description, dem, source, patches })
}

/// What styles may learn from: all of the terrain, or its west where truths lie in its east.
fn western<'a>(spec: &ExperimentSpec, dem: &'a Dem) -> Result<Cow<'a, Dem>> {
    if protocols::of(spec.kind).sketch_source() != SketchSource::MainLines {
        return Ok(Cow::Borrowed(dem));
    }
    let west = StrokeCase::west_of(dem.shape().1, spec.largest_truth());
    Ok(Cow::Owned(dem.crop(Window::new(Cell::new(0, 0), dem.shape().0, west))?))
}

/// The test patches of an area.
fn patches(
    spec: &ExperimentSpec,
    entry: &AreaSpec,
    dem: &Dem,
    exemplar: Cell,
    side: usize,
) -> Result<Vec<Cell>> {
    let meets = |a: usize, b: usize| a < b + side && b < a + PATCH;
    let shares_cells = |c: &Cell| meets(c.row, exemplar.row) && meets(c.col, exemplar.col);
    let mut cells = match &entry.patches {
        None => patch_cells(dem).into_iter().filter(|c| !shares_cells(c)).collect(),
        Some(given) => {
            let cells: Vec<Cell> = given.iter().map(|&[row, col]| Cell::new(row, col)).collect();
            for cell in &cells {
                let name = format!("patch {},{}", cell.row, cell.col);
                if shares_cells(cell) {
                    let found =
                        format!("shares cells with the exemplar at {},{}", exemplar.row, exemplar.col);
                    return Err(Error::value(
                        name,
                        found,
                        "allowed: test patches apart from the training cells",
                    ));
                }
                dem.valid().crop(Window::square(*cell, PATCH))?;
            }
            cells
        }
    };
    if let Some(limit) = spec.patches_per_area.filter(|limit| *limit < cells.len()) {
        // Ties by place, so that the choice does not depend on the sort.
        cells.sort_by_key(|c| (c.distance_squared(exemplar), *c));
        cells.truncate(limit);
        cells.sort();
    }
    if cells.is_empty() {
        let allowed = format!("a whole {PATCH}x{PATCH} patch beside the exemplar is needed");
        return Err(Error::value("number of test patches", 0, allowed));
    }
    Ok(cells)
}
