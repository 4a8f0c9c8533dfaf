//! How systems are compared: patches of a DEM, a sketch from each, every system's terrain, scores.

mod evaluation;
mod patches;
mod table;

pub use evaluation::{Evaluation, EvaluationConfig, Rebuilt, Row, evaluate};
pub use patches::{PATCH, choose_exemplar, patch_cells};
pub use table::{Line, aggregate, to_csv};
