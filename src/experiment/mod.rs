//! How systems are compared: patches of a DEM, a sketch from each, every system's terrain, scores; and experiments, which
//! are such comparisons as data files with a record.
//!
//! [`ExperimentSpec`] -> [`resolve`](resolve::resolve) -> [`Resolved`](resolve::Resolved) -> [`run`](run::run) -> a record
//! folder -> [`report`](report::write). The format of the file and of the record is in `docs/experiments.md`.

pub mod bounds;
mod by_kind;
mod evaluation;
pub mod markdown;
mod extras;
pub mod findings;
mod fit;
mod gallery;
mod measure;
mod moved;
mod patches;
mod pictures;
pub mod record;
pub mod report;
pub mod resolve;
pub mod rows;
pub mod run;
pub mod spec;
mod states;
pub mod summary;
mod table;
mod validate;

pub use evaluation::{Evaluation, EvaluationConfig, Rebuilt, Row, evaluate};
pub use patches::{PATCH, choose_exemplar, patch_cells};
pub use spec::ExperimentSpec;
pub use table::{Line, aggregate, to_csv};
