//! Every system by name: the only file that knows them all.

use super::classical;
use super::pipeline::{detail_of, detailed};
use super::region_gnn::config::HeightFrame;
use super::region_gnn::{GenerationConfig, RegionGnnSystem, Style, StyleConfig};
use super::task::{DetailUse, Finishing, SketchToTerrain};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::{Correction, CorrectionKind};
use crate::seed::Seed;
use crate::sketch::LineMap;
use std::sync::Arc;

/// A system and its name.
pub type Named = (String, Arc<dyn SketchToTerrain>);

/// Every way to use a style, then every interpolator.
///
/// An anchored style is `gnn` (its own configuration). A style of the paper is `gnn-aligned` and, with fine-tuned embeddings,
/// `gnn-tuned`, each also with the harmonic correction (`+harmonic`). A style with detail has each of them but the corrected
/// ones once more, with it (`+detail`, which ends with a correction of its own).
///
/// # Errors
/// When the style's detail contradicts itself.
pub fn all(style: &Style) -> Result<Vec<Named>> {
    let mut systems = trained(style)?;
    systems.extend(interpolators());
    Ok(systems)
}

/// Every way to use a style. Systems that finish another one share it.
///
/// # Errors
/// When the style's detail contradicts itself.
pub fn trained(style: &Style) -> Result<Vec<Named>> {
    let starts: Vec<Named> = uses(&style.info.config)
        .into_iter()
        .map(|(name, generation)| -> Named {
            (name.to_owned(), Arc::new(RegionGnnSystem { model: style.model.clone(), generation }))
        })
        .collect();
    let mut systems = Vec::new();
    for (name, start) in &starts {
        systems.push((name.clone(), start.clone()));
        if corrects(&style.info.config) {
            systems.push((format!("{name}{HARMONIC}"), Arc::new(harmonic(start.clone()))));
        }
    }
    if let Some(detail) = detail_of(style)?.map(Arc::new) {
        systems.extend(starts.into_iter().map(|(name, start)| -> Named {
            (format!("{name}{DETAIL}"), Arc::new(detailed(start, detail.clone(), DetailUse::default())))
        }));
    }
    Ok(systems)
}

/// The names of [`trained`] for any style of this configuration, with detail or without.
#[must_use]
pub fn names(config: &StyleConfig, has_detail: bool) -> Vec<String> {
    let starts = uses(config).into_iter().map(|(name, _)| name);
    let ends = |name: &str| {
        let corrected = corrects(config).then(|| format!("{name}{HARMONIC}"));
        std::iter::once(name.to_owned()).chain(corrected).collect::<Vec<_>>()
    };
    let mut names: Vec<String> = starts.clone().flat_map(ends).collect();
    names.extend(starts.filter(|_| has_detail).map(|name| format!("{name}{DETAIL}")));
    names
}

/// Every interpolator.
#[must_use]
pub fn interpolators() -> Vec<Named> {
    classical::all().into_iter().map(|(name, system)| (name.to_owned(), system)).collect()
}

const HARMONIC: &str = "+harmonic";
const DETAIL: &str = "+detail";

/// The ways to use a style of this configuration that do not start from another one.
fn uses(config: &StyleConfig) -> Vec<(&'static str, GenerationConfig)> {
    let own = &config.generation;
    match config.model.frame {
        HeightFrame::Anchored => vec![("gnn", own.clone())],
        HeightFrame::Absolute => {
            let with = |fine_tuning| GenerationConfig { fine_tuning, correction: None, ..own.clone() };
            vec![("gnn-aligned", with(None)), ("gnn-tuned", with(Some(own.fine_tuning.unwrap_or_default())))]
        }
    }
}

/// Whether the uses of a style are also scored with the harmonic correction: those that end without one.
fn corrects(config: &StyleConfig) -> bool {
    config.model.frame == HeightFrame::Absolute
}

fn harmonic(start: Arc<dyn SketchToTerrain>) -> Finishing {
    let finish = |coarse: &Grid<f32>, lines: &LineMap, _: Seed| {
        Correction::new(CorrectionKind::Harmonic, lines)?.apply(coarse)
    };
    Finishing { start, finish: Box::new(finish) }
}

/// The systems whose names stand in `wanted`, separated by commas; `all` for every one. A name that ends at a `-` or `+` of
/// longer ones takes them all: `gnn` is every way to use the style.
///
/// # Errors
/// When a name fits no system.
pub fn select(style: &Style, wanted: &str) -> Result<Vec<Named>> {
    let systems = all(style)?;
    if wanted == "all" {
        return Ok(systems);
    }
    let fits = |name: &str, wanted: &str| {
        name == wanted || name.strip_prefix(wanted).is_some_and(|rest| rest.starts_with(['-', '+']))
    };
    let wanted: Vec<&str> = wanted.split(',').map(str::trim).collect();
    for w in &wanted {
        if !systems.iter().any(|(name, _)| fits(name, w)) {
            let names: Vec<&str> = systems.iter().map(|(name, _)| name.as_str()).collect();
            return Err(Error::value("system", w, format!("allowed: all, {}", names.join(", "))));
        }
    }
    Ok(systems.into_iter().filter(|(name, _)| wanted.iter().any(|w| fits(name, w))).collect())
}
