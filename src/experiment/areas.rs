//! The areas of an experiment in memory.

use super::spec::ExperimentSpec;
use crate::dem::Dem;
use crate::dem::io::Description;
pub use crate::dem::{Loaded, Terrain};
use crate::grid::Cell;
use crate::style::Source;
use std::path::PathBuf;

/// An area in memory.
#[derive(Clone, Debug)]
pub struct Area {
    /// Its name.
    pub name: String,
    /// Its file; the name of a bundled tile.
    pub file: PathBuf,
    /// What was assumed about it.
    pub description: Description,
    /// All of it.
    pub dem: Dem,
    /// The exemplar.
    pub source: Source,
    /// North-west cells of the test patches; none for `fit`.
    pub patches: Vec<Cell>,
}

/// An experiment ready to be run.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// With every configuration, exemplar, patch and fingerprint written out; resolving it again changes nothing.
    pub spec: ExperimentSpec,
    /// Its areas, in the order of the file.
    pub areas: Vec<Area>,
}
