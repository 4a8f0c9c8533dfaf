//! From an exemplar to a style, stage by stage.

use super::{DetailPlan, Origin, Style, StyleConfig, SystemPlan};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::extract::ExtractionConfig;
use crate::grid::Grid;
use crate::metrics::mean_valid_slope;
use crate::seed::Seed;
use crate::systems::task::{Exemplar, Source};

/// Learns a coarse system: a style without detail.
///
/// # Errors
/// When the window is too small, level or without lines, the training diverges, a checkpoint does not fit, or the work is stopped.
pub fn learn_coarse(
    source: &Source,
    extraction: &ExtractionConfig,
    plan: &dyn SystemPlan,
    seed: Seed,
    control: Control<'_>,
) -> Result<Style> {
    let exemplar = Exemplar::new(source, extraction, seed)?;
    let system = plan.learn(&exemplar, control)?;
    let origin = Origin {
        seed,
        normalization: exemplar.normalization,
        exemplar: source.info.clone(),
        mean_slope: Some(mean_valid_slope(&exemplar.heights, source.dem.valid())?),
        extraction: extraction.clone(),
    };
    Ok(Style { origin, coarse: vec![system], detail: None, terrain: Some(source.terrain.clone()) })
}

impl Style {
    /// Whether this is what a training of `source` with this seed and configuration has made, so that its detail can be learned in
    /// a later run.
    ///
    /// # Errors
    /// Says what differs.
    pub fn continues(&self, source: &Source, config: &StyleConfig, seed: Seed) -> Result<()> {
        let allowed =
            "to resume, or to take its coarse model, exemplar, seed and configuration must be the same";
        if self.origin.exemplar.sha256 != source.info.sha256 {
            return Err(Error::value("exemplar of the style", &self.origin.exemplar.name, allowed));
        }
        if self.origin.seed != seed {
            return Err(Error::value("seed of the style", self.origin.seed.0, allowed));
        }
        if *config != self.config() {
            return Err(Error::value("configuration of the style", "another one", allowed));
        }
        Ok(())
    }
}

/// Learns detail for a style of `plan`, and puts it in. `unseen`: see [`unseen_surface`](super::unseen_surface).
///
/// # Errors
/// As [`learn_coarse`].
pub fn learn_detail(
    style: &mut Style,
    source: &Source,
    plan: &dyn SystemPlan,
    unseen: Option<Grid<f32>>,
    detail: &dyn DetailPlan,
    control: Control<'_>,
) -> Result<()> {
    let exemplar = Exemplar::new(source, &style.origin.extraction, style.origin.seed)?;
    let exemplar = Exemplar { extractions: plan.extractions(), unseen, ..exemplar };
    style.detail = Some(detail.learn(&exemplar, control)?);
    Ok(())
}
