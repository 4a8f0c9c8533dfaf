//! The checks of an experiment that need no terrain; every complaint names the key, the value and what is allowed.

use super::spec::{Against, Bound, ExperimentSpec, Kind, Scope, SketchSpec};
use crate::error::{Error, Result};
use crate::sketch::samples;
use std::collections::BTreeSet;

pub(super) fn validate(spec: &ExperimentSpec) -> Result<()> {
    let filled = |key: &str, text: &str| {
        if text.trim().is_empty() { Err(Error::value(key, "empty", "allowed: some words")) } else { Ok(()) }
    };
    filled("title", &spec.title)?;
    filled("question", &spec.question)?;
    some("seeds", &spec.seeds)?;
    once("seeds", spec.seeds.iter())?;
    if !(spec.budget_minutes > 0.0 && spec.budget_minutes.is_finite()) {
        return Err(Error::value("budget_minutes", spec.budget_minutes, "allowed: above 0"));
    }
    if spec.patches_per_area == Some(0) {
        return Err(Error::value("patches_per_area", 0, "allowed: at least 1"));
    }
    spec.extraction.validate()?;
    let columns = spec.columns();
    some("metrics", &spec.metrics)?;
    once("metrics", spec.metrics.iter())?;
    for metric in &spec.metrics {
        known("metrics", metric, &columns)?;
    }
    styles(spec)?;
    areas(spec)?;
    sketches(spec)?;
    if spec.kind == Kind::Drawings && spec.sketch.is_empty() {
        return Err(Error::value("number of sketches", 0, "kind = \"drawings\" needs at least one drawing"));
    }
    if spec.kind == Kind::Disentanglement && !spec.interpolators.is_empty() {
        let allowed = "not for kind = \"disentanglement\": interpolators have no region states";
        return Err(Error::value("interpolators", "given", allowed));
    }
    let systems = spec.systems()?;
    once("names of systems", systems.iter())?;
    for (key, name) in [("highlight", &spec.highlight), ("baseline", &spec.baseline)] {
        if let Some(name) = name {
            known(key, name, &systems)?;
        }
    }
    if spec.baseline.is_some() && spec.kind != Kind::Ablation {
        return Err(Error::value("baseline", "given", "allowed: for kind = \"ablation\" only"));
    }
    if spec.kind == Kind::Ablation && spec.style.len() < 2 {
        return Err(Error::value("number of styles", spec.style.len(), "an ablation compares at least 2"));
    }
    for (i, bound) in spec.bound.iter().enumerate() {
        check_bound(spec, bound, &systems, &columns).map_err(|e| in_entry(e, "bound", i))?;
    }
    let names: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
    for (i, printed) in spec.printed.iter().enumerate() {
        known("metric", &printed.metric, &columns)
            .and_then(|()| known("area", &printed.area, &names))
            .map_err(|e| in_entry(e, "printed", i))?;
    }
    Ok(())
}

fn styles(spec: &ExperimentSpec) -> Result<()> {
    some("style", &spec.style)?;
    once("style names", spec.style.iter().map(|s| &s.name))?;
    for style in &spec.style {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
        if style.name.is_empty() || !style.name.chars().all(allowed) {
            let allowed = "allowed: letters, digits, - _ . +";
            return Err(Error::value("name of a style", format!("{:?}", style.name), allowed));
        }
        if spec.kind == Kind::Fit && !style.systems.is_empty() {
            let name = format!("systems of style {:?}", style.name);
            let allowed = "not for kind = \"fit\": a style rebuilds its exemplar in one way";
            return Err(Error::value(name, style.systems.join(", "), allowed));
        }
        spec.uses(style)?;
    }
    Ok(())
}

fn areas(spec: &ExperimentSpec) -> Result<()> {
    some("area", &spec.area)?;
    once("area names", spec.area.iter().map(|a| &a.name))?;
    for area in &spec.area {
        let name = |key: &str| format!("{key} of area {:?}", area.name);
        if let Some(e) = area
            .exemplar
            .as_ref()
            .filter(|e| !matches!(e.as_slice(), [_, _] | [_, _, _]) || e.get(2) == Some(&0))
        {
            return Err(Error::value(
                name("exemplar"),
                format!("{e:?}"),
                "allowed: [row, column] or [row, column, side]",
            ));
        }
        if let Some(factor) = area.coarser.filter(|factor| !(1..=64).contains(factor)) {
            return Err(Error::value(name("coarser"), factor, "allowed: 1 to 64"));
        }
        if let Some(patches) = &area.patches {
            if matches!(spec.kind, Kind::Fit | Kind::Drawings) {
                let allowed = format!("not for kind = {:?}: it has no test patches", spec.kind.name());
                return Err(Error::value(name("patches"), "given", allowed));
            }
            some(&name("patches"), patches)?;
            once(&name("patches"), patches.iter().map(|p| format!("{p:?}")))?;
        }
    }
    Ok(())
}

fn sketches(spec: &ExperimentSpec) -> Result<()> {
    if spec.kind == Kind::Fit && (!spec.sketch.is_empty() || spec.patches_per_area.is_some()) {
        return Err(Error::value(
            "sketch or patches_per_area",
            "given",
            "not for kind = \"fit\": it tests the exemplars",
        ));
    }
    if spec.kind == Kind::Sparse && spec.sketch.len() < 2 {
        return Err(Error::value(
            "number of sketches",
            spec.sketch.len(),
            "kind = \"sparse\" compares at least 2",
        ));
    }
    if spec.kind == Kind::Exchange && !spec.sketch.is_empty() {
        let allowed = "not for kind = \"exchange\": its sketches are those of the areas";
        return Err(Error::value("number of sketches", spec.sketch.len(), allowed));
    }
    once("sketch names", spec.sketch.iter().map(|s| &s.name))?;
    for sketch in &spec.sketch {
        let mut extraction = spec.extraction.clone();
        extraction.min_order = sketch.order.unwrap_or(extraction.min_order);
        extraction.min_accumulation = sketch.accumulation.unwrap_or(extraction.min_accumulation);
        let named = |e: Error| match e {
            Error::Value { name, value, allowed } => {
                Error::Value { name: format!("sketch {:?}, {name}", sketch.name), value, allowed }
            }
            other => other,
        };
        extraction.validate().map_err(named)?;
        use_of(spec.kind, sketch).map_err(named)?;
        if sketch.name.trim().is_empty() {
            return Err(Error::value("name of a sketch", "empty", "allowed: some words"));
        }
    }
    Ok(())
}

/// The keys of a sketch that only some kinds read.
fn use_of(kind: Kind, sketch: &SketchSpec) -> Result<()> {
    let only = |given: bool, key: &str, wanted: Kind| {
        if given && kind != wanted {
            let allowed = format!("allowed: for kind = {:?} only", wanted.name());
            return Err(Error::value(key, "given", allowed));
        }
        Ok(())
    };
    let is_moved = sketch.turn.is_some() || sketch.mirror || sketch.shift.is_some() || sketch.same_parts;
    only(is_moved, "turn, mirror, shift or same_parts", Kind::Invariance)?;
    only(sketch.drawing.is_some() || sketch.random.is_some(), "drawing or random", Kind::Drawings)?;
    only(sketch.random_heights.is_some(), "random_heights", Kind::Drawings)?;
    if sketch.strokes == Some(0) || sketch.strokes.is_none() && sketch.choose.is_some() {
        return Err(Error::value("strokes", format!("{:?}", sketch.strokes), "allowed: at least 1"));
    }
    if kind == Kind::Drawings {
        let names: Vec<&str> = samples::names().collect();
        known("drawing", sketch.drawing.as_deref().unwrap_or_default(), &names)?;
        let of_patches = sketch.order.is_some() || sketch.accumulation.is_some() || sketch.strokes.is_some();
        if of_patches {
            let allowed = "not for a drawing, which is taken as it is";
            return Err(Error::value("order, accumulation or strokes", "given", allowed));
        }
    }
    if let Some(turn) = sketch.turn.filter(|turn| !(turn.is_finite() && turn.abs() <= 360.0)) {
        return Err(Error::value("turn", turn, "allowed: -360 to 360 degrees"));
    }
    if let Some(shift) = sketch.shift.filter(|shift| shift.iter().any(|cells| cells.abs() > 64)) {
        return Err(Error::value("shift", format!("{shift:?}"), "allowed: -64 to 64 cells"));
    }
    let is_exact = sketch.turn.unwrap_or(0.0) % 90.0 == 0.0 && sketch.shift.is_none();
    if sketch.same_parts && !is_exact {
        let allowed = "allowed: with turns by 90 degrees and mirrors, which keep cells whole";
        return Err(Error::value("same_parts", true, allowed));
    }
    Ok(())
}

fn check_bound(spec: &ExperimentSpec, bound: &Bound, systems: &[String], columns: &[&str]) -> Result<()> {
    known("metric", &bound.metric, columns)?;
    if let Some(system) = &bound.system {
        known("system", system, systems)?;
    }
    if let Some(area) = &bound.area {
        known("area", area, &spec.area.iter().map(|a| a.name.as_str()).collect::<Vec<_>>())?;
        if bound.over == Scope::AllAreas {
            return Err(Error::value("area", area, "not with over = \"all-areas\""));
        }
    }
    if let Some(sketch) = &bound.sketch {
        let names: Vec<String> = spec.sketches().into_iter().map(|s| s.name).collect();
        known("sketch", sketch, &names)?;
    }
    match &bound.against {
        Some(Against::System(system)) => known("against.system", system, systems)?,
        Some(_) if spec.interpolators.is_empty() => {
            let allowed = "the experiment has no interpolators to compare with";
            return Err(Error::value("against", "an interpolator", allowed));
        }
        _ => {}
    }
    let limits = [bound.min, bound.max];
    if limits == [None, None] || limits.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Error::value(
            "min and max",
            format!("{limits:?}"),
            "allowed: at least one of them, finite",
        ));
    }
    if let [Some(min), Some(max)] = limits
        && min > max
    {
        return Err(Error::value("min", min, format!("allowed: up to max, {max}")));
    }
    Ok(())
}

/// The same complaint, saying of which entry of a list.
fn in_entry(error: Error, list: &str, index: usize) -> Error {
    match error {
        Error::Value { name, value, allowed } => {
            Error::Value { name: format!("{name} of {list} {}", index + 1), value, allowed }
        }
        other => other,
    }
}

fn some<T>(key: &str, list: &[T]) -> Result<()> {
    if list.is_empty() { Err(Error::value(key, "empty", "allowed: at least one")) } else { Ok(()) }
}

fn known<T: AsRef<str>>(key: &str, name: &str, names: &[T]) -> Result<()> {
    if names.iter().any(|known| known.as_ref() == name) {
        return Ok(());
    }
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    Err(Error::value(key, format!("{name:?}"), format!("allowed: {}", names.join(", "))))
}

fn once<T: Ord + std::fmt::Display>(key: &str, items: impl Iterator<Item = T>) -> Result<()> {
    let mut seen = BTreeSet::new();
    for item in items {
        if seen.contains(&item) {
            return Err(Error::value(key, item, "allowed: each one once"));
        }
        seen.insert(item);
    }
    Ok(())
}
