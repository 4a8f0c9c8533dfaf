//! Every system by name: the only file that knows them all.

use super::classical;
use super::pipeline::{Detailed, detail_of};
use super::region_gnn::config::HeightFrame;
use super::region_gnn::{FineTuning, GenerationConfig, RegionGnnSystem, Style, StyleConfig};
use super::singan::DetailUse;
use super::task::SketchToTerrain;
use crate::error::{Error, Result};
use crate::interpolation::CorrectionKind;
use std::sync::Arc;

/// A system and its name.
pub type Named = (String, Box<dyn SketchToTerrain>);

/// Every way to use a style, then every interpolator.
///
/// A style with detail has every system twice, the second one with it (`+detail`). An anchored style is `gnn` (its own configuration). A style of the paper is `gnn-aligned` and, with fine-tuned
/// embeddings, `gnn-tuned`, each also with the harmonic correction (`+harmonic`).
///
/// # Errors
/// When the style's detail contradicts itself.
pub fn all(style: &Style) -> Result<Vec<Named>> {
    let mut systems = trained(style);
    systems.extend(detailed(style)?);
    systems.extend(interpolators());
    Ok(systems)
}

/// Every way to use a style that has detail, with it; none when it has none.
///
/// # Errors
/// When the style's detail contradicts itself.
pub fn detailed(style: &Style) -> Result<Vec<Named>> {
    let Some(detail) = detail_of(style)?.map(Arc::new) else { return Ok(Vec::new()) };
    let with = |(name, coarse): Named| -> Named {
        let system = Detailed { coarse, detail: detail.clone(), how: DetailUse::default() };
        (format!("{name}+detail"), Box::new(system))
    };
    // The correction that ends the detail is also that of the coarse system.
    Ok(trained(style).into_iter().filter(|(name, _)| !name.ends_with("+harmonic")).map(with).collect())
}

/// Every way to use a style.
#[must_use]
pub fn trained(style: &Style) -> Vec<Named> {
    uses(&style.info.config)
        .into_iter()
        .map(|(name, generation)| -> Named {
            (name, Box::new(RegionGnnSystem { model: style.model.clone(), generation }))
        })
        .collect()
}

/// The names of [`trained`] for any style of this configuration.
#[must_use]
pub fn names(config: &StyleConfig) -> Vec<String> {
    uses(config).into_iter().map(|(name, _)| name).collect()
}

/// Every interpolator.
#[must_use]
pub fn interpolators() -> Vec<Named> {
    classical::all().into_iter().map(|(name, system)| (name.to_owned(), system)).collect()
}

fn uses(config: &StyleConfig) -> Vec<(String, GenerationConfig)> {
    let own = &config.generation;
    match config.model.frame {
        HeightFrame::Anchored => vec![("gnn".to_owned(), own.clone())],
        HeightFrame::Absolute => {
            let tuned = own.fine_tuning.unwrap_or_default();
            [("gnn-aligned", None), ("gnn-tuned", Some(tuned))]
                .into_iter()
                .flat_map(|(name, fine_tuning): (&str, Option<FineTuning>)| {
                    let with = |correction| GenerationConfig { fine_tuning, correction, ..own.clone() };
                    [
                        (name.to_owned(), with(None)),
                        (format!("{name}+harmonic"), with(Some(CorrectionKind::Harmonic))),
                    ]
                })
                .collect()
        }
    }
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
