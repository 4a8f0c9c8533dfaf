//! Systems against terrain that they have not seen: patches of a DEM, the lines of each, every system's terrain, scores.
//!
//! A DEM and systems by name -> [`evaluate`] -> an [`Evaluation`] -> [`aggregate`]. The protocol is that of Liu & Benes 2025, 7.2.

mod rebuild;
mod strokes;
mod summary;

pub use crate::style::{PATCH, choose_exemplar, patch_cells};
pub use rebuild::{Evaluation, EvaluationConfig, PatchScore, Rebuilt, evaluate};
pub(crate) use rebuild::{Patch, evaluate_reduced, patch_seed};
pub(crate) use strokes::{STROKE_SCORES, StrokeCase};
pub(crate) use summary::to_csv;
pub use summary::{SystemSummary, aggregate};
