//! Experiments: comparisons of systems as data files, with a record from which every published number is taken.
//!
//! [`ExperimentSpec`] -> [`resolve`](resolve::resolve) -> [`Resolved`](areas::Resolved) -> [`run`](run::run) -> a record
//! folder -> [`report`](report::write). What is done with the styles is a protocol, one file each below `protocols/`. The
//! format of the file and of the record is in `docs/experiments.md`.

pub(crate) mod areas;
pub(crate) mod bounds;
pub(crate) mod documents;
pub(crate) mod events;
mod measure;
mod pictures;
mod protocol;
mod protocols;
pub(crate) mod record;
pub(crate) mod report;
pub(crate) mod resolve;
pub(crate) mod results;
pub(crate) mod rows;
pub(crate) mod run;
pub(crate) mod spec;
mod styles;
#[cfg(test)]
mod tests;
mod validate;

pub(crate) use spec::ExperimentSpec;
#[cfg(test)]
pub(crate) use spec::Kind;
