//! The ways to use a style, by name: each coarse system as it is, corrected where it ends beside its lines, and with detail.

use super::{LearnedDetail, Named, Registry, Style, SystemPlan};
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::interpolation::{Correction, CorrectionKind};
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::systems::task::{DetailUse, Finishing, SketchToTerrain, Use};
use std::sync::Arc;

const HARMONIC: &str = "+harmonic";
const DETAIL: &str = "+detail";

impl Style {
    /// Every way to use the style. Systems that finish another one share it.
    ///
    /// A system's usual way has its name; others have more behind it. Those that end beside their lines come also with the harmonic
    /// correction (`+harmonic`), and a style with detail has each once more with it (`+detail`, which ends with a correction of
    /// its own), but for those whose terrain is complete.
    #[must_use]
    pub fn uses(&self) -> Vec<Named> {
        let mut all = Vec::new();
        for system in &self.coarse {
            let starts: Vec<(String, Use, Arc<dyn SketchToTerrain>)> = system
                .clone()
                .all_uses()
                .into_iter()
                .map(|(way, start)| (format!("{}{}", system.name(), way.suffix), way, start))
                .collect();
            for (name, way, start) in &starts {
                all.push((name.clone(), start.clone()));
                if way.corrected {
                    all.push((format!("{name}{HARMONIC}"), Arc::new(harmonic(start.clone()))));
                }
            }
            if let Some(detail) = self.detail.as_ref().filter(|_| !system.is_complete()) {
                all.extend(starts.into_iter().map(|(name, _, start)| -> Named {
                    (format!("{name}{DETAIL}"), Arc::new(detailed(start, detail.clone())))
                }));
            }
        }
        all
    }
}

/// The names of [`Style::uses`] for a style that is not learned yet.
#[must_use]
pub(crate) fn names(plans: &[Arc<dyn SystemPlan>], has_detail: bool) -> Vec<String> {
    let mut names = Vec::new();
    for plan in plans {
        let starts: Vec<(String, Use)> =
            plan.uses().into_iter().map(|way| (format!("{}{}", plan.name(), way.suffix), way)).collect();
        for (name, way) in &starts {
            names.push(name.clone());
            names.extend(way.corrected.then(|| format!("{name}{HARMONIC}")));
        }
        names.extend(
            starts
                .iter()
                .filter(|_| has_detail && !plan.is_complete())
                .map(|(name, _)| format!("{name}{DETAIL}")),
        );
    }
    names
}

/// What stands behind the name of the system in the name of a way to use it: `-aligned+harmonic` of `gnn-aligned+harmonic`.
#[must_use]
pub(crate) fn suffix<'a>(registry: &Registry, name: &'a str) -> &'a str {
    let names = registry.system_names();
    let rests = names.iter().filter_map(|system| name.strip_prefix(system));
    rests
        .filter(|rest| rest.is_empty() || rest.starts_with(['-', '+']))
        .min_by_key(|rest| rest.len())
        .unwrap_or(name)
}

fn harmonic(start: Arc<dyn SketchToTerrain>) -> Finishing {
    let finish = |coarse: &Grid<f32>, lines: &LineMap, _: Seed, stop: &Stop| {
        Correction::new(CorrectionKind::Harmonic, lines)?.apply_until(coarse, stop)
    };
    Finishing { start, finish: Box::new(finish) }
}

/// A coarse system with detail, corrected towards the lines at the end.
fn detailed(start: Arc<dyn SketchToTerrain>, detail: Arc<dyn LearnedDetail>) -> Finishing {
    let finish = move |coarse: &Grid<f32>, lines: &LineMap, seed: Seed, stop: &Stop| -> Result<Grid<f32>> {
        detail.add(coarse, Some(lines), None, &DetailUse::default(), seed.derive("detail"), stop)
    };
    Finishing { start, finish: Box::new(finish) }
}
