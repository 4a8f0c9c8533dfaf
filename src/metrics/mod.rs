//! How good terrain is: against the truth cell by cell, as a landscape, and as an answer to its sketch.
//!
//! Everything here compares an output with the truth on the same raster, both in the *unit interval of the truth's own
//! range* (0 its lowest and 1 its highest valid height), and leaves out voids. [`Scores`] gathers all of it for one patch
//! and [`Summary`] over patches.

mod contract;
mod correlation;
mod embedding;
mod error;
mod landforms;
mod lines;
mod naming;
#[cfg(test)]
mod oracle_tests;
mod patches;
mod provenance;
mod relief;
mod scores;
mod spectrum;
mod ssim;
mod summary;
mod two_sample;

pub(crate) use contract::{Contract, ContractBounds, StrokeCheck};
pub(crate) use correlation::spearman;
pub(crate) use embedding::{Labelled, separation, tsne};
pub use error::{psnr, rmse};
pub(crate) use landforms::{aspect_distance, geomorphon_distance};
pub(crate) use lines::{LineAgreement, line_agreement, stroke_height_error};
pub(crate) use naming::{decimals, lower_is_better, title};
pub use patches::{copy_audit, diversity, sliced_wasserstein};
pub(crate) use provenance::Origin;
pub use provenance::{Provenance, SourceAudit};
pub use relief::{curvature_distance, mean_slope_ratio, slope_distance};
pub(crate) use relief::{mean_square_slope, mean_valid_slope, pit_share, roughness};
pub use scores::Scores;
pub(crate) use scores::{BORDER_WIDTH, LINE_TOLERANCE};
pub use spectrum::spectrum_distance;
pub use ssim::ssim;
pub(crate) use ssim::{WINDOW, similarity, window_means, window_means_adjoint};
pub(crate) use summary::Stat;
pub use summary::Summary;
pub(crate) use two_sample::{WINDOW_FEATURES, WindowFeatures};
pub use two_sample::{told_share, window_features};

use crate::error::{Error, Result};
use crate::grid::{Grid, Mask};

/// Both rasters and the mask have one shape, something is valid, and what is valid is finite.
fn check_pair(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<()> {
    check_one("output", output, valid)?;
    check_one("truth", truth, valid)
}

/// The raster has the mask's shape, something is valid, and what is valid is finite.
fn check_one(name: &str, raster: &Grid<f32>, valid: &Mask) -> Result<()> {
    if raster.shape() != valid.shape() {
        return Err(Error::value(
            format!("{name} to score"),
            format!("{:?}", raster.shape()),
            format!("the mask of valid cells is {:?}", valid.shape()),
        ));
    }
    let mut known = raster.cells().zip(valid.as_slice()).filter(|(_, ok)| **ok).peekable();
    if known.peek().is_none() {
        return Err(Error::value("number of valid cells", 0, "a score needs at least one"));
    }
    match known.find(|((_, z), _)| !z.is_finite()) {
        Some(((cell, z), _)) => Err(Error::value(
            format!("{name} at row {}, column {}", cell.row, cell.col),
            z,
            "allowed: finite, or marked as void",
        )),
        None => Ok(()),
    }
}
