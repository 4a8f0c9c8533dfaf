//! What an experiment does with its styles: a [`Protocol`], one file each below `protocols/`.
//!
//! A protocol says which scores it gives, what its file may hold, how one patch is measured, and what its scores say. What it
//! leaves open is that of the plainest one: every test patch is rebuilt from its lines by every system.

use super::areas::{Area, Resolved};
use super::measure::{Measured, Task, rebuild};
use super::pictures::{Gallery, patch_sheets};
use super::record::{Record, TrainingRow};
use super::results::Results;
use super::rows::Timed;
use super::spec::{ExperimentSpec, Kind, SketchSpec};
use super::styles::Styles;
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::metrics::Scores;
use crate::viz::plot::Svg;
use crate::viz::report::Table;

/// What the sketches of a file are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SketchSource {
    /// Lines of each test patch.
    Patches,
    /// Lines of each test patch, moved.
    MovedPatches,
    /// Bundled drawings.
    Drawings,
    /// The main lines of terrain beside the exemplar.
    MainLines,
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
    pub(super) resolved: &'a Resolved,
    pub(super) styles: &'a Styles<'a>,
    pub(super) record: &'a Record,
    pub(super) trainings: &'a [TrainingRow],
    /// Largest memory of the process up to the end of the trainings, bytes.
    pub(super) peak_of_training: Option<u64>,
    pub(super) rows: &'a [Timed],
}

/// What is done with the trained styles.
pub(super) trait Protocol: Sync {
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

    /// Scores that take all rows together.
    fn complete(&self, _: &Record, _: &mut [Timed]) -> Result<()> {
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

/// An error about a key that the protocol does not read.
pub(super) fn not_for(kind: Kind, key: impl Into<String>, found: impl std::fmt::Display, why: &str) -> Error {
    Error::value(key, found, format!("not for kind = \"{kind}\": {why}"))
}

/// An error unless `holds`.
pub(super) fn check(
    holds: bool,
    key: impl Into<String>,
    found: impl std::fmt::Display,
    allowed: &str,
) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::value(key, found, allowed)) }
}
