//! The exemplar, prepared: its heights at every size, its main lines, and the drawings of it that stand for a drawing.

use super::config::SynthesisConfig;
use super::patch::Channel;
use super::source::Centres;
use super::strokes::LevelStrokes;
use super::symmetry::{self, Symmetries};
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::extract::{MainLines, MainLinesConfig};
use crate::grid::pyramid::{doubled, halved, halved_mask};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Mask, Window, gaussian};
use crate::interpolation::harmonic;
use crate::landscape::{self, LandscapeConfig, LandscapeFit};
use crate::seed::Seed;
use crate::sketch::{LineMap, Sketch, Stroke};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Largest number of the exemplar's cells.
const LARGEST: usize = 1 << 24;
/// The coarsest size keeps so many cells of the shorter side beyond a patch of the quilting.
const ROOM: usize = 5;
/// A map has at least so many cells at its coarsest size.
const FEWEST: usize = 4;
/// Side of the tiles whose main lines are found apart, cells.
const TILE: f64 = 256.0;
/// Tilings of the self-sketches in turn are this much coarser or finer.
const TILING: f64 = 0.25;

/// A DEM whose patches make terrain. Everything in it follows from the heights and the configuration.
pub struct Synthesis {
    config: SynthesisConfig,
    cell: f64,
    /// Subtracted from all heights inside.
    datum: f64,
    levels: Vec<Level>,
    /// For each self-sketch.
    tilings: Vec<Vec<Tile>>,
    symmetries: Symmetries,
    landscape: LandscapeFit,
    /// Drawings that have been asked for, by density.
    drawn: Mutex<BTreeMap<[usize; 2], Arc<Drawn>>>,
}

/// A part of the exemplar and its main lines.
struct Tile {
    window: Window,
    lines: MainLines,
}

/// The exemplar at one size.
pub(super) struct Level {
    pub(super) heights: Grid<f32>,
    pub(super) sharp: Channel,
    /// Brought to half the size and back: what a map looks like that has just been enlarged.
    pub(super) blurred: Option<Channel>,
    /// Without forms below the level's `flow_sigma`.
    pub(super) smooth: Option<Channel>,
    pub(super) centres: Centres,
    /// Where heights are known.
    pub(super) valid: Mask,
    /// Strength of forms smaller than a patch: the unit of squared differences.
    pub(super) strength: f32,
}

/// The drawings of the exemplar of one density.
pub(super) struct Drawn {
    pub(super) sketches: Vec<SelfSketch>,
    /// How much higher the ground is than its ridges and valleys, at each size.
    pub(super) above: Vec<[f32; 2]>,
    /// How much higher the ground is than the membranes in the mean, in standard deviations of a membrane.
    pub(super) lift: f64,
}

/// What a drawing of the exemplar by its own main lines says at each size: the A of the analogy, whose A' is the exemplar.
pub(super) struct SelfSketch {
    pub(super) levels: Vec<SketchLevel>,
    pub(super) lines: LineMap,
    /// How much higher the ground is than the membrane in the mean, in the membrane's standard deviations.
    lift: f64,
}

/// One size of a self-sketch.
pub(super) struct SketchLevel {
    pub(super) membrane: Option<(Grid<f32>, Channel)>,
    pub(super) landscape: Option<(Grid<f32>, Channel)>,
    pub(super) strokes: Option<[(Grid<f32>, Channel); 2]>,
}

/// Cells of the shorter side at the coarsest size, at the least.
const fn fewest(config: &SynthesisConfig) -> usize {
    2 * config.quilting.radius + 1 + ROOM
}

impl Synthesis {
    /// Prepares a DEM of square cells.
    ///
    /// # Errors
    /// When `config` is out of range, the DEM is too small for a patch (about 32 cells at the least), has more than 2^24 cells, is
    /// level, or its voids leave no whole patch.
    pub fn new(dem: &Dem, config: &SynthesisConfig) -> Result<Self> {
        config.validate()?;
        Self::check(dem, config)?;
        let (rows, cols) = dem.shape();
        let least = fewest(config);
        let mut config = config.clone();
        while config.levels.len() > 1 && (rows.min(cols) >> (config.levels.len() - 1)) < least {
            config.levels.pop();
        }
        let known = dem.heights().as_slice().iter().zip(dem.valid().as_slice()).filter(|(_, ok)| **ok);
        let count = known.clone().count() as f64;
        let datum = known.map(|(z, _)| f64::from(*z)).sum::<f64>() / count;
        let heights = filled(dem, datum)?;
        let mut levels = levels(&heights, dem.valid(), &config)?;
        // Voids may leave no room for the quilting's patches where they are large.
        let has_room = |level: &Level| {
            Centres::new(&level.valid, config.quilting.radius).is_some_and(|c| c.list().len() >= ROOM * ROOM)
        };
        while levels.len() > 1 && !levels.last().is_some_and(has_room) {
            levels.pop();
        }
        config.levels.truncate(levels.len());
        let cell = dem.cell_size().mean();
        let mut all = Self {
            symmetries: symmetry::measure(&levels[levels.len().min(2) - 1].heights),
            landscape: LandscapeFit::of(dem.heights(), dem.valid(), cell)?,
            config,
            cell,
            datum,
            levels,
            tilings: Vec::new(),
            drawn: Mutex::default(),
        };
        all.tilings = (0..all.config.self_sketches)
            .into_par_iter()
            .map(|k| all.tiling(&heights, dem.valid(), k))
            .collect::<Result<_>>()?;
        Ok(all)
    }

    /// Whether a DEM is large enough, not too large, and not level.
    ///
    /// # Errors
    /// Says what is wrong.
    pub(super) fn check(dem: &Dem, config: &SynthesisConfig) -> Result<()> {
        let (rows, cols) = dem.shape();
        if rows * cols > LARGEST {
            let allowed = format!("allowed: at most {LARGEST} cells");
            return Err(Error::value("exemplar of the synthesis", format!("{rows}x{cols}"), allowed));
        }
        let least = 2 * fewest(config);
        if rows.min(cols) < least {
            let allowed = format!("allowed: sides of at least {least} cells");
            return Err(Error::value("exemplar of the synthesis", format!("{rows}x{cols}"), allowed));
        }
        let (low, high) = dem.range();
        if low >= high {
            return Err(Error::value("relief of the exemplar", 0, "level ground has no forms"));
        }
        let finest = config.levels.first().map_or(0, |level| level.radius).max(config.quilting.radius);
        Centres::new(dem.valid(), finest).map(|_| ()).ok_or_else(no_patch)
    }

    /// What it was prepared with; fewer sizes than asked where the exemplar is small.
    #[must_use]
    pub(crate) const fn config(&self) -> &SynthesisConfig {
        &self.config
    }

    /// Which symmetries are used, and why.
    #[must_use]
    pub const fn symmetries(&self) -> &Symmetries {
        &self.symmetries
    }

    /// Metres of a cell.
    #[must_use]
    pub(crate) const fn cell(&self) -> f64 {
        self.cell
    }

    /// (rows, columns).
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        self.levels[0].heights.shape()
    }

    pub(super) const fn datum(&self) -> f64 {
        self.datum
    }

    pub(super) fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// The landscape model's laws of the exemplar.
    #[must_use]
    pub(crate) const fn landscape(&self) -> &LandscapeFit {
        &self.landscape
    }

    /// Centres of the quilting's patches at a size.
    ///
    /// # Errors
    /// When voids leave none.
    pub(super) fn quilting_centres(&self, level: usize) -> Result<Centres> {
        Centres::new(&self.levels[level].valid, self.config.quilting.radius).ok_or_else(no_patch)
    }

    /// Strength of forms smaller than a patch of the quilting, in the mean over its centres.
    pub(super) fn strength_of_patches(&self, level: usize, centres: &Centres) -> f32 {
        let channel = Channel::new(&self.levels[level].heights, self.config.quilting.radius);
        channel.strength(centres.list()).max(f32::MIN_POSITIVE)
    }

    /// How many sizes a map of this shape has room for.
    pub(super) fn levels_for(&self, (rows, cols): (usize, usize)) -> usize {
        let fits = |l: &usize| rows.min(cols) >> l >= FEWEST;
        (0..self.levels.len()).take_while(fits).count().max(1)
    }

    /// Main lines of the tiles of the `k`-th self-sketch.
    fn tiling(&self, heights: &Grid<f32>, valid: &Mask, k: usize) -> Result<Vec<Tile>> {
        let (rows, cols) = heights.shape();
        let shift = if k.is_multiple_of(2) { -TILING } else { TILING };
        let parts = |side: usize| ((side as f64 / TILE + shift).round() as usize).max(1);
        let edges = |side: usize| -> Vec<usize> {
            let n = parts(side);
            (0..=n).map(|i| i * side / n).collect()
        };
        let (down, right) = (edges(rows), edges(cols));
        let mut tiles = Vec::new();
        for rows in down.windows(2) {
            for cols in right.windows(2) {
                let window = Window::new(Cell::new(rows[0], cols[0]), rows[1] - rows[0], cols[1] - cols[0]);
                if valid.crop(window)?.as_slice().contains(&true) {
                    tiles.push(window);
                }
            }
        }
        let seed = Seed(0).derive_indexed("self-sketch", k);
        tiles
            .into_par_iter()
            .enumerate()
            .map(|(i, window)| {
                let (part, ok) = (heights.crop(window)?, valid.crop(window)?);
                let most = self.lines_of_tile(self.config.most_lines, window.shape());
                let config = MainLinesConfig::default();
                let lines = MainLines::of(&part, &ok, &config, most, seed.derive_indexed("tile", i))?;
                Ok(Tile { window, lines })
            })
            .collect()
    }

    /// Lines of a tile when 256x256 cells have `count`.
    fn lines_of_tile(&self, count: usize, size: (usize, usize)) -> usize {
        let share = (size.0 * size.1) as f64 / (TILE * TILE);
        if count == 0 { 0 } else { ((count as f64 * share).round() as usize).max(1) }
    }

    /// The lines of the self-sketches with so many ridges and valleys on 256x256 cells.
    fn self_lines(&self, [ridges, valleys]: [usize; 2]) -> Vec<LineMap> {
        let (rows, cols) = self.shape();
        let draw = |tiles: &Vec<Tile>| {
            let mut strokes: Vec<Stroke> = Vec::new();
            for Tile { window, lines } in tiles {
                let origin = window.origin;
                for (own, count) in [(&lines.ridges, ridges), (&lines.valleys, valleys)] {
                    for stroke in own.iter().take(self.lines_of_tile(count, window.shape())) {
                        let mut stroke = stroke.clone();
                        for v in &mut stroke.vertices {
                            (v.x, v.y) = (v.x + origin.col as f64, v.y + origin.row as f64);
                        }
                        strokes.push(stroke);
                    }
                }
            }
            Sketch { rows, cols, strokes }.rasterize()
        };
        self.tilings.iter().map(draw).collect()
    }

    /// The drawings of the exemplar with so many ridges and valleys on 256x256 cells.
    ///
    /// # Errors
    /// Never for an exemplar that could be prepared.
    pub(super) fn drawn(&self, density: [usize; 2]) -> Result<Arc<Drawn>> {
        let known = || self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(drawn) = known().get(&density) {
            return Ok(drawn.clone());
        }
        let drawn = Arc::new(self.draw(density)?);
        known().insert(density, drawn.clone());
        Ok(drawn)
    }

    fn draw(&self, density: [usize; 2]) -> Result<Drawn> {
        let lines = self.self_lines(density);
        let sketches: Vec<SelfSketch> = lines
            .into_par_iter()
            .enumerate()
            .map(|(k, lines)| self.sketch(lines, k))
            .collect::<Result<_>>()?;
        let above = |l: usize| {
            let level = &self.levels[l];
            let mut sums = [(0.0f64, 0u32); 2];
            for sketch in &sketches {
                for (cell, z, kind) in LevelStrokes::new(&sketch.lines, 1 << l, level.heights.shape()).cells {
                    sums[kind].0 += f64::from(level.heights[cell] - z);
                    sums[kind].1 += 1;
                }
            }
            sums.map(|(sum, count)| (sum / f64::from(count.max(1))) as f32)
        };
        let above = (0..self.levels.len()).map(above).collect();
        let lift = sketches.iter().map(|s| s.lift).sum::<f64>() / sketches.len().max(1) as f64;
        Ok(Drawn { sketches, above, lift })
    }

    fn sketch(&self, lines: LineMap, k: usize) -> Result<SelfSketch> {
        let shape = |l: usize| self.levels[l].heights.shape();
        let landscape = if self.landscape.is_fluvial() && lines.line_count() > 0 {
            let lines = lines.map_heights(|z| (f64::from(z) + self.datum) as f32);
            let seed = Seed(0).derive_indexed("landscape of self-sketch", k);
            Some(landscape::solve(&self.landscape, &lines, self.cell, &LandscapeConfig::guide(), seed)?)
        } else {
            None
        };
        let membranes = membranes(&lines, self.levels.len(), &shape)?;
        let coarsest = self.levels.len() - 1;
        let (ground, _) = mean_and_deviation(&self.levels[coarsest].heights);
        let (mean, deviation) = mean_and_deviation(&membranes[coarsest]);
        let lift = if deviation > 0.0 { (ground - mean) / deviation } else { 0.0 };
        let levels = (0..self.levels.len()).map(|l| {
            let config = &self.config.levels[l];
            let with = |map: Grid<f32>| {
                let channel = Channel::new(&map, config.radius);
                (map, channel)
            };
            if config.guide == 0.0 {
                return Ok(SketchLevel { membrane: None, landscape: None, strokes: None });
            }
            let strokes = LevelStrokes::new(&lines, 1 << l, shape(l)).nearness(&self.config.guide);
            Ok(SketchLevel {
                membrane: (config.flow == 0.0).then(|| with(membranes[l].clone())),
                landscape: match &landscape {
                    Some(found) => {
                        let (rows, cols) = shape(l);
                        let heights =
                            found.heights(1 << l)?.crop(Window::new(Cell::new(0, 0), rows, cols))?;
                        Some(with(heights.map(|z| (f64::from(*z) - self.datum) as f32)))
                    }
                    None => None,
                },
                strokes: Some(strokes.map(with)),
            })
        });
        Ok(SelfSketch { levels: levels.collect::<Result<_>>()?, lines, lift })
    }
}

/// The membrane through lines at every size, solved at a quarter of the finest (or at the coarsest, where that is finer).
///
/// # Errors
/// Never for finite heights.
pub(super) fn membranes(
    lines: &LineMap,
    count: usize,
    shape: &dyn Fn(usize) -> (usize, usize),
) -> Result<Vec<Grid<f32>>> {
    let solved = 2.min(count - 1);
    let strokes = LevelStrokes::new(lines, 1 << solved, shape(solved));
    let (rows, cols) = shape(solved);
    // An exemplar without lines says the same everywhere.
    let at = if strokes.cells.is_empty() { Grid::filled(rows, cols, 0.0) } else { strokes.membrane()? };
    let mut all = vec![at];
    for l in (0..solved).rev() {
        let (rows, cols) = shape(l);
        let finer = resample(&all[0], rows, cols);
        all.insert(0, finer);
    }
    while all.len() < count {
        let coarser = halved(&all[all.len() - 1]);
        all.push(coarser);
    }
    Ok(all)
}

/// Mean and standard deviation of all cells.
pub(super) fn mean_and_deviation(map: &Grid<f32>) -> (f64, f64) {
    let n = map.len() as f64;
    let mean = map.as_slice().iter().map(|z| f64::from(*z)).sum::<f64>() / n;
    let squares = map.as_slice().iter().map(|z| (f64::from(*z) - mean).powi(2)).sum::<f64>();
    (mean, (squares / n).sqrt())
}

fn no_patch() -> Error {
    Error::value("whole patches of the exemplar", 0, "its voids leave no window that is large enough")
}

/// Heights without the datum; voids are filled smoothly, so that no step meets an edge there, and never copied.
fn filled(dem: &Dem, datum: f64) -> Result<Grid<f32>> {
    if dem.void_count() == 0 {
        return Ok(dem.heights().map(|z| (f64::from(*z) - datum) as f32));
    }
    let values = dem.heights().map(|z| f64::from(*z) - datum);
    Ok(harmonic(dem.valid(), &values)?.map(|z| *z as f32))
}

fn levels(heights: &Grid<f32>, valid: &Mask, config: &SynthesisConfig) -> Result<Vec<Level>> {
    let mut maps = vec![(heights.clone(), valid.clone())];
    for _ in 1..config.levels.len() {
        let (z, ok) = &maps[maps.len() - 1];
        maps.push((halved(z), halved_mask(ok)));
    }
    let last = maps.len() - 1;
    // Any size may be the coarsest of a map, on which patches are quilted.
    let quilted = config.quilting.radius;
    let all: Vec<Option<Level>> = maps
        .into_par_iter()
        .zip(&config.levels)
        .enumerate()
        .map(|(l, ((heights, valid), config))| {
            let (Some(centres), Some(_)) =
                (Centres::new(&valid, config.radius), Centres::new(&valid, quilted))
            else {
                return Ok(None);
            };
            let everywhere = valid.map(|_| true);
            let blurred = (l < last).then(|| {
                let back = doubled(&halved(&heights));
                let (rows, cols) = heights.shape();
                // An odd last row or column has no coarse cell.
                let map = Grid::from_fn(rows, cols, |c| {
                    if c.row < back.rows() && c.col < back.cols() { back[c] } else { heights[c] }
                });
                Channel::new(&map, config.radius)
            });
            let smooth = (config.flow > 0.0).then(|| {
                Channel::new(&gaussian::smooth(&heights, &everywhere, config.flow_sigma), config.radius)
            });
            let sharp = Channel::new(&heights, config.radius);
            let strength = sharp.strength(centres.list()).max(f32::MIN_POSITIVE);
            Ok(Some(Level { sharp, blurred, smooth, centres, strength, heights, valid }))
        })
        .collect::<Result<_>>()?;
    // A size without any whole patch ends the pyramid.
    let levels: Vec<Level> = all.into_iter().map_while(|level| level).collect();
    if levels.is_empty() { Err(no_patch()) } else { Ok(levels) }
}
