//! The protocols of experiments, one file each, by name; and what of an experiment follows from its protocol.

mod ablation;
mod cost;
mod disentanglement;
mod drawings;
mod exchange;
mod exemplar;
mod fit;
mod general;
mod invariance;
mod losses;
mod neighbours;
mod sparse;
mod strokes;

use super::protocol::Protocol;
use super::spec::{ExperimentSpec, Kind, SketchSpec, StyleSpec};
use crate::error::Result;

/// The protocol of a name.
pub(super) fn of(kind: Kind) -> &'static dyn Protocol {
    match kind {
        Kind::Neighbours => &neighbours::Neighbours,
        Kind::Fit => &fit::Fit,
        Kind::Sparse => &sparse::Sparse,
        Kind::Ablation => &ablation::Ablation,
        Kind::Exemplar => &exemplar::Exemplar,
        Kind::Exchange => &exchange::Exchange,
        Kind::Drawings => &drawings::Drawings,
        Kind::Invariance => &invariance::Invariance,
        Kind::Disentanglement => &disentanglement::Disentanglement,
        Kind::Cost => &cost::Cost,
        Kind::Strokes => &strokes::Strokes,
    }
}

impl ExperimentSpec {
    /// The columns of scores that this experiment gives.
    #[must_use]
    pub(crate) fn columns(&self) -> Vec<&'static str> {
        of(self.kind).columns()
    }

    /// The names of all systems, those of the styles first, as they stand in the scores.
    ///
    /// # Errors
    /// When a style's configuration or a system's name is not allowed.
    pub(crate) fn systems(&self) -> Result<Vec<String>> {
        let mut systems = Vec::new();
        for style in &self.style {
            systems.extend(self.labels(style)?);
        }
        systems.extend(self.interpolator_names()?);
        Ok(systems)
    }

    /// The names of a style's systems in the scores.
    pub(in crate::experiment) fn labels(&self, style: &StyleSpec) -> Result<Vec<String>> {
        let uses = self.uses(style)?;
        let all_uses = of(self.kind).compares_uses();
        Ok(if all_uses {
            uses.iter().map(|name| style.label(name)).collect()
        } else {
            vec![style.name.clone()]
        })
    }

    /// The sketches; the protocol's own when the file names none.
    #[must_use]
    pub(crate) fn sketches(&self) -> Vec<SketchSpec> {
        if self.sketch.is_empty() { of(self.kind).sketches(self) } else { self.sketch.clone() }
    }
}
