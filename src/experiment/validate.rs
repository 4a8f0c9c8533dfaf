//! The checks of an experiment that need no terrain; every complaint names the key, the value and what is allowed.

use super::spec::{Against, Bound, ExperimentSpec, Kind, Scope};
use crate::error::{Error, Result};
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
        if let Some(patches) = &area.patches {
            if spec.kind == Kind::Fit {
                return Err(Error::value(
                    name("patches"),
                    "given",
                    "not for kind = \"fit\": it tests the exemplars",
                ));
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
        if sketch.name.trim().is_empty() {
            return Err(Error::value("name of a sketch", "empty", "allowed: some words"));
        }
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
