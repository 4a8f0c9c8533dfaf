//! What an experiment does with its styles: a [`Protocol`], one file each below `protocols/`.
//!
//! A protocol says which scores it gives, what its file may hold, how one patch is measured, and what its scores say. What it
//! leaves open is that of the plainest one: every test patch is rebuilt from its lines by every system.

use super::measure::{Measured, Task, rebuild};
use super::pictures::{Gallery, patch_sheets};
use super::protocols::{
    ablation, cost, disentanglement, drawings, exchange, exemplar, fit, invariance, neighbours, sparse,
};
use super::record::{Record, TrainingRow};
use super::resolve::{Area, Resolved};
use super::results::Results;
use super::rows::Timed;
use super::run::Plan;
use super::spec::{ExperimentSpec, SketchSpec};
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::metrics::Scores;
use crate::viz::plot::Svg;
use crate::viz::report::Table;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Every protocol.
const ALL: [&dyn Protocol; 10] = [
    &neighbours::Neighbours,
    &fit::Fit,
    &sparse::Sparse,
    &ablation::Ablation,
    &exemplar::Exemplar,
    &exchange::Exchange,
    &drawings::Drawings,
    &invariance::Invariance,
    &disentanglement::Disentanglement,
    &cost::Cost,
];

/// What the sketches of a file are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SketchSource {
    /// Lines of each test patch.
    Patches,
    /// Lines of each test patch, moved.
    MovedPatches,
    /// Bundled drawings.
    Drawings,
    /// The file names none: they follow from the areas.
    Areas,
}

/// What the results say.
#[derive(Clone)]
pub(super) enum Finding {
    Words(String),
    Table(Table),
}

/// A plot of the report: the name of its file, the drawing, its caption.
pub(super) type Plot = (String, Svg, String);

/// What is known when all rows are scored.
pub(super) struct Finished<'a> {
    pub(super) plan: &'a Plan<'a>,
    pub(super) record: &'a Record,
    pub(super) trainings: &'a [TrainingRow],
    /// Largest memory of the process up to the end of the trainings, bytes.
    pub(super) peak_of_training: Option<u64>,
    pub(super) rows: &'a [Timed],
}

/// What is done with the trained styles.
pub(super) trait Protocol: Sync {
    /// Its name in files.
    fn name(&self) -> &'static str;

    /// The columns of `scores.csv`.
    fn columns(&self) -> Vec<&'static str> {
        Scores::names().to_vec()
    }

    /// What the file's sketches are made of.
    fn sketch_source(&self) -> SketchSource {
        SketchSource::Patches
    }

    /// Whether it tests on patches beside the exemplar.
    fn has_test_patches(&self) -> bool {
        true
    }

    /// Whether each way to use a style is a system of its own.
    fn compares_uses(&self) -> bool {
        true
    }

    /// Whether interpolators are given other lines for every seed.
    fn draws_lines(&self) -> bool {
        false
    }

    /// The checks of the file beyond those of every experiment.
    fn validate(&self, _: &ExperimentSpec) -> Result<()> {
        Ok(())
    }

    /// The sketches of a file that names none.
    fn sketches(&self, _: &ExperimentSpec) -> Vec<SketchSpec> {
        vec![SketchSpec { name: "dense".to_owned(), ..SketchSpec::default() }]
    }

    /// The north-west cells of what is measured with a sketch and the styles of an area.
    fn cells(&self, _: &Resolved, area: &Area, _: &SketchSpec) -> Vec<Cell> {
        area.patches.clone()
    }

    /// Terrain and scores of every system. What fails for one system is an error in its entry.
    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        Ok(rebuild(task, &task.area.dem, false)?.0)
    }

    /// What is measured before any training.
    fn before_training(&self, _: &Resolved, _: &Record) -> Result<()> {
        Ok(())
    }

    /// Tables that the record holds beside the scores.
    fn after_scoring(&self, _: &Finished<'_>) -> Result<()> {
        Ok(())
    }

    /// Pictures of the record.
    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        patch_sheets(gallery)
    }

    /// What the pictures show.
    fn about_pictures(&self) -> &'static str {
        "For each area, the patches with the lowest and the highest margin over the interpolators in turn; first seed."
    }

    /// What the scores say, for documents, the report and the terminal.
    fn findings(&self, results: &Results<'_>, record: &Record) -> Result<Vec<Finding>>;

    /// Plots beside those of every report.
    fn plots(&self, _: &Results<'_>, _: &Record) -> Result<Vec<Plot>> {
        Ok(Vec::new())
    }
}

/// The protocol of an experiment, by its name in files.
#[derive(Clone, Copy)]
pub struct Kind(&'static dyn Protocol);

impl Kind {
    /// Every protocol.
    pub fn all() -> impl Iterator<Item = Self> {
        ALL.into_iter().map(Self)
    }

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    pub(super) fn protocol(self) -> &'static dyn Protocol {
        self.0
    }
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::all().find(|kind| kind.name() == name).ok_or_else(|| {
            let known: Vec<&str> = Self::all().map(Self::name).collect();
            serde::de::Error::custom(format!("kind is {name:?}; allowed: {}", known.join(", ")))
        })
    }
}

/// An error about a key that the protocol does not read.
pub(super) fn not_for(kind: Kind, key: impl Into<String>, found: impl std::fmt::Display, why: &str) -> Error {
    Error::value(key, found, format!("not for kind = {:?}: {why}", kind.name()))
}
