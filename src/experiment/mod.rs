//! Experiments: comparisons of systems as data files, with a record from which every published number is taken.
//!
//! [`ExperimentSpec`] -> [`resolve`](resolve::resolve) -> [`Resolved`](areas::Resolved) -> [`run`](run::run) -> a record
//! folder -> [`report`](report::write). What is done with the styles is a protocol, one file each below `protocols/`. The
//! format of the file and of the record is in `docs/experiments.md`.

pub mod areas;
pub mod bounds;
pub mod documents;
pub mod events;
mod measure;
mod pictures;
mod protocol;
mod protocols;
pub mod record;
pub mod report;
pub mod resolve;
pub mod results;
pub mod rows;
pub mod run;
pub mod spec;
mod styles;
#[cfg(test)]
mod tests;
mod validate;

pub use spec::{ExperimentSpec, Kind};
