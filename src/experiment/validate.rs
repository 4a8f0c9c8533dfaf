//! The checks of an experiment that need no terrain; every complaint names the key, the value and what is allowed.

use super::protocol::{SketchSource, check, not_for};
use super::protocols;
use super::spec::{Against, Bound, ExperimentSpec, Kind, Scope, SketchSpec};
use crate::error::{Error, Result};
use crate::file;
use crate::sketch::samples;
use std::collections::BTreeSet;
use std::path::Path;

/// The largest file that is read as an experiment, bytes.
const LARGEST: u64 = 1 << 22;

impl ExperimentSpec {
    /// Reads and checks an experiment file.
    ///
    /// # Errors
    /// When the file cannot be read or understood, or a value is not allowed; the message names file, key and value.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = file::read_text(path, LARGEST)?;
        let spec: Self = toml::from_str(&text).map_err(|e| {
            let said = e.to_string();
            Error::file(path, "experiment", "not understood", format!("the reader says: {}", said.trim_end()))
        })?;
        spec.validate().map_err(|e| e.in_file(path))?;
        Ok(spec)
    }

    /// Checks everything that can be checked without terrain.
    ///
    /// # Errors
    /// Names the first key that is not allowed.
    pub(crate) fn validate(&self) -> Result<()> {
        validate(self)
    }
}

fn validate(spec: &ExperimentSpec) -> Result<()> {
    for (key, text) in [("title", &spec.title), ("question", &spec.question)] {
        check(!text.trim().is_empty(), key, "empty", "allowed: some words")?;
    }
    some("seeds", &spec.seeds)?;
    once("seeds", spec.seeds.iter())?;
    let budget = spec.budget_minutes;
    check(budget > 0.0 && budget.is_finite(), "budget_minutes", budget, "allowed: above 0")?;
    check(spec.patches_per_area != Some(0), "patches_per_area", 0, "allowed: at least 1")?;
    spec.extraction.validate()?;
    let columns = spec.columns();
    some("metrics", &spec.metrics)?;
    once("metrics", spec.metrics.iter())?;
    spec.metrics.iter().try_for_each(|metric| known("metrics", metric, &columns))?;
    styles(spec)?;
    areas(spec)?;
    sketches(spec)?;
    protocols::of(spec.kind).validate(spec)?;
    let systems = spec.systems()?;
    once("names of systems", systems.iter())?;
    for (key, name) in [("highlight", &spec.highlight), ("baseline", &spec.baseline)] {
        name.iter().try_for_each(|name| known(key, name, &systems))?;
    }
    if spec.baseline.is_some() && spec.kind != Kind::Ablation {
        return Err(Error::value("baseline", "given", "allowed: for kind = \"ablation\" only"));
    }
    for (i, bound) in spec.bound.iter().enumerate() {
        check_bound(spec, bound, &systems, &columns)
            .map_err(|e| e.renamed(|name| format!("{name} of bound {}", i + 1)))?;
    }
    let names: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    for (i, printed) in spec.printed.iter().enumerate() {
        known("metric", &printed.metric, &columns)
            .and_then(|()| known("area", &printed.area, &names))
            .map_err(|e| e.renamed(|name| format!("{name} of printed {}", i + 1)))?;
    }
    Ok(())
}

fn styles(spec: &ExperimentSpec) -> Result<()> {
    some("style", &spec.style)?;
    once("style names", spec.style.iter().map(|s| &s.name))?;
    for style in &spec.style {
        let letters = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
        let is_name = !style.name.is_empty() && style.name.chars().all(letters);
        let quoted = format!("{:?}", style.name);
        check(is_name, "name of a style", quoted, "allowed: letters, digits, - _ . +")?;
        spec.uses(style)?;
    }
    Ok(())
}

fn areas(spec: &ExperimentSpec) -> Result<()> {
    some("area", &spec.area)?;
    once("area names", spec.area.iter().map(|a| &a.name))?;
    for area in &spec.area {
        let name = |key: &str| format!("{key} of area {:?}", area.name);
        if let Some(e) = &area.exemplar {
            let is_window = matches!(e.as_slice(), [_, _] | [_, _, 1..=usize::MAX]);
            let allowed = "allowed: [row, column] or [row, column, side]";
            check(is_window, name("exemplar"), format!("{e:?}"), allowed)?;
        }
        let factor = area.coarser.unwrap_or(1);
        check((1..=64).contains(&factor), name("coarser"), factor, "allowed: 1 to 64")?;
        if let Some(patches) = &area.patches {
            if !protocols::of(spec.kind).has_test_patches() {
                return Err(not_for(spec.kind, name("patches"), "given", "it has no test patches"));
            }
            some(&name("patches"), patches)?;
            once(&name("patches"), patches.iter().map(|p| format!("{p:?}")))?;
        }
    }
    Ok(())
}

fn sketches(spec: &ExperimentSpec) -> Result<()> {
    if protocols::of(spec.kind).sketch_source() == SketchSource::Areas && !spec.sketch.is_empty() {
        return Err(not_for(
            spec.kind,
            "number of sketches",
            spec.sketch.len(),
            "its sketches are those of the areas",
        ));
    }
    once("sketch names", spec.sketch.iter().map(|s| &s.name))?;
    for sketch in &spec.sketch {
        let mut extraction = spec.extraction.clone();
        extraction.min_order = sketch.order.unwrap_or(extraction.min_order);
        extraction.min_accumulation = sketch.accumulation.unwrap_or(extraction.min_accumulation);
        let checked = extraction.validate().and_then(|()| check_sketch(spec, sketch));
        checked.map_err(|e| e.renamed(|name| format!("sketch {:?}, {name}", sketch.name)))?;
        check(!sketch.name.trim().is_empty(), "name of a sketch", "empty", "allowed: some words")?;
    }
    Ok(())
}

/// The keys of a sketch, some of which only some protocols read.
fn check_sketch(spec: &ExperimentSpec, sketch: &SketchSpec) -> Result<()> {
    let source = protocols::of(spec.kind).sketch_source();
    let is_moved = sketch.turn.is_some() || sketch.mirror || sketch.shift.is_some() || sketch.same_parts;
    let only = |given: bool, key: &str, reader: SketchSource, name: &str| {
        check(!given || source == reader, key, "given", &format!("allowed: for kind = {name:?} only"))
    };
    only(is_moved, "turn, mirror, shift or same_parts", SketchSource::MovedPatches, "invariance")?;
    only(sketch.drawing.is_some(), "drawing", SketchSource::Drawings, "drawings")?;
    only(
        sketch.size.is_some() || sketch.share.is_some(),
        "size or share",
        SketchSource::MainLines,
        "strokes",
    )?;
    if source != SketchSource::MainLines {
        let is_random = sketch.random.is_some() || sketch.random_heights.is_some();
        only(is_random, "random or random_heights", SketchSource::Drawings, "drawings\" or \"strokes")?;
    }
    let side = sketch.size();
    check((64..=4096).contains(&side), "size", side, "allowed: 64 to 4096 cells")?;
    let share = sketch.share.unwrap_or(1.0);
    check(share > 0.0 && share <= 1.0, "share", share, "allowed: above 0 to 1")?;
    if source == SketchSource::MainLines {
        let of_network = sketch.order.is_some() || sketch.accumulation.is_some() || sketch.choose.is_some();
        check(
            !of_network,
            "order, accumulation or choose",
            "given",
            "main lines are the longest: share says how many",
        )?;
    }
    let has_count = sketch.strokes != Some(0) && (sketch.strokes.is_some() || sketch.choose.is_none());
    check(has_count, "strokes", format!("{:?}", sketch.strokes), "allowed: at least 1")?;
    if source == SketchSource::Drawings {
        let names: Vec<&str> = samples::names().collect();
        known("drawing", sketch.drawing.as_deref().unwrap_or_default(), &names)?;
        let of_patches = sketch.order.is_some() || sketch.accumulation.is_some() || sketch.strokes.is_some();
        let allowed = "not for a drawing, which is taken as it is";
        check(!of_patches, "order, accumulation or strokes", "given", allowed)?;
    }
    let turn = sketch.turn.unwrap_or(0.0);
    check(turn.is_finite() && turn.abs() <= 360.0, "turn", turn, "allowed: -360 to 360 degrees")?;
    let shift = sketch.shift.unwrap_or_default();
    let is_near = shift.iter().all(|cells| cells.abs() <= 64);
    check(is_near, "shift", format!("{shift:?}"), "allowed: -64 to 64 cells")?;
    let is_exact = turn % 90.0 == 0.0 && sketch.shift.is_none();
    let allowed = "allowed: with turns by 90 degrees and mirrors, which keep cells whole";
    check(!sketch.same_parts || is_exact, "same_parts", true, allowed)
}

fn check_bound(spec: &ExperimentSpec, bound: &Bound, systems: &[String], columns: &[&str]) -> Result<()> {
    known("metric", &bound.metric, columns)?;
    bound.system.iter().try_for_each(|system| known("system", system, systems))?;
    if let Some(area) = &bound.area {
        known("area", area, &spec.area.iter().map(|a| a.name.as_str()).collect::<Vec<_>>())?;
        check(bound.over != Scope::AllAreas, "area", area, "not with over = \"all-areas\"")?;
    }
    let sketches: Vec<String> = spec.sketches().into_iter().map(|s| s.name).collect();
    bound.sketch.iter().try_for_each(|sketch| known("sketch", sketch, &sketches))?;
    match &bound.against {
        Some(Against::System(system)) => known("against.system", system, systems)?,
        Some(_) => {
            let allowed = "the experiment has no interpolators to compare with";
            check(!spec.interpolators.is_empty(), "against", "an interpolator", allowed)?;
        }
        None => {}
    }
    let limits = [bound.min, bound.max];
    let is_limit = limits != [None, None] && limits.iter().flatten().all(|v| v.is_finite());
    check(is_limit, "min and max", format!("{limits:?}"), "allowed: at least one of them, finite")?;
    let (min, max) = (bound.min.unwrap_or(f64::NEG_INFINITY), bound.max.unwrap_or(f64::INFINITY));
    check(min <= max, "min", min, &format!("allowed: up to max, {max}"))
}

fn some<T>(key: &str, list: &[T]) -> Result<()> {
    check(!list.is_empty(), key, "empty", "allowed: at least one")
}

fn known<T: AsRef<str>>(key: &str, name: &str, names: &[T]) -> Result<()> {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    check(names.contains(&name), key, format!("{name:?}"), &format!("allowed: {}", names.join(", ")))
}

fn once<T: Ord + std::fmt::Display>(key: &str, items: impl Iterator<Item = T>) -> Result<()> {
    let mut seen = BTreeSet::new();
    for item in items {
        check(!seen.contains(&item), key, &item, "allowed: each one once")?;
        seen.insert(item);
    }
    Ok(())
}
