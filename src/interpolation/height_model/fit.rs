//! What the ridges and valleys of an exemplar are like.
//!
//! [`Dem`] -> [`HeightModel`]. Heights are smoothed by a cell, water is routed over them and over their mirror image, and
//! channels and ridges are looked at from several drained areas on. Cost: two routings, and a nearest-neighbour search of
//! every ridge cell for each area.

use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::flow::{Accumulation, FlowDirections, Surface, accumulate, route};
use crate::grid::{Cell, Grid, Mask, distance, gaussian};
use crate::interpolation::line_cells::LineCells;
use crate::sketch::{LineMap, StrokeKind};

/// Smoothing before everything, cells.
const SMOOTHING: f64 = 1.0;
/// Cells along the frame that are left out: water follows it.
const FRAME: usize = 6;
/// Least drained area at which slopes are measured, cells.
const SMALLEST_CHANNEL: f64 = 30.0;
/// Steps downstream over which a slope is measured.
const RUN: usize = 10;
/// Drained areas from which channels and ridges are looked at, cells.
const AREAS: [u32; 8] = [64, 128, 256, 512, 1024, 2048, 4096, 8192];
/// Fewest cells of a kind that figures are taken from.
const FEWEST: usize = 30;
/// Ratio of two drained areas whose slopes are averaged.
const AREA_STEP: f64 = 2.0;

/// Ridges and valleys that are seen when only channels of some drained area count.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Density {
    /// Mean distance to the nearest valley over the map, cells.
    pub(crate) spacing: f64,
    /// Height of a ridge above the nearest valley, one cell away, metres: c of c d^p.
    pub(crate) relief: f64,
    /// p of c d^p.
    pub(crate) exponent: f64,
    /// Standard deviation of the height above the nearest valley, as a share of it.
    pub(crate) spread: f64,
    /// Mean and standard deviation of the heights of ridges, metres.
    pub ridges: [f64; 2],
    /// The same of valleys.
    pub valleys: [f64; 2],
}

/// What heights along ridges and valleys are like in an exemplar.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightModel {
    /// Slope of a valley that drains one cell, metres a cell: k of k A^-theta.
    pub(crate) valley_slope: f64,
    /// theta of k A^-theta.
    pub(crate) concavity: f64,
    /// Standard deviation of the slope over ten cells, as a share of it.
    pub(crate) slope_spread: f64,
    /// Root of the mean square change of height along a ridge over one cell, metres; over n cells root n times as much.
    pub(crate) ridge_step: f64,
    /// Standard deviation of all heights, metres.
    pub(crate) deviation: f64,
    /// From dense to sparse lines; at least one.
    pub densities: Vec<Density>,
}

impl HeightModel {
    /// What is in the exemplar.
    ///
    /// # Errors
    /// When it is too small or too flat to have ridges and valleys.
    pub fn fit(dem: &Dem) -> Result<Self> {
        let heights = gaussian::smooth(dem.heights(), dem.valid(), SMOOTHING);
        let surface = Surface::new(heights.clone(), dem.valid().clone())?;
        let mirrored = surface.inverted();
        let (down, up) = (route(&surface), route(&mirrored));
        let (drained, climbed) = (accumulate(&down), accumulate(&up));
        let inside = inside(dem.valid());
        let nothing = || {
            let (rows, cols) = dem.shape();
            let allowed = "ridges and valleys with some relief are needed, to take heights of strokes from";
            Error::value("exemplar", format!("{rows}x{cols} cells without them"), allowed)
        };
        let deviation = deviation(&heights, dem.valid());
        let runs = runs(&heights, &down, &drained, &inside);
        let (valley_slope, concavity) = slope_law(&runs, deviation).ok_or_else(nothing)?;
        let law = |area: f64| valley_slope * area.powf(-concavity);
        let slope_spread = root_mean_square(runs.iter().map(|&(area, slope)| slope / law(area) - 1.0));
        let along: Vec<f64> = AREAS
            .iter()
            .rev()
            .map(|&area| ridge_steps(&heights, &up, &climbed, &inside, area))
            .find(|steps| steps.len() >= FEWEST)
            .ok_or_else(nothing)?;
        let sides = Sides { heights: &heights, drained: &drained, climbed: &climbed, inside: &inside };
        let densities: Vec<Density> =
            AREAS.iter().filter_map(|&area| sides.at(area).transpose()).collect::<Result<_>>()?;
        if densities.is_empty() || deviation == 0.0 {
            return Err(nothing());
        }
        Ok(Self {
            valley_slope,
            concavity,
            slope_spread,
            ridge_step: root_mean_square(along.into_iter()),
            deviation,
            densities,
        })
    }

    /// The same model where the range `from` has become the range `to`: heights move, differences grow with it.
    #[must_use]
    pub(crate) fn in_range(&self, from: Normalization, to: Normalization) -> Self {
        let factor = (to.high() - to.low()) / (from.high() - from.low());
        let place =
            |[mean, deviation]: [f64; 2]| [to.low() + (mean - from.low()) * factor, deviation * factor];
        let density = |d: &Density| Density {
            relief: d.relief * factor,
            ridges: place(d.ridges),
            valleys: place(d.valleys),
            ..*d
        };
        Self {
            valley_slope: self.valley_slope * factor,
            ridge_step: self.ridge_step * factor,
            deviation: self.deviation * factor,
            densities: self.densities.iter().map(density).collect(),
            ..self.clone()
        }
    }

    /// The figures for lines that are `spacing` cells from the middle of the map's places, between those of the nearest
    /// densities.
    pub(super) fn at_spacing(&self, spacing: f64) -> Density {
        let after = self.densities.partition_point(|d| d.spacing < spacing);
        let (Some(before), Some(after)) = (after.checked_sub(1), self.densities.get(after)) else {
            return self.densities[after.min(self.densities.len() - 1)];
        };
        let before = &self.densities[before];
        let share = (spacing / before.spacing).ln() / (after.spacing / before.spacing).ln();
        let mix = |a: f64, b: f64| a + (b - a) * share;
        let mix_two = |a: [f64; 2], b: [f64; 2]| [mix(a[0], b[0]), mix(a[1], b[1])];
        Density {
            spacing,
            relief: mix(before.relief.ln(), after.relief.ln()).exp(),
            exponent: mix(before.exponent, after.exponent),
            spread: mix(before.spread, after.spread),
            ridges: mix_two(before.ridges, after.ridges),
            valleys: mix_two(before.valleys, after.valleys),
        }
    }
}

/// Valid cells away from the frame.
fn inside(valid: &Mask) -> Mask {
    let (rows, cols) = valid.shape();
    let frame = FRAME.min(rows.min(cols) / 8);
    Mask::from_fn(rows, cols, |c| {
        valid[c] && c.row >= frame && c.row + frame < rows && c.col >= frame && c.col + frame < cols
    })
}

fn deviation(heights: &Grid<f32>, valid: &Mask) -> f64 {
    let known =
        || heights.as_slice().iter().zip(valid.as_slice()).filter(|(_, ok)| **ok).map(|(z, _)| f64::from(*z));
    let mean = known().sum::<f64>() / known().count().max(1) as f64;
    root_mean_square(known().map(|z| z - mean))
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, n), v| (sum + v * v, n + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// The cell some steps along the flow, and the length of the way; `None` when the way ends before.
fn along(directions: &FlowDirections, start: Cell) -> Option<(Cell, f64)> {
    let (mut cell, mut length) = (start, 0.0);
    for _ in 0..RUN {
        let next = directions.receiver(cell)?;
        length += if next.row != cell.row && next.col != cell.col { std::f64::consts::SQRT_2 } else { 1.0 };
        cell = next;
    }
    Some((cell, length))
}

/// (drained area, slope downstream) of the channels' cells.
fn runs(
    heights: &Grid<f32>,
    down: &FlowDirections,
    drained: &Accumulation,
    inside: &Mask,
) -> Vec<(f64, f64)> {
    let counts = drained.counts();
    let channel = |&(cell, area): &(Cell, &u32)| inside[cell] && f64::from(*area) >= SMALLEST_CHANNEL;
    let run = |(cell, area): (Cell, &u32)| {
        let (end, length) = along(down, cell)?;
        Some((f64::from(*area), f64::from(heights[cell] - heights[end]) / length))
    };
    counts.cells().filter(channel).filter_map(run).collect()
}

/// k and theta of slope = k A^-theta, by least squares on the logarithms of mean slopes over areas that are alike.
fn slope_law(runs: &[(f64, f64)], deviation: f64) -> Option<(f64, f64)> {
    let bin = |area: f64| ((area / SMALLEST_CHANNEL).ln() / AREA_STEP.ln()) as usize;
    let mut bins: Vec<(f64, f64, f64)> = Vec::new(); // count, sum of ln A, sum of slopes
    for &(area, slope) in runs {
        let i = bin(area);
        if bins.len() <= i {
            bins.resize(i + 1, (0.0, 0.0, 0.0));
        }
        let (n, a, s) = bins[i];
        bins[i] = (n + 1.0, a + area.ln(), s + slope);
    }
    let least = 1e-4 * deviation;
    let full = bins.iter().filter(|(n, ..)| *n >= 10.0);
    let points: Vec<[f64; 3]> = full.map(|&(n, a, s)| [a / n, (s / n).max(least).ln(), n]).collect();
    if points.is_empty() || least == 0.0 {
        return None;
    }
    let (level, tilt) = line_through(&points);
    // Valleys that steepen downstream are no law to extrapolate.
    let tilt = tilt.min(0.0);
    let mean = weighted_mean(&points, |[a, s, _]| s - tilt * a);
    let level = if tilt == 0.0 { mean } else { level };
    Some((level.exp(), -tilt))
}

fn weighted_mean(points: &[[f64; 3]], value: impl Fn([f64; 3]) -> f64) -> f64 {
    let weight: f64 = points.iter().map(|p| p[2]).sum();
    points.iter().map(|&p| p[2] * value(p)).sum::<f64>() / weight
}

/// Level and tilt of the line through points [x, y, weight]; level where there is only one.
fn line_through(points: &[[f64; 3]]) -> (f64, f64) {
    let (x, y) = (weighted_mean(points, |p| p[0]), weighted_mean(points, |p| p[1]));
    let square = weighted_mean(points, |p| (p[0] - x).powi(2));
    let tilt = if square > 1e-12 { weighted_mean(points, |p| (p[0] - x) * (p[1] - y)) / square } else { 0.0 };
    (y - tilt * x, tilt)
}

/// Changes of height along ridges, over the root of the length.
fn ridge_steps(
    heights: &Grid<f32>,
    up: &FlowDirections,
    climbed: &Accumulation,
    inside: &Mask,
    area: u32,
) -> Vec<f64> {
    let ridge = |&(cell, count): &(Cell, &u32)| inside[cell] && *count >= area;
    let step = |(cell, _): (Cell, &u32)| {
        let (end, length) = along(up, cell)?;
        Some(f64::from(heights[cell] - heights[end]) / length.sqrt())
    };
    climbed.counts().cells().filter(ridge).filter_map(step).collect()
}

/// What ridges are beside valleys.
struct Sides<'a> {
    heights: &'a Grid<f32>,
    drained: &'a Accumulation,
    climbed: &'a Accumulation,
    inside: &'a Mask,
}

impl Sides<'_> {
    /// With the lines of a drained area; `None` when there are too few of them.
    fn at(&self, area: u32) -> Result<Option<Density>> {
        let (rows, cols) = self.heights.shape();
        let lines =
            |of: &Accumulation| Mask::from_fn(rows, cols, |c| self.inside[c] && of.counts()[c] >= area);
        let (valley, ridge) = (lines(self.drained), lines(self.climbed));
        let mut map = LineMap::empty(rows, cols);
        for (cell, _) in valley.cells().filter(|(_, on)| **on) {
            map.set(cell, StrokeKind::Valley, self.heights[cell]);
        }
        let count = |mask: &Mask| mask.as_slice().iter().filter(|on| **on).count();
        if map.line_count() < FEWEST || count(&ridge) < FEWEST {
            return Ok(None);
        }
        let away = distance::squared(&valley).map(|&squared| f64::from(squared).sqrt());
        let cells = LineCells::of(&map)?;
        let mut beside: Vec<(f64, f64)> = Vec::new();
        for (cell, _) in ridge.cells().filter(|(c, on)| **on && away[*c] > 1.5) {
            beside.push((away[cell], f64::from(self.heights[cell] - cells.nearest(cell))));
        }
        let Some((relief, exponent)) = relief_law(beside.clone()) else { return Ok(None) };
        let law = |d: f64| relief * d.powf(exponent);
        let spread = root_mean_square(beside.iter().map(|&(d, dz)| dz / law(d) - 1.0));
        let all = self.inside.cells().filter(|(_, on)| **on).map(|(c, _)| away[c]);
        let spacing = all.sum::<f64>() / count(self.inside).max(1) as f64;
        let (ridges, valleys) = (self.range(&ridge), self.range(&valley));
        Ok(Some(Density { spacing, relief, exponent, spread, ridges, valleys }))
    }

    /// Mean and standard deviation of heights.
    fn range(&self, mask: &Mask) -> [f64; 2] {
        let mean = {
            let on = self.heights.as_slice().iter().zip(mask.as_slice()).filter(|(_, on)| **on);
            let (sum, n) = on.fold((0.0, 0_usize), |(sum, n), (z, _)| (sum + f64::from(*z), n + 1));
            sum / n.max(1) as f64
        };
        [mean, deviation(self.heights, mask)]
    }
}

/// c and p of height = c d^p, by least squares on the logarithms of means over eighths of the distances.
fn relief_law(mut beside: Vec<(f64, f64)>) -> Option<(f64, f64)> {
    const GROUPS: usize = 8;
    beside.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let size = beside.len().div_ceil(GROUPS).max(1);
    let mut points = Vec::new();
    for group in beside.chunks(size).filter(|group| group.len() > 5) {
        let n = group.len() as f64;
        let (d, dz) = group.iter().fold((0.0, 0.0), |(d, z), p| (d + p.0 / n, z + p.1 / n));
        if dz > 0.0 {
            points.push([d.ln(), dz.ln(), 1.0]);
        }
    }
    if points.is_empty() {
        return None;
    }
    let (_, tilt) = line_through(&points);
    let tilt = tilt.clamp(0.0, 1.5);
    Some((weighted_mean(&points, |[d, z, _]| z - tilt * d).exp(), tilt))
}
