//! The generators as a part of a style.

use super::config::{DetailConfig, NAME};
use super::detail::{Detail, DetailInfo};
use super::train::train;
use crate::arrays::Arrays;
use crate::checked::Checked;
use crate::control::Control;
use crate::dem::Dem;
use crate::error::Result;
use crate::grid::Grid;
use crate::systems::task::{Account, Exemplar, Part};
use std::sync::Arc;

impl Part for Detail {
    const NAME: &'static str = NAME;
    type Config = DetailConfig;
    type Description = DetailInfo;

    /// The coarse twins of the training are natural-neighbour surfaces through the exemplar's lines, in the variants that the
    /// coarse system learns from. The strength is the one that suits terrain which that has not seen, or else the first twin.
    fn learn(exemplar: &Exemplar, config: &Checked<DetailConfig>, control: Control<'_>) -> Result<Self> {
        let stop = control.stop.clone();
        let (truth, twins) = (exemplar.filled()?, exemplar.twins(exemplar.extractions)?);
        let surfaces: Vec<Grid<f32>> = twins.iter().map(|(surface, _)| surface.clone()).collect();
        let mut detail = train(&truth, &surfaces, config, exemplar.seed.derive("detail"), control)?;
        let (surface, lines) = &twins[0];
        detail.calibrate(exemplar.unseen.as_ref().unwrap_or(surface), lines, &truth, &stop)?;
        Ok(detail)
    }

    fn config(&self) -> &DetailConfig {
        self.settings()
    }

    fn account(&self) -> Account {
        let r = self.record();
        let (scales, steps) = (r.steps.len(), r.steps.iter().sum::<usize>());
        let text = format!(
            "{scales} scales, {steps} steps in {:.1} s; exemplar rebuilt with PSNR {:.2} dB",
            r.seconds, r.psnr
        );
        Account { text, seconds: r.seconds, figures: vec![("PSNR", r.psnr), ("strength", r.gain.into())] }
    }

    fn save(&self) -> Result<(DetailInfo, Arrays)> {
        let (info, weights) = self.parts();
        let mut arrays = Arrays::default();
        weights.iter().for_each(|(name, values)| arrays.put_f32(name, &[values.len()], values));
        Ok((info, arrays))
    }

    fn load(info: DetailInfo, arrays: &mut Arrays, _: Option<&Arc<Dem>>) -> Result<Self> {
        Self::from_parts(info, |name| arrays.take_f32(name))
    }
}
