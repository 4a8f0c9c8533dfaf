//! Terrain from the few strokes that a hand would draw of terrain that no style has seen.
//!
//! The exemplars are the western parts of their areas; truths lie in the east. Of each its longest valleys and ridges are
//! drawn as a hand would ([`MainLines`]; every seed is another hand), every system makes terrain of them in metres, and that is held against
//! the truth as a landscape rather than cell by cell. When all is made, a classifier says how many windows can be told from real ones
//! ([`told_share`]).

use super::general;
use crate::control::Stop;
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::experiment::areas::{Area, Resolved};
use crate::experiment::measure::{Measured, Task, Values};
use crate::experiment::pictures::{Gallery, Painter, plain};
use crate::experiment::protocol::{Finding, Protocol, SketchSource, check};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::rows::{Key, Timed};
use crate::experiment::spec::{ExperimentSpec, SketchSpec};
use crate::extract::{MainLines, MainLinesConfig};
use crate::flow::{Surface, ponded_share};
use crate::grid::{Cell, Grid};
use crate::metrics::{
    Contract, WindowFeatures, curvature_distance, geomorphon_distance, mean_slope_ratio, mean_valid_slope, psnr,
    slope_distance, sliced_wasserstein, spectrum_distance, ssim, told_share, window_features,
};
use crate::seed::Seed;
use crate::sketch::{Sketch, StrokeKind};
use crate::style::Named;
use crate::systems::task::{Ground, with_random_lines};
use crate::viz::{LineArt, LineStyle, Sheet};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

const TOLD: &str = "told_share";
const COLUMNS: [&str; 16] = [
    TOLD,
    "stroke_height_error",
    "ridge_recall",
    "valley_recall",
    "carried_recall",
    "ponded_share",
    "truth_ponded_share",
    "mean_slope_ratio",
    "slope_distance",
    "spectrum_distance",
    "curvature_distance",
    "patch_distance",
    "landform_distance",
    "ssim",
    "psnr",
    "range_ratio",
];
/// The folder of windows in the record.
const WINDOWS: &str = "windows";

pub(super) struct Strokes;

impl Protocol for Strokes {
    fn columns(&self) -> Vec<&'static str> {
        COLUMNS.to_vec()
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

    /// North and south ends of the east, or the middle where the two would overlap; none where truths of that size do not fit.
    fn cells(&self, _: &Resolved, area: &Area, sketch: &SketchSpec) -> Vec<Cell> {
        let (rows, cols) = area.dem.shape();
        let side = sketch.size();
        let first = area.source.terrain.shape().1;
        if side > rows || first + side > cols {
            return Vec::new();
        }
        let tops = if rows >= 2 * side { vec![0, rows - side] } else { vec![(rows - side) / 2] };
        tops.into_iter().map(|row| Cell::new(row, cols - side)).collect()
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        let case = Case::new(task.area, task.cell, task.sketch, task.seed)?;
        let lines = case.given.rasterize();
        let share = lines.line_count() as f64 / lines.kinds().len() as f64;
        let about = (case.range.high() - case.range.low(), share);
        let mut windows = Windows(vec![(String::new(), window_features(&case.truth)?)]);
        let mut rows = Vec::new();
        for named in &task.systems.named {
            let started = Instant::now();
            let made = case.terrain(named, task);
            let seconds = started.elapsed().as_secs_f64();
            let scored = made.and_then(|made| {
                windows.0.push((named.0.clone(), window_features(&made)?));
                case.scores(&made)
            });
            rows.push(Measured { seconds, ..Measured::new(&named.0, about, started, scored) });
        }
        windows.write(task.record, &Windows::name(&task.area.name, task.cell, task.seed, &task.sketch.name))?;
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
                Windows::read(record, &Windows::name(&key.area, cell, key.seed, &key.sketch))?.pair(&system)
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
                let task = Task { resolved, area, cell, sketch, systems: &systems, seed, record: gallery.record };
                let painter = Painter::new(&case.truth, case.range);
                let unit = |dem: &Dem| case.range.normalize(dem);
                let mut truth = painter.draw(&unit(&case.truth), case.truth.valid())?;
                LineArt::try_from(&case.drawn)?.overlay(&mut truth, &LineStyle::default())?;
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

/// A truth and what a hand draws of it, metres.
struct Case {
    truth: Dem,
    /// Metres of the truth's lowest and highest height.
    range: Normalization,
    drawn: Sketch,
    /// With random lines, where these are asked for.
    given: Sketch,
}

impl Case {
    fn new(area: &Area, cell: Cell, sketch: &SketchSpec, seed: u64) -> Result<Self> {
        let side = sketch.size();
        let truth = area.dem.crop(cell, side, side)?;
        let range = Normalization::of(&truth);
        let usual = MainLinesConfig::default();
        let share = sketch.share.unwrap_or(usual.share);
        // Lines that drain less are shorter.
        let min_length = (usual.min_length as f64 * (share / usual.share).sqrt()).clamp(4.0, 24.0) as usize;
        let config = MainLinesConfig { share, min_length, ..usual };
        let seed = Seed(seed).derive(&format!("hand {},{}", cell.row, cell.col));
        let most = sketch.strokes.unwrap_or(usize::MAX).div_ceil(2);
        let found = MainLines::of(truth.heights(), truth.valid(), &config, most, seed)?;
        let drawn = Sketch::new(side, side, [found.valleys, found.ridges].concat())?;
        if drawn.strokes.is_empty() {
            return Err(Error::value("number of strokes", 0, "the truth shows no valley and no ridge"));
        }
        let given = match sketch.random {
            Some(nodes) => {
                let style = &area.source.dem;
                let (low, high) = style.range();
                let slope = mean_valid_slope(style.heights(), style.valid())?;
                let ground = Ground { range: (low.into(), high.into()), slope: Some(slope) };
                with_random_lines(&drawn, nodes, sketch.random_heights.unwrap_or_default(), ground, seed)?
            }
            None => drawn.clone(),
        };
        Ok(Self { truth, range, drawn, given })
    }

    /// What a system makes of the strokes, in the unit interval of the style as by `generate`.
    fn terrain(&self, (_, system): &Named, task: &Task<'_>) -> Result<Dem> {
        let style = Normalization::of(&task.area.source.dem);
        let lines = self.given.rasterize().map_heights(|z| style.to_unit(f64::from(z)) as f32);
        let seed = Seed(task.seed).derive(&format!("terrain {},{}", task.cell.row, task.cell.col));
        let made = system.draw(&lines, seed, &Stop::new())?;
        Dem::new(made.map(|&z| style.to_metres(f64::from(z)) as f32), self.truth.cell_size())
    }

    fn scores(&self, made: &Dem) -> Result<Values> {
        let valid = self.truth.valid();
        let (output, truth) = (self.range.normalize(made), self.range.normalize(&self.truth));
        let contract = Contract::of(made.heights(), valid, &self.drawn)?;
        let relief = self.range.high() - self.range.low();
        let recall = |kind: StrokeKind, carried: bool| {
            let of = || contract.strokes.iter().filter(|stroke| stroke.kind == kind);
            let cells: usize = of().map(|stroke| stroke.cells).sum();
            let share = |carried: bool| move |s: &crate::metrics::StrokeCheck| {
                s.cells as f64 * if carried { s.carries.unwrap_or(0.0) } else { s.found }
            };
            (cells > 0).then(|| of().map(share(carried)).sum::<f64>() / cells as f64)
        };
        let ponds = |heights: &Grid<f32>| Surface::new(heights.clone(), valid.clone()).map(|s| ponded_share(&s));
        let (low, high) = made.range();
        let values = [
            None,
            contract.height_error.map(|error| error / relief),
            recall(StrokeKind::Ridge, false),
            recall(StrokeKind::Valley, false),
            recall(StrokeKind::Valley, true),
            Some(contract.pits),
            Some(ponds(self.truth.heights())?),
            Some(mean_slope_ratio(&output, &truth, valid)?),
            Some(slope_distance(&output, &truth, valid)?),
            Some(spectrum_distance(&output, &truth, valid)?),
            Some(curvature_distance(&output, &truth, valid)?),
            Some(sliced_wasserstein(&output, &truth, valid)?),
            Some(geomorphon_distance(&output, &truth, valid)?),
            Some(ssim(&output, &truth, valid, 1.0)?),
            Some(psnr(&output, &truth, valid, 1.0)?),
            Some(f64::from(high - low) / relief),
        ];
        Ok(COLUMNS.into_iter().zip(values).collect())
    }
}

/// The windows of a truth (under no name) and of what systems made of it.
struct Windows(Vec<(String, Vec<WindowFeatures>)>);

/// One window of a table of [`Windows`].
#[derive(Serialize, Deserialize)]
struct WindowRow {
    system: String,
    /// Separated by spaces: a row of CSV has no lists.
    features: String,
}

impl Windows {
    fn name(area: &str, cell: Cell, seed: u64, sketch: &str) -> String {
        format!("{WINDOWS}/{}-{}-{}-{seed}-{}.csv", plain(area), cell.row, cell.col, plain(sketch))
    }

    fn write(&self, record: &Record, name: &str) -> Result<()> {
        let rows: Vec<WindowRow> = self
            .0
            .iter()
            .flat_map(|(system, windows)| {
                windows.iter().map(move |features| WindowRow {
                    system: system.clone(),
                    features: features.iter().map(f32::to_string).collect::<Vec<_>>().join(" "),
                })
            })
            .collect();
        crate::file::create_folder(&record.path(WINDOWS))?;
        record.write_table(name, &rows)
    }

    fn read(record: &Record, name: &str) -> Result<Self> {
        let rows: Vec<WindowRow> = record.table(name)?;
        let mut all: Vec<(String, Vec<WindowFeatures>)> = Vec::new();
        for row in rows {
            let number = |text: &str| {
                text.parse().map_err(|_| Error::file(&record.path(name), "feature", text, "allowed: a number"))
            };
            let features = row.features.split(' ').map(number).collect::<Result<_>>()?;
            match all.last_mut().filter(|(system, _)| *system == row.system) {
                Some((_, windows)) => windows.push(features),
                None => all.push((row.system, vec![features])),
            }
        }
        Ok(Self(all))
    }

    /// Windows of the truth and of a system.
    fn pair(mut self, system: &str) -> Result<(Vec<WindowFeatures>, Vec<WindowFeatures>)> {
        let mut take = |name: &str| {
            let found = self.0.iter_mut().find(|(known, _)| known == name);
            found.map(|(_, windows)| std::mem::take(windows)).ok_or_else(|| {
                let allowed = "the record lacks its windows: add --restart to start over";
                Error::value("windows of the system", name, allowed)
            })
        };
        Ok((take("")?, take(system)?))
    }
}
