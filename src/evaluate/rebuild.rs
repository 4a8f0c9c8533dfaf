//! The protocol of Liu & Benes 2025, 7.2: every patch is rebuilt from the lines extracted from it.
//!
//! Each patch is put into [0, 1] by its own range, its lines are extracted from it alone, every system rebuilds it from
//! them, and the result is scored against the truth and, after another extraction, against the lines.

use crate::control::Stop;
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::extract::{self, ExtractionConfig};
use crate::grid::{Cell, Grid, Mask, Window};
use crate::metrics::{Scores, SourceAudit};
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::style::Named;
use crate::style::PATCH;
use crate::systems::task::SketchToTerrain;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// How patches become sketches.
#[derive(Clone, Debug, Default)]
pub struct EvaluationConfig {
    /// How lines are found, also for the second extraction.
    pub extraction: ExtractionConfig,
    /// Lowest Strahler order of the lines that the systems are given; the extraction's own when absent.
    pub sketch_order: Option<u8>,
    /// Fewest cells that a line given to the systems drains; the extraction's own when absent.
    pub sketch_accumulation: Option<u32>,
    /// Whether patches are kept with all that was made of them.
    pub keep: bool,
}

impl EvaluationConfig {
    fn sketch_extraction(&self) -> ExtractionConfig {
        let e = &self.extraction;
        ExtractionConfig {
            min_order: self.sketch_order.unwrap_or(e.min_order),
            min_accumulation: self.sketch_accumulation.unwrap_or(e.min_accumulation),
            ..e.clone()
        }
    }
}

/// The score of one system on one patch.
#[derive(Clone, Debug, Serialize)]
pub struct PatchScore {
    /// First row of the patch in the DEM.
    pub row: usize,
    /// First column.
    pub col: usize,
    /// The system.
    pub system: String,
    /// Seconds to rebuild the patch, alone on one of the workers; with those of the system that this one finishes.
    pub seconds: f64,
    /// Metres of the unit interval: the patch's range.
    pub relief: f64,
    /// Share of the patch's cells that carry a line.
    pub line_share: f64,
    /// How much of it is copied, of systems that say where their terrain comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sources: Option<SourceAudit>,
    /// The scores; absent when the system failed.
    pub scores: Option<Scores>,
    /// Why it failed.
    pub error: Option<String>,
}

/// A patch with everything that was made of it.
#[derive(Clone, Debug)]
pub struct Rebuilt {
    /// First cell in the DEM.
    pub origin: Cell,
    /// Metres to unit.
    pub normalization: Normalization,
    /// True heights, unit.
    pub truth: Grid<f32>,
    /// False at voids.
    pub valid: Mask,
    /// The lines that the systems were given, unit heights.
    pub lines: LineMap,
    /// Each system's terrain, unit heights as it made them; none when it failed.
    pub outputs: Vec<(String, Option<Grid<f32>>)>,
}

/// All rows of an evaluation, and the patches when they were to be kept.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// A row per patch and system, patches in order.
    pub rows: Vec<PatchScore>,
    /// The patches, empty unless kept.
    pub patches: Vec<Rebuilt>,
}

/// Takes lines away from the sketch of the patch at a cell.
pub(crate) type Reduction<'a> = &'a (dyn Fn(LineMap, Cell) -> LineMap + Sync);

/// A patch as it is shown to the systems.
pub(crate) struct Patch {
    /// Metres to unit.
    pub(crate) normalization: Normalization,
    /// True heights, unit.
    pub(crate) truth: Grid<f32>,
    /// False at voids.
    pub(crate) valid: Mask,
    /// What the systems are given, unit heights.
    pub(crate) lines: LineMap,
}

impl Patch {
    /// The patch at `origin`.
    ///
    /// # Errors
    /// When it reaches past the frame, is all void or level, or shows no line.
    pub(crate) fn new(
        dem: &Dem,
        origin: Cell,
        config: &EvaluationConfig,
        reduce: Reduction<'_>,
    ) -> Result<Self> {
        let patch = dem.crop(Window::square(origin, PATCH))?;
        let (low, high) = patch.range();
        if low == high {
            let allowed = "level ground has no range to score in";
            return Err(Error::value("relief of the patch", "0 m", allowed));
        }
        let normalization = Normalization::of(&patch);
        let (truth, valid) = (normalization.normalize(&patch), patch.valid().clone());
        let lines = extract::ridges_and_valleys(&truth, &valid, &config.sketch_extraction())?;
        let lines = reduce(lines, origin);
        if lines.line_count() == 0 {
            return Err(Error::value("number of line cells", 0, "the patch shows no ridge or valley"));
        }
        Ok(Self { normalization, truth, valid, lines })
    }

    /// Share of the cells that carry a line.
    #[must_use]
    pub(crate) fn line_share(&self) -> f64 {
        self.lines.line_count() as f64 / self.truth.len() as f64
    }

    /// Metres of the unit interval.
    #[must_use]
    pub(crate) fn relief(&self) -> f64 {
        self.normalization.high() - self.normalization.low()
    }
}

/// Rebuilds the patches at `origins` with every system. `done` is told after each patch.
///
/// A patch without relief or lines, and a system that fails, give rows with the error: never a hole.
///
/// ```
/// # fn main() -> monadnock::Result<()> {
/// use monadnock::evaluate::{EvaluationConfig, aggregate, evaluate};
/// use monadnock::{Cell, Registry, Seed, Stop, dem::bundled};
///
/// let dem = bundled::load("sierra")?;
/// let (registry, config) = (Registry::default(), EvaluationConfig::default());
/// let result = evaluate(&dem, &[Cell::new(0, 0)], registry.interpolators(), &config, Seed(1), &Stop::new(), || ())?;
/// let nearest = aggregate(&result.rows).into_iter().find(|row| row.system == "nearest");
/// let psnr = nearest.and_then(|row| row.summary.get("psnr").map(|spread| spread.mean));
/// assert!(psnr.is_some_and(|psnr| psnr > 20.0 && psnr < 40.0));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// When a patch reaches past the frame, the extraction's settings are out of range, or the work is stopped.
pub fn evaluate(
    dem: &Dem,
    origins: &[Cell],
    systems: &[Named],
    config: &EvaluationConfig,
    seed: Seed,
    stop: &Stop,
    done: impl Fn() + Sync,
) -> Result<Evaluation> {
    evaluate_reduced(dem, origins, systems, config, &|lines, _| lines, seed, stop, done)
}

/// As [`evaluate`], from fewer lines: `reduce` takes some of the patch's.
///
/// # Errors
/// As [`evaluate`].
#[allow(clippy::too_many_arguments, reason = "those of `evaluate` and one more")]
pub(crate) fn evaluate_reduced(
    dem: &Dem,
    origins: &[Cell],
    systems: &[Named],
    config: &EvaluationConfig,
    reduce: Reduction<'_>,
    seed: Seed,
    stop: &Stop,
    done: impl Fn() + Sync,
) -> Result<Evaluation> {
    config.extraction.validate()?;
    config.sketch_extraction().validate()?;
    let results: Vec<(Vec<PatchScore>, Option<Rebuilt>)> = origins
        .par_iter()
        .map(|&origin| {
            stop.check()?;
            let seed = patch_seed(seed, origin);
            let result = rebuild(dem, origin, systems, config, reduce, seed, stop);
            done();
            let (rows, patch) = result?;
            Ok((rows, patch.filter(|_| config.keep)))
        })
        .collect::<Result<_>>()?;
    let (rows, patches): (Vec<_>, Vec<_>) = results.into_iter().unzip();
    Ok(Evaluation { rows: rows.concat(), patches: patches.into_iter().flatten().collect() })
}

/// The seed of the patch at `origin`.
#[must_use]
pub(crate) fn patch_seed(seed: Seed, origin: Cell) -> Seed {
    seed.derive(&format!("patch {},{}", origin.row, origin.col))
}

fn rebuild(
    dem: &Dem,
    origin: Cell,
    systems: &[Named],
    config: &EvaluationConfig,
    reduce: Reduction<'_>,
    seed: Seed,
    stop: &Stop,
) -> Result<(Vec<PatchScore>, Option<Rebuilt>)> {
    let blank = |system: &str, error: String| PatchScore {
        row: origin.row,
        col: origin.col,
        system: system.to_owned(),
        seconds: 0.0,
        relief: 0.0,
        line_share: 0.0,
        sources: None,
        scores: None,
        error: Some(error),
    };
    dem.valid().crop(Window::square(origin, PATCH))?;
    let patch = match Patch::new(dem, origin, config, reduce) {
        Ok(patch) => patch,
        Err(error) => {
            return Ok((systems.iter().map(|(name, _)| blank(name, error.to_string())).collect(), None));
        }
    };
    let (relief, line_share) = (patch.relief(), patch.line_share());
    let Patch { normalization, truth, valid, lines } = patch;
    let mut rows = Vec::new();
    let mut outputs: Vec<(String, Option<Grid<f32>>)> = Vec::new();
    for (name, system) in systems {
        let (output, seconds) = generated(system.as_ref(), systems, &rows, &outputs, &lines, seed, stop);
        let scored = output.and_then(|(output, sources)| {
            let scores = Scores::of(&output, &truth, &valid, &lines)?;
            let found = extract::ridges_and_valleys(&output, &valid, &config.sketch_extraction())?;
            Ok((scores.with_lines(&lines, &found)?, sources, output))
        });
        let row = PatchScore { seconds, relief, line_share, ..blank(name, String::new()) };
        match scored {
            Ok((scores, sources, output)) => {
                rows.push(PatchScore { scores: Some(scores), sources, error: None, ..row });
                outputs.push((name.clone(), Some(output)));
            }
            Err(Error::Stopped) => return Err(Error::Stopped),
            Err(error) => {
                rows.push(PatchScore { error: Some(error.to_string()), ..row });
                outputs.push((name.clone(), None));
            }
        }
    }
    Ok((rows, Some(Rebuilt { origin, normalization, truth, valid, lines, outputs })))
}

/// Terrain, with what is known of where it comes from.
type Made = (Grid<f32>, Option<SourceAudit>);

/// Terrain of a system and its seconds, on top of what is there already of the first of `systems`.
fn generated(
    system: &dyn SketchToTerrain,
    systems: &[Named],
    rows: &[PatchScore],
    outputs: &[(String, Option<Grid<f32>>)],
    lines: &LineMap,
    seed: Seed,
    stop: &Stop,
) -> (Result<Made>, f64) {
    let started = Instant::now();
    let half_done = system.finishing().and_then(|finishing| {
        let index = systems.iter().position(|(_, other)| Arc::ptr_eq(other, &finishing.start))?;
        let coarse = outputs.get(index)?.1.as_ref()?;
        Some((finishing, coarse, rows.get(index)?.seconds))
    });
    let (output, before) = match half_done {
        Some((finishing, coarse, seconds)) => {
            let finished = (finishing.finish)(coarse, lines, seed, stop);
            (finished.map(|terrain| (terrain, None)), seconds)
        }
        None => match system.traced(lines, seed, stop) {
            Some(made) => (made.map(|(terrain, sources)| (terrain, Some(sources.audit()))), 0.0),
            None => (system.generate(lines, seed, stop).map(|terrain| (terrain, None)), 0.0),
        },
    };
    (output, before + started.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::bundled;
    use crate::systems::classical::Nearest;
    use crate::systems::task::Finishing;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// [`Nearest`], counted.
    #[derive(Default)]
    struct Counted(AtomicUsize);

    impl SketchToTerrain for Counted {
        fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
            self.0.fetch_add(1, Ordering::Relaxed);
            Nearest.generate(lines, seed, stop)
        }
    }

    fn doubled(start: Arc<dyn SketchToTerrain>) -> Arc<dyn SketchToTerrain> {
        let finish = |coarse: &Grid<f32>, _: &LineMap, seed: Seed, _: &Stop| {
            Ok(coarse.map(|z| 2.0 * z + seed.0 as f32 % 7.0))
        };
        Arc::new(Finishing { start, finish: Box::new(finish) })
    }

    #[test]
    fn a_system_that_others_finish_runs_once_a_patch() {
        let dem = bundled::load("sierra").unwrap();
        let origins = [Cell::new(0, 0), Cell::new(128, 128)];
        let counted = Arc::new(Counted::default());
        let start: Arc<dyn SketchToTerrain> = counted.clone();
        let systems =
            vec![("start".to_owned(), start.clone()), ("finished".to_owned(), doubled(start.clone()))];
        let config = EvaluationConfig { keep: true, ..EvaluationConfig::default() };
        let stop = Stop::new();
        let run =
            |systems: &[Named]| evaluate(&dem, &origins, systems, &config, Seed(5), &stop, || {}).unwrap();
        let both = run(&systems);
        assert_eq!(counted.0.load(Ordering::Relaxed), origins.len());
        for rows in both.rows.chunks(2) {
            assert!(rows[1].seconds >= rows[0].seconds, "the start's seconds count");
        }
        // The same terrain as on its own.
        let alone = run(&systems[1..]);
        for (both, alone) in both.patches.iter().zip(&alone.patches) {
            assert_eq!(both.outputs[1], alone.outputs[0]);
            assert_ne!(both.outputs[1].1, both.outputs[0].1);
        }
    }
}
