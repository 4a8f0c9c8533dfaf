//! Terrain from the few strokes that a hand would draw of terrain that no style has seen.
//!
//! The exemplars are the western parts of their areas; truths lie in the east. Of each its longest valleys and ridges are drawn as a
//! hand would (every seed is another hand), every system makes terrain of them in metres, and that is held against the truth as a
//! landscape ([`StrokeCase`]). When all is made, a classifier says how many windows can be told from real ones ([`told_share`]).

use super::general;
use crate::arrays::Arrays;
use crate::control::Stop;
use crate::dem::{Dem, Normalization};
use crate::error::Result;
use crate::evaluate::{STROKE_SCORES, StrokeCase};
use crate::experiment::areas::{Area, Resolved};
use crate::experiment::measure::{Measured, Task};
use crate::experiment::pictures::{Gallery, plain};
use crate::experiment::protocol::{Finding, Protocol, SketchSource, check};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::rows::{Key, Timed};
use crate::experiment::spec::{ExperimentSpec, SketchSpec};
use crate::file;
use crate::grid::Cell;
use crate::metrics::{WINDOW_FEATURES, WindowFeatures, mean_valid_slope, told_share, window_features};
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::style::Named;
use crate::systems::task::{Ground, with_random_lines};
use crate::viz::{LineArt, LineStyle, Painter, Sheet};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

const TOLD: &str = "told_share";
/// The name of the truth's windows.
const TRUTH: &str = "truth";

pub(super) struct Strokes;

impl Protocol for Strokes {
    fn columns(&self) -> Vec<&'static str> {
        std::iter::once(TOLD).chain(STROKE_SCORES).collect()
    }

    fn sketch_source(&self) -> SketchSource {
        SketchSource::MainLines
    }

    fn has_test_patches(&self) -> bool {
        false
    }

    fn draws_lines(&self) -> bool {
        true
    }

    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        check(!spec.sketch.is_empty(), "number of sketches", 0, "kind = \"strokes\" needs at least one")
    }

    fn cells(&self, resolved: &Resolved, area: &Area, sketch: &SketchSpec) -> Vec<Cell> {
        let west = StrokeCase::west_of(area.dem.shape().1, resolved.spec.largest_truth());
        StrokeCase::places(&area.dem, west, sketch.size())
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        let case = Case::new(task.area, task.cell, task.sketch, task.seed)?;
        let share = case.given.line_count() as f64 / case.given.kinds().len() as f64;
        let about = (case.of.range.high() - case.of.range.low(), share);
        let mut windows = vec![(TRUTH.to_owned(), window_features(&case.of.truth)?)];
        let mut rows = Vec::new();
        for named in &task.systems.named {
            let started = Instant::now();
            let made = case.terrain(named, task);
            let seconds = started.elapsed().as_secs_f64();
            let scored = made.and_then(|made| {
                windows.push((format!("of {}", named.0), window_features(&made)?));
                Ok(case.of.scores(&made)?.to_vec())
            });
            rows.push(Measured { seconds, ..Measured::new(&named.0, about, started, scored) });
        }
        Windows::at(task.record, &task.area.name, task.cell, task.seed, &task.sketch.name).write(&windows)?;
        Ok(rows)
    }

    /// What of the windows is told from real ones.
    fn complete(&self, record: &Record, rows: &mut [Timed]) -> Result<()> {
        let mut sets: BTreeMap<(String, String, u64), Vec<usize>> = BTreeMap::new();
        for (i, (row, _)) in rows.iter().enumerate().filter(|(_, (row, _))| row.error.is_empty()) {
            let Key { sketch, system, seed, .. } = row.key.clone();
            sets.entry((sketch, system, seed)).or_default().push(i);
        }
        for ((_, system, seed), of) in sets.into_iter().filter(|(_, of)| of.len() > 1) {
            let windows = |i: &usize| {
                let key = &rows[*i].0.key;
                let cell = Cell::new(key.row, key.col);
                Windows::at(record, &key.area, cell, key.seed, &key.sketch).pair(&system)
            };
            let cases: Vec<_> = of.iter().map(windows).collect::<Result<_>>()?;
            let shares = told_share(&cases, Seed(seed).derive("told from real"))?;
            for (i, share) in of.into_iter().zip(shares) {
                rows[i].0.values[0] = Some(share);
            }
        }
        Ok(())
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::means(results, false))
    }

    fn about_pictures(&self) -> &'static str {
        "The first truths of each area with their strokes, and what every system makes of them; first seed."
    }

    /// As many sketches of every area as pictures are asked for.
    fn pictures(&self, gallery: &Gallery<'_>) -> Result<()> {
        let (resolved, seed) = (gallery.resolved, gallery.seed);
        for area in &resolved.areas {
            let systems = gallery.systems(area)?;
            for sketch in gallery.sketches.iter().take(resolved.spec.pictures) {
                let Some(&cell) = self.cells(resolved, area, sketch).first() else { continue };
                let case = Case::new(area, cell, sketch, seed)?;
                let task =
                    Task { resolved, area, cell, sketch, systems: &systems, seed, record: gallery.record };
                let StrokeCase { truth, range, drawn } = &case.of;
                let painter = Painter::of(truth);
                let unit = |dem: &Dem| range.normalize(dem);
                let mut truth = painter.draw(&unit(truth), truth.valid())?;
                LineArt::try_from(drawn)?.overlay(&mut truth, &LineStyle::default())?;
                let title = format!("{}, \"{}\", seed {seed}", area.name, sketch.name);
                let mut sheet = Sheet::new(4).title(title).panel(truth, "truth and strokes");
                for named in &systems.named {
                    if let Ok(made) = case.terrain(named, &task) {
                        sheet = sheet.panel(painter.draw(&unit(&made), made.valid())?, named.0.as_str());
                    }
                }
                let name = format!("{}-{}", plain(&area.name), plain(&sketch.name));
                gallery.keep(&name, &painter.finish(sheet)?)?;
            }
        }
        Ok(())
    }
}

/// A truth and what the systems are given of it.
struct Case {
    of: StrokeCase,
    /// The strokes, with random lines where these are asked for, metres.
    given: LineMap,
}

impl Case {
    fn new(area: &Area, cell: Cell, sketch: &SketchSpec, seed: u64) -> Result<Self> {
        let seed = Seed(seed).derive(&format!("hand {},{}", cell.row, cell.col));
        let of = StrokeCase::new(&area.dem, cell, sketch.size(), sketch.strokes, sketch.share, seed)?;
        let Some(nodes) = sketch.random else { return Ok(Self { given: of.drawn.rasterize(), of }) };
        let (low, high) = area.source.dem.range();
        let slope = mean_valid_slope(area.source.dem.heights(), area.source.dem.valid())?;
        let ground = Ground { range: (low.into(), high.into()), slope: Some(slope) };
        let heights = sketch.random_heights.unwrap_or_default();
        let given = with_random_lines(&of.drawn, nodes, heights, ground, seed)?.rasterize();
        Ok(Self { of, given })
    }

    /// What a system makes of the strokes, metres; in the unit interval of the style as by `generate`.
    fn terrain(&self, (_, system): &Named, task: &Task<'_>) -> Result<Dem> {
        let style = Normalization::of(&task.area.source.dem);
        let lines = self.given.to_unit(style);
        let seed = Seed(task.seed).derive(&format!("terrain {},{}", task.cell.row, task.cell.col));
        let made = system.draw(&lines, seed, &Stop::new())?;
        Dem::new(style.denormalize(&made), self.of.truth.cell_size())
    }
}

/// A file of the features of the windows of a truth (`truth`) and of what every system made of it (`of SYSTEM`).
struct Windows(PathBuf);

impl Windows {
    fn at(record: &Record, area: &str, cell: Cell, seed: u64, sketch: &str) -> Self {
        let name = format!("{}-{}-{}-{seed}-{}", plain(area), cell.row, cell.col, plain(sketch));
        Self(record.path(&format!("windows/{name}.safetensors")))
    }

    fn write(&self, all: &[(String, Vec<WindowFeatures>)]) -> Result<()> {
        let mut arrays = Arrays::default();
        for (name, windows) in all {
            arrays.put_f32(name, &[windows.len(), WINDOW_FEATURES], &windows.concat());
        }
        self.0.parent().map_or(Ok(()), file::create_folder)?;
        arrays.write(&self.0, TRUTH, String::new())
    }

    /// Windows of the truth and of a system.
    fn pair(&self, system: &str) -> Result<(Vec<WindowFeatures>, Vec<WindowFeatures>)> {
        let (_, mut arrays) = Arrays::read(&self.0, TRUTH, "windows")?;
        let mut take = |name: &str| -> Result<Vec<WindowFeatures>> {
            Ok(arrays.take_f32(name)?.chunks(WINDOW_FEATURES).map(<[f32]>::to_vec).collect())
        };
        Ok((take(TRUTH)?, take(&format!("of {system}"))?))
    }
}
