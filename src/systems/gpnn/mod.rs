//! Detail without training: every small patch of a coarse map gets what the exemplar has where it looks alike (GPNN).
//!
//! Granot, Feinstein, Shocher, Bagon, Irani: *Drop the GAN: In Defense of Patches Nearest Neighbors as Single Image Generative
//! Models*, CVPR 2022. The exemplar is there twice: as lines show it (the natural-neighbour surface through its own lines), and
//! as it is. Patches of a map are compared with the first and get the difference of both; [`PatchDetail`] is the exemplar,
//! `synthesis` goes from coarse to fine, and `sample` does so from noise; `patches` says what is compared, `search` finds the best,
//! `clusters` those that are worth a search.

mod clusters;
mod patches;
mod sample;
mod search;
mod synthesis;

#[cfg(test)]
mod tests;

use crate::arrays::Arrays;
use crate::checked::{Checked, Settings};
use crate::control::{Control, Progress, Stage, Stop};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Window, gaussian};
use crate::metrics::mean_square_slope;
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};
use crate::systems::task::{
    Account, DetailModel, DetailUse, Exemplar, Part, Residual, SampleUse, combined, gain_of, gap,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;
use synthesis::{Pair, Query};

/// Smallest side of an exemplar, cells.
const SMALLEST: usize = 32;
/// Largest number of its cells: time and memory of a search grow with them.
const LARGEST: usize = 256 * 256;
/// Up to so many times the exemplar's own gaps between lines a map's lines are as dense; where they are sparser, the smooth
/// exemplar is the one without forms below the gaps.
const AS_DENSE: f64 = 2.0;
/// Forms larger than this many times the size where detail begins are taken out of what is added, as the standard deviation
/// of a Gaussian: they are the map's, and cost likeness without making it rougher.
const LARGE_FORMS: f64 = 1.25;

/// What a style file says of detail from patches beside the exemplar itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PatchInfo {
    /// Rows of the exemplar.
    pub(crate) rows: usize,
    /// Columns of the exemplar.
    pub(crate) cols: usize,
    /// What was measured when it was taken.
    pub(crate) record: PatchRecord,
}

/// What can be set: nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PatchConfig {}

impl Settings for PatchConfig {
    fn validate(&self) -> Result<()> {
        Ok(())
    }
}

/// What was measured when an exemplar was taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PatchRecord {
    /// Seconds that the calibration took.
    pub(crate) seconds: f64,
    /// Share of what the patches say that suits the exemplar best; 1 before [`PatchDetail::calibrate`].
    pub(crate) gain: f32,
}

/// An exemplar whose patches are the detail.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PatchDetail {
    /// In the unit interval.
    truth: Grid<f32>,
    /// The surface through its lines.
    twin: Grid<f32>,
    /// 1 on ridges, -1 in valleys, 0 elsewhere.
    marks: Grid<f32>,
    /// Mean distance of a cell to the nearest line, cells.
    gap: f64,
    record: PatchRecord,
}

impl PatchDetail {
    /// Takes the patches of `truth`, whose `lines` give the coarse map `twin`. All of one shape, in one unit.
    ///
    /// # Errors
    /// When the exemplar has a side below 32 cells or more than 65,536 cells, is level or not finite, when there is no line, or
    /// shapes differ.
    pub(crate) fn new(truth: Grid<f32>, twin: Grid<f32>, lines: &LineMap) -> Result<Self> {
        if lines.line_count() == 0 {
            return Err(Error::value(
                "number of line cells",
                0,
                "detail from patches needs the exemplar's lines",
            ));
        }
        Self::of(truth, twin, marks(lines), PatchRecord { seconds: 0.0, gain: 1.0 })
    }

    fn of(truth: Grid<f32>, twin: Grid<f32>, marks: Grid<f32>, record: PatchRecord) -> Result<Self> {
        let (rows, cols) = truth.shape();
        check_shape(rows, cols)?;
        for (name, map) in [("twin of the exemplar", &twin), ("lines of the exemplar", &marks)] {
            if map.shape() != (rows, cols) {
                let allowed = format!("the exemplar is {:?}", (rows, cols));
                return Err(Error::value(name, format!("{:?}", map.shape()), allowed));
            }
        }
        for map in [&truth, &twin, &marks] {
            if let Some(z) = map.as_slice().iter().find(|z| !z.is_finite()) {
                return Err(Error::value("height of the exemplar", z, "allowed: finite"));
            }
        }
        if !marks.as_slice().iter().any(|m| *m != 0.0) {
            return Err(Error::value("number of line cells", 0, "the exemplar of detail has lines"));
        }
        if mean_square_slope(&truth) <= 0.0 || mean_square_slope(&twin) <= 0.0 {
            return Err(Error::value("relief of the exemplar", 0, "level ground has no detail"));
        }
        if !(0.0..=10.0).contains(&record.gain) {
            return Err(Error::value("gain of the detail", record.gain, "allowed: 0 to 10"));
        }
        let gap = gap(&lines_of(&marks));
        Ok(Self { truth, twin, marks, gap, record })
    }

    /// (rows, columns) of the exemplar.
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        self.truth.shape()
    }

    /// Finds the strength with which `coarse`, a coarse map of the exemplar, comes nearest to it in slopes, curvatures and
    /// spectrum, and takes it for 1 from now on. Each half of the map is searched in the other half of the exemplar: in its own
    /// every patch would find itself. `lines` are those of [`new`](Self::new), with heights; `coarse` passes through them.
    ///
    /// # Errors
    /// When shapes differ or the exemplar is too narrow.
    pub(crate) fn calibrate(
        &mut self,
        coarse: &Grid<f32>,
        lines: &LineMap,
        seed: Seed,
        stop: &Stop,
    ) -> Result<()> {
        let started = Instant::now();
        let how = DetailUse::default();
        let (rows, cols) = self.shape();
        let middle = cols / 2;
        let from = |first: usize, width: usize| -> Result<Option<Residual>> {
            let part = |map: &Grid<f32>| map.crop(Window::new(Cell::new(0, first), rows, width));
            let half = Self {
                truth: part(&self.truth)?,
                twin: part(&self.twin)?,
                marks: part(&self.marks)?,
                ..self.clone()
            };
            half.residual(coarse, Some(lines), self.gap, &how, seed, stop)
        };
        let (west, east) = (from(0, middle)?, from(middle, cols - middle)?);
        if let (Some(west), Some(mut crossed)) = (west, east) {
            for row in 0..rows {
                for col in middle..cols {
                    crossed.added[Cell::new(row, col)] = west.added[Cell::new(row, col)];
                }
            }
            self.record.gain = gain_of(&crossed, coarse, lines, &self.truth)?;
        }
        self.record.seconds = started.elapsed().as_secs_f64();
        Ok(())
    }

    /// The description and the named tensors, to be stored in any container.
    #[must_use]
    pub(crate) fn parts(&self) -> (PatchInfo, Vec<(String, Vec<f32>)>) {
        let (rows, cols) = self.shape();
        let info = PatchInfo { rows, cols, record: self.record };
        let tensors = [("truth", &self.truth), ("twin", &self.twin), ("marks", &self.marks)];
        (info, tensors.map(|(name, map)| (name.to_owned(), map.as_slice().to_vec())).into())
    }

    /// The model that [`parts`](Self::parts) came from; `tensor` gives the values of a name.
    ///
    /// # Errors
    /// When a tensor is missing or has another length, or as [`new`](Self::new).
    pub(crate) fn from_parts(
        info: &PatchInfo,
        mut tensor: impl FnMut(&str) -> Result<Vec<f32>>,
    ) -> Result<Self> {
        let mut map = |name: &str| Grid::from_vec(info.rows, info.cols, tensor(name)?);
        Self::of(map("truth")?, map("twin")?, map("marks")?, info.record)
    }
}

/// Whether an exemplar of this shape can be searched.
///
/// # Errors
/// When a side is below 32 cells, or there are more than 65,536.
pub(crate) fn check_shape(rows: usize, cols: usize) -> Result<()> {
    if rows.min(cols) >= SMALLEST && rows * cols <= LARGEST {
        return Ok(());
    }
    let allowed = format!("allowed: sides of at least {SMALLEST} cells, {LARGEST} cells in all");
    Err(Error::value("exemplar for detail from patches", format!("{rows}x{cols}"), allowed))
}

impl DetailModel for PatchDetail {
    /// What the exemplar has beyond its twin, or beyond itself without small forms, where it looks like the map.
    fn residual(
        &self,
        heights: &Grid<f32>,
        lines: Option<&LineMap>,
        size: f64,
        how: &DetailUse,
        seed: Seed,
        stop: &Stop,
    ) -> Result<Option<Residual>> {
        let dense = lines.filter(|_| size <= AS_DENSE * self.gap).map(marks);
        let smooth = |map: &Grid<f32>| {
            let side = |s: usize| ((s as f64 / size).round() as usize).max(2);
            resample(&resample(map, side(map.rows()), side(map.cols())), map.rows(), map.cols())
        };
        let pair = Pair {
            smooth: if dense.is_some() { self.twin.clone() } else { smooth(&self.truth) },
            truth: self.truth.clone(),
            marks: dense.as_ref().map(|_| self.marks.clone()),
        };
        let asked = Query {
            heights,
            marks: dense.as_ref(),
            size,
            match_relief: how.match_relief,
            left_out: f64::from(how.noise / (1.0 + how.noise)),
        };
        let Some(found) = synthesis::residual(&asked, &pair, seed, stop)? else { return Ok(None) };
        let widest = heights.rows().min(heights.cols()) as f64 / 8.0;
        let large = gaussian::smooth(&found, &found.map(|_| true), (LARGE_FORMS * size).min(widest));
        Ok(Some(Residual { smooth: smooth(heights), added: combined(&found, 1.0, &large, -1.0) }))
    }

    fn gain(&self) -> f32 {
        self.record.gain
    }

    /// The paper's random generation; at most 2^25 cells.
    fn sample(&self, what: &SampleUse, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        what.validate()?;
        synthesis::check_cells((what.rows, what.cols))?;
        sample::sample(&self.truth, what, seed, stop)
    }
}

impl Part for PatchDetail {
    const NAME: &'static str = "patches";
    const TAKES_BUDGET: bool = false;
    type Config = PatchConfig;
    type Description = PatchInfo;

    /// Takes the exemplar's patches. The strength is the one that suits terrain which the coarse system has not seen, or else the
    /// natural-neighbour surface.
    fn learn(exemplar: &Exemplar, _: &Checked<PatchConfig>, control: Control<'_>) -> Result<Self> {
        let (surface, lines) = exemplar.twins(1)?.swap_remove(0);
        let mut detail = Self::new(exemplar.filled()?, surface.clone(), &lines)?;
        let coarse = exemplar.unseen.as_ref().unwrap_or(&surface);
        detail.calibrate(coarse, &lines, exemplar.seed.derive("detail"), &control.stop)?;
        let (stage, seconds) = (Stage::Detail(Self::NAME), detail.record.seconds);
        (control.progress)(&Progress { stage, step: 1, steps: 1, share: 1.0, seconds, figures: &[] });
        Ok(detail)
    }

    fn config(&self) -> &PatchConfig {
        &PatchConfig {}
    }

    fn account(&self) -> Account {
        let (r, (rows, cols)) = (&self.record, self.shape());
        let text =
            format!("patches of {rows}x{cols} cells, strength {:.2} found in {:.1} s", r.gain, r.seconds);
        Account { text, seconds: r.seconds, figures: vec![("strength", r.gain.into())] }
    }

    fn save(&self) -> Result<(PatchInfo, Arrays)> {
        let (info, maps) = self.parts();
        let mut arrays = Arrays::default();
        maps.iter().for_each(|(name, values)| arrays.put_f32(name, &[values.len()], values));
        Ok((info, arrays))
    }

    fn load(info: PatchInfo, arrays: &mut Arrays, _: Option<&Arc<Dem>>) -> Result<Self> {
        Self::from_parts(&info, |name| arrays.take_f32(name))
    }
}

/// 1 on ridges, -1 in valleys, 0 elsewhere.
fn marks(lines: &LineMap) -> Grid<f32> {
    lines.kinds().map(|kind| match kind {
        Some(StrokeKind::Ridge) => 1.0,
        Some(StrokeKind::Valley) => -1.0,
        None => 0.0,
    })
}

/// Lines of [`marks`], without heights.
fn lines_of(marks: &Grid<f32>) -> LineMap {
    let mut lines = LineMap::empty(marks.rows(), marks.cols());
    for (cell, &mark) in marks.cells().filter(|(_, mark)| **mark != 0.0) {
        lines.set(cell, if mark > 0.0 { StrokeKind::Ridge } else { StrokeKind::Valley }, 0.0);
    }
    lines
}
