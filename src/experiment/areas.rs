//! The areas of an experiment in memory.

use super::spec::ExperimentSpec;
use crate::dem::Dem;
use crate::dem::io::Description;
pub(crate) use crate::dem::{Loaded, Terrain};
use crate::grid::Cell;
use crate::style::Source;
use std::path::PathBuf;

/// An area in memory.
#[derive(Clone, Debug)]
pub(crate) struct Area {
    /// Its name.
    pub(crate) name: String,
    /// Its file; the name of a bundled tile.
    pub(crate) file: PathBuf,
    /// What was assumed about it.
    pub(crate) description: Description,
    /// All of it.
    pub(crate) dem: Dem,
    /// The exemplar.
    pub(crate) source: Source,
    /// North-west cells of the test patches; none for `fit`.
    pub(crate) patches: Vec<Cell>,
}

/// An experiment ready to be run.
#[derive(Clone, Debug)]
pub(crate) struct Resolved {
    /// With every configuration, exemplar, patch and fingerprint written out; resolving it again changes nothing.
    pub(crate) spec: ExperimentSpec,
    /// Its areas, in the order of the file.
    pub(crate) areas: Vec<Area>,
}
