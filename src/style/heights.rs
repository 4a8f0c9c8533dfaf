//! What heights along ridges and valleys are like in a style.

use super::Style;
use crate::dem::{CellSize, Dem, Normalization};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::interpolation::height_model::HeightModel;
use crate::systems::gpnn::PatchDetail;
use std::any::Any;

impl Style {
    /// The model of heights of the exemplar, for strokes that have none: from the terrain that the style keeps, or that its
    /// patches keep. `range`: the elevations that stand for the exemplar's lowest and highest height.
    ///
    /// # Errors
    /// When the style keeps no terrain, or it has no ridges and valleys.
    pub fn height_model(&self, range: Normalization) -> Result<HeightModel> {
        let own = self.origin.normalization;
        let model = match (&self.terrain, self.patches()) {
            (Some(terrain), _) => HeightModel::fit(terrain)?,
            (None, Some(patches)) => {
                let (info, arrays) = patches.parts();
                let unit = arrays.into_iter().find(|(name, _)| name == "truth").map(|(_, unit)| unit);
                let unit = Grid::from_vec(info.rows, info.cols, unit.unwrap_or_default())?;
                let heights = own.denormalize(&unit);
                // Only cells count.
                HeightModel::fit(&Dem::new(heights, CellSize::square(1.0)?)?)?
            }
            (None, None) => {
                let allowed = "strokes without heights take them from the style's terrain: train it with detail from patches \
                               (--detail-model patches), or give every stroke heights";
                return Err(Error::value("terrain of the style", "not kept", allowed));
            }
        };
        Ok(model.in_range(own, range))
    }

    fn patches(&self) -> Option<&PatchDetail> {
        let any: &dyn Any = &**self.detail.as_ref()?;
        any.downcast_ref()
    }
}
