//! Ways out for water in terrain that is made with a style.

use super::Style;
use crate::control::Stop;
use crate::error::Result;
use crate::grid::Grid;
use crate::landscape::{BreachConfig, Breached, LandscapeFit, breach};
use crate::sketch::LineMap;
use crate::systems::landscape::LandscapeSystem;

/// Where water is given ways out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Drain {
    /// Where rivers made the exemplar.
    #[default]
    LikeExemplar,
    /// Whatever made the exemplar.
    Always,
    /// Nowhere.
    Never,
}

impl Style {
    /// The laws of the exemplar's landscape; none where the style keeps no terrain, or too little of it.
    pub(crate) fn landscape(&self) -> Option<LandscapeFit> {
        if let Some(system) = self.system::<LandscapeSystem>() {
            return Some(system.0.fit.clone());
        }
        let terrain = self.terrain.as_ref()?;
        LandscapeFit::of(terrain.heights(), terrain.valid(), terrain.cell_size().mean()).ok()
    }

    /// `terrain` (metres) with its dams cut until no more of it lies in ponds than of the exemplar, or than .3 % where that is less. Heights
    /// of `lines` are kept to the bit. None where it is not to be drained.
    ///
    /// # Errors
    /// When the shapes differ, a height is not finite, or it is stopped.
    pub(crate) fn drained(
        &self,
        terrain: &Grid<f32>,
        lines: &LineMap,
        drain: Drain,
        stop: &Stop,
    ) -> Result<Option<Breached>> {
        let fit = self.landscape();
        let is_wanted = match drain {
            Drain::LikeExemplar => fit.as_ref().is_some_and(LandscapeFit::is_fluvial),
            Drain::Always => true,
            Drain::Never => false,
        };
        // An exemplar full of closed hollows is no measure of what was asked for all the same.
        let config = match fit.filter(LandscapeFit::is_fluvial) {
            Some(fit) => BreachConfig::like(&fit),
            None => BreachConfig::default(),
        };
        is_wanted.then(|| breach(terrain, lines, &config, stop)).transpose()
    }
}
