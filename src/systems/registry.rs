//! Every system by name: the only file that knows them all.

use super::classical;
use super::pipeline::{Detailed, detail_of};
use super::region_gnn::config::HeightFrame;
use super::region_gnn::{FineTuning, GenerationConfig, RegionGnnSystem, Style};
use super::singan::DetailUse;
use super::task::SketchToTerrain;
use crate::error::{Error, Result};
use crate::interpolation::CorrectionKind;
use std::sync::Arc;

/// A system and its name.
pub type Named = (String, Box<dyn SketchToTerrain>);

/// Every way to use a style, then every interpolator.
///
/// An anchored style is `gnn` (its own configuration). A style of the paper is `gnn-aligned` and, with fine-tuned
/// embeddings, `gnn-tuned`, each also with the harmonic correction (`+harmonic`). A style with detail has each of them with
/// detail too (`+detail`).
///
/// # Errors
/// When the style's detail model contradicts its description.
pub fn all(style: &Style) -> Result<Vec<Named>> {
    let own = &style.info.config.generation;
    let system = |name: &str, generation: GenerationConfig| -> Named {
        (name.to_owned(), Box::new(RegionGnnSystem { model: style.model.clone(), generation }))
    };
    let systems_of_style = || match style.model.config().frame {
        HeightFrame::Anchored => vec![system("gnn", own.clone())],
        HeightFrame::Absolute => {
            let tuned = own.fine_tuning.unwrap_or_default();
            [("gnn-aligned", None), ("gnn-tuned", Some(tuned))]
                .into_iter()
                .flat_map(|(name, fine_tuning): (&str, Option<FineTuning>)| {
                    let with = |correction| GenerationConfig { fine_tuning, correction, ..own.clone() };
                    [
                        system(name, with(None)),
                        system(&format!("{name}+harmonic"), with(Some(CorrectionKind::Harmonic))),
                    ]
                })
                .collect()
        }
    };
    let mut systems: Vec<Named> = systems_of_style();
    if let Some(detail) = detail_of(style)?.map(Arc::new) {
        systems.extend(systems_of_style().into_iter().map(|(name, coarse)| -> Named {
            let detailed = Detailed { coarse, detail: detail.clone(), how: DetailUse::default() };
            (format!("{name}+detail"), Box::new(detailed))
        }));
    }
    systems.extend(classical::all().into_iter().map(|(name, system)| (name.to_owned(), system)));
    Ok(systems)
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
